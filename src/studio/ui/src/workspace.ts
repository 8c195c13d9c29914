// What a workspace gives to the shell.
import type { ComponentType } from "preact";
import type { Connection } from "./connection";

/** An action: in the palette, the menus and the list of shortcuts. */
export interface Command {
  id: string;
  title: string;
  group: string;
  /** As shown and matched: "Ctrl+Z", "G", "Shift+D", "Space". */
  shortcut?: string;
  enabled?: () => boolean;
  run: () => void;
}

/** The page of one kind of document. */
export interface WorkspacePage {
  name: string;
  /** Everything below the top bar: view and panels. */
  View: ComponentType<{ connection: Connection<any> }>;
  commands: (connection: Connection<any>) => Command[];
}
