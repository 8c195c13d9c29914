//! The program: everything it does is in the library.

#[global_allocator]
static ALLOCATOR: plumbline::app::cli::NotingAllocator = plumbline::app::cli::NotingAllocator;

fn main() -> std::process::ExitCode {
    plumbline::app::cli::main(&plumbline::app::stages::BuiltinStages)
}
