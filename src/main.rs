//! The command line of Flank.

use std::process::ExitCode;

fn main() -> ExitCode {
    ExitCode::from(flank::cli::main(std::env::args_os()))
}
