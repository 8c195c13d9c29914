//! Little-endian binary input and output. Counts are checked against the remaining bytes before allocation.

use nalgebra::SMatrix;

use crate::character::RigFileError;

/// The remaining bytes of a file.
pub(super) struct Reader<'a> {
    left: &'a [u8],
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { left: bytes }
    }

    pub(super) fn take(&mut self, count: usize, item: &dyn Fn() -> String) -> Result<&'a [u8], RigFileError> {
        self.fits(count as u64, 1, item)?;
        let (taken, left) = self.left.split_at(count);
        self.left = left;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, item: &dyn Fn() -> String) -> Result<[u8; N], RigFileError> {
        Ok(self.take(N, item)?.try_into().expect("as many as asked for"))
    }

    pub(super) fn u32(&mut self, item: &dyn Fn() -> String) -> Result<u32, RigFileError> {
        Ok(u32::from_le_bytes(self.array(item)?))
    }

    pub(super) fn u64(&mut self, item: &dyn Fn() -> String) -> Result<u64, RigFileError> {
        Ok(u64::from_le_bytes(self.array(item)?))
    }

    /// A count of items of at least `each` bytes; the remaining bytes must hold them.
    pub(super) fn count(&mut self, each: usize, item: &dyn Fn() -> String) -> Result<usize, RigFileError> {
        let count = self.u64(item)?;
        self.fits(count, each, item)?;
        Ok(count as usize)
    }

    /// Rejects counts that the remaining bytes cannot hold.
    pub(super) fn fits(&self, count: u64, each: usize, item: &dyn Fn() -> String) -> Result<(), RigFileError> {
        let (wanted, left) = (count.saturating_mul(each as u64), self.left.len() as u64);
        if wanted <= left {
            return Ok(());
        }
        let missing = format!("at least {} bytes are missing; was it copied completely?", wanted - left);
        Err(RigFileError::Content(format!("the file ends within {}: {missing}", item())))
    }

    /// A number below `end`.
    pub(super) fn index(&mut self, end: usize, item: &dyn Fn() -> String) -> Result<u32, RigFileError> {
        let value = self.u32(item)?;
        if (value as usize) < end {
            return Ok(value);
        }
        Err(invalid(&item(), value, &format!("0 to {}", end.saturating_sub(1))))
    }

    /// A finite double.
    pub(super) fn f64(&mut self, item: &dyn Fn() -> String) -> Result<f64, RigFileError> {
        finite(f64::from_le_bytes(self.array(item)?), item)
    }

    /// A finite single.
    pub(super) fn f32(&mut self, item: &dyn Fn() -> String) -> Result<f32, RigFileError> {
        let value = f32::from_le_bytes(self.array(item)?);
        finite(f64::from(value), item).map(|_| value)
    }

    /// A matrix of finite doubles, column-major.
    pub(super) fn matrix<const R: usize, const C: usize>(
        &mut self,
        item: &dyn Fn() -> String,
    ) -> Result<SMatrix<f64, R, C>, RigFileError> {
        let mut matrix = SMatrix::<f64, R, C>::zeros();
        for x in matrix.iter_mut() {
            *x = self.f64(item)?;
        }
        Ok(matrix)
    }

    /// Rejects trailing bytes.
    pub(super) fn end(self) -> Result<(), RigFileError> {
        match self.left.len() {
            0 => Ok(()),
            bytes => {
                let fault = format!("{bytes} bytes follow the end of the model; is this the right file?");
                Err(RigFileError::Content(fault))
            }
        }
    }
}

/// Reports an invalid value.
pub(super) fn invalid(item: &str, value: impl std::fmt::Display, expected: &str) -> RigFileError {
    RigFileError::Content(format!("{item} is {value} (expected {expected})"))
}

fn finite(value: f64, item: &dyn Fn() -> String) -> Result<f64, RigFileError> {
    if value.is_finite() { Ok(value) } else { Err(invalid(&item(), value, "a finite number")) }
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
