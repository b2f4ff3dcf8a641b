//! The far side of a serial line: a pseudo terminal or a TCP port with slaves, and a log of what was on it.

use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant as Clock};

use puente_cell::{Cell, Config, Event};
use puente_line::{Instant, Settings};
use puente_modbus::server::Decoder;
use puente_modbus::{Mode, ascii, rtu};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::OFlags;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

use super::{ms, scratch, target, thesis};

/// A request with a right check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Heard {
    /// When its last byte was there.
    pub at: Clock,
    pub unit: u8,
    pub pdu: Vec<u8>,
}

/// What is on the line: bytes in, bytes out, time as an argument.
pub trait Device: Send + 'static {
    fn receive(&mut self, now: Instant, bytes: &[u8]);
    fn poll(&mut self, now: Instant) -> Option<Vec<u8>>;
    fn poll_at(&self) -> Option<Instant>;
    /// The requests since the last call.
    fn requests(&mut self) -> Vec<(Instant, u8, Vec<u8>)>;
}

impl Device for Cell {
    fn receive(&mut self, now: Instant, bytes: &[u8]) {
        Cell::receive(self, now, bytes);
    }

    fn poll(&mut self, now: Instant) -> Option<Vec<u8>> {
        Cell::poll(self, now)
    }

    fn poll_at(&self) -> Option<Instant> {
        Cell::poll_at(self)
    }

    fn requests(&mut self) -> Vec<(Instant, u8, Vec<u8>)> {
        let requests = self.take_events().filter_map(|(at, event)| match event {
            Event::Request { unit, pdu } => Some((at, unit, pdu)),
            _ => None,
        });
        requests.collect()
    }
}

/// Bytes on the line, so long after the request.
pub type Chunk = (Duration, Vec<u8>);

/// What slaves answer to a unit and a PDU.
type Act = Box<dyn FnMut(u8, &[u8]) -> Vec<Chunk> + Send>;

/// Slaves that answer as a closure says.
pub struct Script {
    decoder: Decoder,
    act: Act,
    due: Vec<(Instant, Vec<u8>)>,
    requests: Vec<(Instant, u8, Vec<u8>)>,
}

impl Script {
    pub fn new(
        mode: Mode,
        line: Settings,
        act: impl FnMut(u8, &[u8]) -> Vec<Chunk> + Send + 'static,
    ) -> Self {
        Self { decoder: Decoder::new(mode, line), act: Box::new(act), due: Vec::new(), requests: Vec::new() }
    }
}

impl Device for Script {
    fn receive(&mut self, now: Instant, bytes: &[u8]) {
        self.decoder.receive(now, bytes);
    }

    fn poll(&mut self, now: Instant) -> Option<Vec<u8>> {
        while let Some(request) = self.decoder.poll(now) {
            let Ok(frame) = request else { continue };
            self.requests.push((now, frame.unit, frame.pdu.to_vec()));
            for (after, bytes) in (self.act)(frame.unit, &frame.pdu) {
                let due = now + after;
                let at = self.due.partition_point(|(earlier, _)| *earlier <= due);
                self.due.insert(at, (due, bytes));
            }
        }
        let (at, _) = self.due.first()?;
        (*at <= now).then(|| self.due.remove(0).1)
    }

    fn poll_at(&self) -> Option<Instant> {
        let due = self.due.first().map(|(at, _)| *at);
        [due, self.decoder.poll_at()].into_iter().flatten().min()
    }

    fn requests(&mut self) -> Vec<(Instant, u8, Vec<u8>)> {
        std::mem::take(&mut self.requests)
    }
}

/// The frame around a PDU.
pub fn frame(mode: Mode, unit: u8, pdu: &[u8]) -> Vec<u8> {
    match mode {
        Mode::Rtu => rtu::emit(unit, pdu).to_vec(),
        Mode::Ascii => ascii::emit(unit, pdu).to_vec(),
    }
}

/// The value of a register in which unit and address can be told, so that no other value passes for it.
pub fn value(unit: u8, address: u16) -> u16 {
    u16::from(unit) << 12 | address & 0x0FFF
}

/// Values of registers as [`value`] has them.
pub fn values(unit: u8, address: u16, quantity: u16) -> Vec<u16> {
    (address..address + quantity).map(|address| value(unit, address)).collect()
}

/// The PDU with which a healthy slave answers a reading (function 03) or a writing (06) of registers.
pub fn healthy(unit: u8, pdu: &[u8]) -> Vec<u8> {
    match *pdu {
        [3, high, low, 0, quantity] => {
            let words = values(unit, u16::from_be_bytes([high, low]), u16::from(quantity));
            [3, quantity * 2].into_iter().chain(words.iter().flat_map(|word| word.to_be_bytes())).collect()
        }
        _ => pdu.to_vec(),
    }
}

struct Log {
    bytes: Vec<u8>,
    requests: Vec<Heard>,
    sent: Vec<(Clock, Vec<u8>)>,
}

enum End {
    Pty { master: File, far: File },
    Tcp { listener: TcpListener, client: Option<TcpStream> },
}

