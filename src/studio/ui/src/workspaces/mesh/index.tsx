// The mesh workspace.
import type { WorkspacePage } from "../../workspace";

export const page: WorkspacePage = {
  name: "mesh",
  View: () => <main class="workspace" />,
  commands: () => [],
};
