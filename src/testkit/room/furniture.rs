//! Furniture and pictures of the room.

use super::paint::{Color, Paint};
use super::panel::Edges;
use super::{HIGH, LOW, Room, Wall};

const PLASTER: Color = [0.72, 0.70, 0.64];
const OAK: Color = [0.33, 0.19, 0.09];
const PALE_OAK: Color = [0.52, 0.36, 0.20];
const WHITE: Color = [0.86, 0.86, 0.84];
const BLACK: Color = [0.02, 0.02, 0.02];

pub(super) fn furnish(room: &mut Room) {
    floor_and_ceiling(room);
    front(room);
    left(room);
    right(room);
    back(room);
    corners(room);
}

/// The whole of a wall in one paint.
fn whole(room: &mut Room, wall: Wall, paint: Paint) {
    let [a, b] = wall.along();
    room.panel("", wall, (LOW[a], HIGH[a]), (LOW[b], HIGH[b]), paint, Edges::None);
}

fn floor_and_ceiling(room: &mut Room) {
    let side = 0.6;
    whole(
        room,
        Wall::FLOOR,
        Paint::Tiles { side: (side, side), joint: 0.014, tile: [0.30, 0.24, 0.19], between: [0.10, 0.09, 0.08] },
    );
    for i in (2..=8).step_by(2) {
        let x = LOW[0] + side * f64::from(i);
        room.mark(format!("floor joint along {i}"), Wall::FLOOR, (x, LOW[2]), (x, HIGH[2]));
    }
    for i in [5, 7, 9, 11] {
        let z = LOW[2] + side * f64::from(i);
        room.mark(format!("floor joint across {i}"), Wall::FLOOR, (LOW[0], z), (HIGH[0], z));
    }
    whole(room, Wall::CEILING, Paint::Plain([0.80, 0.80, 0.78]));
    for (i, z) in [(1, -0.2), (2, 1.6), (3, 3.4)] {
        let name = format!("lamp {i}");
        room.panel(&name, Wall::CEILING, (-0.7, 0.9), (z, z + 0.3), Paint::Plain([1.25, 1.22, 1.1]), Edges::All);
    }
    for (i, x) in [(1, -1.8), (2, 2.0)] {
        let beam = Paint::Plain(PALE_OAK);
        room.panel(&format!("beam {i}"), Wall::CEILING, (x - 0.09, x + 0.09), (LOW[2], HIGH[2]), beam, Edges::None);
        room.mark(format!("beam {i} near"), Wall::CEILING, (x - 0.09, LOW[2]), (x - 0.09, HIGH[2]));
        room.mark(format!("beam {i} far"), Wall::CEILING, (x + 0.09, LOW[2]), (x + 0.09, HIGH[2]));
    }
}

/// Ahead: a checkerboard, a door, a picture.
fn front(room: &mut Room) {
    let wall = Wall::FRONT;
    whole(room, wall, Paint::Plain(PLASTER));
    let (s, t, side) = (-0.9, -0.7, 0.2);
    room.panel("board frame", wall, (s - 0.06, s + 1.66), (t - 0.06, t + 1.26), Paint::Plain(OAK), Edges::All);
    let colors = [BLACK, WHITE];
    room.panel("board", wall, (s, s + 8.0 * side), (t, t + 6.0 * side), Paint::Checker { side, colors }, Edges::None);
    for i in 1..6 {
        let y = t + side * f64::from(i);
        room.mark(format!("board row {i}"), wall, (s, y), (s + 8.0 * side, y));
    }
    for i in [1, 4, 7] {
        let x = s + side * f64::from(i);
        room.mark(format!("board column {i}"), wall, (x, t), (x, t + 6.0 * side));
    }
    door(room, wall, 1.7, "door");
    let picture = Paint::Fade { colors: [[0.10, 0.22, 0.42], [0.62, 0.30, 0.12]] };
    room.panel("picture frame", wall, (-2.6, -1.5), (-0.6, 0.3), Paint::Plain(BLACK), Edges::All);
    room.panel("picture", wall, (-2.52, -1.58), (-0.52, 0.22), picture, Edges::None);
}

/// A door of 0.95 m × 2.1 m from `s` on.
fn door(room: &mut Room, wall: Wall, s: f64, name: &str) {
    let top = HIGH[1] - 2.1;
    room.panel(
        &format!("{name} frame"),
        wall,
        (s - 0.1, s + 1.05),
        (top - 0.1, HIGH[1]),
        Paint::Plain(WHITE),
        Edges::NotLast,
    );
    room.panel(name, wall, (s, s + 0.95), (top, HIGH[1]), Paint::Plain([0.16, 0.24, 0.20]), Edges::NotLast);
    for (i, (a, b)) in [(0.12, 0.9), (1.05, 1.95)].into_iter().enumerate() {
        let paint = Paint::Plain([0.12, 0.19, 0.16]);
        let name = format!("{name} panel {}", i + 1);
        room.panel(&name, wall, (s + 0.14, s + 0.81), (top + a, top + b), paint, Edges::None);
    }
    room.panel("", wall, (s + 0.06, s + 0.12), (top + 0.96, top + 1.0), Paint::Plain([0.7, 0.6, 0.3]), Edges::None);
}

