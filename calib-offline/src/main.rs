//! The command line; everything is in [`calib_offline::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    calib_offline::cli::main()
}
