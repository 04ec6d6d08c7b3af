use std::process::ExitCode;

fn main() -> ExitCode {
    glint::cli::main()
}
