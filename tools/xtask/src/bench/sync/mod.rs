//! The jitter of SYNC in real time, as an SLCAN adapter is given it, with three drives that follow set-points, and of SYNC alone:
//! of the gateway on this host, and of the firmware on the emulated board, whose time is not that of a real one.

mod adapter;
mod commander;

use std::net::SocketAddr;
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::{Duration, Instant};

use puente_canopen::Frame;
use puente_emulator::{Emulator, Setup};

use super::machine;
use super::modbus::row;
use super::programs::{Bench, CanCell, Gateway};
use super::samples::{Samples, ms};
use crate::Outcome;
use crate::emulate;
use crate::firmware;
use adapter::Passed;
use commander::Commander;

/// The drives, nodes 2 to 4.
const AXES: [&str; 3] = ["u", "v", "w"];
const NODES: [u8; 3] = [2, 3, 4];
/// Periods that are tried with drives, until one is kept.
const PERIODS: [Duration; 4] =
    [Duration::from_millis(1), Duration::from_millis(2), Duration::from_millis(5), Duration::from_millis(10)];
/// A gateway has been running for so long before it is measured,
const START: Duration = Duration::from_secs(3);
/// for so long.
const TIME: Duration = Duration::from_secs(10);
/// A period is kept where so many of the set-points that are due are told, percent.
const KEPT: f64 = 99.0;
/// Bounds of the histogram, us.
const BOUNDS: [u64; 9] = [10, 20, 50, 100, 200, 500, 1_000, 2_000, 5_000];
/// Characters of SLCAN for SYNC and for a set-point, each with its acknowledgement, and for an answer; those of a cycle.
const SYNC: usize = 6 + 2;
const SET_POINT: usize = 14 + 2;
const ANSWER: usize = 18;
const CYCLE: usize = SYNC + AXES.len() * (SET_POINT + ANSWER);
/// Of a serial adapter, 8N1.
const BAUD: u32 = 115_200;

/// What an adapter was given.
struct Seen {
    name: String,
    period: Duration,
    /// The moments of SYNC.
    at: Vec<Instant>,
    set_points: usize,
    answers: usize,
}

/// Who drives the bus.
#[derive(Clone, Copy)]
enum Who {
    Host,
    Board,
}

impl Who {
    const fn name(self) -> &'static str {
        match self {
            Who::Host => "gateway on the host",
            Who::Board => "firmware on the emulated board",
        }
    }

    /// SYNC with nothing else.
    fn alone(self, bench: &Bench) -> Result<Seen, String> {
        let period = PERIODS[0];
        let (address, passed) = adapter::alone()?;
        let name = format!("{}, SYNC alone", self.name());
        self.with(bench, address, period, false, |_| collect(name, period, &passed, || Ok(())))
    }

    /// With drives, at the shortest period that is kept, and those before that.
    fn driving(self, bench: &Bench) -> Result<Vec<Seen>, String> {
        let mut all = Vec::new();
        for period in PERIODS {
            eprintln!("{}, three axes, SYNC each {} ms", self.name(), ms(period));
            let cell = CanCell::start(bench, &NODES)?;
            let (address, passed) = adapter::before(cell.address)?;
            let name = format!("{}, three axes", self.name());
            let seen = self.with(bench, address, period, true, |gateway| {
                let mut commander = Commander::start(gateway)?;
                collect(name, period, &passed, || commander.feed())
            })?;
            let kept = seen.is_kept();
            all.push(seen);
            if kept {
                break;
            }
        }
        Ok(all)
    }

    /// Runs it with an adapter.
    fn with(
        self,
        bench: &Bench,
        adapter: SocketAddr,
        period: Duration,
        drives: bool,
        measure: impl FnOnce(SocketAddr) -> Result<Seen, String>,
    ) -> Result<Seen, String> {
        match self {
            Who::Host => measure(Gateway::with(bench, &toml(adapter, period, drives))?.main),
            Who::Board => {
                let image = emulate::image(firmware::build)?;
                let cans = [Some(adapter), None];
                let setup = Setup { lines: [None, None], cans, ..Setup::new(image, adapter) };
                let board = Emulator::start(&setup, |_| {})?;
                emulate::configure(board.main, &json(period, drives), "canopen")?;
                measure(board.main)
            }
        }
    }
}

