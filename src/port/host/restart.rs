//! A new start.

use std::os::unix::process::CommandExt;
use std::process::Command;

/// Starts the gateway anew: this process runs the program again, with the same arguments.
pub fn restart() -> ! {
    let mut arguments = std::env::args_os();
    let name = arguments.next().unwrap_or_default();
    let program = std::env::current_exe().unwrap_or_else(|_| name.into());
    // It comes back only where it has failed.
    let error = Command::new(program).args(arguments).exec();
    log::error!("the gateway does not start again: {error}");
    std::process::exit(1);
}
