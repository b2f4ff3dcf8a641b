//! The bus itself.

use std::time::Duration;

use puente_canopen::{Frame, Id};
use puente_cell::can::bus::{Bus, Event, Order, State};
use puente_line::Instant;

const END: Instant = Instant::from_millis(60_000);

fn data(id: u16, data: &[u8]) -> Frame {
    Frame::new(Id::base(id), data).unwrap()
}

fn bus(seats: usize) -> Bus {
    let mut bus = Bus::new(1_000_000, 7);
    for _ in 0..seats {
        bus.join(Order::Given);
    }
    bus
}

/// What goes over the bus until an end: when it was heard, and what.
fn run(bus: &mut Bus, until: Instant) -> Vec<(u64, Frame)> {
    let mut frames = Vec::new();
    while let Some(event) = bus.step(until) {
        if let Event::Frame(sent) = event {
            frames.push((sent.at.as_micros(), sent.frame));
        }
    }
    frames
}

#[test]
fn frames_that_begin_together_go_by_their_identifiers() {
    // In the order in which they win: lower base identifiers; data before remote; base before extended of the same
    // beginning; the lower 18 bits.
    let order = [
        data(0x080, &[]),
        data(0x181, &[1]),
        Frame::remote(Id::base(0x181), 1),
        Frame::new(Id::extended(0x181 << 18), &[2]).unwrap(),
        Frame::remote(Id::extended(0x181 << 18), 2),
        Frame::new(Id::extended(0x181 << 18 | 1), &[3]).unwrap(),
        data(0x182, &[]),
        data(0x7FF, &[]),
    ];
    let mut bus = bus(order.len() + 1);
    for (seat, frame) in order.iter().enumerate().rev() {
        bus.send(Instant::ZERO, seat, *frame);
    }
    let mut at = 0;
    let expected = order.map(|frame| {
        let heard = at + u64::from(frame.bits()) - 3;
        at += u64::from(frame.bits());
        (heard, frame)
    });
    assert_eq!(run(&mut bus, END), expected);
    let heard: Vec<_> = std::iter::from_fn(|| bus.take(order.len())).map(|heard| heard.frame).collect();
    assert_eq!(heard, order);
    let own: Vec<_> = std::iter::from_fn(|| bus.take(0)).map(|heard| heard.frame).collect();
    assert_eq!(own, order[1..], "nobody hears its own frame");
    let bits: u32 = order.iter().map(Frame::bits).sum();
    assert_eq!((bus.totals().frames, bus.totals().bits), (8, u64::from(bits)));
    let last = bits - order[7].bits();
    assert_eq!(bus.totals().longest_wait, Duration::from_micros(last.into()));
    assert_eq!(bus.longest_wait(7), Duration::from_micros(last.into()));
}

#[test]
fn a_frame_on_the_bus_is_not_interrupted() {
    let mut bus = bus(2);
    let (long, urgent) = (data(0x7F0, &[0xAA; 8]), data(0x001, &[]));
    bus.send(Instant::ZERO, 0, long);
    let soon = Instant::from_micros(10);
    assert_eq!(run(&mut bus, soon), []);
    bus.send(soon, 1, urgent);
    let frames = run(&mut bus, END);
    let free = u64::from(long.bits());
    assert_eq!(frames, [(free - 3, long), (free + u64::from(urgent.bits()) - 3, urgent)]);
    assert_eq!(bus.longest_wait(1), Duration::from_micros(free - 10), "the blocking of one frame");
}

#[test]
fn a_node_alone_is_not_acknowledged_and_stays_passive() {
    let mut bus = bus(2);
    bus.set_present(1, false);
    bus.send(Instant::ZERO, 0, data(0x701, &[0]));
    assert_eq!(run(&mut bus, Instant::from_millis(100)), []);
    let counters = bus.counters(0);
    assert_eq!((counters.transmit(), counters.state()), (128, State::Passive), "ISO 11898-1: no bus off");
    assert!(bus.totals().errors > 100);
    bus.set_present(1, true);
    assert_eq!(run(&mut bus, Instant::from_millis(101)).len(), 1);
    assert_eq!(bus.take(1).map(|heard| heard.frame), Some(data(0x701, &[0])));
}

#[test]
fn two_who_send_the_same_identifier_destroy_each_other() {
    let mut bus = bus(3);
    bus.send(Instant::ZERO, 0, data(0x182, &[1, 2]));
    bus.send(Instant::ZERO, 1, data(0x182, &[1, 3]));
    while bus.counters(0).state() != State::Off {
        let at = bus.poll_at().unwrap();
        assert!(!matches!(bus.step(at), Some(Event::Frame(_))));
    }
    // 8 an attempt, more than 255: 32 attempts.
    assert_eq!((bus.totals().errors, bus.counters(0).bus_offs(), bus.counters(1).bus_offs()), (32, 1, 1));
    assert_eq!(bus.counters(2).receive(), 32, "those who hear it count it");
    // Both recover at the same moment, 128 times 11 bits later, and meet again.
    let from = Instant::from_micros(bus.totals().bits);
    let back = bus.poll_at().unwrap();
    // The delimiter of the last error frame was the first of them.
    assert!(back.since(from) >= Duration::from_micros(127 * 11), "{:?}", back.since(from));
    bus.step(back);
    assert_eq!((bus.counters(0).state(), bus.counters(1).state()), (State::Active, State::Active));
}

