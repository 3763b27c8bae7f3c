//! The command line of Flank. Exit codes: 0 done, 1 the run failed or was stopped, 2 bad usage or scene.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    match cli::execute(cli::Arguments::read()) {
        Ok(done) => done.code(),
        Err(error) => error.report(),
    }
}
