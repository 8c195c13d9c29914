//! Mode 1, triangles: a byte for each, which names an edge and a vertex of those seen last, or the next new vertex.

use super::Fault;
use super::cursor::{Cursor, signed};

const HEADER: u8 = 0xe1;
/// Size of the table of pairs of vertices at the end.
const TABLE: usize = 16;

/// The last 16 items, the newest first.
struct Recent<T> {
    items: [T; 16],
    newest: usize,
}

impl<T: Copy + Default> Recent<T> {
    fn new() -> Self {
        Self { items: [T::default(); 16], newest: 0 }
    }

    fn push(&mut self, item: T) {
        self.newest = (self.newest + 1) % 16;
        self.items[self.newest] = item;
    }

    fn get(&self, age: u8) -> T {
        self.items[(self.newest + 16 - usize::from(age & 15)) % 16]
    }
}

/// What the decoder has seen.
struct Decoder<'a> {
    data: Cursor<'a>,
    table: &'a [u8],
    edges: Recent<(u32, u32)>,
    vertices: Recent<u32>,
    /// The next new vertex.
    next: u32,
    /// The last index that was stated by its difference.
    last: u32,
}

pub(super) fn decode(stream: &[u8], triangles: usize) -> Result<Vec<u32>, Fault> {
    let (mut data, table) = Cursor::new(stream, HEADER, TABLE)?;
    let codes = data.take(triangles)?;
    let (edges, vertices) = (Recent::new(), Recent::new());
    let mut decoder = Decoder { data, table, edges, vertices, next: 0, last: 0 };
    let mut indices = Vec::with_capacity(3 * triangles);
    for &code in codes {
        indices.extend(decoder.triangle(code)?);
    }
    decoder.data.end()?;
    Ok(indices)
}

impl Decoder<'_> {
    fn triangle(&mut self, code: u8) -> Result<[u32; 3], Fault> {
        match (code >> 4, code & 15) {
            (15, low) => self.apart(low),
            (edge, vertex) => self.beside(edge, vertex),
        }
    }

    /// A triangle beside an edge.
    fn beside(&mut self, edge: u8, vertex: u8) -> Result<[u32; 3], Fault> {
        let (a, b) = self.edges.get(edge);
        let c = match vertex {
            0 => self.new_vertex(),
            1..=12 => self.vertices.get(vertex),
            13 => self.stated(u32::MAX),
            14 => self.stated(1),
            _ => self.difference()?,
        };
        if !(1..=12).contains(&vertex) {
            self.vertices.push(c);
        }
        self.edges.push((c, b));
        self.edges.push((a, c));
        Ok([a, b, c])
    }

    /// A triangle that has no edge of those before it: by the table, or by a byte that states its second and third vertex.
    fn apart(&mut self, low: u8) -> Result<[u32; 3], Fault> {
        let stated = low >= 14;
        let pair = if stated { self.data.byte()? } else { self.table[usize::from(low)] };
        if stated && pair == 0 {
            self.next = 0;
        }
        let a = if low == 15 { self.difference()? } else { self.new_vertex() };
        let (b, b_is_new) = self.of_pair(pair >> 4, stated)?;
        let (c, c_is_new) = self.of_pair(pair & 15, stated)?;
        self.vertices.push(a);
        for (vertex, new) in [(b, b_is_new), (c, c_is_new)] {
            if new {
                self.vertices.push(vertex);
            }
        }
        for edge in [(b, a), (c, b), (a, c)] {
            self.edges.push(edge);
        }
        Ok([a, b, c])
    }

    /// A vertex by half a byte, and whether it is none of the recent ones.
    fn of_pair(&mut self, half: u8, stated: bool) -> Result<(u32, bool), Fault> {
        Ok(match half {
            0 => (self.new_vertex(), true),
            15 if stated => (self.difference()?, true),
            age => (self.vertices.get(age - 1), false),
        })
    }

    fn new_vertex(&mut self) -> u32 {
        self.next = self.next.wrapping_add(1);
        self.next.wrapping_sub(1)
    }

    fn difference(&mut self) -> Result<u32, Fault> {
        let difference = signed(self.data.number()?);
        Ok(self.stated(difference))
    }

    fn stated(&mut self, difference: u32) -> u32 {
        self.last = self.last.wrapping_add(difference);
        self.last
    }
}
