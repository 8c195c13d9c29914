//! One channel of an image, with a stride.

/// A channel of an image in the memory `D`: `height` rows of `width` samples, `stride` samples apart.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Raster<D> {
    data: D,
    width: usize,
    height: usize,
    stride: usize,
}

/// An owned channel.
pub type Plane<T> = Raster<Vec<T>>;
/// A borrowed channel.
pub type PlaneRef<'a, T> = Raster<&'a [T]>;
/// A mutably borrowed channel.
pub type PlaneMut<'a, T> = Raster<&'a mut [T]>;

impl<D> Raster<D> {
    /// Width, px.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, px.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Distance between the starts of two rows, samples.
    pub fn stride(&self) -> usize {
        self.stride
    }
}

/// Samples that a slice must hold for such a plane; the last row needs no padding.
fn needed(width: usize, height: usize, stride: usize) -> usize {
    if height == 0 { 0 } else { (height - 1) * stride + width }
}

impl<T: Copy + Default> Plane<T> {
    /// A plane of default samples, rows padded to a multiple of 32 samples.
    pub fn new(width: usize, height: usize) -> Self {
        let stride = width.next_multiple_of(32);
        Self { data: vec![T::default(); stride * height], width, height, stride }
    }

    /// A plane filled by `f(x, y)`.
    pub fn from_fn(width: usize, height: usize, mut f: impl FnMut(usize, usize) -> T) -> Self {
        let mut plane = Self::new(width, height);
        for y in 0..height {
            for (x, sample) in plane.as_mut().row_mut(y).iter_mut().enumerate() {
                *sample = f(x, y);
            }
        }
        plane
    }

    /// Gives the plane another size; the samples are unspecified afterwards, the allocation is kept where it suffices.
    pub fn resize(&mut self, width: usize, height: usize) {
        self.stride = width.next_multiple_of(32);
        self.width = width;
        self.height = height;
        self.data.resize(self.stride * height, T::default());
    }
}

impl<T> Plane<T> {
    /// A read-only view.
    pub fn as_ref(&self) -> PlaneRef<'_, T> {
        PlaneRef { data: &self.data, width: self.width, height: self.height, stride: self.stride }
    }

    /// A writable view.
    pub fn as_mut(&mut self) -> PlaneMut<'_, T> {
        PlaneMut { data: &mut self.data, width: self.width, height: self.height, stride: self.stride }
    }
}

impl<'a, T> PlaneRef<'a, T> {
    /// A view into `data`; `None` where the rows do not fit into it or overlap (`stride < width`).
    pub fn new(data: &'a [T], width: usize, height: usize, stride: usize) -> Option<Self> {
        (stride >= width && data.len() >= needed(width, height, stride)).then_some(Self { data, width, height, stride })
    }

    /// Row `y`, `width` samples.
    pub fn row(&self, y: usize) -> &'a [T] {
        assert!(y < self.height, "row {y} of a plane of {} rows", self.height);
        &self.data[y * self.stride..y * self.stride + self.width]
    }

    /// All samples from the first of the first row, padding included.
    pub fn data(&self) -> &'a [T] {
        self.data
    }
}

impl<'a, T> PlaneMut<'a, T> {
    /// A view into `data`; `None` where the rows do not fit into it or overlap (`stride < width`).
    pub fn new(data: &'a mut [T], width: usize, height: usize, stride: usize) -> Option<Self> {
        (stride >= width && data.len() >= needed(width, height, stride)).then_some(Self { data, width, height, stride })
    }

    /// Row `y`, `width` samples.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        assert!(y < self.height, "row {y} of a plane of {} rows", self.height);
        &mut self.data[y * self.stride..y * self.stride + self.width]
    }

    /// The same plane, read-only.
    pub fn as_ref(&self) -> PlaneRef<'_, T> {
        PlaneRef { data: self.data, width: self.width, height: self.height, stride: self.stride }
    }

    /// All samples, padding included, and the stride: for loops that split the rows between threads.
    pub fn into_data(self) -> (&'a mut [T], usize) {
        (self.data, self.stride)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_exclude_the_padding() {
        let p = Plane::from_fn(33, 3, |x, y| (x + 100 * y) as u16);
        assert_eq!(p.stride(), 64);
        assert_eq!(p.as_ref().row(2).len(), 33);
        assert_eq!(p.as_ref().row(2)[32], 232);
    }

    #[test]
    fn views_that_do_not_fit_are_refused() {
        let data = [0_u8; 20];
        assert!(PlaneRef::new(&data, 5, 4, 5).is_some());
        assert!(PlaneRef::new(&data, 4, 4, 5).is_some(), "the last row needs no padding");
        assert!(PlaneRef::new(&data, 5, 5, 5).is_none());
        assert!(PlaneRef::new(&data, 6, 2, 5).is_none(), "rows would overlap");
    }
}
