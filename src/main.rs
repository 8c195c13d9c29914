//! The program: everything it does is in the library.

#[global_allocator]
static ALLOCATOR: plumbline::app::cli::NotingAllocator = plumbline::app::cli::NotingAllocator;

fn main() -> std::process::ExitCode {
    let extensions = [
        #[cfg(feature = "studio")]
        plumbline_studio::command::STUDIO,
    ];
    plumbline::app::cli::main(&plumbline::app::stages::BuiltinStages, &extensions)
}
