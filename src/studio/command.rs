//! `plumbline studio`: starts the server and opens the page.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{ArgMatches, Args, FromArgMatches as _};

use crate::browser;
use crate::content::Content;
use crate::error::StudioError;
use crate::server::{Options, Server, TlsFiles};
use crate::session::Timing;
use plumbline_app::cli::Extension;
use plumbline_app::pipeline::{Exit, RunError};
use plumbline_num::files::folder_of;
use plumbline_num::run::Interrupt;

/// The command, for the program's command line.
pub const STUDIO: Extension = Extension { group: "Studio", examples: EXAMPLES, command, run };

const EXAMPLES: &str = "  plumbline studio
  plumbline studio cactus.obj
  plumbline studio scans/ --no-open --port 7811
";

/// Threads that pass messages on; documents have their own.
const WORKERS: usize = 2;
/// Between two looks at the interrupt.
const LOOK: Duration = Duration::from_millis(50);

/// Options of `plumbline studio`.
#[derive(Args, Debug)]
struct StudioArgs {
    /// What to open: a mesh, a character, a photo, a pipeline file of one of these; or the folder that files are chosen from [default: the current folder]
    #[arg(value_name = "FILE|FOLDER")]
    target: Option<PathBuf>,
    /// The port to listen on; 0 takes one that is free
    #[arg(long, value_name = "N", default_value_t = 0)]
    port: u16,
    /// Print the address of the page instead of opening it in the browser
    #[arg(long)]
    no_open: bool,
    /// The address to listen on. Beyond this machine it needs --cert and --key; prefer an SSH tunnel
    #[arg(long, value_name = "HOST", default_value = "127.0.0.1")]
    host: String,
    /// Certificate for --host, in PEM
    #[arg(long, value_name = "FILE", requires = "key")]
    cert: Option<PathBuf>,
    /// Private key of the certificate, in PEM
    #[arg(long, value_name = "FILE", requires = "cert")]
    key: Option<PathBuf>,
    /// Another folder that files may be opened from
    #[arg(long, value_name = "DIR")]
    allow_path: Vec<PathBuf>,
}

fn command() -> clap::Command {
    // Afterwards: the options bring the comment of their struct.
    StudioArgs::augment_args(clap::Command::new("studio"))
        .about("Edit meshes, characters and photos by hand, in the browser")
        .long_about(
            "Edit meshes, characters and photos by hand, in the browser: grab and drag a shape, build a skeleton, pose it, mark lines in a \
             photo. The page is served to this machine only, and every action is stored in a pipeline file that `plumbline run` executes.",
        )
}

fn run(matches: &ArgMatches, interrupt: &Interrupt) -> Result<Exit, RunError> {
    let args = StudioArgs::from_arg_matches(matches).map_err(|e| RunError::Usage(e.to_string()))?;
    let no_open = args.no_open;
    let options = args.options()?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(WORKERS)
        .thread_name("studio server")
        .enable_all()
        .build()
        .map_err(|e| RunError::Temporary(format!("the server cannot be started: {e}")))?;
    let served = runtime.block_on(serve(options, no_open, interrupt));
    runtime.shutdown_timeout(Duration::from_millis(100));
    served.map(|()| Exit::Done)
}

async fn serve(options: Options, no_open: bool, interrupt: &Interrupt) -> Result<(), RunError> {
    let server = Server::bind(options).await.map_err(run_error)?;
    // Kept until the end: the browser reads it when it comes to it.
    let _page = if no_open {
        print(&server.url());
        None
    } else {
        let opened = browser::open(&server.url());
        message(&format!("plumbline studio runs; Ctrl-C ends it. In another browser: {}", server.url()));
        if let Err(error) = &opened {
            message(&format!("warning: the browser could not be opened: {error}"));
        }
        opened.ok()
    };
    server
        .run(async {
            while !interrupt.is_stopped() {
                tokio::time::sleep(LOOK).await;
            }
        })
        .await;
    Ok(())
}

impl StudioArgs {
    fn options(self) -> Result<Options, RunError> {
        let target = self.target.unwrap_or_else(|| PathBuf::from("."));
        let input = |e: std::io::Error| RunError::Input(format!("{}: {e}", target.display()));
        let target = target.canonicalize().map_err(input)?;
        let (folder, file) = if target.is_dir() {
            (target, None)
        } else {
            Content::of(&target).map_err(run_error)?;
            (folder_of(&target).to_owned(), Some(target))
        };
        Ok(Options {
            host: self.host,
            port: self.port,
            tls: self.cert.zip(self.key).map(|(cert, key)| TlsFiles { cert, key }),
            folders: [folder].into_iter().chain(self.allow_path).collect(),
            file,
            state_folder: state_folder(),
            timing: Timing::default(),
        })
    }
}

/// `$XDG_STATE_HOME/plumbline/studio`, or below `~/.local/state`.
fn state_folder() -> Option<PathBuf> {
    let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
    let state = absolute("XDG_STATE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".local/state")));
    state.map(|state| state.join(Path::new("plumbline/studio")))
}

fn run_error(error: StudioError) -> RunError {
    match error {
        StudioError::Request(why) => RunError::Usage(why),
        StudioError::Environment(why) => RunError::Temporary(why),
        StudioError::Stopped(stopped) => stopped.into(),
        error @ StudioError::Output { .. } => RunError::Output(error.to_string()),
        error => RunError::Input(error.to_string()),
    }
}

/// Writes a result to standard output. A reader that went away has read enough.
fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = writeln!(out, "{text}").and_then(|()| out.flush());
}

fn message(text: &str) {
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}
