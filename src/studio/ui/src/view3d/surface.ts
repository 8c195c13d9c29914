// A surface of triangles: positions from the server, or skinned by the graphics card; colors per vertex; wireframe.
import {
  BufferAttribute, BufferGeometry, Color, DoubleSide, Group, Matrix4, Mesh, MeshBasicMaterial, MeshPhongMaterial, Skeleton, SkinnedMesh, Sphere,
  Vector3, type Box3, Box3 as Box, type Material,
} from "three";
import { colorValues, linearByte, type ScaleName } from "./colors";
import { SurfacePicker } from "./picking";

/** How scalars become colors. */
export interface Scale { low: number; high: number; name: ScaleName }

/** A surface in a view. All setters redraw; buffers are kept, not copied, unless said. */
export class Surface {
  readonly group = new Group();
  private readonly geometry = new BufferGeometry();
  private readonly material = new MeshPhongMaterial({ side: DoubleSide, specular: 0x1a1a1a, shininess: 24 });
  private readonly lines = new MeshBasicMaterial({ wireframe: true, transparent: true, opacity: 0.28, depthWrite: false });
  private mesh: Mesh = new Mesh(this.geometry, this.material);
  private wire: Mesh = new Mesh(this.geometry, this.lines);
  private skeleton: Skeleton | null = null;
  private skinnedDirty = false;
  private skinned: Float32Array | null = null;
  /** Ray casts, brush and lasso on what is drawn. */
  readonly picker = new SurfacePicker(this);

  constructor(private readonly invalidate: () => void) {
    this.material.polygonOffset = true;
    this.material.polygonOffsetFactor = 1;
    this.material.polygonOffsetUnits = 1;
    this.wire.visible = false;
    this.adopt();
  }

  private adopt() {
    this.group.clear();
    for (const object of [this.mesh, this.wire]) object.frustumCulled = false;
    this.wire.renderOrder = 1;
    this.group.add(this.mesh, this.wire);
  }

  get vertexCount(): number {
    return this.geometry.getAttribute("position")?.count ?? 0;
  }

  get triangles(): Uint32Array {
    return (this.geometry.index?.array as Uint32Array | undefined) ?? new Uint32Array();
  }

  /** Another surface: `triangles` has three vertices each. Removes skin and colors. */
  setTopology(triangles: Uint32Array, vertexCount: number) {
    this.setSkin(null);
    this.geometry.dispose();
    for (const name of ["position", "normal", "color"]) this.geometry.deleteAttribute(name);
    this.geometry.setIndex(new BufferAttribute(triangles, 1));
    this.geometry.setAttribute("position", new BufferAttribute(new Float32Array(3 * vertexCount), 3));
    this.geometry.setAttribute("normal", new BufferAttribute(new Int16Array(4 * vertexCount), 4, true));
    this.material.vertexColors = false;
    this.material.needsUpdate = true;
    this.picker.topologyChanged();
    this.invalidate();
  }

  /** Positions (three per vertex) and normals (four 16-bit integers per vertex, the fourth unused; computed where they are left out).
      Copied. Of a skinned surface they are its rest pose. */
  setPositions(positions: Float32Array, normals?: Int16Array) {
    const attribute = this.geometry.getAttribute("position") as BufferAttribute;
    if (!attribute || positions.length !== attribute.array.length) return;
    attribute.array.set(positions);
    attribute.needsUpdate = true;
    const normal = this.geometry.getAttribute("normal") as BufferAttribute;
    if (normals && normals.length === normal.array.length) normal.array.set(normals);
    else computeNormals(positions, this.triangles, normal.array as Int16Array);
    normal.needsUpdate = true;
    this.skinnedDirty = true;
    this.picker.positionsChanged();
    this.invalidate();
  }

