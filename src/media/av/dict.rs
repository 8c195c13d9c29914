//! String-to-string options and tags.

use std::ffi::{CStr, CString};
use std::ptr;

use ffmpeg_next::ffi;

/// An owned `AVDictionary`.
pub(crate) struct Dictionary(*mut ffi::AVDictionary);

// SAFETY: the dictionary is plain heap memory with one owner; nothing in it belongs to a thread.
unsafe impl Send for Dictionary {}

impl Dictionary {
    pub(crate) fn new() -> Self {
        Self(ptr::null_mut())
    }

    /// Sets `key`, replacing an older value. Keys and values with a zero byte inside are cut there.
    pub(crate) fn set(&mut self, key: &str, value: &str) {
        let (key, value) = (c_string(key), c_string(value));
        // SAFETY: both strings end with zero and outlive the call, which copies them.
        unsafe { ffi::av_dict_set(&raw mut self.0, key.as_ptr(), value.as_ptr(), 0) };
    }

    /// `self` with `key` set.
    pub(crate) fn with(mut self, key: &str, value: &str) -> Self {
        self.set(key, value);
        self
    }

    /// All pairs, in their order.
    pub(crate) fn pairs(&self) -> Vec<(String, String)> {
        // SAFETY: the dictionary is ours and alive.
        unsafe { pairs(self.0) }
    }

    pub(super) fn as_mut_ptr(&mut self) -> *mut *mut ffi::AVDictionary {
        &raw mut self.0
    }

    /// Gives the memory to FFmpeg, which frees it.
    pub(super) fn into_raw(mut self) -> *mut ffi::AVDictionary {
        std::mem::replace(&mut self.0, ptr::null_mut())
    }
}

impl FromIterator<(String, String)> for Dictionary {
    fn from_iter<I: IntoIterator<Item = (String, String)>>(iter: I) -> Self {
        iter.into_iter().fold(Self::new(), |d, (k, v)| d.with(&k, &v))
    }
}

impl Drop for Dictionary {
    fn drop(&mut self) {
        // SAFETY: ours, freed once; null is allowed.
        unsafe { ffi::av_dict_free(&raw mut self.0) };
    }
}

/// Pairs of a dictionary that FFmpeg owns.
///
/// # Safety
/// `dict` is null or a live dictionary that nobody writes to meanwhile.
pub(super) unsafe fn pairs(dict: *const ffi::AVDictionary) -> Vec<(String, String)> {
    let mut out = Vec::new();
    let mut entry: *const ffi::AVDictionaryEntry = ptr::null();
    loop {
        // SAFETY: `dict` is alive by contract; `entry` is null or came from the same dictionary.
        entry = unsafe { ffi::av_dict_get(dict, c"".as_ptr(), entry, ffi::AV_DICT_IGNORE_SUFFIX) };
        if entry.is_null() {
            return out;
        }
        // SAFETY: a non-null entry holds two zero-terminated strings.
        out.push(unsafe { (string((*entry).key), string((*entry).value)) });
    }
}

/// Rust text of a C string; null is empty, bytes that are not UTF-8 are replaced.
///
/// # Safety
/// `text` is null or points to a zero-terminated string that lives through the call.
pub(super) unsafe fn string(text: *const std::ffi::c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: by contract.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// The text as a C string, cut at the first zero byte.
pub(super) fn c_string(text: &str) -> CString {
    let bytes = text.as_bytes();
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    CString::new(&bytes[..end]).unwrap_or_default()
}

/// A path as a C string, byte for byte, cut at the first zero byte (which no path has).
pub(crate) fn c_path(path: &std::ffi::OsStr) -> CString {
    let bytes = path.as_encoded_bytes();
    let end = bytes.iter().position(|b| *b == 0).unwrap_or(bytes.len());
    CString::new(&bytes[..end]).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_come_back_in_order_and_later_values_win() {
        let d = Dictionary::new().with("crf", "20").with("preset", "slow").with("crf", "18");
        let pairs = d.pairs();
        assert_eq!(pairs.len(), 2);
        assert!(pairs.contains(&("crf".into(), "18".into())));
    }

    #[test]
    fn a_zero_byte_ends_a_value_instead_of_panicking() {
        assert_eq!(Dictionary::new().with("a", "x\0y").pairs(), [("a".into(), "x".into())]);
    }
}
