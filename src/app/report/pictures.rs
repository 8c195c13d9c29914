//! Frames as small pictures for a page: reduced by the mean over each pixel's area, turned as a player turns them, JPEG.

use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;

use super::color::Conversion;
use plumbline_image::{Frame, Plane, PlaneRef, analysis_size};

/// JPEG quality: artifacts hardly show, and a dozen pictures stay below a megabyte.
const QUALITY: u8 = 82;

/// How frames are shown.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Longest side of the picture, px; nothing is enlarged.
    pub most_px: usize,
    /// Clockwise turn that a player applies, degrees; taken to the nearest quarter.
    pub rotation_deg: f64,
    /// The player mirrors the picture from left to right before it turns it.
    pub mirrored: bool,
    /// Width over height of a pixel.
    pub pixel_aspect: f64,
}

/// A picture as a page holds it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// The file.
    pub jpeg: Vec<u8>,
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
}

impl Picture {
    /// `frame` as a player shows it, no larger than `view` allows. `None` where the frame's memory does not hold its planes.
    pub fn of(frame: &Frame, view: &View) -> Option<Self> {
        let (pixels, width, height) = shown(frame, view)?;
        let mut jpeg = Vec::new();
        let encoder = JpegEncoder::new_with_quality(&mut jpeg, QUALITY);
        let mut encoder = encoder;
        encoder.encode(&pixels, width as u32, height as u32, ExtendedColorType::Rgb8).ok()?;
        Some(Self { jpeg, width, height })
    }
}

/// Red, green and blue of every pixel, and the size.
fn shown(frame: &Frame, view: &View) -> Option<(Vec<u8>, usize, usize)> {
    let aspect = if view.pixel_aspect.is_finite() && view.pixel_aspect > 0.0 { view.pixel_aspect } else { 1.0 };
    let square = (frame.width as f64 * aspect.max(1.0), frame.height as f64 / aspect.min(1.0));
    let (w, h) = analysis_size((square.0.round() as usize).max(1), (square.1.round() as usize).max(1), view.most_px);
    let planes = (0..frame.format.planes().min(3)).map(|i| reduced(frame, i, (w, h))).collect::<Option<Vec<_>>>()?;
    let conversion = Conversion::of(frame);
    let quarter = ((view.rotation_deg / 90.0).round() as i64).rem_euclid(4);
    let (width, height) = if quarter % 2 == 0 { (w, h) } else { (h, w) };
    let mut pixels = Vec::with_capacity(3 * w * h);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (x, y) = match quarter {
            0 => (x, y),
            1 => (y, h - 1 - x),
            2 => (w - 1 - x, h - 1 - y),
            _ => (w - 1 - y, x),
        };
        let x = if view.mirrored { w - 1 - x } else { x };
        let sample = |i: usize| planes.get(i).map_or(0.0, |p| f64::from(p.as_ref().row(y)[x]));
        pixels.extend(conversion.rgb([sample(0), sample(1), sample(2)]));
    }
    Some((pixels, width, height))
}

/// Plane `i` at the size of the picture, its samples where they are sited.
fn reduced(frame: &Frame, i: usize, (w, h): (usize, usize)) -> Option<Plane<f32>> {
    let (shift_x, shift_y) = frame.format.subsampling(i);
    let [offset_x, offset_y] = frame.color.chroma_offset.map(f64::from);
    let plane_size = frame.format.plane_size(i, frame.width, frame.height);
    let columns = covers(frame.width, w, shift_x, offset_x, plane_size.0);
    let rows = covers(frame.height, h, shift_y, offset_y, plane_size.1);
    if frame.format.bytes_per_sample() == 1 {
        Some(averaged(frame.plane8(i)?, &columns, &rows))
    } else {
        Some(averaged(frame.plane16(i)?, &columns, &rows))
    }
}

/// Samples and their shares in an output pixel.
type Cover = Vec<(usize, f32)>;

/// What each of `out` pixels covers of the `samples` of a plane that is `2^shift` times smaller than the `luma` pixels across;
/// its first sample lies `offset` luma pixels after the first of them. Beyond its ends a plane goes on as it ends.
fn covers(luma: usize, out: usize, shift: u32, offset: f64, samples: usize) -> Vec<Cover> {
    let cell = f64::from(1_u32 << shift);
    let in_plane = |x: f64| if shift == 0 { x } else { (x - offset - 0.5) / cell + 0.5 };
    let edge = |k: usize| in_plane(k as f64 * luma as f64 / out as f64);
    let cover = |k: usize| {
        let (start, end) = (edge(k), edge(k + 1));
        let cells = start.floor() as i64..end.ceil() as i64;
        let share = |j: i64| (end.min((j + 1) as f64) - start.max(j as f64)) / (end - start);
        cells.map(|j| ((j.max(0) as usize).min(samples - 1), share(j) as f32)).collect()
    };
    (0..out).map(cover).collect()
}

