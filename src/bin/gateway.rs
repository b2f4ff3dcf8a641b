//! The gateway. One entry for every port: the target and, on a board, a cargo feature choose it.

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    puente::app::host::main()
}
