//! Modbus masters that ask again as soon as they are answered: over TCP, and at the line itself.

use std::fs::OpenOptions;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::sync::Barrier;
use std::thread;
use std::time::{Duration, Instant};

use puente_line::Settings;
use puente_modbus::request::Request;
use puente_modbus::{mbap, reply::Reply, rtu};

const UNIT: u8 = 1;
const PATIENCE: Duration = Duration::from_secs(5);

/// What clients have seen.
pub struct Seen {
    /// From request to reply, of all clients.
    pub latencies: Vec<Duration>,
    /// From the first request to the last reply.
    pub time: Duration,
}

/// Read Holding Registers of `quantity` registers from 0 on.
pub fn request(quantity: u16) -> Request<'static> {
    Request::ReadHoldingRegisters { address: 0, quantity }
}

/// Lets `clients` Modbus/TCP clients read `quantity` registers over and over, one request at a time each.
pub fn over_tcp(gateway: SocketAddr, clients: usize, quantity: u16, time: Duration) -> Result<Seen, String> {
    let start = Barrier::new(clients);
    let seen = thread::scope(|scope| {
        let client = || scope.spawn(|| one_over_tcp(gateway, quantity, time, &start));
        let all: Vec<_> = (0..clients).map(|_| client()).collect();
        all.into_iter()
            .map(|client| client.join().map_err(|_| "a client panicked".to_owned())?)
            .collect::<Result<Vec<Seen>, String>>()
    })?;
    let time = seen.iter().map(|seen| seen.time).max().unwrap_or_default();
    Ok(Seen { latencies: seen.into_iter().flat_map(|seen| seen.latencies).collect(), time })
}

fn one_over_tcp(gateway: SocketAddr, quantity: u16, time: Duration, start: &Barrier) -> Result<Seen, String> {
    let stream = connect(gateway);
    start.wait();
    let mut stream = stream.map_err(|error| format!("a client cannot connect: {error}"))?;
    let pdu = request(quantity).emit();
    let mut latencies = Vec::new();
    let start = Instant::now();
    for transaction in (0..=u16::MAX).cycle() {
        let sent = Instant::now();
        if sent - start >= time {
            break;
        }
        let reply = exchange(&mut stream, transaction, &pdu);
        let reply = reply.map_err(|error| format!("a client got no reply: {error}"))?;
        latencies.push(sent.elapsed());
        check(&pdu, &reply)?;
    }
    Ok(Seen { latencies, time: start.elapsed() })
}

fn connect(gateway: SocketAddr) -> std::io::Result<TcpStream> {
    let stream = TcpStream::connect(gateway)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    Ok(stream)
}

/// Sends a request PDU and returns the reply PDU.
fn exchange(stream: &mut TcpStream, transaction: u16, pdu: &[u8]) -> std::io::Result<Vec<u8>> {
    let wrong = |what: String| std::io::Error::other(what);
    stream.write_all(&mbap::emit(transaction, UNIT, pdu))?;
    let mut header = [0; mbap::HEADER];
    stream.read_exact(&mut header)?;
    let header = mbap::Header::parse(&header).map_err(|error| wrong(format!("{error:?}")))?;
    if (header.transaction, header.unit) != (transaction, UNIT) {
        return Err(wrong(format!("{header:?} answers transaction {transaction}")));
    }
    let mut reply = vec![0; usize::from(header.pdu_len)];
    stream.read_exact(&mut reply)?;
    Ok(reply)
}

/// Reads `quantity` registers over and over at the line itself: what the line allows a program that does nothing else.
pub fn at_line(path: &Path, line: Settings, quantity: u16, time: Duration) -> Result<(), String> {
    let failed = |error| format!("{}: {error}", path.display());
    let mut terminal = OpenOptions::new().read(true).write(true).open(path).map_err(failed)?;
    let pdu = request(quantity).emit();
    let adu = rtu::emit(UNIT, &pdu);
    let mut reply = vec![0; reply_adu(quantity)];
    #[cfg(target_os = "linux")]
    let _ = rustix::thread::set_current_timer_slack(std::num::NonZeroU64::new(1));
    let start = Instant::now();
    while start.elapsed() < time {
        terminal.write_all(&adu).map_err(failed)?;
        terminal.read_exact(&mut reply).map_err(failed)?;
        let end = Instant::now();
        let (_, reply) = rtu::parse(&reply).map_err(|error| format!("the line: {error}"))?;
        check(&pdu, reply)?;
        thread::sleep(rtu::t3_5(line).saturating_sub(end.elapsed()));
    }
    Ok(())
}

/// Bytes of the RTU frame that answers [`request`].
pub fn reply_adu(quantity: u16) -> usize {
    // Unit, function, byte count, registers, CRC.
    3 + 2 * usize::from(quantity) + 2
}

fn check(request: &[u8], reply: &[u8]) -> Result<(), String> {
    match Reply::parse(request, reply) {
        Ok(Reply::Exception { code, .. }) => Err(format!("exception {code} came back")),
        Ok(_) => Ok(()),
        Err(mismatch) => Err(format!("a wrong reply came back: {mismatch:?}")),
    }
}
