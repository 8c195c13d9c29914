// A character of a GLB file as plain lists: surface, skin of four joints per vertex, joints with their positions.
import { readFileSync } from "node:fs";

const ARRAYS = { 5126: Float32Array, 5123: Uint16Array, 5125: Uint32Array, 5121: Uint8Array };
const WIDTHS = { SCALAR: 1, VEC3: 3, VEC4: 4, MAT4: 16 };

/** Reads a file whose joints have no rotation at rest. */
export function readCharacter(path) {
  const bytes = readFileSync(path);
  const jsonLength = bytes.readUInt32LE(12);
  const gltf = JSON.parse(bytes.subarray(20, 20 + jsonLength));
  const binary = bytes.subarray(28 + jsonLength);
  const list = (index) => {
    const accessor = gltf.accessors[index];
    const view = gltf.bufferViews[accessor.bufferView];
    const array = ARRAYS[accessor.componentType];
    const count = WIDTHS[accessor.type] * accessor.count;
    const start = (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
    return [...new array(new Uint8Array(binary.subarray(start, start + count * array.BYTES_PER_ELEMENT)).buffer)];
  };
  const { attributes, indices } = gltf.meshes[0].primitives[0];
  const { joints } = gltf.skins[0];
  const parents = new Map(gltf.nodes.flatMap((node, i) => (node.children ?? []).map((child) => [child, i])));
  const at = (node) => {
    const above = joints.includes(parents.get(node)) ? at(parents.get(node)) : [0, 0, 0];
    return above.map((x, k) => x + (gltf.nodes[node].translation ?? [0, 0, 0])[k]);
  };
  const parent = (node) => (joints.includes(parents.get(node)) ? joints.indexOf(parents.get(node)) : null);
  return {
    positions: list(attributes.POSITION), triangles: list(indices), joints: list(attributes.JOINTS_0), weights: list(attributes.WEIGHTS_0),
    skeleton: joints.map((node) => ({ name: gltf.nodes[node].name, parent: parent(node), at: at(node) })),
  };
}
