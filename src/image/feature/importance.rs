//! Importance of each pixel for retargeting.
//!
//! ```text
//! I = max(floor, mask(faces(Ĝ (υ + (1 − υ) Ŝ))))
//! ```
//!
//! with saliency `Ŝ` ([`super::saliency`]) and the mean gradient `Ĝ` ([`super::gradient`]), each in [0, 1]. Wang et al.
//! multiply the two, `υ` = 0: but where a picture is busy all over, what does not stand out shows distortion too.
//! Faces, and weaker the body expected below them, are raised to a value of their own. A mask by hand overrides it: 0
//! is unimportant, 1 fully important, ½ leaves the computed value.
//!
//! # Reference
//! Y.-S. Wang, C.-L. Tai, O. Sorkine, T.-Y. Lee, *Optimized scale-and-stretch for image resizing*, ACM Trans. Graph.
//! (SIGGRAPH Asia) 27 (2008), section 3.2.

use super::gradient::{box_mean, gradient};
use super::{Face, FeatureError, LabPicture, saliency};
use crate::{Frame, Plane, analysis_luma};
use plumbline_num::math::{Point2, Rect};
use plumbline_num::options::OptionError;
use plumbline_num::run::{Run, Stopped};

/// Radius of the gradient's average, as a fraction of the longer side: about a cell of the retargeting grid. Without it
/// only outlines would be important, and objects be squeezed between them.
const GRADIENT_RADIUS: f64 = 0.0125;
/// Quantile of the gradient that maps to 1. At the maximum a single lamp would make everything else look even.
const BUSY_QUANTILE: f64 = 0.9;
/// `υ`: weight of texture that is not salient relative to texture that is. At 0 hair above sunglasses and chairs beside
/// a table are squeezed like sky; at 1 a wave weighs as much as a child.
const UNSALIENT: f32 = 0.4;
/// Radius of the final blur, as a fraction of the longer side: neighboring cells must not differ abruptly.
const BLUR_RADIUS: f64 = 0.01;
/// Minimum importance of the body expected below a face.
const BODY: f32 = 0.7;

/// How importance is judged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImportanceOptions {
    /// Longer side of the picture that is looked at, px.
    pub max_side: usize,
    /// Minimum importance, above 0, up to 1. At 0.01 the sky may vanish altogether; at 1 nothing matters more than
    /// anything else.
    pub floor: f32,
}

impl Default for ImportanceOptions {
    fn default() -> Self {
        Self { max_side: 400, floor: 0.03 }
    }
}

/// Importance over a whole picture, in (0, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct Importance {
    plane: Plane<f32>,
}

impl Importance {
    /// Judges a frame. `faces` are in px of the frame; `mask` is a picture of the same size, black to white.
    ///
    /// # Errors
    /// [`FeatureError::Input`] for a picture without pixels and a mask of another size; [`FeatureError::Option`],
    /// [`FeatureError::Interrupted`].
    pub fn of_frame(
        frame: &Frame,
        faces: &[Face],
        mask: Option<&Frame>,
        options: &ImportanceOptions,
        run: &Run,
    ) -> Result<Self, FeatureError> {
        let floor = f64::from(options.floor);
        OptionError::check(floor > 0.0 && floor <= 1.0, "floor", floor, "above 0, at most 1")?;
        let (width, height) = (frame.width, frame.height);
        let picture = LabPicture::of_frame(frame, options.max_side.max(1)).ok_or_else(|| unreadable(width, height))?;
        run.check()?;
        let mut found = found_in(&picture, run)?;
        raise_faces(&mut found, faces, (width as f64, height as f64));
        if let Some(mask) = mask {
            apply_mask(&mut found, mask, (width, height), options)?;
        }
        let floor = options.floor;
        let plane = map(&found, |_, _, v| v.clamp(floor, 1.0));
        Ok(Self { plane })
    }

    /// Importance given value by value, each in [0, 1], over the whole picture.
    ///
    /// # Errors
    /// [`FeatureError::Input`] for an empty plane and a value out of range.
    pub fn from_plane(plane: Plane<f32>) -> Result<Self, FeatureError> {
        let (width, height) = (plane.width(), plane.height());
        if width == 0 || height == 0 {
            return Err(unreadable(width, height));
        }
        for y in 0..height {
            let wrong = plane.as_ref().row(y).iter().position(|v| !(0.0..=1.0).contains(v));
            if let Some(x) = wrong {
                let value = plane.as_ref().row(y)[x];
                let text = format!("the importance at ({x}, {y}) is {value} (expected 0 to 1)");
                return Err(FeatureError::Input(text));
            }
        }
        Ok(Self { plane })
    }

