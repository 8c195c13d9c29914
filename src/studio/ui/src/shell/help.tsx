// The list of shortcuts, and what this program is.
import { menus, overlay } from "./commands";
import { server } from "./documents";
import { Dialog } from "./components";

const close = () => (overlay.value = null);

export function Shortcuts() {
  const groups = menus.value
    .map(({ title, items }) => ({ title, items: items.filter(({ shortcut }) => shortcut) }))
    .filter(({ items }) => items.length > 0);
  return (
    <Dialog title="Keyboard shortcuts" onClose={close} wide>
      <div class="shortcut-groups">
        {groups.map(({ title, items }) => (
          <section key={title}>
            <h3>{title}</h3>
            <dl>
              {items.map((command) => (
                <div key={command.id}>
                  <dt>{command.title}</dt>
                  <dd><kbd>{command.shortcut}</kbd></dd>
                </div>
              ))}
            </dl>
          </section>
        ))}
      </div>
      <p class="muted">In lists: arrow keys choose, Shift and Ctrl choose several, F2 renames, Delete removes. In numbers: up and down, with Shift by ten steps.</p>
    </Dialog>
  );
}

export function About() {
  return (
    <Dialog title="About plumbline studio" onClose={close}>
      <p>
        plumbline {server.value?.version ?? ""}. The page draws; every solve runs in the program that serves it, on this machine. Nothing is sent
        anywhere else.
      </p>
      <p class="muted">
        The page contains Preact, three.js, three-mesh-bvh, Konva, uPlot, Lit and Web Awesome. Their licenses:{" "}
        <a href="NOTICES.txt" target="_blank" rel="noreferrer">NOTICES.txt</a>.
      </p>
    </Dialog>
  );
}