#[test]
fn two_who_send_the_very_same_frame_are_heard_as_one() {
    let mut bus = bus(3);
    for seat in 0..2 {
        bus.send(Instant::ZERO, seat, data(0x080, &[]));
    }
    assert_eq!(run(&mut bus, END).len(), 1);
    assert_eq!((bus.pending(0), bus.pending(1)), (0, 0));
    assert!(bus.take(2).is_some() && bus.take(2).is_none());
}

#[test]
fn a_destroyed_frame_is_sent_again_until_it_is_through() {
    let mut bus = bus(2);
    bus.set_errors(0.3);
    let frames: Vec<_> = (0..1_000_u16).map(|count| data(0x200, &count.to_le_bytes())).collect();
    for frame in &frames {
        bus.send(Instant::ZERO, 0, *frame);
    }
    run(&mut bus, END);
    let heard: Vec<_> = std::iter::from_fn(|| bus.take(1)).map(|heard| heard.frame).collect();
    assert_eq!(heard, frames, "each once, in order");
    let errors = bus.totals().errors;
    // 1000 · 0.3 / 0.7.
    assert!((350..=510).contains(&errors), "{errors}");
}

#[test]
fn dropped_frames_are_gone() {
    let mut bus = bus(2);
    bus.set_drop(0.01);
    for count in 0..10_000_u16 {
        bus.send(Instant::ZERO, 0, data(0x200, &count.to_le_bytes()));
    }
    run(&mut bus, END);
    let heard = std::iter::from_fn(|| bus.take(1)).count() as u64;
    let dropped = bus.totals().dropped;
    assert_eq!(heard + dropped, 10_000);
    assert!((60..=140).contains(&dropped), "{dropped}");
    assert_eq!(bus.pending(0), 0);
}

#[test]
fn who_babbles_leaves_only_what_wins_against_it() {
    let mut bus = bus(3);
    let noise = data(0x100, &[0; 8]);
    bus.babble(2, noise, Instant::from_millis(10));
    bus.send(Instant::from_micros(50), 0, data(0x080, &[]));
    bus.send(Instant::from_micros(50), 1, data(0x200, &[]));
    let frames = run(&mut bus, END);
    let at = |id| frames.iter().find(|(_, frame)| frame.id() == Id::base(id)).unwrap().0;
    let bits = u64::from(noise.bits());
    assert_eq!(at(0x080), bits + u64::from(data(0x080, &[]).bits()) - 3, "after one frame");
    assert!(at(0x200) > 10_000, "after the babbling");
    assert!(bus.longest_wait(1) > Duration::from_micros(9_900));
    assert!(bus.totals().bits >= 10_000, "all of the time");
}

#[test]
fn a_seat_that_is_off_comes_back_by_itself() {
    let mut bus = bus(2);
    bus.switch_off(0);
    bus.send(Instant::ZERO, 0, data(0x181, &[]));
    bus.send(Instant::ZERO, 1, data(0x182, &[]));
    // Nobody acknowledges the other one meanwhile.
    assert_eq!(bus.counters(0).state(), State::Off);
    let frames = run(&mut bus, END);
    assert_eq!(frames.len(), 2);
    assert_eq!((bus.counters(0).state(), bus.counters(0).bus_offs()), (State::Active, 1));
}

/// What a controller sends next is decided when the bus is free, not when it was given.
#[test]
fn a_controller_may_send_its_lowest_identifier_first() {
    let mut bus = Bus::new(1_000_000, 1);
    let (from, _) = (bus.join(Order::Identifier), bus.join(Order::Given));
    let frames = [data(0x700, &[1]), data(0x181, &[1]), data(0x181, &[2]), data(0x080, &[])];
    bus.send(Instant::ZERO, from, frames[0]);
    run(&mut bus, Instant::from_micros(5));
    for frame in &frames[1..] {
        bus.send(Instant::from_micros(5), from, *frame);
    }
    let order: Vec<_> = run(&mut bus, END).into_iter().map(|(_, frame)| frame).collect();
    assert_eq!(order, [frames[0], frames[3], frames[1], frames[2]]);
}

#[test]
fn bit_rates() {
    for (bitrate, bit) in
        [(1_000_000, 1), (500_000, 2), (250_000, 4), (125_000, 8), (50_000, 20), (10_000, 100)]
    {
        let mut bus = Bus::new(bitrate, 1);
        let (from, _) = (bus.join(Order::Given), bus.join(Order::Given));
        let frame = data(0x2AA, &[0x55; 5]);
        bus.send(Instant::ZERO, from, frame);
        assert_eq!(run(&mut bus, END), [(bit * (u64::from(frame.bits()) - 3), frame)]);
    }
}
