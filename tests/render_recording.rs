//! Renders the recording of `tests/recordings/trail` into a folder of your choice.
//!
//! ```sh
//! cargo run -p fencepost-tests --example render_recording -- FOLDER
//! ```

fn main() -> std::process::ExitCode {
    let Some(folder) = std::env::args_os().nth(1) else {
        eprintln!("usage: render_recording FOLDER");
        return std::process::ExitCode::from(2);
    };
    fencepost_tests::golden::render(folder.as_ref());
    std::process::ExitCode::SUCCESS
}
