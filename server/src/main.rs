//! The binary `chefshat`: parses the command line and runs what it asks for.

use std::process::ExitCode;

fn main() -> ExitCode {
    chefshat_server::cli::main()
}
