//! What is typed while a cell runs.

use std::io;
use std::sync::mpsc::{Receiver, channel};
use std::thread;

/// The lines of the standard input.
pub fn lines() -> Receiver<String> {
    let (sender, receiver) = channel();
    thread::spawn(move || {
        let lines = io::stdin().lines().map_while(Result::ok);
        lines.filter(|line| !line.trim().is_empty()).try_for_each(|line| sender.send(line))
    });
    receiver
}
