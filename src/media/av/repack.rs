//! Samples change places between FFmpeg's packed, semi-planar, palette or foreign-endian layouts and planes of ours.
//!
//! No value changes: no color matrix, no range, no rounding. `FFmpeg`'s line reader and writer know where each component of
//! each format lies; a component goes to its plane one row at a time.

use ffmpeg_next::ffi;

use super::frame::PlanarFrame;
use super::pixel::plane_of;
use super::{AvError, AvFrame, Pix};
use plumbline_image::{FrameBuffer, Layout, PixelFormat};

/// Component and plane pairs of a packed format: palettes hold blue, green, red, alpha in memory order, gray stands for
/// all three of red, green and blue where alpha follows it.
fn components(pix: Pix, format: PixelFormat) -> Vec<(usize, usize)> {
    let n = usize::from(pix.descriptor().nb_components);
    if pix.is_palette() {
        return vec![(0, 1), (1, 0), (2, 2), (3, 3)];
    }
    if n == 2 && format.layout == Layout::Gbr {
        return vec![(0, 0), (0, 1), (0, 2), (1, 3)];
    }
    (0..n).map(|c| (c, plane_of(format.layout, c))).collect()
}

/// Reads `src` into the planes of `dst`, whose format is the one that [`Pix::route`] names.
pub(crate) fn unpack(src: &AvFrame, dst: &mut PlanarFrame) -> Result<(), AvError> {
    let (pix, format, size) = (src.pix().ok_or(AvError::INVALID)?, dst.format(), src.size());
    if size != dst.frame().size() || pix.is_hardware() {
        return Err(AvError::INVALID);
    }
    let mut line = vec![0_u16; size.0];
    for (c, plane) in components(pix, format) {
        let (w, h) = format.plane_size(plane, size.0, size.1);
        for y in 0..h {
            read_line(src, pix, c, y, &mut line[..w]);
            let (rows, stride) = dst.plane_mut(plane).ok_or(AvError::INVALID)?;
            store(&line[..w], &mut rows[y * stride..], format.bytes_per_sample());
        }
    }
    Ok(())
}

/// Writes the planes of `src` into `dst`, a frame of a packed or semi-planar format with the same components.
pub(crate) fn pack(src: &PlanarFrame, dst: &mut AvFrame) -> Result<(), AvError> {
    let (pix, format, size) = (dst.pix().ok_or(AvError::INVALID)?, src.format(), src.frame().size());
    if size != dst.size() || pix.is_hardware() || pix.is_palette() {
        return Err(AvError::INVALID);
    }
    clear(dst);
    let mut line = vec![0_u16; size.0];
    for (c, plane) in components(pix, format) {
        let (w, h) = format.plane_size(plane, size.0, size.1);
        let (rows, stride) = src.plane(plane);
        for y in 0..h {
            load(&rows[y * stride..], &mut line[..w], format.bytes_per_sample());
            write_line(dst, pix, c, y, &line[..w]);
        }
    }
    Ok(())
}

fn read_line(src: &AvFrame, pix: Pix, component: usize, y: usize, line: &mut [u16]) {
    let frame = src.get();
    let mut data = [frame.data[0].cast_const(), frame.data[1], frame.data[2], frame.data[3]];
    // SAFETY: FFmpeg made the frame with this format and size; row and width were computed for the component's own plane
    // from that size, and the line has room for `line.len()` elements of two bytes.
    unsafe {
        ffi::av_read_image_line2(
            line.as_mut_ptr().cast(),
            data.as_mut_ptr(),
            frame.linesize.as_ptr(),
            pix.descriptor(),
            0,
            y as i32,
            component as i32,
            line.len() as i32,
            i32::from(pix.is_palette()),
            2,
        );
    }
}

