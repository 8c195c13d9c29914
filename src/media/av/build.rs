//! Which FFmpeg is linked.

use std::ffi::CStr;

use ffmpeg_next::ffi;

use super::dict::string;

/// Version of FFmpeg as a whole, such as `5.1.6-0+deb12u1`.
pub(crate) fn release() -> String {
    // SAFETY: a static string.
    unsafe { string(ffi::av_version_info()) }
}

/// Options that FFmpeg was built with.
pub(crate) fn configuration() -> String {
    // SAFETY: a static string.
    unsafe { string(ffi::avcodec_configuration()) }
}

/// License that these options put it under.
pub(crate) fn license() -> String {
    // SAFETY: a static string.
    unsafe { CStr::from_ptr(ffi::avcodec_license()) }.to_string_lossy().into_owned()
}

/// Each library and the version that runs, which may be newer than the one that was built against.
pub(crate) fn libraries() -> [(&'static str, [u32; 3]); 4] {
    let parts = |v: u32| [v >> 16, v >> 8 & 0xff, v & 0xff];
    // SAFETY: functions without arguments or state.
    let (util, codec, format, scale) =
        unsafe { (ffi::avutil_version(), ffi::avcodec_version(), ffi::avformat_version(), ffi::swscale_version()) };
    [("avutil", util), ("avcodec", codec), ("avformat", format), ("swscale", scale)].map(|(n, v)| (n, parts(v)))
}