    /// Everything matters alike.
    pub fn even() -> Self {
        Self { plane: Plane::from_fn(1, 1, |_, _| 1.0) }
    }

    /// The values, stretched over the whole picture.
    pub fn plane(&self) -> &Plane<f32> {
        &self.plane
    }

    /// Means over the cells of a `cols × rows` grid laid over `window`, row-major. The window is in fractions of the
    /// picture, which is `[0, 1] × [0, 1]`.
    pub fn cell_means(&self, window: &Rect, cols: usize, rows: usize) -> Vec<f64> {
        let sums = Sums::new(&self.plane);
        let cell = |i: usize| {
            let (c, r) = ((i % cols) as f64, (i / cols) as f64);
            let min = window.at(c / cols as f64, r / rows as f64);
            let max = window.at((c + 1.0) / cols as f64, (r + 1.0) / rows as f64);
            sums.mean(&Rect { min, max })
        };
        (0..cols * rows).map(cell).collect()
    }
}

/// `Ĝ (υ + (1 − υ) Ŝ)`.
fn found_in(picture: &LabPicture, run: &Run) -> Result<Plane<f32>, Stopped> {
    let longer = picture.width().max(picture.height()) as f64;
    let radius = |share: f64| ((longer * share).round() as usize).max(1);
    let salient = saliency(picture);
    run.check()?;
    let busy = gradient(picture, radius(GRADIENT_RADIUS));
    run.check()?;
    let full = quantile(&busy, BUSY_QUANTILE).max(1e-3);
    let product = map(&busy, |x, y, g| {
        let stands_out = UNSALIENT + (1.0 - UNSALIENT) * salient.as_ref().row(y)[x];
        stands_out * (g / full).min(1.0)
    });
    Ok(box_mean(&product, radius(BLUR_RADIUS)))
}

fn map(plane: &Plane<f32>, f: impl Fn(usize, usize, f32) -> f32) -> Plane<f32> {
    let view = plane.as_ref();
    Plane::from_fn(plane.width(), plane.height(), |x, y| f(x, y, view.row(y)[x]))
}

fn quantile(plane: &Plane<f32>, q: f64) -> f32 {
    let mut values: Vec<f32> = (0..plane.height()).flat_map(|y| plane.as_ref().row(y).iter().copied()).collect();
    let k = ((values.len() - 1) as f64 * q) as usize;
    *values.select_nth_unstable_by(k, f32::total_cmp).1
}

/// Faces become as important as can be within an ellipse around their box (hair, chin and ears stand outside it), the body
/// below them within a wider one.
fn raise_faces(plane: &mut Plane<f32>, faces: &[Face], size: (f64, f64)) {
    let (w, h) = (plane.width() as f64, plane.height() as f64);
    for face in faces {
        let (center, fw, fh) = (face.rect.center(), face.rect.width(), face.rect.height());
        let head = Ellipse { center, across: 0.75 * fw, down: 0.9 * fh };
        let body = Ellipse { center: Point2::new(center.x, center.y + 3.2 * fh), across: 1.3 * fw, down: 3.4 * fh };
        *plane = map(plane, |x, y, v| {
            let p = Point2::new((x as f64 + 0.5) / w * size.0, (y as f64 + 0.5) / h * size.1);
            v.max(head.at(p)).max(BODY * body.at(p))
        });
    }
}

struct Ellipse {
    center: Point2,
    across: f64,
    down: f64,
}

impl Ellipse {
    /// 1 inside, falling to 0 at 1.3 times the size.
    fn at(&self, p: Point2) -> f32 {
        let r = ((p.x - self.center.x) / self.across).hypot((p.y - self.center.y) / self.down);
        ((1.3 - r) / 0.3).clamp(0.0, 1.0) as f32
    }
}

/// The frame's memory does not hold its planes, or a side is zero.
fn unreadable(width: usize, height: usize) -> FeatureError {
    FeatureError::Input(format!("a picture of {width}×{height} px holds no pixels to judge"))
}

