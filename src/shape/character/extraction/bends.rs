//! Sharp bends of the curve are rounded off.
//!
//! Where the curve was drawn aside by single places, or led round what is outside, it turns sharply. A node between two others whose
//! directions differ by more than an angle goes half the way to the middle between them, pass by pass, and never where that would take
//! one of its edges through the surface: a curve that is inside stays inside. Gentle bends stay as they are.

use nalgebra::Point3;

use super::aabb::AabbTree;
use super::web::Web;

/// Cosine of the angle that is a sharp bend, 45°.
const SHARP: f64 = 0.7;
/// Times that all bends are rounded.
const PASSES: usize = 10;

/// Rounds off all sharp bends, but for junctions and pinned nodes.
pub(super) fn round_off(web: &mut Web, tree: &AabbTree) {
    let inner: Vec<u32> = web.alive().filter(|v| web.degree(*v) == 2 && !web.pinned[*v as usize]).collect();
    for _ in 0..PASSES {
        for &v in &inner {
            round(web, tree, v);
        }
    }
}

fn round(web: &mut Web, tree: &AabbTree, v: u32) {
    let [a, b] = *web.neighbors(v) else { return };
    let [p, at, q] = [a, v, b].map(|v| web.nodes[v as usize]);
    let along = |from: Point3<f64>, to: Point3<f64>| (to - from).try_normalize(0.0);
    let straight = along(p, at).zip(along(at, q)).is_none_or(|(before, after)| before.dot(&after) >= SHARP);
    if straight {
        return;
    }
    let place = at + (nalgebra::center(&p, &q) - at) * 0.5;
    // What it passes over on its way, and the edges that it has then.
    if ![at, p, q].iter().any(|to| tree.is_hit(&place, &(to - place), 1.0)) {
        web.nodes[v as usize] = place;
    }
}
