//! A room of straight lines, seen through any lens, with the exact image of every line.
//!
//! ```text
//! color(p) = mean over samples q of pixel p of  surface( first wall hit from c along Rᵀ unproject(q) )
//! line     = { project(R (a + s (b − a) − c)) : 0 ≤ s ≤ 1 }
//! ```
//!
//! The room is a box seen from inside, so that nothing hides anything; windows, doors, shelves and boards are painted on its
//! walls. Edges that a person would mark are in a list of segments in space. Their images are computed by the lens model, not
//! found in the picture: residuals measured on them are exact. Axes are those of a camera: +x right, +y down, +z forward;
//! meters; the floor is y = 1.5.

mod furniture;
mod line;
mod paint;
mod panel;
mod view;

pub use line::{ImageLine, LineKind};
pub use view::RoomView;

use panel::Panel;
use plumbline_camera::Point3;

/// Extent of the room, m: left, floor or ceiling, and depth.
const LOW: [f64; 3] = [-3.0, -1.3, -2.6];
/// The opposite corner.
const HIGH: [f64; 3] = [3.2, 1.5, 4.6];

/// One of the six walls, by its axis and side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Wall {
    /// The axis that is constant: 0, 1, 2 for x, y, z.
    axis: usize,
    /// Whether it is the one at the larger coordinate.
    high: bool,
}

impl Wall {
    const FLOOR: Self = Self { axis: 1, high: true };
    const CEILING: Self = Self { axis: 1, high: false };
    const LEFT: Self = Self { axis: 0, high: false };
    const RIGHT: Self = Self { axis: 0, high: true };
    const FRONT: Self = Self { axis: 2, high: true };
    const BACK: Self = Self { axis: 2, high: false };

    /// The two axes along the wall: those of the floor plan first, height last.
    fn along(self) -> [usize; 2] {
        match self.axis {
            0 => [2, 1],
            1 => [0, 2],
            _ => [0, 1],
        }
    }

    fn coordinate(self) -> f64 {
        if self.high { HIGH[self.axis] } else { LOW[self.axis] }
    }

    /// The point on the wall with coordinates `s`, `t` along its axes.
    fn place(self, s: f64, t: f64) -> Point3 {
        let mut place = Point3::origin();
        let [a, b] = self.along();
        (place[self.axis], place[a], place[b]) = (self.coordinate(), s, t);
        place
    }
}

/// A segment in space that a person would mark.
#[derive(Clone, Debug, PartialEq)]
struct Segment {
    name: String,
    from: Point3,
    to: Point3,
}

/// The room: panels on its walls, later entries over earlier ones.
#[derive(Clone, Debug)]
pub struct Room {
    panels: Vec<Panel>,
    segments: Vec<Segment>,
}

impl Room {
    /// The furnished room.
    pub fn furnished() -> Self {
        let mut room = Self { panels: Vec::new(), segments: Vec::new() };
        furniture::furnish(&mut room);
        room
    }

    fn mark(&mut self, name: String, wall: Wall, from: (f64, f64), to: (f64, f64)) {
        self.segments.push(Segment { name, from: wall.place(from.0, from.1), to: wall.place(to.0, to.1) });
    }
}