fn apply_mask(
    plane: &mut Plane<f32>,
    mask: &Frame,
    (width, height): (usize, usize),
    options: &ImportanceOptions,
) -> Result<(), FeatureError> {
    if (mask.width, mask.height) != (width, height) {
        let sizes = format!("{}×{} px and the picture {width}×{height} px", mask.width, mask.height);
        return Err(FeatureError::Input(format!("the importance mask has {sizes}; scale the mask to the picture")));
    }
    let mut small = Plane::new(0, 0);
    if !analysis_luma(mask, options.max_side.max(1), &mut small) {
        return Err(unreadable(width, height));
    }
    *plane = map(plane, |x, y, v| masked(v, f32::from(small.as_ref().row(y)[x]) / 255.0));
    Ok(())
}

/// `v` under a mask `m`: 0 at 0, `v` at ½, 1 at 1, linear between.
fn masked(v: f32, m: f32) -> f32 {
    if m < 0.5 { 2.0 * m * v } else { v + (2.0 * m - 1.0) * (1.0 - v) }
}

/// Sums over `[0, x) × [0, y)`, for exact means of any rectangle.
struct Sums {
    up_to: Vec<f64>,
    width: usize,
    height: usize,
}

impl Sums {
    fn new(plane: &Plane<f32>) -> Self {
        let (width, height) = (plane.width(), plane.height());
        let mut sums = vec![0.0; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = 0.0;
            for (x, &v) in plane.as_ref().row(y).iter().enumerate() {
                row += f64::from(v);
                sums[(y + 1) * (width + 1) + x + 1] = sums[y * (width + 1) + x + 1] + row;
            }
        }
        Self { up_to: sums, width, height }
    }

    /// The integral up to a point, px: bilinear between the corners of pixels, exact as pixels are even.
    fn up_to(&self, x: f64, y: f64) -> f64 {
        let (i, j) = ((x as usize).min(self.width - 1), (y as usize).min(self.height - 1));
        let (s, t) = (x - i as f64, y - j as f64);
        let at = |i: usize, j: usize| self.up_to[j * (self.width + 1) + i];
        (1.0 - t) * ((1.0 - s) * at(i, j) + s * at(i + 1, j)) + t * ((1.0 - s) * at(i, j + 1) + s * at(i + 1, j + 1))
    }

    /// Mean over a rectangle in fractions of the picture.
    fn mean(&self, r: &Rect) -> f64 {
        let x = |v: f64| v.clamp(0.0, 1.0) * self.width as f64;
        let y = |v: f64| v.clamp(0.0, 1.0) * self.height as f64;
        let (x0, x1, y0, y1) = (x(r.min.x), x(r.max.x), y(r.min.y), y(r.max.y));
        let area = (x1 - x0) * (y1 - y0);
        if !(area > 0.0) {
            let at = |v: f64, n: usize| (v as usize).min(n - 1);
            let (i, j) = (at(x0, self.width), at(y0, self.height));
            return self.mean_of_pixel(i, j);
        }
        (self.up_to(x1, y1) - self.up_to(x0, y1) - self.up_to(x1, y0) + self.up_to(x0, y0)) / area
    }

    fn mean_of_pixel(&self, i: usize, j: usize) -> f64 {
        let at = |i: usize, j: usize| self.up_to[j * (self.width + 1) + i];
        at(i + 1, j + 1) - at(i + 1, j) - at(i, j + 1) + at(i, j)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Layout, PixelFormat};

    fn gray(width: usize, height: usize, f: impl Fn(usize, usize) -> u8) -> Frame {
        let mut frame = Frame::new(PixelFormat::opaque(Layout::Gray, 8), width, height);
        for y in 0..height {
            for (x, v) in frame.plane8_mut(0).expect("own").row_mut(y).iter_mut().enumerate() {
                *v = f(x, y);
            }
        }
        frame
    }

    const OPTIONS: ImportanceOptions = ImportanceOptions { max_side: 100, floor: 0.1 };

    fn at(i: &Importance, s: f64, t: f64) -> f32 {
        let p = i.plane();
        p.as_ref().row((t * p.height() as f64) as usize)[(s * p.width() as f64) as usize]
    }

    fn mean(i: &Importance, window: (f64, f64, f64, f64)) -> f64 {
        let (x0, y0, x1, y1) = window;
        i.cell_means(&Rect { min: Point2::new(x0, y0), max: Point2::new(x1, y1) }, 1, 1)[0]
    }

