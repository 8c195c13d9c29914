#!/usr/bin/env python3
"""glTF files compressed by the encoder of meshoptimizer against what they were compressed from.

Needs node and the npm package `meshoptimizer` in a folder that NODE_PATH names; `make oracle` installs it. Checked are the
character of media/ and, with PLUMBLINE_MEDIA, real ones: without filters, both must be written alike, their buffers byte for byte.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

SKIPPED = 77
COMPRESS = """
const { MeshoptEncoder: encoder } = require('meshoptimizer'), fs = require('fs'), path = require('path');
const [, source, target] = process.argv;
let file = fs.readFileSync(source), binary = null, text = file;
if (file.toString('latin1', 0, 4) === 'glTF') {
  const length = file.readUInt32LE(12);
  text = file.subarray(20, 20 + length);
  binary = file.subarray(28 + length);
}
const document = JSON.parse(text.toString());
const buffers = document.buffers.map((buffer) =>
  buffer.uri === undefined ? binary : buffer.uri.startsWith('data:')
    ? Buffer.from(buffer.uri.split(',')[1], 'base64')
    : fs.readFileSync(path.join(path.dirname(source), decodeURIComponent(buffer.uri))));
const size = { 5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4 };
const width = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };
const triangles = new Set(document.meshes.flatMap((mesh) => mesh.primitives)
  .filter((primitive) => (primitive.mode ?? 4) === 4).map((primitive) => document.accessors[primitive.indices]?.bufferView));
encoder.ready.then(() => {
  const streams = [];
  let at = 0, count = 0;
  document.bufferViews.forEach((view, k) => {
    const users = document.accessors.filter((accessor) => accessor.bufferView === k);
    if (users.length === 0) return;
    const { componentType, type } = users[0], item = size[componentType] * width[type];
    const stride = view.byteStride ?? item, length = view.byteLength;
    const indices = type === 'SCALAR' && (componentType === 5123 || componentType === 5125);
    if (length % stride !== 0 || (!indices && stride % 4 !== 0)) return;
    const mode = !indices ? 'ATTRIBUTES' : triangles.has(k) && length / stride % 3 === 0 ? 'TRIANGLES' : 'INDICES';
    // Triangles may begin with another corner afterwards; the order of corners is kept by the other mode.
    const kept = mode === 'TRIANGLES' && process.env.KEEP_CORNERS ? 'INDICES' : mode;
    const bytes = buffers[view.buffer].subarray(view.byteOffset ?? 0, (view.byteOffset ?? 0) + length);
    const stream = encoder.encodeGltfBuffer(new Uint8Array(bytes), length / stride, stride, kept);
    view.extensions = { EXT_meshopt_compression: {
      buffer: document.buffers.length + 1, byteOffset: at, byteLength: stream.length, byteStride: stride,
      count: length / stride, mode: kept } };
    view.buffer = document.buffers.length;
    streams.push(stream);
    at += stream.length;
    count += length;
  });
  document.buffers.forEach((buffer, k) => buffer.uri =
    'data:application/octet-stream;base64,' + buffers[k].toString('base64'));
  document.images?.forEach((image) => { if (image.uri && !image.uri.startsWith('data:')) delete image.uri; });
  document.buffers.push({ byteLength: 1 << 30, extensions: { EXT_meshopt_compression: { fallback: true } } });
  document.buffers.push({ byteLength: at, uri:
    'data:application/octet-stream;base64,' + Buffer.concat(streams).toString('base64') });
  document.extensionsUsed = [...(document.extensionsUsed ?? []), 'EXT_meshopt_compression'];
  document.extensionsRequired = [...(document.extensionsRequired ?? []), 'EXT_meshopt_compression'];
  fs.writeFileSync(target, JSON.stringify(document));
  console.log(`${streams.length} ${count} ${at}`);
});
"""


def node(*arguments, **environment):
    return subprocess.run(["node", *arguments], capture_output=True, text=True, env=os.environ | environment)


def converted(program, source, target):
    command = [program, "mesh", "convert", str(source), "-o", str(target), "--overwrite"]
    subprocess.run(command, check=True, capture_output=True)
    return pathlib.Path(target).read_bytes()


def main():
    if shutil.which("node") is None or node("-e", "require('meshoptimizer')").returncode != 0:
        print("skipped: node or its package meshoptimizer is missing (`make oracle` installs it)")
        return SKIPPED
    program = os.environ.get("PLUMBLINE_BIN", "target/debug/plumbline")
    characters = [pathlib.Path("media/humanoid.glb")]
    media = os.environ.get("PLUMBLINE_MEDIA")
    if media:
        characters += sorted(pathlib.Path(media, "mesh/gltf").glob("*.glb"))
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        for character in characters:
            compressed = f"{folder}/compressed.gltf"
            ran = node("-e", COMPRESS, str(character), compressed, KEEP_CORNERS="1")
            if ran.returncode != 0:
                print(ran.stderr)
                return 1
            views, before, after = map(int, ran.stdout.split())
            plain = converted(program, character, f"{folder}/plain.glb")
            same = contents(plain) == contents(converted(program, compressed, f"{folder}/decoded.glb"))
            # Triangles by their own mode: as many, of the same corners, in the same order of triangles.
            node("-e", COMPRESS, str(character), compressed)
            triangles = [corners(converted(program, path, f"{folder}/mesh.off")) for path in (character, compressed)]
            alike = len(triangles[0]) > 0 and triangles[0] == triangles[1]
            print(f"{character.name}: {views} views, {before} bytes in {after}: "
                  f"{'alike' if same else 'NOT alike'}, triangles {'alike' if alike else 'NOT alike'}")
            faults += (not same) + (not alike) + (views == 0)
    return 1 if faults else 0


def contents(glb):
    """The document and the buffer of a GLB file; node writes the numbers of a document in its own way (0 for -0.0)."""
    length = int.from_bytes(glb[12:16], "little")
    return json.loads(glb[20:20 + length]), glb[28 + length:]


def corners(off):
    """The triangles of an OFF file by their positions, each from its least corner on."""
    lines = off.decode().split("\n")
    vertices, faces = map(int, lines[1].split()[:2])
    positions, found = lines[2:2 + vertices], []
    for line in lines[2 + vertices:2 + vertices + faces]:
        face = [positions[int(index)] for index in line.split()[1:4]]
        first = face.index(min(face))
        found.append(face[first:] + face[:first])
    return found


if __name__ == "__main__":
    sys.exit(main())
