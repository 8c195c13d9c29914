// The character workspace.
import type { WorkspacePage } from "../../workspace";

export const page: WorkspacePage = {
  name: "character",
  View: () => <main class="workspace" />,
  commands: () => [],
};