fn averaged<T: Copy + Into<f32>>(plane: PlaneRef<'_, T>, columns: &[Cover], rows: &[Cover]) -> Plane<f32> {
    let mut out = Plane::new(columns.len(), rows.len());
    let mut sums = vec![0.0_f32; plane.width()];
    for (y, row) in rows.iter().enumerate() {
        sums.fill(0.0);
        for (k, share) in row {
            for (sum, v) in sums.iter_mut().zip(plane.row(*k)) {
                *sum += share * (*v).into();
            }
        }
        for (out, column) in out.as_mut().row_mut(y).iter_mut().zip(columns) {
            *out = column.iter().map(|(k, share)| share * sums[*k]).sum();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use plumbline_image::{Layout, PixelFormat};

    const VIEW: View = View { most_px: 640, rotation_deg: 0.0, mirrored: false, pixel_aspect: 1.0 };

    /// A picture whose gray tells the place: `60 x + y` over cells.
    fn frame(bits: u8, (w, h): (usize, usize)) -> Frame {
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Gbr, bits), w, h);
        for i in 0..3 {
            for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
                let v = 60 * x + y;
                match bits {
                    8 => frame.plane8_mut(i).expect("8 bit").row_mut(y)[x] = v as u8,
                    _ => frame.plane16_mut(i).expect("deeper").row_mut(y)[x] = (v << (bits - 8)) as u16,
                }
            }
        }
        frame
    }

    fn reds(frame: &Frame, view: View) -> (Vec<u8>, usize, usize) {
        let (pixels, w, h) = shown(frame, &view).expect("planes");
        (pixels.chunks(3).map(|p| p[0]).collect(), w, h)
    }

    #[test]
    fn pictures_are_turned_and_mirrored_as_players_do() {
        let frame = frame(8, (3, 2));
        let turned = |rotation_deg, mirrored| reds(&frame, View { rotation_deg, mirrored, ..VIEW });
        assert_eq!(turned(0.0, false), (vec![0, 60, 120, 1, 61, 121], 3, 2));
        assert_eq!(turned(90.0, false), (vec![1, 0, 61, 60, 121, 120], 2, 3));
        assert_eq!(turned(180.0, false), (vec![121, 61, 1, 120, 60, 0], 3, 2));
        assert_eq!(turned(-90.0, false), (vec![120, 121, 60, 61, 0, 1], 2, 3));
        assert_eq!(turned(0.0, true), (vec![120, 60, 0, 121, 61, 1], 3, 2));
        assert_eq!(turned(90.0, true), (vec![121, 120, 61, 60, 1, 0], 2, 3), "mirrored first");
    }

    #[test]
    fn depth_does_not_change_the_picture_and_reduction_is_the_mean() {
        let (eight, ten) = (frame(8, (4, 40)), frame(10, (4, 40)));
        let by_one = |a: &[u8], b: &[u8]| a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1);
        assert!(by_one(&reds(&eight, VIEW).0, &reds(&ten, VIEW).0));
        let (half, w, h) = reds(&eight, View { most_px: 20, ..VIEW });
        assert_eq!((w, h), (2, 20));
        assert_eq!(half[..2], [31, 151], "(0 + 60 + 1 + 61)/4 and (120 + 180 + 121 + 181)/4, rounded");
        let (third, ..) = reds(&eight, View { most_px: 30, ..VIEW });
        assert_eq!(third.len(), 3 * 30);
    }

    #[test]
    fn pixels_that_are_not_square_are_shown_square_without_loss() {
        let size = |pixel_aspect| {
            let (_, w, h) = reds(&frame(8, (4, 10)), View { pixel_aspect, ..VIEW });
            (w, h)
        };
        assert_eq!((size(2.0), size(0.5), size(f64::NAN)), ((8, 10), (4, 20), (4, 10)));
    }

    #[test]
    fn chroma_is_read_where_it_is_sited() {
        let at = |offset: f64, k: usize| covers(8, 8, 1, offset, 4)[k].clone();
        assert_eq!(
            (at(0.5, 2), at(0.5, 3)),
            (vec![(1, 1.0)], vec![(1, 1.0)]),
            "between two luma samples: a sample for both"
        );
        assert_eq!((at(0.0, 2), at(0.0, 3)), (vec![(1, 1.0)], vec![(1, 0.5), (2, 0.5)]), "on every other luma sample");
        assert_eq!(at(0.0, 7), [(3, 0.5), (3, 0.5)], "beyond the end");
    }

    #[test]
    fn a_picture_is_a_jpeg_of_its_size() {
        let picture = Picture::of(&frame(8, (4, 3)), &VIEW).expect("planes");
        let read = image::load_from_memory(&picture.jpeg).expect("a picture").into_rgb8();
        assert_eq!((read.dimensions(), (picture.width, picture.height)), ((4, 3), (4, 3)));
    }
}
