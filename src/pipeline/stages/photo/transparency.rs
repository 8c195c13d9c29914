//! Alpha planes of still pictures: where something is shown.

use crate::image::{Frame, PixelFormat, Plane};
use crate::photo::rectangle::Outline;

/// The frame with an alpha plane: opaque, or the one it has. With `round`, transparent too around the disk that a fisheye shows in
/// a frame of one color.
pub(super) fn with_alpha(frame: &Frame, round: bool) -> Option<Frame> {
    let outline = if round { Outline::of_frame(frame).filter(Outline::is_round) } else { None };
    if frame.format.alpha && outline.is_none() {
        return copied(frame, frame.format, frame.format.planes());
    }
    let mut out = copied(frame, PixelFormat { alpha: true, ..frame.format }, frame.format.planes())?;
    let shown = |x: usize, y: usize| match &outline {
        Some(outline) => outline.contains(crate::math::Point2::new(x as f64 + 0.5, y as f64 + 0.5)),
        None => true,
    };
    let (plane, had) = (out.format.planes() - 1, frame.format.alpha);
    let most = ((1_u32 << out.format.bits) - 1) as u16;
    for y in 0..out.height {
        if out.format.bytes_per_sample() == 1 {
            let mut alpha = out.plane8_mut(plane)?;
            let samples = alpha.row_mut(y).iter_mut().enumerate();
            samples.for_each(|(x, v)| *v = if shown(x, y) { if had { *v } else { most as u8 } } else { 0 });
        } else {
            let mut alpha = out.plane16_mut(plane)?;
            let samples = alpha.row_mut(y).iter_mut().enumerate();
            samples.for_each(|(x, v)| *v = if shown(x, y) { if had { *v } else { most } } else { 0 });
        }
    }
    Some(out)
}

/// The frame without its alpha plane.
pub(super) fn without_alpha(frame: &Frame) -> Option<Frame> {
    copied(frame, PixelFormat { alpha: false, ..frame.format }, frame.format.planes() - 1)
}

/// The alpha plane in 8 bit; 255 only where it is full.
pub(super) fn opacity(frame: &Frame) -> Option<Plane<u8>> {
    let plane = frame.format.planes() - 1;
    if let Some(alpha) = frame.plane8(plane) {
        return Some(Plane::from_fn(frame.width, frame.height, |x, y| alpha.row(y)[x]));
    }
    let alpha = frame.plane16(plane)?;
    let shift = frame.format.bits - 8;
    let most = ((1_u32 << frame.format.bits) - 1) as u16;
    let level = |v: u16| if v == most { 255 } else { (v >> shift).min(254) as u8 };
    Some(Plane::from_fn(frame.width, frame.height, |x, y| level(alpha.row(y)[x])))
}

/// The first `planes` planes in a frame of another format of the same depth.
fn copied(frame: &Frame, format: PixelFormat, planes: usize) -> Option<Frame> {
    let mut out = Frame::new(format, frame.width, frame.height);
    out.copy_properties(frame);
    for i in 0..planes {
        for y in 0..frame.height {
            if format.bytes_per_sample() == 1 {
                let row = frame.plane8(i)?.row(y);
                out.plane8_mut(i)?.row_mut(y).copy_from_slice(row);
            } else {
                let row = frame.plane16(i)?.row(y);
                out.plane16_mut(i)?.row_mut(y).copy_from_slice(row);
            }
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Layout;

    #[test]
    fn alpha_comes_and_goes_without_touching_colors() {
        for bits in [8, 16] {
            let mut frame = Frame::new(PixelFormat::opaque(Layout::Gbr, bits), 7, 5);
            for (plane, y) in (0..3).flat_map(|p| (0..5).map(move |y| (p, y))) {
                let value = |x: usize| (40 * plane + 8 * y + x) as u8;
                match bits {
                    8 => frame
                        .plane8_mut(plane)
                        .expect("8 bit")
                        .row_mut(y)
                        .iter_mut()
                        .enumerate()
                        .for_each(|(x, v)| *v = value(x)),
                    _ => frame
                        .plane16_mut(plane)
                        .expect("16 bit")
                        .row_mut(y)
                        .iter_mut()
                        .enumerate()
                        .for_each(|(x, v)| *v = u16::from(value(x))),
                }
            }
            let opaque = with_alpha(&frame, false).expect("planes");
            assert!(opaque.format.alpha && opacity(&opaque).expect("alpha").as_ref().row(3).iter().all(|v| *v == 255));
            let back = without_alpha(&opaque).expect("planes");
            assert_eq!(back.format, frame.format);
            for plane in 0..3 {
                assert_eq!(
                    back.plane8(plane).map(|p| p.row(4).to_vec()),
                    frame.plane8(plane).map(|p| p.row(4).to_vec())
                );
                assert_eq!(
                    back.plane16(plane).map(|p| p.row(4).to_vec()),
                    frame.plane16(plane).map(|p| p.row(4).to_vec())
                );
            }
        }
    }
}
