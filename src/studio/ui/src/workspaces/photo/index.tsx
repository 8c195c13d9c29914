// The photo workspace.
import type { WorkspacePage } from "../../workspace";

export const page: WorkspacePage = {
  name: "photo",
  View: () => <main class="workspace" />,
  commands: () => [],
};
