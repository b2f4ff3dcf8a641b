//! The jitter of SYNC in real time, as an SLCAN adapter sees it: of the gateway on this host, and of the firmware on the
//! emulated board, whose time is not that of a real one.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::mpsc::{self, Receiver};
use std::thread;
use std::time::{Duration, Instant};

use puente_emulator::{Emulator, Setup};

use super::machine;
use super::programs::Gateway;
use super::samples::{Samples, ms};
use crate::Outcome;
use crate::emulate;
use crate::firmware;

const PERIOD: Duration = Duration::from_millis(1);
/// A gateway has been running for so long before it is measured,
const START: Duration = Duration::from_secs(3);
/// for so long.
const TIME: Duration = Duration::from_secs(10);
/// Bounds of the histogram, us.
const BOUNDS: [u64; 9] = [10, 20, 50, 100, 200, 500, 1_000, 2_000, 5_000];

/// The moments at which an adapter was given SYNC.
struct Seen {
    name: &'static str,
    at: Vec<Instant>,
}

/// An adapter that takes everything at once, and tells when it was given SYNC.
fn adapter() -> Result<(SocketAddr, Receiver<Instant>), String> {
    let listener = TcpListener::bind("127.0.0.1:0").map_err(|error| error.to_string())?;
    let address = listener.local_addr().map_err(|error| error.to_string())?;
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        // It ends with the gateway, or with whoever wants to know.
        while let Ok((mut stream, _)) = listener.accept() {
            if stream.set_nodelay(true).is_err() {
                return;
            }
            let mut line = Vec::new();
            while let Some((now, bytes)) = read(&mut stream) {
                let mut answers = Vec::new();
                for byte in bytes {
                    if byte != b'\r' {
                        line.push(byte);
                        continue;
                    }
                    if line.starts_with(b"t080") && sender.send(now).is_err() {
                        return;
                    }
                    answers.extend_from_slice(answer(&line));
                    line.clear();
                }
                if stream.write_all(&answers).is_err() {
                    break;
                }
            }
        }
    });
    Ok((address, receiver))
}

fn read(stream: &mut TcpStream) -> Option<(Instant, Vec<u8>)> {
    let mut buffer = [0; 256];
    let count = stream.read(&mut buffer).ok().filter(|count| *count > 0)?;
    Some((Instant::now(), buffer[..count].to_vec()))
}

/// As the Lawicel adapters answer.
fn answer(line: &[u8]) -> &'static [u8] {
    match line.first() {
        Some(b't' | b'r') => b"z\r",
        Some(b'F') => b"F00\r",
        Some(b'V') => b"V1013\r",
        _ => b"\r",
    }
}

/// What comes within the time, once the gateway has been running for a while.
fn collect(name: &'static str, syncs: &Receiver<Instant>) -> Result<Seen, String> {
    thread::sleep(START);
    let begin = Instant::now();
    let mut at = Vec::new();
    while begin.elapsed() < TIME {
        let sync = syncs.recv_timeout(TIME).map_err(|error| format!("{name}: {error}"))?;
        if sync >= begin {
            at.push(sync);
        }
    }
    Ok(Seen { name, at })
}

fn host() -> Result<Seen, String> {
    let bench = super::modbus::build()?;
    let (address, syncs) = adapter()?;
    let bus = format!(
        "[[bus]]\nname = \"can\"\nprotocol = \"canopen\"\nport = \"slcan:tcp:{address}\"\nbitrate = 1000000\nsync_us = 1000\n"
    );
    let _gateway = Gateway::with(&bench, &bus)?;
    collect("gateway on the host", &syncs)
}

fn board() -> Result<Seen, String> {
    const SETTINGS: &str = r#"{"net":{"port":80,"modbus_port":502},
"bus":[{"name":"can","protocol":"canopen","port":"can-1","bitrate":1000000,"sync_us":1000}]}"#;
    let image = emulate::image(firmware::build)?;
    let (address, syncs) = adapter()?;
    let setup = Setup { lines: [None, None], cans: [Some(address), None], ..Setup::new(image, address) };
    let board = Emulator::start(&setup, |_| {})?;
    emulate::configure(board.main, SETTINGS, "canopen")?;
    collect("firmware on the emulated board", &syncs)
}

impl Seen {
    /// From one SYNC to the next.
    fn periods(&self) -> Result<Samples, String> {
        Samples::new(self.at.windows(2).map(|pair| pair[1] - pair[0]).collect())
    }

    /// How far each period is from what it should be.
    fn deviations(&self) -> Result<Samples, String> {
        let deviation = |pair: &[Instant]| (pair[1] - pair[0]).abs_diff(PERIOD);
        Samples::new(self.at.windows(2).map(deviation).collect())
    }

    /// The part of the periods that is off by at most this, percent.
    fn within(&self, bound: Duration) -> f64 {
        let periods = self.at.windows(2);
        let count = periods.len();
        let within = periods.filter(|pair| (pair[1] - pair[0]).abs_diff(PERIOD) <= bound).count();
        within as f64 / count.max(1) as f64 * 100.0
    }

    fn row(&self) -> Result<String, String> {
        let (periods, deviations) = (self.periods()?, self.deviations()?);
        let bounds = BOUNDS.map(|bound| format!("{:.2}", self.within(Duration::from_micros(bound))));
        Ok(format!(
            "| {} | {} | {} | {} | {} | {} |\n",
            self.name,
            periods.count(),
            ms(periods.median()),
            ms(deviations.percentile(99)),
            ms(deviations.percentile(100)),
            bounds.join(" | "),
        ))
    }
}

pub fn run() -> Outcome {
    let before = machine::description();
    let rows = [host()?, board()?].iter().map(Seen::row).collect::<Result<String, _>>()?;
    let bounds = BOUNDS.map(|bound| format!("{bound} us")).join(" | ");
    println!(
        "# The jitter of SYNC, in real time\n\n\
         `cargo xtask bench sync > docs/sync.md`\n\n\
         Measured on {before}. SYNC each {} ms, as an SLCAN adapter on TCP is given it, {} s each: from one to the next, and\n\
         how far that is from what it should be. The percentages are cumulative. On the wire a frame that has begun adds up to\n\
         0.135 ms at 1 Mbit/s, see [canopen-bench.md](canopen-bench.md).\n\n\
         | | periods | median | off by, 99 % | off by, at most | {bounds} |\n|---|--:|--:|--:|--:|{}\n{rows}",
        ms(PERIOD),
        TIME.as_secs(),
        "--:|".repeat(BOUNDS.len()),
    );
    Ok(())
}