fn write_line(dst: &mut AvFrame, pix: Pix, component: usize, y: usize, line: &[u16]) {
    let frame = dst.get_mut();
    // SAFETY: as in `read_line`, and the frame came from a pool of ours with no other reference.
    unsafe {
        ffi::av_write_image_line2(
            line.as_ptr().cast(),
            frame.data.as_mut_ptr(),
            frame.linesize.as_ptr(),
            pix.descriptor(),
            0,
            y as i32,
            component as i32,
            line.len() as i32,
            2,
        );
    }
}

/// Zeroes the picture: FFmpeg's writer sets bits but clears none where components share a word.
fn clear(dst: &mut AvFrame) {
    let frame = dst.get_mut();
    for buffer in frame.buf.iter().filter(|b| !b.is_null()) {
        // SAFETY: a live buffer of which this frame, fresh from a pool, is the only owner.
        unsafe { std::ptr::write_bytes((**buffer).data, 0, (**buffer).size) };
    }
}

fn store(line: &[u16], row: &mut [u8], bytes: usize) {
    if bytes == 1 {
        row.iter_mut().zip(line).for_each(|(r, v)| *r = *v as u8);
    } else {
        row.as_chunks_mut::<2>().0.iter_mut().zip(line).for_each(|(r, v)| *r = v.to_ne_bytes());
    }
}

fn load(row: &[u8], line: &mut [u16], bytes: usize) {
    if bytes == 1 {
        line.iter_mut().zip(row).for_each(|(v, r)| *v = u16::from(*r));
    } else {
        line.iter_mut().zip(row.as_chunks::<2>().0).for_each(|(v, r)| *v = u16::from_ne_bytes(*r));
    }
}

#[cfg(test)]
mod tests {
    use super::super::FramePool;
    use super::super::pixel::Route;
    use super::*;

    /// Planes of noise that use every bit of the depth.
    fn noise(format: PixelFormat, w: usize, h: usize) -> PlanarFrame {
        let pool = FramePool::new(Pix::from_planar(format).expect("planar"), w, h).expect("pool");
        let mut frame = pool.get_planar(format).expect("frame");
        let mut random = fastrand::Rng::with_seed(7);
        for i in 0..format.planes() {
            let (rows, _) = frame.plane_mut(i).expect("sole owner");
            let mut line = vec![0; rows.len() / format.bytes_per_sample()];
            line.fill_with(|| random.u16(..=u16::MAX >> (16 - format.bits)));
            store(&line, rows, format.bytes_per_sample());
        }
        frame
    }

    fn rows(frame: &PlanarFrame, i: usize) -> Vec<Vec<u8>> {
        let (w, h) = frame.frame().size();
        let (pw, ph) = frame.format().plane_size(i, w, h);
        let (data, stride) = frame.plane(i);
        (0..ph).map(|y| data[y * stride..][..pw * frame.format().bytes_per_sample()].to_vec()).collect()
    }

    #[test]
    fn packing_and_unpacking_keep_every_bit_of_every_format() {
        for name in ["nv12", "nv21", "p010le", "p016le", "yuyv422", "uyvy422", "rgb24", "bgra", "rgb48be", "rgba64le"] {
            let pix = Pix::from_name(name).expect("known");
            let Route::Repack(format) = pix.route() else { panic!("{name}: {:?}", pix.route()) };
            let (w, h) = (34, 17); // even width: packed 4:2:2 has no half pairs
            let before = noise(format, w, h);
            let mut packed = FramePool::new(pix, w, h).expect("pool").get().expect("frame");
            pack(&before, &mut packed).expect("pack");
            let mut after = noise(format, w, h);
            unpack(&packed, &mut after).expect("unpack");
            for i in 0..format.planes() {
                assert_eq!(rows(&before, i), rows(&after, i), "{name}, plane {i}");
            }
        }
    }

    #[test]
    fn sizes_that_differ_are_refused() {
        let mut packed =
            FramePool::new(Pix::from_name("nv12").expect("known"), 32, 16).expect("pool").get().expect("f");
        let planar = noise(PixelFormat::opaque(Layout::Yuv420, 8), 34, 16);
        assert_eq!(pack(&planar, &mut packed), Err(AvError::INVALID));
    }
}
