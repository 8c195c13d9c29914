//! FFmpeg's messages, as `tracing` events; the last complaint of a thread is kept for error messages.

use std::cell::RefCell;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::Once;

use ffmpeg_next::ffi;

thread_local! {
    static LAST: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Routes FFmpeg's messages to `tracing`; the first call counts, the others cost nothing.
pub(crate) fn install() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // SAFETY: the callback is a plain function that lives as long as the program and may run on any thread.
        unsafe {
            ffi::av_log_set_level(ffi::AV_LOG_WARNING);
            ffi::av_log_set_callback(Some(forward));
        }
    });
}

/// Clears the messages of this thread's FFmpeg calls.
pub(crate) fn forget() {
    LAST.with_borrow_mut(String::clear);
}

/// The last error that FFmpeg reported on this thread since [`forget`]; empty where none.
pub(crate) fn last_complaint() -> String {
    LAST.with_borrow(Clone::clone)
}

unsafe extern "C" fn forward(class: *mut c_void, level: c_int, format: *const c_char, args: *mut ffi::__va_list_tag) {
    if level > ffi::AV_LOG_WARNING {
        return;
    }
    // Without the prefix, which is an address.
    let (mut line, mut prefix) = ([0; 1024], 0);
    // SAFETY: FFmpeg hands over its own class, format and arguments, valid for this call; the line is writable for its
    // length and ends with zero afterwards.
    let text = unsafe {
        ffi::av_log_format_line2(class, level, format, args, line.as_mut_ptr(), line.len() as c_int, &raw mut prefix);
        CStr::from_ptr(line.as_ptr()).to_string_lossy()
    };
    let text = text.trim();
    if text.is_empty() {
        return;
    }
    if level <= ffi::AV_LOG_ERROR {
        // A thread that is being torn down has no place left; the event below still tells.
        let _ = LAST.try_with(|last| {
            if let Ok(mut last) = last.try_borrow_mut() {
                text.clone_into(&mut last);
            }
        });
        tracing::debug!(target: "ffmpeg", "{text}");
    } else {
        tracing::trace!(target: "ffmpeg", "{text}");
    }
}
