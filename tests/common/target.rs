//! What the scenarios run on. Whatever a scenario has to know of the difference is here.

use std::io;
use std::net::{SocketAddr, TcpStream};
use std::path::PathBuf;
use std::sync::{LazyLock, Mutex};
use std::thread;
use std::time::Duration;

use super::ms;

/// Where the gateway under test runs, and how large it is.
pub struct Target {
    /// The firmware of the emulated board, as `cargo xtask emulate --test` names it in the variable `PUENTE_IMAGE`; without
    /// it the gateway runs on this machine.
    pub image: Option<PathBuf>,
    /// What it calls itself.
    pub name: &'static str,
    /// Most clients that the settings allow.
    pub clients: usize,
    /// Requests of one connection that are under way at once.
    pub pipeline: usize,
    /// Requests that may be under way at once without one being refused, where ten clients have an equal part in them.
    pub room: usize,
    /// Requests under way at once, HTTP replies, and places for clients where 16 are served, those for stops included.
    pub tickets: u64,
    pub sheets: u64,
    pub places: u64,
    /// Clients whose arrival is in the log at least, of many.
    pub logged_clients: usize,
    /// Frames that may come between the loss of a commander and the stop: the one in progress, and those that begin while
    /// the gateway learns of the loss, which takes an emulated processor longer.
    pub frames_before_stop: usize,
    /// How long clients reconnect.
    pub reconnecting: Duration,
    /// Where a scenario does not say otherwise. An emulated processor may have to wait for a real one at each character.
    pub reply_timeout_ms: u32,
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
        Some(image) => Target {
            image: Some(image.into()),
            name: "mps2-an500",
            clients: 16,
            pipeline: 4,
            room: 20,
            tickets: 24,
            sheets: 3,
            places: 18,
            logged_clients: 20,
            frames_before_stop: 4,
            reconnecting: Duration::from_secs(30),
            reply_timeout_ms: 1500,
        },
        None => Target {
            image: None,
            name: "host",
            clients: 64,
            pipeline: 16,
            room: 80,
            tickets: 256,
            sheets: 32,
            places: 20,
            logged_clients: 101,
            frames_before_stop: 2,
            reconnecting: Duration::from_secs(3),
            reply_timeout_ms: 500,
        },
    });
    &TARGET
}
