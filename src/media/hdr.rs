//! HDR metadata: the mastering display (SMPTE ST 2086) and the content light level (CTA-861.3).
//!
//! FFmpeg keeps both as structures of its own. They are carried as those bytes into the container, and spelled out for the
//! encoders that write them into the bitstream.

use super::info::HdrBytes;

/// Chromaticities in units of 0.00002, luminances in 0.0001 cd/m²: the units of the bitstreams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Mastering {
    /// Red, green, blue, white: x and y.
    points: [[i64; 2]; 4],
    min: i64,
    max: i64,
}

/// Reads `AVMasteringDisplayMetadata`: ten fractions (three primaries and white, x and y, then minimum and maximum
/// luminance), then two flags.
fn mastering(bytes: &[u8]) -> Option<Mastering> {
    let mut numbers = bytes.as_chunks::<4>().0.iter().map(|b| i32::from_ne_bytes(*b));
    let mut scaled = |unit: f64| -> Option<i64> {
        let (num, den) = (numbers.next()?, numbers.next()?);
        (den != 0).then(|| (f64::from(num) / f64::from(den) * unit).round() as i64)
    };
    let mut points = [[0; 2]; 4];
    for value in points.as_flattened_mut() {
        *value = scaled(50_000.0)?;
    }
    let (min, max) = (scaled(10_000.0)?, scaled(10_000.0)?);
    let flags = (numbers.next()?, numbers.next()?);
    (flags == (1, 1)).then_some(Mastering { points, min, max })
}

/// Reads `AVContentLightMetadata`: greatest and mean-per-frame-greatest light level, cd/m².
fn light(bytes: &[u8]) -> Option<(u32, u32)> {
    let [a, b] = *bytes.as_chunks::<4>().0.first_chunk::<2>()?;
    Some((u32::from_ne_bytes(a), u32::from_ne_bytes(b)))
}

/// The metadata in the words of x264 and x265; `None` where there are none.
pub(super) fn x26x_parameters(hdr: &HdrBytes, encoder: &str) -> Option<String> {
    let (display, levels) =
        if encoder == "libx264" { ("mastering-display", "cll") } else { ("master-display", "max-cll") };
    let mut words = Vec::new();
    if let Some(m) = hdr.mastering.as_deref().and_then(mastering) {
        let [r, g, b, w] = m.points.map(|[x, y]| format!("({x},{y})"));
        words.push(format!("{display}=G{g}B{b}R{r}WP{w}L({},{})", m.max, m.min));
    }
    if let Some((most, mean)) = hdr.light.as_deref().and_then(light) {
        words.push(format!("{levels}={most},{mean}"));
    }
    (!words.is_empty()).then(|| words.join(":"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bt2020() -> Vec<u8> {
        let fractions = [
            (35_400, 50_000),
            (14_600, 50_000),
            (8500, 50_000),
            (39_850, 50_000),
            (6550, 50_000),
            (2300, 50_000),
            (15_635, 50_000),
            (16_450, 50_000),
            (1, 10_000),
            (1000, 1),
        ];
        let numbers = fractions.into_iter().flat_map(|(n, d)| [n, d]).chain([1, 1]);
        numbers.flat_map(i32::to_ne_bytes).collect()
    }

    #[test]
    fn both_encoders_get_the_numbers_of_the_standard() {
        let light = [1000_u32, 400].into_iter().flat_map(u32::to_ne_bytes).collect();
        let hdr = HdrBytes { mastering: Some(bt2020()), light: Some(light), ..HdrBytes::default() };
        assert_eq!(
            x26x_parameters(&hdr, "libx265").as_deref(),
            Some("master-display=G(8500,39850)B(6550,2300)R(35400,14600)WP(15635,16450)L(10000000,1):max-cll=1000,400")
        );
        assert!(x26x_parameters(&hdr, "libx264").is_some_and(|s| s.starts_with("mastering-display=G(")));
        assert_eq!(x26x_parameters(&HdrBytes::default(), "libx265"), None);
    }

    #[test]
    fn incomplete_metadata_are_left_out() {
        assert_eq!(mastering(&bt2020()[..40]), None);
        assert_eq!(mastering(&[0; 88]), None);
    }
}