  /** Linear skinning on the graphics card: four joints and weights per vertex. The positions set are the rest pose. Null: none. */
  setSkin(skin: { joints: Uint16Array; weights: Float32Array; jointCount: number } | null) {
    this.skeleton?.dispose();
    this.skeleton = null;
    const wireframe = this.wire.visible;
    if (skin) {
      this.geometry.setAttribute("skinIndex", new BufferAttribute(skin.joints, 4));
      this.geometry.setAttribute("skinWeight", new BufferAttribute(skin.weights, 4));
      this.mesh = this.skinnedMesh(this.material, skin.jointCount);
      this.wire = this.skinnedMesh(this.lines, skin.jointCount);
    } else {
      for (const name of ["skinIndex", "skinWeight"]) this.geometry.deleteAttribute(name);
      [this.mesh, this.wire] = [new Mesh(this.geometry, this.material), new Mesh(this.geometry, this.lines)];
    }
    this.wire.visible = wireframe;
    this.adopt();
    this.picker.positionsChanged();
    this.invalidate();
  }

  private skinnedMesh(material: Material, joints: number): Mesh {
    const mesh = new SkinnedMesh(this.geometry, material);
    if (!this.skeleton) {
      this.skeleton = new Skeleton([]);
      const matrices = new Float32Array(16 * joints);
      for (let j = 0; j < joints; j++) new Matrix4().toArray(matrices, 16 * j);
      this.skeleton.boneMatrices = matrices;
      // Matrices come from the server: there are no bones to compute them from.
      this.skeleton.update = () => {};
      this.skeleton.bones.length = joints;
      this.skeleton.computeBoneTexture();
    }
    mesh.bindMode = "detached";
    mesh.bind(this.skeleton, new Matrix4());
    // Never culled; computing it would ask for bones.
    mesh.boundingSphere = new Sphere(new Vector3(), Infinity);
    return mesh as unknown as Mesh;
  }

  /** Posed-from-rest matrices of the joints, 16 numbers each, column by column. */
  setJointMatrices(matrices: Float32Array) {
    const skeleton = this.skeleton;
    if (!skeleton?.boneMatrices) return;
    (skeleton.boneMatrices as Float32Array).set(matrices.subarray(0, 16 * skeleton.bones.length));
    if (skeleton.boneTexture) skeleton.boneTexture.needsUpdate = true;
    this.skinnedDirty = true;
    this.picker.positionsChanged();
    this.invalidate();
  }

  /** Where the vertices are drawn: of a skinned surface computed here, when somebody picks. */
  drawnPositions(): Float32Array {
    const positions = this.geometry.getAttribute("position").array as Float32Array;
    const matrices = this.skeleton?.boneMatrices as Float32Array | undefined;
    if (!matrices) return positions;
    if (this.skinnedDirty || this.skinned?.length !== positions.length) {
      this.skinned = skin(positions, matrices, this.geometry.getAttribute("skinIndex").array as Uint16Array,
        this.geometry.getAttribute("skinWeight").array as Float32Array, this.skinned);
      this.skinnedDirty = false;
    }
    return this.skinned;
  }

  /** One color for all of the surface, CSS; where vertices have colors, they are used instead. */
  setColor(color: string) {
    this.material.color = new Color(this.material.vertexColors ? 0xffffff : color);
    this.plainColor = color;
    this.invalidate();
  }
  private plainColor = "#b9c0c8";

  setLineColor(color: string) {
    this.lines.color = new Color(color);
    this.invalidate();
  }

  /** Colors of the vertices, three bytes of sRGB each; null: one color for all. Copied. */
  setColors(rgb: Uint8Array | null) {
    const on = rgb !== null;
    if (on) {
      let attribute = this.geometry.getAttribute("color") as BufferAttribute | undefined;
      if (!attribute) {
        attribute = new BufferAttribute(new Uint8Array(4 * this.vertexCount), 4, true);
        this.geometry.setAttribute("color", attribute);
      }
      const to = attribute.array as Uint8Array;
      for (let v = 0; v < this.vertexCount; v++) {
        for (let c = 0; c < 3; c++) to[4 * v + c] = linearByte[rgb[3 * v + c]!]!;
        to[4 * v + 3] = 255;
      }
      attribute.needsUpdate = true;
    }
    if (on !== this.material.vertexColors) {
      this.material.vertexColors = on;
      this.material.needsUpdate = true;
    }
    this.material.color = new Color(on ? 0xffffff : this.plainColor);
    this.invalidate();
  }

