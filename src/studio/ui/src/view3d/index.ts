/**
 * The 3D view of the mesh and the character workspace.
 *
 * ```tsx
 * <View3D label="Mesh" onReady={(view) => {
 *   view.surface.setTopology(triangles, vertexCount);          // once per mesh
 *   view.surface.setPositions(positions, normals);             // whenever they change; normals may be left out
 *   view.fit();
 *   view.tool = clickTool(view, (hit, at) => select(hit?.vertex, combination(at)));
 * }} legend={{ title: "Displacement", low: 0, high: 1, scale: "sequential" }} />
 * ```
 *
 * Coordinates are those of the scene: positions relative to the center of the document, which the server sends once, so that a mesh
 * far from its origin keeps its digits.
 *
 * - `view.surface`, `view.addSurface()`: triangles. `setSkin({joints, weights, jointCount})` and `setJointMatrices(matrices)` skin on the
 *   graphics card (linear, four joints per vertex); `setSkin(null)` and `setPositions` show positions from the server instead. Colors by
 *   `setScalars(values, {low, high, name})` or `setColors(rgb)`; `setWireframe`, `setFlat`, `setOpacity`, `setOffset`, `setVisible`.
 * - `surface.picker`: `pick(ray)`, `inBall(center, radius)`, `inLasso(polygon, camera, visible)`, on what is drawn, skinned surfaces too.
 * - `view.addMarks(surface, color)`: vertices as dots. `view.addJoints()`: a skeleton over the surface, with `pickJoint(at, view)` and
 *   `pickBone(at, view)`. `view.addLines(color)`: segments. `view.add(object)`: any object of three.
 * - `view.gizmo`: `attach({position, quaternion, onStart, onChange, onEnd})`, `setMode("translate" | "rotate" | "scale", "local" | "world")`,
 *   `setSnap`. Its changes are relative to the start of the drag. Clicks go through it to the tool. `attach` again while it is dragged
 *   replaces the callbacks and leaves the frame to the user.
 * - `view.tool`: what the primary button, a finger or a pen does: `clickTool`, `brushTool`, `lassoTool`, `grabTool` (a drag in the plane that
 *   faces the camera), or one of your own (`Tool`). What a tool leaves moves the camera: drag orbits, right button pans, wheel zooms, two
 *   fingers pan and zoom, Alt+drag always orbits. Escape ends a gesture without effect.
 * - `view.rig`: `look("front")`, `orbit`, `pan`, `zoom`, `setUp("z")`, `unitsPerPixel(point)`. `view.fit()`, `view.project(point)`,
 *   `view.onFrame(listener)` for labels, `view.captureImage()`, `view.invalidate()` after changes to objects of your own.
 *
 * Nothing is drawn unless something changed. Keys of the canvas: arrows orbit, Shift+arrows pan, + and − zoom, 1 3 7 look from front,
 * right, top (Shift: from the other side), 0 and Home show all.
 */
export { OrbitCamera, type NamedView } from "./camera";
export { categoryColor, categoryRgb, colorValues, scaleGradient, type ScaleName } from "./colors";
export { Gizmo, type GizmoChange, type GizmoMode, type GizmoTarget, type Snap } from "./gizmo";
export { BrushCircle, JointLines, LineOverlay, VertexMarks, type JointStyle } from "./overlays";
export type { Pick } from "./picking";
export type { Gesture, Pointer, Tool } from "./pointer";
export { Surface, type Scale } from "./surface";
export { brushTool, clickTool, combination, grabTool, lassoTool, type Combine } from "./tools";
export { Legend, View3D, type LegendProps } from "./view";
export { NoWebGL2, Viewport } from "./viewport";
