//! `fencepost`: see the library of the same name.

fn main() -> std::process::ExitCode {
    fencepost::run(std::env::args_os())
}