/// Settings of the gateway on the host.
fn toml(adapter: SocketAddr, period: Duration, drives: bool) -> String {
    let mut text = format!(
        "lease_ms = 5000\n[[bus]]\nname = \"can\"\nprotocol = \"canopen\"\nport = \"slcan:tcp:{adapter}\"\n\
         bitrate = 1000000\nsync_us = {}\n",
        period.as_micros()
    );
    for (axis, node) in AXES.iter().zip(NODES).filter(|_| drives) {
        text += &format!(
            "[[axis]]\nname = \"{axis}\"\nbus = \"can\"\ndrive = \"cia402\"\nprofile = \"lexium23a\"\n\
             address = {node}\ncyclic = \"ip\"\n[[node]]\nbus = \"can\"\nid = {node}\nheartbeat_ms = 1000\n"
        );
    }
    text
}

/// Settings of the board.
fn json(period: Duration, drives: bool) -> String {
    let list = |item: &dyn Fn(&str, u8) -> String| {
        let items = AXES.iter().zip(NODES).filter(|_| drives).map(|(axis, node)| item(axis, node));
        items.collect::<Vec<_>>().join(",")
    };
    let axes = list(&|axis, node| {
        format!(
            r#"{{"name":"{axis}","bus":"can","drive":"cia402","profile":"lexium23a","address":{node},"cyclic":"ip"}}"#
        )
    });
    let nodes = list(&|_, node| format!(r#"{{"bus":"can","id":{node},"heartbeat_ms":1000}}"#));
    format!(
        r#"{{"net":{{"port":80,"modbus_port":502,"lease_ms":5000}},
"bus":[{{"name":"can","protocol":"canopen","port":"can-1","bitrate":1000000,"sync_us":{}}}],
"axis":[{axes}],"node":[{nodes}]}}"#,
        period.as_micros()
    )
}

/// What comes within the time, once the gateway has been running for a while.
fn collect(
    name: String,
    period: Duration,
    passed: &Receiver<Passed>,
    mut meanwhile: impl FnMut() -> Result<(), String>,
) -> Result<Seen, String> {
    let ready = Instant::now();
    while ready.elapsed() < START {
        meanwhile()?;
        thread::sleep(Duration::from_millis(10));
    }
    let begin = Instant::now();
    let mut seen = Seen { name, period, at: Vec::new(), set_points: 0, answers: 0 };
    while begin.elapsed() < TIME {
        meanwhile()?;
        match passed.recv_timeout(TIME).map_err(|error| format!("{}: {error}", seen.name))? {
            Passed::Sync(at) if at >= begin => seen.at.push(at),
            // What goes with the first SYNC comes after it.
            Passed::SetPoint if !seen.at.is_empty() => seen.set_points += 1,
            Passed::Answer if !seen.at.is_empty() => seen.answers += 1,
            Passed::Sync(_) | Passed::SetPoint | Passed::Answer => {}
        }
    }
    Ok(seen)
}

impl Seen {
    /// From one SYNC to the next.
    fn periods(&self) -> Result<Samples, String> {
        Samples::new(self.at.windows(2).map(|pair| pair[1] - pair[0]).collect())
    }

    /// How far each period is from what it should be.
    fn deviations(&self) -> impl ExactSizeIterator<Item = Duration> {
        self.at.windows(2).map(|pair| (pair[1] - pair[0]).abs_diff(self.period))
    }

    /// The part of the periods that is off by at most this, percent.
    fn within(&self, bound: Duration) -> f64 {
        let count = self.deviations().len().max(1);
        self.deviations().filter(|off| *off <= bound).count() as f64 / count as f64 * 100.0
    }

    /// Of what the time has room for, percent.
    fn part(&self, frames: usize, each: usize) -> f64 {
        frames as f64 / (TIME.div_duration_f64(self.period) * each as f64) * 100.0
    }

    /// Characters that the cycles took, a second.
    fn characters(&self) -> f64 {
        let all = self.at.len() * SYNC + self.set_points * SET_POINT + self.answers * ANSWER;
        all as f64 / TIME.as_secs_f64()
    }

    /// Whether the bus keeps the period.
    fn is_kept(&self) -> bool {
        let parts = [self.part(self.set_points, AXES.len()), self.part(self.answers, AXES.len())];
        parts.into_iter().all(|part| part >= KEPT)
    }

