//! The line notices every breach of its rules, and carries what stations say as a cable would.

mod common;

use std::collections::VecDeque;
use std::time::Duration;

use common::{Talker, config, fast, join, line};
use puente_framed::arbiter::JAM;
use puente_line::Instant;
use puente_shared_line::{Drive, Heard, Line, Node, Place, Rule, Sense};

/// Does what it is told, when it is told.
#[derive(Default)]
struct Puppet {
    script: VecDeque<(u64, Drive)>,
    heard: Vec<(u64, Heard)>,
    carriers: Vec<u64>,
    /// Asks to be polled at once, for ever.
    restless: bool,
}

impl Puppet {
    fn new(script: &[(u64, Drive)]) -> Self {
        Self { script: script.iter().cloned().collect(), ..Self::default() }
    }

    fn bytes(&self) -> Vec<u8> {
        let byte = |(_, heard): &(u64, Heard)| match heard {
            Heard::Byte(byte) => Some(*byte),
            Heard::Damaged => None,
        };
        self.heard.iter().filter_map(byte).collect()
    }
}

impl Node for Puppet {
    fn hear(&mut self, now: Instant, heard: Heard) {
        self.heard.push((now.as_micros(), heard));
    }

    fn carrier(&mut self, now: Instant) {
        self.carriers.push(now.as_micros());
    }

    fn poll(&mut self, now: Instant) -> Option<Drive> {
        let due = self.script.front().is_some_and(|(at, _)| *at <= now.as_micros());
        if due { self.script.pop_front().map(|(_, drive)| drive) } else { None }
    }

    fn poll_at(&self) -> Option<Instant> {
        if self.restless {
            return Some(Instant::ZERO);
        }
        self.script.front().map(|(at, _)| Instant::from_micros(*at))
    }
}

fn say(bytes: &[u8]) -> Drive {
    Drive::Transmit(bytes.to_vec())
}

fn jam(bytes: &[u8]) -> Drive {
    Drive::Jam(bytes.to_vec())
}

/// A transceiver that is quick, at `position` ns from the end.
fn place(position: u64) -> Place {
    let position = Duration::from_nanos(position);
    Place { position, turnaround: Duration::ZERO, jitter: Duration::ZERO, ..Place::new(fast()) }
}

fn puppets(scripts: &[&[(u64, Drive)]]) -> Line<Puppet> {
    let mut line = Line::new(fast(), Duration::from_micros(20), 0.0, 1);
    for script in scripts {
        line.join(Puppet::new(script), place(0));
    }
    line
}

/// What the line has against the second station.
fn verdict(scripts: &[&[(u64, Drive)]]) -> Option<Rule> {
    let violation = puppets(scripts).run_until(Instant::from_millis(100)).err()?;
    assert_eq!(violation.station, 1, "{violation}");
    Some(violation.rule)
}

#[test]
fn good_manners_pass() {
    assert_eq!(verdict(&[&[(100, say(&[1; 10]))], &[(220, say(&[2; 10])), (340, say(&[3; 10]))]]), None);
}

#[test]
fn talking_into_another_is_noticed() {
    for at in [102, 105, 111, 152, 199] {
        let rule = verdict(&[&[(100, say(&[1; 10]))], &[(at, say(&[2; 10]))]]);
        assert_eq!(rule, Some(Rule::CarrierIgnored), "{at}");
    }
    // Within the first bit nobody can know.
    assert_eq!(verdict(&[&[(100, say(&[1]))], &[(100, say(&[1]))]]), None);
}

#[test]
fn a_gap_that_is_missing_is_noticed() {
    for (at, silence) in [(200, 0), (210, 10), (218, 18)] {
        let rule = verdict(&[&[(100, say(&[1; 10]))], &[(at, say(&[2; 10]))]]);
        assert_eq!(rule, Some(Rule::NoGap { silence: Duration::from_micros(silence) }), "{at}");
    }
    // After one's own frame too.
    let rule = verdict(&[&[], &[(100, say(&[1])), (115, say(&[2]))]]);
    assert_eq!(rule, Some(Rule::NoGap { silence: Duration::from_micros(5) }));
}

#[test]
fn going_on_after_a_collision_is_noticed() {
    let polite = (100, say(&[1; 50]));
    assert_eq!(
        verdict(&[&[polite.clone(), (111, jam(&JAM))], &[(100, say(&[2; 50]))]]),
        Some(Rule::CollisionIgnored)
    );
    let both = [polite, (111, jam(&JAM))];
    assert_eq!(verdict(&[&both, &both]), None, "they say the same");
    assert_eq!(verdict(&[&both, &[(100, say(&[2; 50])), (111, jam(&JAM))]]), None);
}

#[test]
fn a_jam_is_four_times_aa() {
    for wrong in [&[0xAA; 3][..], &[0xAA; 5], &[0x55; 4]] {
        assert_eq!(verdict(&[&[], &[(100, say(&[2; 50])), (121, jam(wrong))]]), Some(Rule::Jam));
    }
}

#[test]
fn talking_without_an_end_is_noticed() {
    assert_eq!(verdict(&[&[], &[(100, say(&[1; 1537]))]]), Some(Rule::Endless));
    assert_eq!(verdict(&[&[], &[(100, say(&[1; 1536]))]]), None);
}