    #[test]
    fn an_even_picture_matters_as_little_as_possible_everywhere() {
        let i =
            Importance::of_frame(&gray(200, 100, |_, _| 90), &[], None, &OPTIONS, &Run::default()).expect("readable");
        assert!(i.cell_means(&Rect::of_size(1.0, 1.0), 10, 5).iter().all(|&v| (v - 0.1).abs() < 1e-6));
    }

    #[test]
    fn a_busy_object_matters_more_than_the_sky_around_it() {
        let object = |x: usize, y: usize| (80..120).contains(&x) && (30..70).contains(&y);
        let frame = gray(200, 100, |x, y| if object(x, y) { ((x * 7 + y * 13) % 97 * 2) as u8 } else { 200 });
        let i = Importance::of_frame(&frame, &[], None, &OPTIONS, &Run::default()).expect("readable");
        let (object, sky) = (mean(&i, (0.41, 0.32, 0.59, 0.68)), mean(&i, (0.0, 0.0, 0.3, 1.0)));
        assert!(object > 5.0 * sky, "{object} against {sky}");
    }

    #[test]
    fn a_face_matters_most_and_the_body_below_it_nearly() {
        let rect = Rect { min: Point2::new(90.0, 10.0), max: Point2::new(110.0, 30.0) };
        let face = Face { rect, score: 20.0 };
        let i = Importance::of_frame(&gray(200, 100, |_, _| 90), &[face], None, &OPTIONS, &Run::default())
            .expect("readable");
        assert!((at(&i, 0.5, 0.2) - 1.0).abs() < 1e-6);
        assert!((at(&i, 0.5, 0.7) - BODY).abs() < 1e-6);
        assert!((at(&i, 0.1, 0.2) - 0.1).abs() < 1e-6);
    }

    #[test]
    fn the_mask_has_the_last_word() {
        for (m, expected) in [(0.0, 0.0), (0.25, 0.2), (0.5, 0.4), (0.75, 0.7), (1.0, 1.0)] {
            assert!((masked(0.4, m) - expected).abs() < 1e-6, "{m}");
        }
        let mask = gray(200, 100, |x, _| if x < 100 { 0 } else { 255 });
        let rect = Rect { min: Point2::new(20.0, 10.0), max: Point2::new(40.0, 30.0) };
        let face = Face { rect, score: 20.0 };
        let i = Importance::of_frame(&gray(200, 100, |_, _| 90), &[face], Some(&mask), &OPTIONS, &Run::default())
            .expect("readable");
        assert!((mean(&i, (0.0, 0.0, 0.5, 1.0)) - 0.1).abs() < 1e-6, "the floor stays");
        assert!((mean(&i, (0.5, 0.0, 1.0, 1.0)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_cannot_be_used_is_refused_with_the_reason() {
        let picture = gray(200, 100, |_, _| 90);
        let of = |mask: &Frame, floor: f32| {
            let options = ImportanceOptions { floor, ..OPTIONS };
            Importance::of_frame(&picture, &[], Some(mask), &options, &Run::default()).expect_err("refused").to_string()
        };
        let small = gray(100, 100, |_, _| 0);
        assert_eq!(
            of(&small, 0.1),
            "the importance mask has 100×100 px and the picture 200×100 px; scale the mask to the picture"
        );
        assert_eq!(of(&small, 0.0), "floor 0 is invalid (expected above 0, at most 1)");
        let nan = Plane::from_fn(3, 2, |x, y| if (x, y) == (1, 1) { f32::NAN } else { 0.5 });
        let e = Importance::from_plane(nan).expect_err("refused");
        assert_eq!(e.to_string(), "the importance at (1, 1) is NaN (expected 0 to 1)");
        assert!(Importance::from_plane(Plane::new(0, 4)).is_err());
    }

    #[test]
    fn means_over_cells_are_exact_for_any_window() {
        let plane = Plane::from_fn(4, 2, |x, y| (x + 4 * y) as f32 / 8.0);
        let i = Importance::from_plane(plane).expect("in range");
        // A third of the picture, from 1/6 to 1/2 across: px ⅔ to 2, that is a third of column 0 and all of column 1.
        let found = mean(&i, (1.0 / 6.0, 0.0, 0.5, 0.5));
        assert!((found - 1.0 / 8.0 / (4.0 / 3.0)).abs() < 1e-12, "{found}");
        let whole: f64 = i.cell_means(&Rect::of_size(1.0, 1.0), 7, 5).iter().sum::<f64>() / 35.0;
        assert!((whole - 3.5 / 8.0).abs() < 1e-12);
    }
}
