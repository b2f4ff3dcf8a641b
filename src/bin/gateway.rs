//! The gateway. One entry for every port: the target and, on a board, a cargo feature choose it.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    puente::app::host::main()
}

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    puente::port::run(puente::app::board::start)
}
