//! Little-endian binary input and output. Counts are checked against the remaining bytes before allocation.

use nalgebra::SMatrix;

use super::ModelFileError;

/// The remaining bytes of a file.
pub(super) struct Reader<'a> {
    left: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { left: bytes }
    }

    pub(super) fn take(&mut self, count: usize, place: &dyn Fn() -> String) -> Result<&'a [u8], ModelFileError> {
        let Some((taken, left)) = self.left.split_at_checked(count) else {
            return Err(ModelFileError::Truncated { place: place(), needed: (count - self.left.len()) as u64 });
        };
        self.left = left;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, place: &dyn Fn() -> String) -> Result<[u8; N], ModelFileError> {
        Ok(self.take(N, place)?.try_into().expect("as many as asked for"))
    }

    pub(super) fn u32(&mut self, place: &dyn Fn() -> String) -> Result<u32, ModelFileError> {
        Ok(u32::from_le_bytes(self.array(place)?))
    }

    pub(super) fn u64(&mut self, place: &dyn Fn() -> String) -> Result<u64, ModelFileError> {
        Ok(u64::from_le_bytes(self.array(place)?))
    }

    /// A count of items of at least `each` bytes; the remaining bytes must hold them.
    pub(super) fn count(&mut self, each: usize, place: &dyn Fn() -> String) -> Result<usize, ModelFileError> {
        let count = self.u64(place)?;
        self.fits(count, each, place)?;
        Ok(count as usize)
    }

    /// Rejects counts that the remaining bytes cannot hold.
    pub(super) fn fits(&self, count: u64, each: usize, place: &dyn Fn() -> String) -> Result<(), ModelFileError> {
        let (wanted, left) = (count.saturating_mul(each as u64), self.left.len() as u64);
        if wanted > left {
            return Err(ModelFileError::Truncated { place: place(), needed: wanted - left });
        }
        Ok(())
    }

    /// A number below `end`.
    pub(super) fn index(&mut self, end: usize, place: &dyn Fn() -> String) -> Result<u32, ModelFileError> {
        let value = self.u32(place)?;
        if (value as usize) < end {
            return Ok(value);
        }
        let expected = format!("0 to {}", end.saturating_sub(1));
        Err(ModelFileError::Value { place: place(), value: value.to_string(), expected })
    }

    /// A finite double.
    pub(super) fn f64(&mut self, place: &dyn Fn() -> String) -> Result<f64, ModelFileError> {
        let value = f64::from_le_bytes(self.array(place)?);
        if value.is_finite() {
            return Ok(value);
        }
        Err(ModelFileError::Value { place: place(), value: value.to_string(), expected: "a finite number".to_owned() })
    }

    /// A finite single.
    pub(super) fn f32(&mut self, place: &dyn Fn() -> String) -> Result<f32, ModelFileError> {
        let value = f32::from_le_bytes(self.array(place)?);
        if value.is_finite() {
            return Ok(value);
        }
        Err(ModelFileError::Value { place: place(), value: value.to_string(), expected: "a finite number".to_owned() })
    }

    /// A matrix of finite doubles, column-major.
    pub(super) fn matrix<const R: usize, const C: usize>(
        &mut self,
        place: &dyn Fn() -> String,
    ) -> Result<SMatrix<f64, R, C>, ModelFileError> {
        let mut matrix = SMatrix::<f64, R, C>::zeros();
        for x in matrix.iter_mut() {
            *x = self.f64(place)?;
        }
        Ok(matrix)
    }

    /// Rejects trailing bytes.
    pub(super) fn end(self) -> Result<(), ModelFileError> {
        match self.left.len() {
            0 => Ok(()),
            bytes => Err(ModelFileError::Trailing { bytes }),
        }
    }
}

/// A file being written.
#[derive(Default)]
pub(super) struct Writer {
    pub(super) bytes: Vec<u8>,
}

impl Writer {
    pub(super) fn u32(&mut self, value: u32) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(super) fn u64(&mut self, value: u64) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(super) fn f32(&mut self, value: f32) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(super) fn matrix<const R: usize, const C: usize>(&mut self, matrix: &SMatrix<f64, R, C>) {
        matrix.iter().for_each(|x| self.f64(*x));
    }
}
