//! Runs a command that can read only what it needs, write to one folder only, and open no connection:
//!
//! ```sh
//! cargo run --release --example sandbox -- clips out plumbline stabilize clips --out-dir out
//! ```
//!
//! The first argument is the file or folder with the inputs, the second the folder for results, the rest is the command.
//! Landlock confines the file system and, where the kernel knows it, TCP; seccomp refuses sockets of every kind, tracing of
//! other processes and mounting. Both hold for every process that the command starts, workers included, and neither
//! needs privileges. `TMPDIR` is set to the folder for results.

#[cfg(target_os = "linux")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    use std::os::unix::process::CommandExt;

    let mut args = std::env::args_os().skip(1);
    let (Some(input), Some(output), Some(program)) = (args.next(), args.next(), args.next()) else {
        return Err("usage: sandbox INPUT OUTPUT_FOLDER COMMAND [ARGUMENT…]".into());
    };
    std::fs::create_dir_all(&output)?;
    let mut command = std::process::Command::new(&program);
    command.args(args).env("TMPDIR", std::path::absolute(&output)?);
    let program = which(&program)?;
    confine_files(&[input.as_ref(), program.as_path()], output.as_ref())?;
    refuse_calls()?;
    // It returns only where the command cannot be started.
    Err(command.exec().into())
}

#[cfg(not(target_os = "linux"))]
fn main() {
    eprintln!("Landlock and seccomp are parts of Linux");
}

/// The file that runs where `program` is typed.
#[cfg(target_os = "linux")]
fn which(program: &std::ffi::OsStr) -> Result<std::path::PathBuf, String> {
    let named = std::path::Path::new(program);
    if named.components().count() > 1 {
        return Ok(named.to_owned());
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&folders).map(|folder| folder.join(named)).find(|path| path.is_file());
    found.ok_or_else(|| format!("{}: not found", named.display()))
}

/// `readable` and what every program needs can be read, `writable` can be written, nothing else can be opened.
#[cfg(target_os = "linux")]
fn confine_files(readable: &[&std::path::Path], writable: &std::path::Path) -> Result<(), Box<dyn std::error::Error>> {
    use landlock::{
        ABI, Access, AccessFs, AccessNet, Ruleset, RulesetAttr, RulesetCreatedAttr, RulesetStatus, path_beneath_rules,
    };
    // Version 4 knows TCP; older kernels enforce the part that they know.
    let abi = ABI::V4;
    let system = ["/usr", "/lib", "/lib64", "/etc/ld.so.cache", "/proc", "/sys/devices/system/cpu", "/dev/urandom"];
    let restricted = Ruleset::default()
        .handle_access(AccessFs::from_all(abi))?
        .handle_access(AccessNet::from_all(abi))?
        .create()?
        .add_rules(path_beneath_rules(system, AccessFs::from_read(abi)))?
        .add_rules(path_beneath_rules(readable, AccessFs::from_read(abi)))?
        .add_rules(path_beneath_rules([writable], AccessFs::from_all(abi)))?
        .add_rules(path_beneath_rules(["/dev/null"], AccessFs::from_all(abi)))?
        .restrict_self()?;
    match restricted.ruleset {
        RulesetStatus::NotEnforced => Err("this kernel has no Landlock".into()),
        _ => Ok(()),
    }
}

/// Calls that no job needs fail with "Operation not permitted".
#[cfg(target_os = "linux")]
fn refuse_calls() -> Result<(), Box<dyn std::error::Error>> {
    use libc::{
        SYS_bpf, SYS_keyctl, SYS_mount, SYS_process_vm_readv, SYS_process_vm_writev, SYS_ptrace, SYS_socket,
        SYS_unshare,
    };
    use seccompiler::{BpfProgram, SeccompAction, SeccompFilter, apply_filter};

    let refused = [
        SYS_socket,
        SYS_ptrace,
        SYS_process_vm_readv,
        SYS_process_vm_writev,
        SYS_mount,
        SYS_unshare,
        SYS_bpf,
        SYS_keyctl,
    ];
    let rules = refused.into_iter().map(|call| (call, Vec::new())).collect();
    let refuse = SeccompAction::Errno(libc::EPERM as u32);
    let filter = SeccompFilter::new(rules, SeccompAction::Allow, refuse, std::env::consts::ARCH.try_into()?)?;
    let program: BpfProgram = filter.try_into()?;
    Ok(apply_filter(&program)?)
}
