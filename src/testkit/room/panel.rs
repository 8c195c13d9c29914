//! Rectangles on walls.

use super::paint::Paint;
use super::{Room, Wall};

/// A rectangle on a wall, along the wall's axes, m.
#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) wall: Wall,
    /// Lower and upper bound along the first axis.
    pub(super) s: (f64, f64),
    /// Lower and upper bound along the second axis.
    pub(super) t: (f64, f64),
    pub(super) paint: Paint,
}

impl Panel {
    pub(super) fn holds(&self, s: f64, t: f64) -> bool {
        s >= self.s.0 && s < self.s.1 && t >= self.t.0 && t < self.t.1
    }
}

/// Which edges of a rectangle are marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Edges {
    None,
    /// All four.
    All,
    /// All but the one at the larger `t`: the foot of a door.
    NotLast,
}

impl Room {
    /// Paints a rectangle and marks its edges.
    pub(super) fn panel(&mut self, name: &str, wall: Wall, s: (f64, f64), t: (f64, f64), paint: Paint, edges: Edges) {
        self.panels.push(Panel { wall, s, t, paint });
        if edges == Edges::None {
            return;
        }
        let sides = [
            ("near", (s.0, t.0), (s.0, t.1)),
            ("far", (s.1, t.0), (s.1, t.1)),
            ("first", (s.0, t.0), (s.1, t.0)),
            ("last", (s.0, t.1), (s.1, t.1)),
        ];
        for (side, from, to) in sides {
            if edges == Edges::All || side != "last" {
                self.mark(format!("{name} {side}"), wall, from, to);
            }
        }
    }
}
