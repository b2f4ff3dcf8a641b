//! SDO reads through CiA 309-3, against the simulated bus, in real time.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Barrier;
use std::thread;
use std::time::{Duration, Instant};

use puente_canopen::sdo::{Initiate, Request, Response};
use puente_canopen::{Address, Frame, Id, NodeId};

use super::client::Seen;
use super::machine;
use super::modbus::{build, row};
use super::programs::Gateway;
use super::samples::{Samples, ms};
use crate::Outcome;

/// Each case is measured this often, with the others in between, lest a disturbance meets one case alone.
const ROUNDS: usize = 3;
const TIME: Duration = Duration::from_secs(3);
const PATIENCE: Duration = Duration::from_secs(5);
const BITRATE: u32 = 1_000_000;
/// The drives, of which each client reads one.
const NODES: [u8; 3] = [2, 3, 4];
/// What is read: the device type, four bytes.
const OBJECT: Address = Address::new(0x1000, 0);
/// What canopend of CANopenNode did, with one client at a time, on a machine of the same kind.
const CANOPEND: &str = "3967 reads/s, p50 0.21 ms";

pub fn run() -> Outcome {
    let bench = build()?;
    let before = machine::description();
    let cases = [1, 3, 16];
    let mut found = cases.map(|_| Seen { latencies: Vec::new(), time: Duration::ZERO });
    for round in 1..=ROUNDS {
        for (clients, sum) in cases.iter().zip(&mut found) {
            eprintln!("round {round} of {ROUNDS}: {clients} clients");
            let gateway = Gateway::with(&bench, &bus())?;
            let seen = read(gateway.main, *clients)?;
            sum.latencies.extend(seen.latencies);
            sum.time += seen.time;
        }
    }
    let floor = floor()?;
    let mut page = format!(
        "# SDO reads\n\n\
         `cargo xtask bench sdo > docs/sdo.md`\n\n\
         On {before} at the start, {} at the end.\n\n\
         Clients read 1000h of simulated drives (three; each client reads one) by CiA 309-3, `[n] 2 r 0x1000 0 u32`, over TCP, each\n\
         as soon as it has its answer. The simulated bus takes the time that the bits take at {} kbit/s, in real time: request\n\
         and response {} ms, so that no gateway can do more than {:.0} reads a second. {ROUNDS} rounds of {} s a case.\n\n\
         | clients | reads/s | of what the bus allows | latency p50, ms | p99, ms | reads |\n\
         |--:|--:|--:|--:|--:|--:|\n",
        machine::load(),
        BITRATE / 1000,
        ms(floor),
        1.0 / floor.as_secs_f64(),
        TIME.as_secs(),
    );
    for (clients, seen) in cases.into_iter().zip(found) {
        let per_second = seen.latencies.len() as f64 / seen.time.as_secs_f64();
        let samples = Samples::new(seen.latencies)?;
        page += &row(&[
            clients.to_string(),
            format!("{per_second:.0}"),
            format!("{:.0} %", per_second * floor.as_secs_f64() * 100.0),
            ms(samples.median()),
            ms(samples.percentile(99)),
            samples.count().to_string(),
        ]);
    }
    println!(
        "{page}\n\
         For comparison: canopend, CANopenNode's gateway of the same dialect, did {CANOPEND}, with one client at a time, measured on a\n\
         machine of the same kind on another day. [cost.md](cost.md) has the instructions of a read on the emulated board."
    );
    Ok(())
}

/// A bus of three drives.
fn bus() -> String {
    let mut text =
        format!("[[bus]]\nname = \"can\"\nprotocol = \"canopen\"\nport = \"sim\"\nbitrate = {BITRATE}\n");
    for node in NODES {
        text += &format!(
            "[[axis]]\nname = \"a{node}\"\nbus = \"can\"\ndrive = \"cia402\"\nprofile = \"generic\"\naddress = {node}\n"
        );
    }
    text
}

/// A request and its response on the bus.
fn floor() -> Result<Duration, String> {
    let node = NodeId::new(NODES[0]).ok_or("no node-ID")?;
    let request =
        Frame::full(Id::Base(node.sdo_request()), Request::InitiateUpload { address: OBJECT }.to_bytes());
    let data = [0x92, 0x01, 0x02, 0x00].into_iter().collect();
    let response = Response::InitiateUpload { address: OBJECT, data: Initiate::Expedited(data) };
    let response = Frame::full(Id::Base(node.sdo_response()), response.to_bytes());
    Ok(Duration::from_secs(1) * (request.bits() + response.bits()) / BITRATE)
}

fn read(gateway: SocketAddr, clients: usize) -> Result<Seen, String> {
    let start = Barrier::new(clients);
    let seen = thread::scope(|scope| {
        let all: Vec<_> = (0..clients)
            .map(|at| (at, NODES[at % NODES.len()]))
            .map(|(at, node)| {
                (
                    at,
                    scope.spawn({
                        let start = &start;
                        move || one(gateway, node, start)
                    }),
                )
            })
            .collect();
        let join = |(at, client): (usize, thread::ScopedJoinHandle<'_, Result<Seen, String>>)| {
            client
                .join()
                .map_err(|_| format!("client {at} panicked"))?
                .map_err(|error| format!("client {at}: {error}"))
        };
        all.into_iter().map(join).collect::<Result<Vec<Seen>, String>>()
    })?;
    let time = seen.iter().map(|seen| seen.time).max().unwrap_or_default();
    Ok(Seen { latencies: seen.into_iter().flat_map(|seen| seen.latencies).collect(), time })
}

fn one(gateway: SocketAddr, node: u8, start: &Barrier) -> Result<Seen, String> {
    let client = connect(gateway);
    start.wait();
    let mut client = client.map_err(|error| error.to_string())?;
    // Until the node has booted.
    let deadline = Instant::now() + PATIENCE;
    while ask(&mut client, 0, node)?.contains("ERROR") {
        if Instant::now() > deadline {
            return Err("the node does not answer".into());
        }
    }
    let mut latencies = Vec::new();
    let begun = Instant::now();
    for number in 1_u32.. {
        let sent = Instant::now();
        if sent - begun >= TIME {
            break;
        }
        let answer = ask(&mut client, number, node)?;
        latencies.push(sent.elapsed());
        if answer.parse::<u32>().map(|device| device & 0xFFFF) != Ok(402) {
            return Err(format!("read {answer} instead of a drive's device type"));
        }
    }
    Ok(Seen { latencies, time: begun.elapsed() })
}

fn connect(gateway: SocketAddr) -> std::io::Result<BufReader<TcpStream>> {
    let stream = TcpStream::connect(gateway)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(PATIENCE))?;
    Ok(BufReader::new(stream))
}

/// The answer to a read, which must have its number.
fn ask(client: &mut BufReader<TcpStream>, number: u32, node: u8) -> Result<String, String> {
    let Address { index, sub } = OBJECT;
    let line = format!("[{number}] {node} r {index:#06x} {sub} u32\r\n");
    client.get_mut().write_all(line.as_bytes()).map_err(|error| error.to_string())?;
    let mut reply = String::new();
    client.read_line(&mut reply).map_err(|error| error.to_string())?;
    let answer = reply.trim_end().strip_prefix(&format!("[{number}] "));
    answer.map(str::to_owned).ok_or(format!("`{}` does not answer number {number}", reply.trim_end()))
}
