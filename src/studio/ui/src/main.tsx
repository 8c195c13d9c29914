// The page of the studio: the shell, and in it the workspace of each open document.
import { render } from "preact";
import { Shell } from "./shell/shell";

const root = document.getElementById("studio");
if (root) render(<Shell />, root);
