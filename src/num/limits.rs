//! Limits that the system sets to this process, and errors that mean that one of them is reached.
//!
//! Such an error is nobody's fault: the same call may succeed where there is more room. It is distinguished from others in one place,
//! [`Shortage::of`], whatever error of a library it is wrapped in.

use std::error::Error;
use std::fmt;
use std::fs::File;
use std::io;
use std::sync::Mutex;
use std::thread::Builder;

/// What a process may have so much of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Resource {
    /// Memory, bytes of address space.
    Memory,
    /// Threads, counted with the processes of the user.
    Threads,
    /// Files open at once.
    OpenFiles,
}

impl Resource {
    /// The limit in force, bytes or a count; `None` where there is none or the system does not say.
    pub fn limit(self) -> Option<u64> {
        #[cfg(unix)]
        {
            use rustix::process::{Resource as Of, getrlimit};
            match self {
                Self::Memory => [Of::As, Of::Data].into_iter().filter_map(|of| getrlimit(of).current).min(),
                Self::Threads => getrlimit(Of::Nproc).current,
                Self::OpenFiles => getrlimit(Of::Nofile).current,
            }
        }
        #[cfg(not(unix))]
        None
    }
}

/// Something that this process has too little of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shortage(pub Resource);

impl Shortage {
    /// The shortage that `error`, or an error that it was made of, stands for.
    pub fn of(error: &(dyn Error + 'static)) -> Option<Self> {
        let mut next = Some(error);
        while let Some(error) = next {
            let found = error.downcast_ref::<Self>().copied();
            if let Some(found) = found.or_else(|| error.downcast_ref::<io::Error>().and_then(Self::of_io)) {
                return Some(found);
            }
            next = error.source();
        }
        None
    }

    /// The shortage that an error of the system stands for.
    pub fn of_io(error: &io::Error) -> Option<Self> {
        // An error of a library inside an error of the system hides the system's own.
        if let Some(inner) = error.get_ref() {
            return Self::of(inner)
                .or_else(|| (error.kind() == io::ErrorKind::OutOfMemory).then_some(Self(Resource::Memory)));
        }
        error
            .raw_os_error()
            .and_then(Self::of_code)
            .or_else(|| (error.kind() == io::ErrorKind::OutOfMemory).then_some(Self(Resource::Memory)))
    }

    /// The shortage that a number of an error of the system stands for.
    #[cfg(unix)]
    pub fn of_code(code: i32) -> Option<Self> {
        use rustix::io::Errno;
        match Errno::from_raw_os_error(code) {
            Errno::MFILE | Errno::NFILE => Some(Self(Resource::OpenFiles)),
            Errno::NOMEM => Some(Self(Resource::Memory)),
            Errno::AGAIN => Some(Self(Resource::Threads)),
            _ => None,
        }
    }

    /// The shortage that a number of an error of the system stands for.
    #[cfg(not(unix))]
    pub fn of_code(_: i32) -> Option<Self> {
        None
    }

    /// The shortage that a message of a library speaks of: for errors that reach us as text.
    pub fn in_text(text: &str) -> Option<Self> {
        let (_, resource) = PHRASES.iter().find(|(phrase, _)| text.contains(phrase))?;
        Some(Self(*resource))
    }

    /// What this process has little left of, for libraries that fail without saying why: less than `LITTLE` of the address
    /// space, or no thread or file more.
    pub fn likely() -> Option<Self> {
        let limit = Resource::Memory.limit();
        if limit.zip(address_space()).is_some_and(|(limit, used)| limit.saturating_sub(used) < LITTLE) {
            return Some(Self(Resource::Memory));
        }
        Self::check(1, 1).err()
    }

    /// Tries to start `threads` threads and to open `files` files at once, and lets go of them: before a long run rather than
    /// in its midst, and for libraries that do not say what they lack.
    ///
    /// # Errors
    /// What there is too little of.
    pub fn check(threads: usize, files: usize) -> Result<(), Self> {
        check_files(files)?;
        check_threads(threads)
    }
}

/// Bytes of address space with which an encoder of small pictures may fail to start: its threads take 8 MiB each for their
/// stacks, and 64 MiB for what they allocate.
const LITTLE: u64 = 256 << 20;

/// Bytes of address space in use; `None` where the system has no file that says so.
fn address_space() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("VmSize:"))?;
    line.split_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// What the C library says of its error numbers, x264 of memory, and rayon of threads. Our own errors carry a [`Shortage`].
