//! Extrapolation beyond the edges of the source.

/// Samples outside the source.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Border {
    /// Black of the frame's format and range; transparent where there is an alpha plane.
    Black,
    /// The nearest sample of the edge. Also right for cropped output, where it is never seen: the outermost half pixel
    /// then has no dark rim.
    #[default]
    Replicate,
    /// The image reflected at its edges, the edge samples repeated, periodically.
    Mirror,
}

impl Border {
    /// The index of the sample used for index `i` of `n`; `None`: black.
    pub(super) fn resolve(self, i: i32, n: usize) -> Option<usize> {
        let n = n as i32;
        let inside = match self {
            Self::Black if i < 0 || i >= n => return None,
            Self::Black => i,
            Self::Replicate => i.clamp(0, n - 1),
            Self::Mirror => {
                let m = i.rem_euclid(2 * n);
                m.min(2 * n - 1 - m)
            }
        };
        Some(inside as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_beyond_the_edge_resolve_as_the_border_says() {
        let row = |border: Border| (-4..8).map(|i| border.resolve(i, 3)).collect::<Vec<_>>();
        let some = |v: [usize; 12]| v.map(Some).to_vec();
        assert_eq!(row(Border::Replicate), some([0, 0, 0, 0, 0, 1, 2, 2, 2, 2, 2, 2]));
        assert_eq!(row(Border::Mirror), some([2, 2, 1, 0, 0, 1, 2, 2, 1, 0, 0, 1]));
        assert_eq!(row(Border::Black)[3..8], [None, Some(0), Some(1), Some(2), None]);
    }
}
