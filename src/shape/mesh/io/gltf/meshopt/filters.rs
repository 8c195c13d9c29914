//! Filters of attributes: what follows the decoder.

/// Unit vectors by their projection to an octahedron, of which the third number is 1 in their precision; the fourth is anything.
/// Numbers of one or two bytes, by the stride.
pub(super) fn octahedral(bytes: &mut [u8], stride: usize) {
    let of_short = |c: &[u8]| i16::from_le_bytes([c[0], c[1]]);
    for element in bytes.chunks_exact_mut(stride) {
        if stride == 4 {
            let [x, y, one] = [0, 1, 2].map(|k| f64::from(element[k] as i8));
            let unit = on_sphere(x / one, y / one);
            element.iter_mut().zip(unit).for_each(|(byte, x)| *byte = (127.0 * x).round() as i8 as u8);
        } else {
            let [x, y, one] = [0, 2, 4].map(|k| f64::from(of_short(&element[k..])));
            let unit = on_sphere(x / one, y / one);
            put(element, [0, 1, 2], unit);
        }
    }
}

fn on_sphere(x: f64, y: f64) -> [f64; 3] {
    let z = 1.0 - x.abs() - y.abs();
    let folded = z.min(0.0).abs();
    let (x, y) = (x - folded.copysign(x), y - folded.copysign(y));
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|c| c / length)
}

/// Unit quaternions by three components, times √2; the last two bits of the fourth number say which one is left out, the others
/// are 1 in their precision.
pub(super) fn quaternion(bytes: &mut [u8]) {
    for element in bytes.chunks_exact_mut(8) {
        let [x, y, z, w] = [0, 2, 4, 6].map(|k| i16::from_le_bytes([element[k], element[k + 1]]));
        let one = f64::from(w | 3) * std::f64::consts::SQRT_2;
        let [x, y, z] = [x, y, z].map(|c| f64::from(c) / one);
        let greatest = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
        let from = usize::from(w.cast_unsigned() & 3);
        put(element, [from, from + 1, from + 2, from + 3].map(|k| k % 4), [greatest, x, y, z]);
    }
}

/// Writes fractions as numbers of two bytes to the places `to`.
fn put<const N: usize>(element: &mut [u8], to: [usize; N], fractions: [f64; N]) {
    for (to, x) in to.into_iter().zip(fractions) {
        element[2 * to..2 * to + 2].copy_from_slice(&((32_767.0 * x).round() as i16).to_le_bytes());
    }
}

/// Floats by an exponent of eight bits and a mantissa of 24.
pub(super) fn exponential(bytes: &mut [u8]) {
    for number in bytes.chunks_exact_mut(4) {
        let code = i32::from_le_bytes([number[0], number[1], number[2], number[3]]);
        let (exponent, mantissa) = (code >> 24, (code << 8) >> 8);
        let value = f64::from(mantissa) * 2.0_f64.powi(exponent);
        number.copy_from_slice(&(value as f32).to_le_bytes());
    }
}
