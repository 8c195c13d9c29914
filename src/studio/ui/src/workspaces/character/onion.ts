// Onion skins: the surface at other times, transparent, before in one color and after in another.
import { skinMatrices, type Frames } from "./frames";
import type { Surface, Viewport } from "../../view3d";

interface Skin { joints: Uint16Array; weights: Float32Array; jointCount: number }
interface Geometry { triangles: Uint32Array; rest: Float32Array; normals?: Int16Array; skin: Skin }

/** Colors of skins before and after the shown time. */
const [BEFORE, AFTER] = ["#4f7fd0", "#d0743c"];

/** The skins of a view; as many surfaces as times. */
export class OnionSkins {
  private surfaces: Surface[] = [];
  private of: Geometry | null = null;

  constructor(private readonly view: Viewport) {}

  /** Shows the surface in some poses; `before`: whether each is earlier than the time that is shown. */
  show(geometry: Geometry | null, rest: Frames, poses: readonly { frames: Frames; before: boolean; distance: number }[]) {
    if (geometry !== this.of) this.clear();
    this.of = geometry;
    if (!geometry) return;
    while (this.surfaces.length > poses.length) this.view.removeSurface(this.surfaces.pop()!);
    while (this.surfaces.length < poses.length) this.surfaces.push(this.make(geometry));
    poses.forEach(({ frames, before, distance }, i) => {
      const surface = this.surfaces[i]!;
      surface.setColor(before ? BEFORE : AFTER);
      surface.setOpacity(0.34 / distance);
      surface.setJointMatrices(skinMatrices(frames, rest));
    });
  }

  private make({ triangles, rest, normals, skin }: Geometry): Surface {
    const surface = this.view.addSurface();
    surface.setTopology(triangles, rest.length / 3);
    surface.setPositions(rest, normals);
    surface.setSkin(skin);
    return surface;
  }

  clear() {
    for (const surface of this.surfaces) this.view.removeSurface(surface);
    this.surfaces = [];
    this.of = null;
  }
}
