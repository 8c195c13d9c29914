//! Leaving the wide vector registers clean.
//!
//! The dense kernels of `faer` for AVX and AVX-512 return with the upper halves of the vector registers in use. Processors then
//! carry those halves along through every SSE instruction, each waiting for the one before that wrote the register: all scalar
//! arithmetic of the thread slows down, threefold in loops over sightings, until something clears them.
#![allow(unsafe_code)] // One instruction that no safe function offers.

/// Clears the upper halves of the vector registers; nothing where there are none.
pub(super) fn clear_upper_halves() {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx") {
        // SAFETY: AVX is there; no value lives in an upper half outside functions that are compiled for AVX, and those keep
        // theirs across calls themselves.
        unsafe { std::arch::x86_64::_mm256_zeroupper() }
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn arithmetic_around_it_is_untouched() {
        let before: Vec<f64> = (0..9).map(|k| f64::from(k).sqrt()).collect();
        super::clear_upper_halves();
        let after: Vec<f64> = (0..9).map(|k| f64::from(k).sqrt()).collect();
        assert_eq!(before, after);
    }
}
