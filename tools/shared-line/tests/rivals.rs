//! Three masters that know nothing of each other, and modules that answer, on a noisy line.

mod common;

use std::time::Duration;

use common::{Node, Talker, config, drain, join, line, run};
use puente_shared_line::Line;

const MASTERS: [u8; 3] = [1, 2, 3];
const MODULES: [u8; 2] = [17, 18];

fn rivals(noise: f64, seed: u64) -> (Line<Node>, usize) {
    let mut line = line(noise, seed);
    for (at, address) in MASTERS.into_iter().chain(MODULES).enumerate() {
        let peers: &[u8] = if MASTERS.contains(&address) { &MODULES } else { &MASTERS };
        join(&mut line, Talker::new(address, peers).strict(), config(address), seed + 100 * at as u64);
    }
    (line, MASTERS.len() + MODULES.len())
}

/// Every message that was submitted has been received: in its place and unchanged, as [`Talker`] itself makes sure.
fn all_arrived(line: &Line<Node>) -> u64 {
    let mut count = 0;
    for sender in line.nodes().map(|node| &node.application) {
        for (to, submitted) in &sender.submitted {
            let receiver = line.nodes().map(|node| &node.application).find(|node| node.address == *to);
            let last =
                receiver.and_then(|node| node.received.get(&sender.address)).and_then(|all| all.last());
            assert_eq!(last.map_or(0, |last| last + 1), *submitted, "{} to {to}", sender.address);
            count += u64::from(*submitted);
        }
        assert_eq!(sender.heard, [], "nothing was sent outside of the windows");
    }
    count
}

fn nothing_is_lost(bits: u64, noise: f64) {
    let (mut line, stations) = rivals(noise, 42);
    let limit = Duration::from_micros(10 * bits);
    run(&mut line, limit, |line| line.totals().bits >= bits);
    drain(&mut line, stations);
    let messages = all_arrived(&line);
    let totals = line.totals();
    let damaged: u32 = line.nodes().map(|node| node.station.damaged()).sum();
    let collisions: u32 = line.nodes().map(|node| node.station.statistics().collisions).sum();
    println!(
        "{} bits in {:?} on the line, {} wrong ones, {collisions} collisions, {damaged} damaged frames heard, {} \
         spoiled characters; {messages} messages, all delivered once and in order",
        totals.bits,
        line.now().since(puente_line::Instant::ZERO),
        totals.flipped,
        totals.spoiled,
    );
    assert!(damaged > 0 && collisions > 0 && totals.flipped > 0, "the line was too kind to prove anything");
}

#[test]
fn nothing_is_lost_above_the_windows() {
    nothing_is_lost(if cfg!(debug_assertions) { 5_000_000 } else { 20_000_000 }, 1e-5);
}

/// A line that damages every sixth frame or so.
#[test]
fn nothing_is_lost_with_much_noise() {
    nothing_is_lost(5_000_000, 3e-4);
}

/// Takes about a minute: `cargo test --release -p puente-shared-line --test rivals -- --ignored --nocapture`.
#[test]
#[ignore = "10^9 bits; run it built for release"]
fn nothing_is_lost_in_a_billion_bits() {
    nothing_is_lost(1_000_000_000, 1e-5);
}