    fn row(&self) -> Result<String, String> {
        let (periods, deviations) = (self.periods()?, Samples::new(self.deviations().collect())?);
        let part = |frames, each| match frames {
            0 => "-".to_owned(),
            frames => format!("{:.2} %", self.part(frames, each)),
        };
        let mut cells = vec![
            self.name.clone(),
            ms(self.period),
            part(self.at.len(), 1),
            part(self.set_points, AXES.len()),
            part(self.answers, AXES.len()),
            format!("{:.0}", self.characters()),
            ms(periods.median()),
            ms(deviations.percentile(99)),
            ms(deviations.percentile(100)),
        ];
        cells.extend(BOUNDS.map(|bound| format!("{:.2}", self.within(Duration::from_micros(bound)))));
        Ok(row(&cells))
    }
}

pub fn run() -> Outcome {
    let before = machine::description();
    let bench = super::modbus::build()?;
    let mut all = Who::Host.driving(&bench)?;
    all.push(Who::Host.alone(&bench)?);
    let board = Who::Board.driving(&bench)?;
    let short = shortest(&board);
    all.extend(board);
    all.push(Who::Board.alone(&bench)?);
    let rows = all.iter().map(Seen::row).collect::<Result<String, _>>()?;
    let bounds = BOUNDS.map(|bound| format!("{bound} us")).join(" | ");
    let serial = Duration::from_secs(1) * (10 * CYCLE as u32) / BAUD;
    println!(
        "# The jitter of SYNC, in real time\n\n\
         `cargo xtask bench sync > docs/sync.md`\n\n\
         Measured on {before} at the start, {} at the end. SYNC as an SLCAN adapter on TCP is given it, {} s a row: from one to\n\
         the next, and how far that is from what it should be. *Three axes*: simulated Lexium 23A behind the adapter, a CAN bus of\n\
         1 Mbit/s in real time, each on its way to a position in interpolated position; with every SYNC there is a set-point for\n\
         each, and its status and position come back. *SYNC alone*: an adapter with nothing behind it. The percentages are\n\
         cumulative; those of SYNC, set-points and answers are of what the time has room for.\n\n\
         The bound of what the bus adds: SYNC waits for one frame at most, {} bits or {} ms at 1 Mbit/s, where the controller lets it\n\
         go before frames of its own that have not begun, see [canopen-bench.md](canopen-bench.md). It is not in these figures, for\n\
         the adapter is in front of the bus.\n\n\
         | | SYNC each | SYNC | set-points | answers | characters/s | median | off by, 99 % | off by, at most | {bounds} |\n\
         |---|--:|--:|--:|--:|--:|--:|--:|--:|{}\n{rows}\n\
         With drives 1 ms is tried first, then 2, 5 and 10 ms, until {KEPT} % of the set-points and answers are there.{short}\n\n\
         A cycle of three axes has {CYCLE} characters of SLCAN, both ways and acknowledgements together, {:.0} a second at 1 ms. The\n\
         UARTs of the emulated board have no baud rate; what they carry is what the emulated processor takes them for, one at a\n\
         time, on a machine with other things to do. A real adapter on a serial line of {BAUD} baud needs {} ms for a cycle, if\n\
         all of it went one way. A board has CAN controllers instead, and nothing of that.",
        machine::load(),
        TIME.as_secs(),
        Frame::worst_bits(false, 8),
        ms(Duration::from_micros(Frame::worst_bits(false, 8).into())),
        "--:|".repeat(BOUNDS.len()),
        CYCLE as f64 / PERIODS[0].as_secs_f64(),
        ms(serial),
    );
    Ok(())
}

/// What a board that did not keep a period carried at most, and what that is for a cycle.
fn shortest(board: &[Seen]) -> String {
    let overloaded = board.iter().filter(|seen| seen.set_points > 0 && !seen.is_kept());
    let most = overloaded.map(Seen::characters).fold(0.0, f64::max);
    if most == 0.0 {
        return String::new();
    }
    let cycle = Duration::from_secs_f64(CYCLE as f64 / most);
    format!(
        " Where the\nboard does not keep a period it carries no more than {most:.0} characters a second: with these a cycle takes {} ms.",
        ms(cycle)
    )
}