/// A line with a device on it; the gateway is started after it. It lives as long as this value.
pub struct Wire<D> {
    device: Arc<Mutex<D>>,
    log: Arc<Mutex<Log>>,
    start: Clock,
    pub(super) place: Place,
    /// Whether the device is on it. Until then it hears nothing of what a board with other settings says.
    pub(super) live: Arc<AtomicBool>,
    thread: Option<(Arc<AtomicBool>, JoinHandle<()>)>,
}

/// Where the gateway finds the line.
#[derive(Clone)]
pub enum Place {
    Link(PathBuf),
    Tcp(SocketAddr),
}

impl Place {
    /// What the settings of the host's gateway call it.
    pub fn port(&self) -> String {
        match self {
            Place::Link(link) => link.to_str().expect("a path").to_owned(),
            Place::Tcp(address) => format!("tcp:{address}"),
        }
    }

    /// Where it is on the network, where it is there.
    pub fn address(&self) -> Option<SocketAddr> {
        match self {
            Place::Link(_) => None,
            Place::Tcp(address) => Some(*address),
        }
    }
}

impl<D: Device> Wire<D> {
    /// Where the target has its lines: a pseudo terminal, or the TCP port of a UART.
    pub fn new(device: D) -> Self {
        if target().is_board() { Self::tcp(device) } else { Self::pty(device) }
    }

    /// On a pseudo terminal.
    pub fn pty(device: D) -> Self {
        Self::at(device, Place::Link(scratch("line")))
    }

    /// On a TCP port, as raw bytes.
    pub fn tcp(device: D) -> Self {
        Self::at(device, Place::Tcp("127.0.0.1:0".parse().expect("an address")))
    }

    fn at(device: D, place: Place) -> Self {
        let log = Log { bytes: Vec::new(), requests: Vec::new(), sent: Vec::new() };
        let mut wire = Self {
            device: Arc::new(Mutex::new(device)),
            log: Arc::new(Mutex::new(log)),
            start: Clock::now(),
            place,
            live: Arc::new(AtomicBool::new(!target().is_board())),
            thread: None,
        };
        wire.plug();
        wire
    }

    /// Puts the device on it, where a board is not to have other settings.
    pub(super) fn go_live(&self) {
        self.live.store(true, Ordering::Relaxed);
    }

    /// The device, to look at or to change.
    pub fn device(&self) -> MutexGuard<'_, D> {
        self.device.lock().expect("the device")
    }

    fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().expect("the log")
    }

    /// All requests so far.
    pub fn requests(&self) -> Vec<Heard> {
        self.log().requests.clone()
    }

    /// The PDUs of the requests to a unit so far.
    pub fn pdus(&self, unit: u8) -> Vec<Vec<u8>> {
        self.log().requests.iter().filter(|r| r.unit == unit).map(|r| r.pdu.clone()).collect()
    }

    /// All bytes of the gateway so far.
    pub fn bytes(&self) -> Vec<u8> {
        self.log().bytes.clone()
    }

    /// What the slaves sent so far, and when.
    pub fn sent(&self) -> Vec<(Clock, Vec<u8>)> {
        self.log().sent.clone()
    }

    /// Takes the line away, as when the plug is pulled.
    pub fn pull(&mut self) {
        if let Some((running, thread)) = self.thread.take() {
            running.store(false, Ordering::Relaxed);
            thread.join().expect("the line's thread");
        }
        if let Place::Link(link) = &self.place {
            let _ = fs::remove_file(link);
        }
    }

    /// Puts it back.
    pub fn plug(&mut self) {
        let end = match &mut self.place {
            Place::Link(link) => {
                let (end, path) = open_pty();
                symlink(path, link).expect("a link");
                end
            }
            Place::Tcp(address) => {
                let listener = TcpListener::bind(*address).expect("a port");
                listener.set_nonblocking(true).expect("not blocking");
                *address = listener.local_addr().expect("an address");
                End::Tcp { listener, client: None }
            }
        };
        let running = Arc::new(AtomicBool::new(true));
        let (device, log, start) = (self.device.clone(), self.log.clone(), self.start);
        let (live, goes_on) = (self.live.clone(), running.clone());
        let thread = thread::spawn(move || {
            let mut end = end;
            let first = before(&mut end, start, &live, &goes_on);
            serve(end, &first, &device, &log, start, &goes_on);
        });
        self.thread = Some((running, thread));
    }
}

impl<D> Drop for Wire<D> {
    fn drop(&mut self) {
        if let Some((running, thread)) = self.thread.take() {
            running.store(false, Ordering::Relaxed);
            let _ = thread.join();
        }
        if let Place::Link(link) = &self.place {
            let _ = fs::remove_file(link);
        }
    }
}

