//! Who commands the drives meanwhile: all of them go far, slowly, and life is shown.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use super::AXES;

/// Drives are there, and in their mode, within this.
const PATIENCE: Duration = Duration::from_secs(30);
/// Life is shown so often.
const FEED: Duration = Duration::from_millis(200);
/// Where they go, and how fast: position units, and per second. It takes longer than what is measured.
const WAY: (u32, u32) = (400_000, 20_000);

pub struct Commander {
    stream: BufReader<TcpStream>,
    fed: Instant,
}

impl Commander {
    /// Sets all axes in motion.
    ///
    /// # Errors
    /// One that does not move.
    pub fn start(gateway: SocketAddr) -> Result<Self, String> {
        let stream = TcpStream::connect(gateway).map_err(|error| error.to_string())?;
        let timeout = stream.set_read_timeout(Some(PATIENCE)).and_then(|()| stream.set_nodelay(true));
        timeout.map_err(|error| error.to_string())?;
        let mut commander = Self { stream: BufReader::new(stream), fed: Instant::now() };
        for axis in AXES {
            commander.set_in_motion(axis)?;
        }
        Ok(commander)
    }

    /// Shows life, where it is time.
    pub fn feed(&mut self) -> Result<(), String> {
        if self.fed.elapsed() >= FEED {
            self.fed = Instant::now();
            self.ask("feed")?;
        }
        Ok(())
    }

    /// Asks until it moves: a machine that is held up may lose a drive in between.
    fn set_in_motion(&mut self, axis: &str) -> Result<(), String> {
        let (target, velocity) = WAY;
        let deadline = Instant::now() + PATIENCE;
        loop {
            let mut reply = self.ask(&format!("axis {axis} enable"))?;
            if reply.starts_with("ok") {
                reply = self.ask(&format!("axis {axis} move {target} {velocity}"))?;
            }
            if reply.starts_with("ok") {
                return Ok(());
            }
            if Instant::now() > deadline {
                return Err(reply);
            }
            std::thread::sleep(FEED);
        }
    }

    fn ask(&mut self, line: &str) -> Result<String, String> {
        let stream = self.stream.get_mut();
        stream.write_all(format!("{line}\r\n").as_bytes()).map_err(|error| format!("{line}: {error}"))?;
        let mut reply = String::new();
        self.stream.read_line(&mut reply).map_err(|error| format!("{line}: {error}"))?;
        Ok(reply.trim_end().to_owned())
    }
}
