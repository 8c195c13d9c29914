//! Where a picture is shown: masks, and alpha planes made of them.

use plumbline_image::{Frame, Layout, PixelFormat, Plane};
use plumbline_num::math::Point2;
use plumbline_photo::rectangle::Outline;

/// Pixels beside a hole that are made anew with it: kernels have mixed them with what lies beyond.
const RIM: usize = 1;

/// A gray frame, white where the picture is. With `round` black around the disk that a fisheye shows in a frame of one color.
pub(crate) fn mask_of(frame: &Frame, round: bool) -> Option<Frame> {
    let outline = if round { Outline::of_frame(frame).filter(Outline::is_round) } else { None };
    let mut mask = Frame::new(PixelFormat::opaque(Layout::Gray, 8), frame.width, frame.height);
    mask.color.full_range = Some(true);
    let shown = |x: usize, y: usize| match &outline {
        Some(outline) => outline.contains(Point2::new(x as f64 + 0.5, y as f64 + 0.5)),
        None => true,
    };
    for y in 0..frame.height {
        let mut plane = mask.plane8_mut(0)?;
        plane.row_mut(y).iter_mut().enumerate().for_each(|(x, v)| *v = 255 * u8::from(shown(x, y)));
    }
    Some(mask)
}

/// The samples of an 8-bit gray frame.
pub(crate) fn plane_of(gray: &Frame) -> Option<Plane<u8>> {
    let plane = gray.plane8(0)?;
    Some(Plane::from_fn(gray.width, gray.height, |x, y| plane.row(y)[x]))
}

/// The alpha plane in 8 bit; 255 only where it is full.
pub(crate) fn opacity(frame: &Frame) -> Option<Plane<u8>> {
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

/// What is shown without its rim: 255 where all around is.
pub(crate) fn eroded(shown: &Plane<u8>) -> Plane<u8> {
    let (width, height) = (shown.width(), shown.height());
    let plane = shown.as_ref();
    let whole = |x: usize, y: usize| {
        let columns = x.saturating_sub(RIM)..(x + RIM + 1).min(width);
        (y.saturating_sub(RIM)..(y + RIM + 1).min(height))
            .all(|j| plane.row(j)[columns.clone()].iter().all(|v| *v == 255))
    };
    Plane::from_fn(width, height, |x, y| if whole(x, y) { 255 } else { 0 })
}

/// An opaque frame with this opacity; nothing of a color is left where it is zero.
pub(crate) fn with_alpha(frame: &Frame, shown: &Plane<u8>) -> Option<Frame> {
    let mut out = Frame::new(PixelFormat { alpha: true, ..frame.format }, frame.width, frame.height);
    out.copy_properties(frame);
    let (planes, most) = (frame.format.planes(), (1_u32 << frame.format.bits) - 1);
    for (i, y) in (0..=planes).flat_map(|i| (0..frame.height).map(move |y| (i, y))) {
        let opacity = shown.as_ref().row(y);
        if frame.format.bytes_per_sample() == 1 {
            let colors = if i < planes { Some(frame.plane8(i)?.row(y)) } else { None };
            let mut plane = out.plane8_mut(i)?;
            for (x, v) in plane.row_mut(y).iter_mut().enumerate() {
                *v = colors.map_or(opacity[x], |c| if opacity[x] > 0 { c[x] } else { 0 });
            }
        } else {
            let colors = if i < planes { Some(frame.plane16(i)?.row(y)) } else { None };
            let mut plane = out.plane16_mut(i)?;
            for (x, v) in plane.row_mut(y).iter_mut().enumerate() {
                let full = (u32::from(opacity[x]) * most / 255) as u16;
                *v = colors.map_or(full, |c| if opacity[x] > 0 { c[x] } else { 0 });
            }
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_alpha_plane_is_added_in_the_depth_of_the_frame_and_hides_what_is_not_shown() {
        let shown = Plane::from_fn(7, 5, |x, _| if x < 4 { 255 } else { 0 });
        for bits in [8, 16] {
            let mut frame = Frame::new(PixelFormat::opaque(Layout::Gbr, bits), 7, 5);
            for (plane, y) in (0..3).flat_map(|p| (0..5).map(move |y| (p, y))) {
                if bits == 8 {
                    frame.plane8_mut(plane).expect("8 bit").row_mut(y).fill(90);
                } else {
                    frame.plane16_mut(plane).expect("16 bit").row_mut(y).fill(30_000);
                }
            }
            let made = with_alpha(&frame, &shown).expect("planes");
            assert_eq!(opacity(&made).expect("alpha").as_ref().row(2), shown.as_ref().row(2));
            let sample = |x: usize| match bits {
                8 => u16::from(made.plane8(1).expect("8 bit").row(3)[x]),
                _ => made.plane16(1).expect("16 bit").row(3)[x],
            };
            assert_eq!((sample(3), sample(4)), (if bits == 8 { 90 } else { 30_000 }, 0));
        }
    }

    #[test]
    fn the_rim_of_a_hole_belongs_to_it() {
        let shown = Plane::from_fn(9, 9, |x, y| if (x, y) == (4, 4) { 254 } else { 255 });
        let left = eroded(&shown);
        let hole = (0..81).filter(|k| left.as_ref().row(k / 9)[k % 9] == 0).count();
        assert_eq!(hole, 9);
    }
}
