//! The program: everything it does is in the library.

fn main() -> std::process::ExitCode {
    plumbline::app::cli::main(&plumbline::app::stages::BuiltinStages)
}
