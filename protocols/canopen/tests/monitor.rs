//! Heartbeat consumer and guarding master.

mod common;

use common::{any_frame, frame, ms};
use proptest::prelude::*;
use puente_canopen::monitor::{Action, Event, Supervision};
use puente_canopen::nmt::State;
use puente_canopen::{Frame, Monitor, NodeId};
use puente_line::{Duration, Instant};

fn node() -> NodeId {
    NodeId::new(2).expect("a node-ID")
}

const HEARTBEAT: Supervision = Supervision::Heartbeat { timeout: Duration::from_millis(300) };
const GUARDING: Supervision = Supervision::Guarding { time: Duration::from_millis(100), factor: 2 };

/// All that a poll brings, until it is idle.
fn poll(monitor: &mut Monitor, now: Instant) -> (Vec<Event>, Vec<Frame>) {
    let (mut events, mut frames) = (Vec::new(), Vec::new());
    for _ in 0..10 {
        match monitor.poll(now) {
            Action::Event(event) => events.push(event),
            Action::Transmit(frame) => frames.push(frame),
            Action::Idle => return (events, frames),
        }
    }
    panic!("it spins");
}

fn hear(monitor: &mut Monitor, at: u64, bytes: &str) -> Vec<Event> {
    monitor.receive(ms(at), &frame(0x702, bytes));
    poll(monitor, ms(at)).0
}

#[test]
fn a_heartbeat_counts_from_the_first_one_on() {
    let mut monitor = Monitor::new(node(), HEARTBEAT, ms(0));
    assert_eq!((monitor.poll_at(), monitor.state()), (None, None));
    assert_eq!(poll(&mut monitor, ms(100_000)), (vec![], vec![]), "never seen, never lost");
    assert_eq!(hear(&mut monitor, 100_000, "7F"), [Event::Started(State::PreOperational)]);
    assert_eq!(monitor.poll_at(), Some(ms(100_300)));
    assert_eq!(hear(&mut monitor, 100_299, "7F"), []);
    let changed = Event::Changed { from: State::PreOperational, to: State::Operational };
    assert_eq!(hear(&mut monitor, 100_500, "05"), [changed]);
    assert_eq!(poll(&mut monitor, ms(100_799)).0, []);
    assert_eq!(poll(&mut monitor, ms(100_800)).0, [Event::Lost(HEARTBEAT)]);
    assert_eq!((monitor.state(), monitor.is_lost(), monitor.poll_at()), (None, true, None));
    assert_eq!(poll(&mut monitor, ms(200_000)).0, [], "once");
    assert_eq!(hear(&mut monitor, 200_001, "05"), [Event::Resumed(State::Operational)]);
}

#[test]
fn a_boot_up_is_told_even_of_a_lost_node() {
    let mut monitor = Monitor::new(node(), HEARTBEAT, ms(0));
    hear(&mut monitor, 1, "05");
    assert_eq!(hear(&mut monitor, 2, "00"), [Event::BootUp]);
    assert_eq!((monitor.state(), monitor.poll_at()), (None, None), "it has still to be configured");
    assert_eq!(hear(&mut monitor, 3, "7F"), [Event::Started(State::PreOperational)]);
    assert_eq!(hear(&mut monitor, 9_000, "00"), [Event::Lost(HEARTBEAT), Event::BootUp]);
}

#[test]
fn what_is_no_heartbeat_does_not_count() {
    let mut monitor = Monitor::new(node(), HEARTBEAT, ms(0));
    for bytes in ["85", "40", "", "05 00"] {
        assert_eq!(hear(&mut monitor, 1, bytes), [], "{bytes}");
    }
    monitor.receive(ms(1), &frame(0x703, "05"));
    monitor.receive(ms(1), &Frame::remote(frame(0x702, "").id(), 1));
    assert_eq!((poll(&mut monitor, ms(1)).0, monitor.poll_at()), (vec![], None));
}

