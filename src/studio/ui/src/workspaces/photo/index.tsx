// The photo workspace: lines and faces marked on a photo, and the rectified picture beside it.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Connection } from "../../connection";
import type { State } from "../../generated/photo";
import { Layout, ToolButton, ToolDivider, Toolbar } from "../../shell/components";
import type { WorkspacePage } from "../../workspace";
import { commandsOf } from "./commands";
import { pageOf, type PhotoPage } from "./page";
import { FacesPanel, FoundPanel, LinesPanel, PointsPanel } from "./panels";
import { ResultView } from "./result_view";
import { LensPanel, ProjectionPanel, ResultPanel } from "./settings_panels";
import { SourceScene } from "./source_scene";

function View({ connection }: { connection: Connection<State> }) {
  const page = useMemo(() => pageOf(connection), [connection]);
  useEffect(() => page.open(), [page]);
  return (
    <Layout
      name="photo"
      left={<><LinesPanel page={page} /><PointsPanel page={page} /><FoundPanel page={page} /><FacesPanel page={page} /></>}
      right={<><LensPanel page={page} /><ProjectionPanel page={page} /><ResultPanel page={page} /></>}
      leftSize={256}
      view={<Pictures page={page} />}
    />
  );
}

/** Side by side or one above the other, whichever shows the pictures larger. */
function Pictures({ page }: { page: PhotoPage }) {
  const pair = useRef<HTMLDivElement>(null);
  const { width, height } = page.photo;
  const [stacked, setStacked] = useState(false);
  useEffect(() => {
    const element = pair.current;
    if (!element) return undefined;
    const choose = () => {
      const { clientWidth: w, clientHeight: h } = element;
      setStacked(Math.min(w / width, h / 2 / height) > Math.min(w / 2 / width, h / height));
    };
    const observer = new ResizeObserver(choose);
    observer.observe(element);
    return () => observer.disconnect();
  }, [width, height]);
  return (
    <div ref={pair} class={`photo-pair ${stacked ? "stacked" : ""}`}>
      <SourceView page={page} />
      <section class="photo-half" aria-label="Result">
        <ResultView page={page} />
        <ResultFacts page={page} />
      </section>
    </div>
  );
}

function SourceView({ page }: { page: PhotoPage }) {
  const container = useRef<HTMLDivElement>(null);
  useEffect(() => {
    if (!container.current) return undefined;
    const scene = new SourceScene(page, container.current);
    return () => scene.dispose();
  }, [page]);
  return (
    <section class="photo-half" aria-label="Source">
      <div class="photo-focus" tabIndex={0} role="application" aria-label={`Photo ${page.photo.name}: ${hintOf(page)}`} onKeyDown={(event) => keyInPicture(event, page)}>
        <div ref={container} class="photo-canvas" data-testid="source" />
      </div>
      <Tools page={page} />
      <p class="view-facts">{page.photo.width} × {page.photo.height} px · {hintOf(page)}</p>
    </section>
  );
}

function Tools({ page }: { page: PhotoPage }) {
  const { camera } = page;
  const tool = page.tool.value;
  const zoom = (factor: number) => camera.zoomAt(factor, camera.middle.value[0], camera.middle.value[1]);
  return (
    <Toolbar label="Tools" vertical class="view-tools">
      <ToolButton label="Select and move" icon="select" shortcut="V" tip="right" pressed={tool === "select"} onClick={() => page.setTool("select")} />
      <ToolButton label="Draw lines" icon="line" shortcut="L" tip="right" pressed={tool === "line"} onClick={() => page.setTool("line")} />
      <ToolButton label="Draw faces" icon="face" shortcut="F" tip="right" pressed={tool === "face"} onClick={() => page.setTool("face")} />
      <ToolDivider />
      <ToolButton label="Zoom in" icon="plus" shortcut="+" tip="right" onClick={() => zoom(1.5)} />
      <ToolButton label="Zoom out" icon="minus" shortcut="-" tip="right" onClick={() => zoom(1 / 1.5)} />
      <ToolButton label="Whole picture" icon="fit" shortcut="0" tip="right" onClick={() => camera.fit()} />
      <ToolDivider />
      <ToolButton label="Grid of the map" icon="grid" shortcut="G" tip="right" pressed={page.showGrid.value} onClick={() => (page.showGrid.value = !page.showGrid.value)} />
      <ToolButton label="Found lines" icon="layers" shortcut="D" tip="right" pressed={page.showFound.value} onClick={() => (page.showFound.value = !page.showFound.value)} />
    </Toolbar>
  );
}

function hintOf(page: PhotoPage): string {
  if (page.tool.value === "line") {
    return page.drawing.value.length === 0 ? "click along a straight edge, or drag from end to end" : "click further points; Enter ends the line, Esc drops it";
  }
  if (page.tool.value === "face") return "drag a box around a face";
  if (page.selected.value.point !== null) return "arrow keys move the point by a pixel";
  return page.line.value !== null ? "drag the line or its points; double-click adds a point" : "L draws a line";
}

function ResultFacts({ page }: { page: PhotoPage }) {
  const { result, problem } = page.state.value;
  if (!result) {
    return (
      <div class="photo-empty" role={problem ? "alert" : "status"}>
        <p>{problem ? inTheWindow(problem) : "The first picture is being made…"}</p>
        {problem?.startsWith("the lens") && <p class="muted">Draw along three edges that are straight in the world (L), with three points or more each, or choose a lens at the right.</p>}
      </div>
    );
  }
  return (
    <p class="view-facts" role={problem ? "alert" : undefined}>
      {problem ? <span class="error-text">{inTheWindow(problem)}</span> : `${result.width} × ${result.height} px${result.exact ? "" : " · preview"}`}
    </p>
  );
}

/** An error without what it says of options of the command line. */
const inTheWindow = (text: string) => text.replace(/[:;,] (?:give|or give)? ?--.*$/, "");

/** Arrow keys move what is selected, or the picture; Tab leaves. */
function keyInPicture(event: KeyboardEvent, page: PhotoPage) {
  if (event.altKey || event.ctrlKey || event.metaKey) return;
  const by: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const step = by[event.key];
  if (!step) return;
  event.preventDefault();
  event.stopPropagation();
  const factor = event.shiftKey ? 10 : 1;
  if (page.line.value !== null || page.face.value !== null) page.nudge(step[0] * factor, step[1] * factor);
  else page.camera.pan((0.05 * step[0] * factor) / page.camera.zoom.value, (0.05 * step[1] * factor) / page.camera.zoom.value);
}

export const page: WorkspacePage = { name: "photo", View, commands: (connection) => commandsOf(pageOf(connection)) };
