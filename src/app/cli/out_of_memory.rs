//! Memory: large blocks go back to the system when they are freed; and when memory has run out, the unfinished files are removed, the
//! limit is named, and the program ends with the status of a passing fault.
//!
//! The allocator of the program notes what it could not give and returns nothing, so that calls that can do without go on.
//! Those that cannot end in `abort`, and its signal comes here. Nothing on this path allocates.
#![allow(unsafe_code)] // A global allocator and a signal handler cannot be written without.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use signal_hook::consts::SIGABRT;
use signal_hook::low_level;

use crate::pipeline::Exit;
use plumbline_num::files::remove_partial_files;
use plumbline_num::limits::{Resource, Shortage};

thread_local! {
    /// Bytes that this thread asked for in vain; 0: its last request was met.
    static REFUSED: Cell<usize> = const { Cell::new(0) };
}

/// The system's allocator, which remembers the request that it could not meet.
#[derive(Debug)]
pub struct NotingAllocator;

fn noted(pointer: *mut u8, bytes: usize) -> *mut u8 {
    if pointer.is_null() {
        // A thread that is ending has nothing to note it in.
        let _ = REFUSED.try_with(|refused| refused.set(bytes));
    }
    pointer
}

// SAFETY: every call is handed to the system's allocator unchanged; noting touches a constant-initialized thread-local
// without a destructor, which does not allocate.
unsafe impl GlobalAlloc for NotingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's contract is ours.
        noted(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's contract is ours.
        noted(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller's contract is ours.
        noted(unsafe { System.realloc(pointer, layout, size) }, size)
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's contract is ours.
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// Blocks of at least so many bytes are mappings of their own and go back to the system when they are freed: the systems of a bundle
/// adjustment are, at 5 to 40 MB. The planes of a frame, which come and go with every frame, are smaller up to 1080p.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const MIN_MAPPING: libc::c_int = 4 << 20;

/// Keeps freed memory from growing with the length of a clip.
///
/// By itself the C library raises its threshold for mappings to the largest block that was freed, up to 32 MB. The systems of the next
/// adjustment then come from the heap, and small blocks that stay behind them, such as the cameras found, hold it at its largest.
pub(super) fn return_large_blocks() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: changes a number of the C library's allocator, before there are other threads.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, MIN_MAPPING)
    };
}

/// Takes over the end by `abort`. Without it such an end leaves unfinished files to the next run.
pub(super) fn install() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    if Resource::Memory.limit().is_some() {
        // Each thread would reserve 64 MiB of the address space for what it allocates: most of what a small limit leaves.
        // SAFETY: changes a number of the C library's allocator, before there are other threads.
        unsafe { libc::mallopt(libc::M_ARENA_MAX, 2) };
    }
    // SAFETY: what is called reads a thread-local without a destructor, formats into a buffer on the stack, and makes system
    // calls: it neither allocates nor waits.
    let _ = unsafe { low_level::register(SIGABRT, aborted) };
}

fn aborted() {
    remove_partial_files();
    let bytes = REFUSED.try_with(Cell::get).unwrap_or(0);
    if bytes == 0 {
        // Another reason, which the system reports as it does.
        return;
    }
    let mut text = Line::new();
    let shortage = Shortage(Resource::Memory);
    // A line that is too long is cut.
    let _ = std::fmt::write(&mut text, format_args!("error: {bytes} bytes could not be allocated: {shortage}\n"));
    let _ = rustix::io::write(rustix::stdio::stderr(), text.bytes());
    low_level::exit(i32::from(Exit::Temporary as u8));
}

/// A line of text on the stack.
struct Line {
    bytes: [u8; 512],
    length: usize,
}

impl Line {
    fn new() -> Self {
        Self { bytes: [0; 512], length: 0 }
    }

    fn bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

impl std::fmt::Write for Line {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        let rest = &mut self.bytes[self.length..];
        let taken = text.len().min(rest.len());
        rest[..taken].copy_from_slice(&text.as_bytes()[..taken]);
        self.length += taken;
        if taken < text.len() { Err(std::fmt::Error) } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_that_cannot_be_met_is_noted_and_the_caller_may_go_on() {
        let layout = Layout::from_size_align(1 << 60, 1).expect("below half of all addresses");
        // SAFETY: the layout has a size; a null pointer is not used.
        let pointer = unsafe { NotingAllocator.alloc(layout) };
        assert!(std::hint::black_box(pointer).is_null());
        assert_eq!(REFUSED.with(Cell::get), 1 << 60);
    }

    #[test]
    fn a_line_that_is_too_long_is_cut() {
        let mut line = Line::new();
        assert!(std::fmt::write(&mut line, format_args!("{}", "x".repeat(1000))).is_err());
        assert_eq!(line.bytes().len(), 512);
    }
}