/// On the left: two windows over a wainscot.
fn left(room: &mut Room) {
    let wall = Wall::LEFT;
    whole(room, wall, Paint::Plain([0.62, 0.66, 0.66]));
    let planks = Paint::Tiles { side: (0.18, 2.0), joint: 0.012, tile: PALE_OAK, between: [0.2, 0.13, 0.07] };
    room.panel("wainscot", wall, (LOW[2], HIGH[2]), (0.6, HIGH[1]), planks, Edges::None);
    room.mark("wainscot top".to_owned(), wall, (LOW[2], 0.6), (HIGH[2], 0.6));
    for (i, s) in [-1.9, 0.3, 2.5].into_iter().enumerate() {
        window(room, wall, s, &format!("window {}", i + 1));
    }
}

/// A window of 1.5 m × 1.4 m with a cross of bars.
fn window(room: &mut Room, wall: Wall, s: f64, name: &str) {
    let (t, width, height) = (-0.95, 1.5, 1.4);
    room.panel(&format!("{name} frame"), wall, (s, s + width), (t, t + height), Paint::Plain(WHITE), Edges::All);
    let sky = || Paint::Fade { colors: [[0.55, 0.75, 1.05], [1.05, 1.05, 1.0]] };
    let bar = 0.07;
    let half = (0.5 * (width - 3.0 * bar), 0.5 * (height - 3.0 * bar));
    for i in 0..4 {
        let (right, below) = (f64::from(i % 2), f64::from(i / 2));
        let (a, b) = (s + bar + right * (half.0 + bar), t + bar + below * (half.1 + bar));
        room.panel(&format!("{name} pane {}", i + 1), wall, (a, a + half.0), (b, b + half.1), sky(), Edges::None);
    }
    let middle = s + 0.5 * (width - bar);
    room.mark(format!("{name} bar"), wall, (middle, t + bar), (middle, t + height - bar));
}

/// On the right: shelves with books, and a second door.
fn right(room: &mut Room) {
    let wall = Wall::RIGHT;
    whole(room, wall, Paint::Plain([0.66, 0.60, 0.52]));
    let (s, t, width, height, board) = (-0.6, -0.9, 3.2, 2.4, 0.04);
    room.panel("shelves", wall, (s, s + width), (t, t + height), Paint::Plain(OAK), Edges::NotLast);
    let (columns, rows) = (4, 6);
    let cell = ((width - board) / f64::from(columns), (height - board) / f64::from(rows));
    for row in 0..rows {
        for column in 0..columns {
            let (a, b) = (s + board + cell.0 * f64::from(column), t + board + cell.1 * f64::from(row));
            room.panel("", wall, (a, a + cell.0 - board), (b, b + cell.1 - board), Paint::Books, Edges::None);
        }
        let y = t + cell.1 * f64::from(row);
        if row > 0 {
            room.mark(format!("shelf {row}"), wall, (s, y), (s + width, y));
        }
    }
    for column in 1..columns {
        let x = s + cell.0 * f64::from(column);
        room.mark(format!("shelf side {column}"), wall, (x, t), (x, t + height));
    }
    door(room, wall, 3.2, "side door");
}

/// Behind: bricks.
fn back(room: &mut Room) {
    let bricks =
        Paint::Tiles { side: (0.36, 0.14), joint: 0.015, tile: [0.36, 0.13, 0.08], between: [0.5, 0.46, 0.42] };
    whole(room, Wall::BACK, bricks);
    for i in [4, 10, 16] {
        let y = LOW[1] + 0.14 * f64::from(i);
        room.mark(format!("brick row {i}"), Wall::BACK, (LOW[0], y), (HIGH[0], y));
    }
}

/// The twelve edges of the room.
fn corners(room: &mut Room) {
    for (name, wall) in [("floor", Wall::FLOOR), ("ceiling", Wall::CEILING)] {
        room.mark(format!("{name} left"), wall, (LOW[0], LOW[2]), (LOW[0], HIGH[2]));
        room.mark(format!("{name} right"), wall, (HIGH[0], LOW[2]), (HIGH[0], HIGH[2]));
        room.mark(format!("{name} front"), wall, (LOW[0], HIGH[2]), (HIGH[0], HIGH[2]));
        room.mark(format!("{name} back"), wall, (LOW[0], LOW[2]), (HIGH[0], LOW[2]));
    }
    for (name, wall) in [("front", Wall::FRONT), ("back", Wall::BACK)] {
        room.mark(format!("{name} left corner"), wall, (LOW[0], LOW[1]), (LOW[0], HIGH[1]));
        room.mark(format!("{name} right corner"), wall, (HIGH[0], LOW[1]), (HIGH[0], HIGH[1]));
    }
}
