//! A silent unit costs the others little of the line: throughput with and without it, in one run.

mod common;

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use common::client::Modbus;
use common::wire::{Wire, cell};
use common::{Document, Ends, Gateway, fast, ms};
use puente_cell::{Cell, Fault};
use puente_modbus::Mode;

const HEALTHY: u8 = 1;
const LATELY_SILENT: u8 = 2;
const NEVER_HEARD: u8 = 9;
const CLIENTS: usize = 4;
/// Of the throughput without the silent unit, in percent.
const LEFT: f64 = 80.0;

/// Readings of four clients of the healthy unit while `meanwhile` runs.
fn readings(count: &AtomicU32, meanwhile: impl FnOnce()) -> f64 {
    let (before, start) = (count.load(Ordering::Relaxed), Instant::now());
    meanwhile();
    f64::from(count.load(Ordering::Relaxed) - before) / start.elapsed().as_secs_f64()
}

/// Polls a unit that does not answer, far more often than the line could ask it.
fn poll_silent(gateway: &Gateway, unit: u8, time: Duration) -> u32 {
    let mut client = Modbus::connect(gateway.main);
    let start = Instant::now();
    let mut asked = 0;
    while start.elapsed() < time {
        assert_eq!(client.read(unit, 0x0901, 1), Err(0x0B));
        asked += 1;
        // What is refused at once would keep the processor busy, and not the line.
        thread::sleep(ms(40));
    }
    asked
}

#[test]
fn four_clients_of_a_healthy_unit_keep_most_of_their_throughput_on_an_rtu_line() {
    four_clients_keep_most_of_their_throughput(Mode::Rtu);
}

#[test]
fn four_clients_of_a_healthy_unit_keep_most_of_their_throughput_on_an_ascii_line() {
    four_clients_keep_most_of_their_throughput(Mode::Ascii);
}

fn four_clients_keep_most_of_their_throughput(mode: Mode) {
    let wire = cell(mode, fast(), &[HEALTHY, LATELY_SILENT]);
    let gateway = Document::new().bus("a", mode, fast(), &wire, "reply_timeout_ms = 200").start();
    assert!(Modbus::connect(gateway.main).read(LATELY_SILENT, 0x0901, 1).is_ok());
    let count = AtomicU32::new(0);
    let running = AtomicBool::new(true);
    thread::scope(|scope| {
        let _ends = Ends(&running);
        for _ in 0..CLIENTS {
            scope.spawn(|| {
                let mut client = Modbus::connect(gateway.main);
                while running.load(Ordering::Relaxed) {
                    let answered = client.read(HEALTHY, 0x0901, 1).is_ok();
                    count.fetch_add(u32::from(answered), Ordering::Relaxed);
                }
            });
        }
        thread::sleep(ms(200));
        for unit in [NEVER_HEARD, LATELY_SILENT] {
            // A unit that is not in the cell cannot have a fault, and is silent anyway.
            wire.device().set_fault(unit, Fault::Silent);
            // Other programs may disturb one measurement, but not always the same half of it.
            let best = (0..3).map(|_| measure(&wire, &gateway, &count, unit)).find(|left| *left >= LEFT);
            assert!(best.is_some(), "{mode:?}, unit {unit}: less than {LEFT} % left, three times");
        }
    });
}

/// How much of their throughput is left to the others while a silent unit is polled, in percent.
fn measure(wire: &Wire<Cell>, gateway: &Gateway, count: &AtomicU32, unit: u8) -> f64 {
    let probed = wire.pdus(unit).len();
    let mut asked = 0;
    let before = readings(count, || thread::sleep(ms(1000)));
    let with = readings(count, || asked = poll_silent(gateway, unit, ms(4000)));
    let after = readings(count, || thread::sleep(ms(1000)));
    let without = (before + after) / 2.0;
    let (left, probes) = (with / without * 100.0, wire.pdus(unit).len() - probed);
    println!(
        "unit {unit}: {without:.1} readings/s without, {with:.1} with it: {left:.1} %; \
         {asked} requests to it, {probes} on the wire"
    );
    assert!(probes >= 1, "it is tried again");
    left
}