const PHRASES: [(&str, Resource); 5] = [
    ("Cannot allocate memory", Resource::Memory),
    ("malloc of size", Resource::Memory),
    ("Too many open files", Resource::OpenFiles),
    ("Resource temporarily unavailable", Resource::Threads),
    ("failed to spawn thread", Resource::Threads),
];

impl fmt::Display for Shortage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let limited = |f: &mut fmt::Formatter<'_>, of: Resource, what: &str, option: &str| match of.limit() {
            Some(limit) => write!(f, "; the limit of {what} is {limit} (`ulimit {option}`)"),
            None => Ok(()),
        };
        match self.0 {
            Resource::Memory => {
                f.write_str("out of memory")?;
                limited(f, Resource::Memory, "address space in bytes", "-v")?;
                f.write_str("; use fewer threads, smaller inputs or fewer at once")
            }
            Resource::Threads => {
                f.write_str("no more threads can be started")?;
                limited(f, Resource::Threads, "threads and processes", "-u")?;
                // Each thread has a stack.
                limited(f, Resource::Memory, "address space in bytes", "-v")?;
                f.write_str("; use fewer threads")
            }
            Resource::OpenFiles => {
                f.write_str("too many open files")?;
                limited(f, Resource::OpenFiles, "open files", "-n")?;
                f.write_str("; raise it, or work on fewer inputs at once")
            }
        }
    }
}

impl Error for Shortage {}

/// The emptiest file of the system.
const NOTHING: &str = if cfg!(windows) { "NUL" } else { "/dev/null" };

fn check_files(count: usize) -> Result<(), Shortage> {
    let mut open = Vec::with_capacity(count);
    for _ in 0..count {
        match File::open(NOTHING) {
            Ok(file) => open.push(file),
            Err(error) => match Shortage::of_io(&error) {
                Some(shortage) => return Err(shortage),
                // Where there is no such file there is nothing to be learnt.
                None => break,
            },
        }
    }
    Ok(())
}

fn check_threads(count: usize) -> Result<(), Shortage> {
    let gate = Mutex::new(());
    let started = std::thread::scope(|scope| {
        // All wait at the gate, so that all of them run at once.
        let closed = gate.lock();
        let pass = || drop(gate.lock());
        let started = (0..count).take_while(|_| Builder::new().spawn_scoped(scope, pass).is_ok()).count();
        drop(closed);
        started
    });
    if started < count { Err(Shortage(Resource::Threads)) } else { Ok(()) }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use rustix::io::Errno;

    fn io(code: Errno) -> io::Error {
        io::Error::from(code)
    }

    #[derive(Debug, thiserror::Error)]
    #[error("cannot be read")]
    struct Wrapped(#[source] io::Error);

    #[test]
    fn a_shortage_is_found_in_whatever_error_it_is_wrapped_in() {
        for (code, resource) in [
            (Errno::MFILE, Some(Resource::OpenFiles)),
            (Errno::NFILE, Some(Resource::OpenFiles)),
            (Errno::NOMEM, Some(Resource::Memory)),
            (Errno::AGAIN, Some(Resource::Threads)),
            (Errno::NOENT, None),
            (Errno::IO, None),
        ] {
            let expected = resource.map(Shortage);
            assert_eq!(Shortage::of(&io(code)), expected);
            assert_eq!(Shortage::of(&Wrapped(io(code))), expected);
            assert_eq!(Shortage::of(&io::Error::other(Wrapped(io(code)))), expected);
        }
        assert_eq!(Shortage::of_io(&io::ErrorKind::OutOfMemory.into()), Some(Shortage(Resource::Memory)));
    }

    #[test]
    fn the_words_of_the_system_are_known() {
        for (code, resource) in [
            (Errno::MFILE, Resource::OpenFiles),
            (Errno::NFILE, Resource::OpenFiles),
            (Errno::NOMEM, Resource::Memory),
            (Errno::AGAIN, Resource::Threads),
        ] {
            let text = format!("a.obj: cannot be read: {}", io(code));
            assert_eq!(Shortage::in_text(&text), Some(Shortage(resource)), "{text}");
        }
        assert_eq!(Shortage::in_text("a.obj: cannot be read: No such file or directory (os error 2)"), None);
    }

    #[test]
    fn a_few_threads_and_files_are_there_and_a_shortage_names_its_limit() {
        assert_eq!(Shortage::check(8, 8), Ok(()));
        let text = Shortage(Resource::OpenFiles).to_string();
        let limit = Resource::OpenFiles.limit().map(|n| n.to_string());
        assert!(text.starts_with("too many open files") && limit.is_none_or(|n| text.contains(&n)), "{text}");
    }
}
