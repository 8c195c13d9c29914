// What is written: files of the document, exports, the command line.
import { useState } from "preact/hooks";
import { Button, NumberField, Panel, Select, TextField } from "../../shell/components";
import type { MeshPage } from "./page";

const FORMATS = ["obj", "ply", "off", "stl", "glb", "gltf"].map((value) => ({ value, label: value.toUpperCase() }));

export function OutputPanel({ page }: { page: MeshPage }) {
  const { output, frames, files } = page.state.value;
  const [format, setFormat] = useState("obj");
  return (
    <Panel title="Output">
      <p class="hint">Saving writes {files[0]} and {files[1]}. <code>plumbline run</code> on the first writes what is shown here.</p>
      {output !== null && <TextField label="Result" value={output} onChange={(name) => void page.edit({ do: "set_output", name })} />}
      <NumberField
        label="Frames" value={frames} min={1} max={9999} digits={0}
        title="Poses from the first key to the last; 1 writes the last alone"
        onChange={(count) => void page.edit({ do: "set_frames", frames: Math.round(count), seconds: page.state.value.seconds ?? undefined })}
      />
      <Select label="Format" value={format} options={FORMATS} onChange={setFormat} />
      <div class="row wrap">
        <Button icon="download" onClick={() => void page.download({ ask: "export", format })}>Mesh</Button>
        <Button icon="download" disabled={frames < 2} onClick={() => void page.download({ ask: "export_frames", format })}>Frames</Button>
        <Button icon="download" onClick={() => void page.download({ ask: "export_handles" })}>Handles</Button>
        <Button icon="download" onClick={() => void page.download({ ask: "report" })}>Report</Button>
        <Button icon="camera" onClick={() => void savePicture(page)}>Picture</Button>
      </div>
      <CopyCommand page={page} />
    </Panel>
  );
}

/** The view as a PNG. */
export async function savePicture(page: MeshPage) {
  const blob = await page.view?.captureImage();
  if (!blob) return;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${page.state.value.mesh.name.replace(/\.[^.]*$/, "")}.png`;
  link.click();
  URL.revokeObjectURL(link.href);
}

/** The equivalent command line, into the clipboard; shown, for browsers that refuse it. */
export async function copyCommand(page: MeshPage): Promise<string> {
  const { command } = await page.connection.ask<{ command: string }>({ ask: "command" });
  await navigator.clipboard?.writeText(command).catch(() => undefined);
  return command;
}

function CopyCommand({ page }: { page: MeshPage }) {
  const [command, setCommand] = useState<string | null>(null);
  return (
    <>
      <Button wide icon="terminal" onClick={() => void copyCommand(page).then(setCommand)}>Copy as command</Button>
      {command !== null && (
        <>
          <textarea class="mono" readOnly rows={3} aria-label="Equivalent command" value={command} onFocus={(event) => event.currentTarget.select()} />
          <p class="hint">Save first: the command reads the file of handles.</p>
        </>
      )}
    </>
  );
}