#[test]
fn guarding_asks_and_checks_the_toggle_bit() {
    let mut monitor = Monitor::new(node(), GUARDING, ms(0));
    let ask = Frame::remote(frame(0x702, "").id(), 1);
    assert_eq!(poll(&mut monitor, ms(0)), (vec![], vec![ask]));
    assert_eq!(
        hear(&mut monitor, 1, "FF"),
        [Event::Started(State::PreOperational)],
        "any toggle bit to begin with"
    );
    assert_eq!(monitor.poll_at(), Some(ms(100)));
    assert_eq!(poll(&mut monitor, ms(100)).1, [ask]);
    let changed = Event::Changed { from: State::PreOperational, to: State::Operational };
    assert_eq!(hear(&mut monitor, 101, "05"), [changed]);
    // The same bit again: as if it had not come, so that the time since 101 counts.
    assert_eq!(hear(&mut monitor, 201, "05"), [Event::Toggle]);
    assert_eq!(poll(&mut monitor, ms(300)).0, []);
    assert_eq!(poll(&mut monitor, ms(301)).0, [Event::Lost(GUARDING)]);
    assert_eq!(poll(&mut monitor, ms(400)).1, [ask], "it goes on asking");
    assert_eq!(
        hear(&mut monitor, 401, "05"),
        [Event::Resumed(State::Operational)],
        "any toggle bit after a loss"
    );
    assert_eq!(hear(&mut monitor, 500, "00"), [Event::BootUp]);
    assert_eq!(hear(&mut monitor, 501, "FF"), [Event::Toggle], "after a boot-up it begins with 0");
    assert_eq!(hear(&mut monitor, 502, "7F"), [Event::Started(State::PreOperational)]);
}

#[test]
fn a_node_that_never_answers_is_lost() {
    let mut monitor = Monitor::new(node(), GUARDING, ms(1_000));
    let mut asked = 0;
    let mut lost = Vec::new();
    let mut now = ms(1_000);
    while now < ms(2_000) {
        let (events, frames) = poll(&mut monitor, now);
        asked += frames.len();
        lost.extend(events.into_iter().map(|event| (now, event)));
        now = monitor.poll_at().expect("it goes on");
    }
    assert_eq!(asked, 10);
    assert_eq!(lost, [(ms(1_200), Event::Lost(GUARDING))]);
}

#[test]
fn unwatched_nodes_are_taken_note_of() {
    let mut monitor = Monitor::new(node(), Supervision::Off, ms(0));
    assert_eq!(hear(&mut monitor, 1, "85"), [Event::Started(State::Operational)]);
    assert_eq!((monitor.state(), monitor.poll_at()), (Some(State::Operational), None));
}

proptest! {
    /// Losses and returns take turns, whatever comes; and polling does not spin.
    #[test]
    fn lost_and_back_take_turns(
        guarded: bool,
        steps in prop::collection::vec((any_frame(), 0..400_u64), 0..60),
    ) {
        let supervision = if guarded { GUARDING } else { HEARTBEAT };
        let mut monitor = Monitor::new(node(), supervision, ms(0));
        let (mut at, mut lost) = (0, false);
        for (frame, pause) in steps {
            at += pause;
            monitor.receive(ms(at), &frame);
            for event in poll(&mut monitor, ms(at)).0 {
                match event {
                    Event::Lost(_) => {
                        prop_assert!(!lost);
                        lost = true;
                    }
                    Event::Resumed(_) => {
                        prop_assert!(lost);
                        lost = false;
                    }
                    Event::BootUp => lost = false,
                    Event::Started(_) | Event::Changed { .. } => prop_assert!(!lost),
                    Event::Toggle => {}
                }
            }
            prop_assert_eq!(monitor.is_lost(), lost);
            prop_assert!(monitor.poll_at().is_none_or(|due| due > ms(at)));
        }
    }
}