#[test]
fn a_station_that_spins_is_noticed() {
    let mut line = puppets(&[&[], &[]]);
    line.tell(1).restless = true;
    let violation = line.run_until(Instant::from_millis(1)).expect_err("it spins");
    assert_eq!((violation.station, violation.rule), (1, Rule::Spins));
}

/// 10 us a character, 5 us of way, nothing lost.
#[test]
fn characters_take_their_time_and_their_way() {
    let mut line = Line::new(fast(), Duration::from_micros(20), 0.0, 1);
    line.join(Puppet::new(&[(100, say(&[1, 2, 3]))]), place(0));
    line.join(Puppet::default(), place(5_000));
    line.join(
        Puppet { script: [(112, say(&[]))].into(), ..Puppet::default() },
        Place { judged: false, ..place(1_000) },
    );
    line.run_until(Instant::from_millis(1)).expect("manners");
    let times = |station: usize| line.node(station).heard.iter().map(|(at, _)| *at).collect::<Vec<_>>();
    assert_eq!(
        (times(0), times(1), times(2)),
        (vec![110, 120, 130], vec![115, 125, 135], vec![111, 121, 131])
    );
    assert_eq!(line.node(1).bytes(), [1, 2, 3]);
    assert_eq!(line.node(2).carriers, [112], "it was in the middle of the second character");
    let totals = line.totals();
    assert_eq!((totals.characters, totals.bits, totals.spoiled), (3, 30, 0));
}

/// Characters that overlap are garbage for everybody, and what is left of them looks like more characters.
#[test]
fn overlapping_characters_are_garbage() {
    let mut line = puppets(&[&[(100, say(&[0x11; 4]))], &[(104, say(&[0x22; 4]))], &[]]);
    for station in [0, 1] {
        line.place(station).judged = false;
    }
    line.run_until(Instant::from_millis(1)).expect("nobody is judged");
    for node in line.nodes() {
        assert!(node.heard.len() >= 4, "{:?}", node.heard);
        let meant = node.bytes().iter().filter(|byte| matches!(byte, 0x11 | 0x22)).count();
        assert!(meant <= 1, "only by chance: {:?}", node.heard);
        assert_eq!(node.heard.last().map(|(at, _)| *at), Some(144), "until the last of both has ended");
    }
    assert!(line.totals().spoiled > 0);
}

#[test]
fn noise_hits_every_receiver_for_itself() {
    let mut line = Line::new(fast(), Duration::from_micros(20), 1e-2, 1);
    let frames: Vec<_> = (0..30).map(|count| (1_000 + 20_000 * count, say(&[0x55; 1_000]))).collect();
    line.join(Puppet::new(&frames), Place { judged: false, ..place(0) });
    line.join(Puppet::default(), place(0));
    line.run_until(Instant::from_millis(1_000)).expect("nobody is judged");
    let wrong = |station: usize| -> Vec<usize> {
        let heard = line.node(station).heard.iter().enumerate();
        heard.filter(|(_, (_, heard))| *heard != Heard::Byte(0x55)).map(|(at, _)| at).collect()
    };
    // A character of ten bits is hit with 9.6 %.
    for station in [0, 1] {
        assert!((2_600..3_150).contains(&wrong(station).len()), "{}", wrong(station).len());
    }
    let both = wrong(0).iter().filter(|at| wrong(1).binary_search(at).is_ok()).count();
    assert!((180..380).contains(&both), "as often as chance has it: {both}");
    let damaged = line.node(0).heard.iter().filter(|(_, heard)| *heard == Heard::Damaged).count();
    assert!((470..730).contains(&damaged), "start and stop bits: {damaged}");
}

/// The short way for characters that meet no others gives what the long one gives, to the last bit.
#[test]
fn the_shortcut_changes_nothing() {
    let run = |shortcut: bool| {
        let line = line(1e-4, 11);
        let mut line = if shortcut { line } else { line.without_shortcut() };
        for (at, address) in [1, 2, 17].into_iter().enumerate() {
            let peers: &[u8] = if address == 17 { &[1, 2] } else { &[17] };
            join(&mut line, Talker::new(address, peers), config(address), 5 + at as u64);
        }
        line.run_until(Instant::from_millis(1_000)).expect("manners");
        let received: Vec<_> = line.nodes().map(|node| node.application.received.clone()).collect();
        let statistics: Vec<_> = line.nodes().map(|node| node.station.statistics()).collect();
        (line.totals(), received, statistics)
    };
    let (short, long) = (run(true), run(false));
    assert_eq!(short, long);
    assert!(short.0.flipped > 50 && short.0.spoiled > 50);
}

/// A station that notices others by whole characters only is judged by what it can know, and gets on all the same.
#[test]
fn slow_ears_break_no_rule() {
    let mut line = line(0.0, 4);
    for (at, address) in [1, 2, 17].into_iter().enumerate() {
        let peers: &[u8] = if address == 17 { &[1, 2] } else { &[17] };
        join(&mut line, Talker::new(address, peers), config(address), 5 + at as u64);
        line.place(at).sense = Sense::Character;
    }
    line.run_until(Instant::from_millis(2_000)).expect("manners");
    let confirmed: u64 = line.nodes().map(|node| node.application.confirmed).sum();
    assert!(confirmed > 1_000, "{confirmed}");
}
