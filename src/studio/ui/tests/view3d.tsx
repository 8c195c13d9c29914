// A page with the 3D view alone: an ellipsoid, for view3d.spec.mjs.
import { render } from "preact";
import { IcosahedronGeometry, Matrix4, Quaternion, Vector2, Vector3 } from "three";
import { mergeVertices } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import "../src/shell/theme";
import { clickTool, combination, lassoTool, View3D, type Viewport } from "../src/view3d";
import { formatVertices, parseVertices } from "../src/workspaces/mesh/vertex_list";

const ball = new IcosahedronGeometry(1, 12);
ball.deleteAttribute("uv");
ball.deleteAttribute("normal");
const geometry = mergeVertices(ball);
const positions = geometry.getAttribute("position").array as Float32Array;
const count = positions.length / 3;
for (let v = 0; v < count; v++) positions[3 * v + 1]! *= 1.5;

const seen = { clicks: [] as (number | null)[], changes: [] as number[][], ended: 0, lasso: [] as number[] };

function ready(view: Viewport) {
  view.surface.setTopology(Uint32Array.from(geometry.getIndex()!.array), count);
  view.surface.setPositions(positions);
  view.fit();
  view.gizmo.attach({
    position: new Vector3(0, 1, 0),
    quaternion: new Quaternion(),
    onChange: ({ translation }) => seen.changes.push(translation.toArray()),
    onEnd: () => (seen.ended += 1),
  });
  view.tool = clickTool(view, (hit) => seen.clicks.push(hit?.vertex ?? null));
  Object.assign(window, { view, seen, positions, count, three: { Matrix4, Vector2, Vector3, Quaternion }, lists: { parseVertices, formatVertices }, useLasso });
}

function useLasso(view: Viewport) {
  view.tool = lassoTool(view, {
    outline: () => undefined, visible: () => true, onSelect: (vertices) => { seen.lasso = [...vertices]; }, onClick: (hit, at) => void [hit, combination(at)],
  });
}

render(<div class="view" style={{ height: "100vh" }}><View3D label="Ellipsoid" onReady={ready} /></div>, document.getElementById("studio")!);
