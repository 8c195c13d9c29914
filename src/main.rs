//! The program: everything it does is in the library.

fn main() -> std::process::ExitCode {
    plumbline::cli::main(&plumbline::pipeline::stages::Bodies)
}