fn open_pty() -> (End, String) {
    // Not inherited by the gateway, which would keep a pulled line open.
    let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
    let master = openpt(flags).expect("a pseudo terminal");
    grantpt(&master).expect("granted");
    unlockpt(&master).expect("unlocked");
    let path = ptsname(&master, Vec::new()).expect("its name").into_string().expect("text");
    let flags = OFlags::NOCTTY | OFlags::NONBLOCK;
    // Kept open, so that the near side reads no error while the gateway does not have it open.
    let far = OpenOptions::new().read(true).write(true).custom_flags(flags.bits() as i32).open(&path);
    (End::Pty { master: master.into(), far: far.expect("its far side") }, path)
}

/// Refuses all that a board asks with its factory settings, until the line is live: the sooner it has its answers, the
/// sooner it takes others. Returns the first bytes after that.
fn before(end: &mut End, start: Clock, live: &AtomicBool, goes_on: &AtomicBool) -> Vec<u8> {
    let now = || Instant::from_micros(start.elapsed().as_micros() as u64);
    let mut refusal = Script::new(Mode::Ascii, thesis(), |unit, request| {
        vec![(Duration::ZERO, frame(Mode::Ascii, unit, &[request[0] | 0x80, 1]))]
    });
    let mut buffer = [0; 256];
    while goes_on.load(Ordering::Relaxed) && !live.load(Ordering::Relaxed) {
        if let Some(bytes) = refusal.poll(now()) {
            end.write(&bytes);
            continue;
        }
        let wait = refusal.poll_at().map_or(ms(20), |at| at.since(now()).min(ms(20)));
        let count = end.read(&mut buffer, wait);
        if live.load(Ordering::Relaxed) {
            return buffer[..count].to_vec();
        }
        refusal.receive(now(), &buffer[..count]);
    }
    Vec::new()
}

fn serve<D: Device>(
    mut end: End,
    first: &[u8],
    device: &Mutex<D>,
    log: &Mutex<Log>,
    start: Clock,
    goes_on: &AtomicBool,
) {
    let now = || Instant::from_micros(start.elapsed().as_micros() as u64);
    let clock = |at: Instant| start + Duration::from_micros(at.as_micros());
    let mut buffer = [0; 4096];
    let take = |bytes: &[u8]| {
        log.lock().expect("the log").bytes.extend(bytes);
        device.lock().expect("the device").receive(now(), bytes);
    };
    take(first);
    while goes_on.load(Ordering::Relaxed) {
        let (bytes, requests, at) = {
            let mut device = device.lock().expect("the device");
            let bytes = device.poll(now());
            (bytes, device.requests(), device.poll_at())
        };
        let heard = requests.into_iter().map(|(at, unit, pdu)| Heard { at: clock(at), unit, pdu });
        log.lock().expect("the log").requests.extend(heard);
        if let Some(bytes) = bytes {
            log.lock().expect("the log").sent.push((Clock::now(), bytes.clone()));
            end.write(&bytes);
            continue;
        }
        let wait = at.map_or(ms(20), |at| at.since(now()).min(ms(20)));
        let count = end.read(&mut buffer, wait);
        if count > 0 {
            take(&buffer[..count]);
        }
    }
}

impl End {
    fn fd(&self) -> BorrowedFd<'_> {
        match self {
            End::Pty { master, .. } => master.as_fd(),
            End::Tcp { client: Some(client), .. } => client.as_fd(),
            End::Tcp { listener, .. } => listener.as_fd(),
        }
    }

    /// Waits for bytes for at most `wait`; 0 when there were none.
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> usize {
        let wait = Timespec::try_from(wait).expect("a short time");
        if poll(&mut [PollFd::new(&self.fd(), PollFlags::IN)], Some(&wait)).unwrap_or(0) == 0 {
            return 0;
        }
        match self {
            End::Pty { master, .. } => master.read(buffer).unwrap_or(0),
            End::Tcp { listener, client } => match client.as_mut().map(|client| client.read(buffer)) {
                Some(Ok(count)) if count > 0 => count,
                Some(Err(error)) if error.kind() == ErrorKind::WouldBlock => 0,
                Some(_) => {
                    *client = None;
                    0
                }
                None => {
                    *client = listener.accept().ok().map(|(client, _)| {
                        client.set_nodelay(true).expect("no delay");
                        client
                    });
                    0
                }
            },
        }
    }

    /// Bytes for which nobody listens are lost, as on a wire.
    fn write(&mut self, bytes: &[u8]) {
        let _ = match self {
            End::Pty { master, .. } => master.write_all(bytes),
            End::Tcp { client: Some(client), .. } => client.write_all(bytes),
            End::Tcp { .. } => Ok(()),
        };
    }
}

/// A cell of EDB drives on a line of the target.
pub fn cell(mode: Mode, line: Settings, addresses: &[u8]) -> Wire<Cell> {
    Wire::new(Cell::new(Config::new(mode, line, addresses)))
}

/// Slaves on a line of the target that answer as a closure says.
pub fn script(
    mode: Mode,
    line: Settings,
    act: impl FnMut(u8, &[u8]) -> Vec<Chunk> + Send + 'static,
) -> Wire<Script> {
    Wire::new(Script::new(mode, line, act))
}