  /** A scalar per vertex as colors; null: one color for all. */
  setScalars(values: ArrayLike<number> | null, scale: Scale) {
    if (!values) return this.setColors(null);
    const rgb = new Uint8Array(3 * values.length);
    colorValues(values, scale.low, scale.high, scale.name, rgb);
    this.setColors(rgb);
  }

  setWireframe(on: boolean) {
    this.wire.visible = on;
    this.invalidate();
  }

  setFlat(on: boolean) {
    this.material.flatShading = on;
    this.material.needsUpdate = true;
    this.invalidate();
  }

  /** 0 to 1; below 1 things behind show through: onion skins, joints. */
  setOpacity(opacity: number) {
    this.material.opacity = opacity;
    this.material.transparent = opacity < 1;
    this.material.depthWrite = opacity >= 0.5;
    // Onion skins lie behind a surface that is where they are, rather than flicker with it.
    this.material.polygonOffsetFactor = this.material.polygonOffsetUnits = opacity < 0.5 ? 6 : 1;
    this.material.needsUpdate = true;
    this.invalidate();
  }

  setVisible(visible: boolean) {
    this.group.visible = visible;
    this.invalidate();
  }

  /** Moves the drawing, for surfaces side by side. */
  setOffset(x: number, y: number, z: number) {
    this.group.position.set(x, y, z);
    this.group.updateMatrixWorld(true);
    this.invalidate();
  }

  bounds(): Box3 {
    const box = new Box();
    if (this.vertexCount > 0) box.setFromArray(this.drawnPositions() as unknown as number[]);
    return box.translate(this.group.position);
  }

  /** Marks share the attribute, so that they move with the surface. */
  get positionAttribute(): BufferAttribute {
    return this.geometry.getAttribute("position") as BufferAttribute;
  }

  dispose() {
    this.skeleton?.dispose();
    this.geometry.dispose();
    this.material.dispose();
    this.lines.dispose();
  }
}

/** Normals of the vertices, weighted by area, as 16-bit integers. */
function computeNormals(p: Float32Array, triangles: Uint32Array, out: Int16Array) {
  const sum = new Float32Array(p.length);
  for (let t = 0; t < triangles.length; t += 3) {
    const [i, j, k] = [3 * triangles[t]!, 3 * triangles[t + 1]!, 3 * triangles[t + 2]!];
    const [ux, uy, uz] = [p[j]! - p[i]!, p[j + 1]! - p[i + 1]!, p[j + 2]! - p[i + 2]!];
    const [vx, vy, vz] = [p[k]! - p[i]!, p[k + 1]! - p[i + 1]!, p[k + 2]! - p[i + 2]!];
    const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    for (const v of [i, j, k]) for (let c = 0; c < 3; c++) sum[v + c]! += n[c]!;
  }
  for (let v = 0; v < p.length / 3; v++) {
    const length = Math.hypot(sum[3 * v]!, sum[3 * v + 1]!, sum[3 * v + 2]!) || 1;
    for (let c = 0; c < 3; c++) out[4 * v + c] = Math.round((32767 * sum[3 * v + c]!) / length);
  }
}

/** Linear skinning, for picking. */
function skin(rest: Float32Array, m: Float32Array, joints: Uint16Array, weights: Float32Array, into: Float32Array | null): Float32Array {
  const out = into?.length === rest.length ? into : new Float32Array(rest.length);
  for (let v = 0; v < rest.length / 3; v++) {
    const [x, y, z] = [rest[3 * v]!, rest[3 * v + 1]!, rest[3 * v + 2]!];
    let [sx, sy, sz] = [0, 0, 0];
    for (let k = 4 * v; k < 4 * v + 4; k++) {
      const [w, o] = [weights[k]!, 16 * joints[k]!];
      if (w === 0) continue;
      sx += w * (m[o]! * x + m[o + 4]! * y + m[o + 8]! * z + m[o + 12]!);
      sy += w * (m[o + 1]! * x + m[o + 5]! * y + m[o + 9]! * z + m[o + 13]!);
      sz += w * (m[o + 2]! * x + m[o + 6]! * y + m[o + 10]! * z + m[o + 14]!);
    }
    out.set([sx, sy, sz], 3 * v);
  }
  return out;
}
