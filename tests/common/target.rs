//! What the scenarios run on. Whatever a scenario has to know of the difference is here.

use std::io;
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::sync::{LazyLock, Mutex};
use std::thread;

use super::ms;

/// Where the gateway under test runs, and how large it is.
pub struct Target {
    /// The firmware of the emulated board, as `cargo xtask emulate --test` names it in the variable `PUENTE_IMAGE`; without
    /// it the gateway runs on this machine.
    pub image: Option<PathBuf>,
    /// Most clients that the settings allow.
    pub clients: usize,
    /// Requests of one connection that are under way at once.
    pub pipeline: usize,
    /// Requests that may be under way at once without one being refused, where ten clients have an equal part in them.
    pub room: usize,
}

impl Target {
    pub fn is_board(&self) -> bool {
        self.image.is_some()
    }

    /// Connects to a gateway. QEMU's forwarder lets no more than two connections wait for it, and the next one tries again
    /// after a second: those to a board come one after the other.
    pub fn connect(&self, address: SocketAddr) -> io::Result<TcpStream> {
        static TURN: Mutex<()> = Mutex::new(());
        if !self.is_board() {
            return TcpStream::connect(address);
        }
        let _turn = TURN.lock();
        let stream = TcpStream::connect(address);
        thread::sleep(ms(2));
        stream
    }
}

/// The one of this run.
pub fn target() -> &'static Target {
    static TARGET: LazyLock<Target> = LazyLock::new(|| match std::env::var_os("PUENTE_IMAGE") {
        Some(image) => Target { image: Some(image.into()), clients: 16, pipeline: 4, room: 20 },
        None => Target { image: None, clients: 64, pipeline: 16, room: 80 },
    });
    &TARGET
}
