//! Modules that do what they are told.

use std::time::Duration;

use puente_cell::framed::{Cell, Config};
use puente_drives::pid::State;
use puente_line::Instant;
use puente_modules::{Control, Form, Setting};

use crate::{Rig, config, order};

const TARGETS: [(u8, i32); 3] = [(17, 5_000), (18, -3_000), (19, 800)];

#[test]
fn three_axes_go_where_they_are_told() {
    for form in [Form::Text, Form::Binary] {
        let mut config = config();
        config.modules.iter_mut().for_each(|module| module.form = form);
        let mut rig = Rig::new(config);
        rig.enable(&[17, 18, 19]);
        for (address, target) in TARGETS {
            rig.want(&[address], order(Control::Follow, target));
        }
        rig.milliseconds(600);
        for (address, target) in TARGETS {
            let report = rig.report(address);
            assert_eq!((report.state, report.refused), (State::Enabled, None));
            assert!((report.position - target).abs() < 20, "{form:?} {address}: {report:?}");
            assert!((rig.position(address) - f64::from(target)).abs() < 20.0);
            assert_eq!(rig.cell.module(address).expect("a module").commander(), Some(1));
        }
        assert_eq!(rig.events.len(), 3, "enabled, each of them: {:?}", rig.events);
    }
}

/// Every one of them answers in every cycle, and none talks into another.
#[test]
fn three_answers_a_cycle_do_not_collide() {
    let mut rig = Rig::new(config());
    rig.enable(&[17, 18, 19]);
    let collisions = |rig: &Rig| -> u32 {
        let modules = rig.cell.modules().map(|(_, module)| module.statistics());
        modules.chain([rig.statistics()]).map(|statistics| statistics.collisions).sum()
    };
    let (before, collided) = (rig.statistics(), collisions(&rig));
    rig.milliseconds(1_000);
    assert_eq!(collisions(&rig), collided);
    let cycles = rig.statistics().frames - before.frames;
    assert!((248..=251).contains(&cycles), "{cycles}");
    for (address, _) in TARGETS {
        let answers = rig.reports.iter().filter(|(from, _)| *from == address).count() as u32;
        assert!(answers + 1 >= cycles, "{address}: {answers} of {cycles}");
    }
}

#[test]
fn a_held_axis_carries_a_load_and_comes_to_rest() {
    let mut rig = Rig::new(config());
    rig.enable(&[17]);
    rig.want(&[17], Setting { ki: 3e-3, ..order(Control::Hold, 0) });
    assert!(rig.cell.disturb(Instant::ZERO, "17 torque 0.1".parse().expect("words")));
    rig.milliseconds(20);
    assert!(rig.position(17) < 0.0, "it gives way at first: {}", rig.position(17));
    rig.milliseconds(2_500);
    assert!(rig.position(17).abs() < 10.0, "{}", rig.position(17));
    assert_eq!(rig.velocity(18), 0.0);
}

/// However often the cell is polled, the same bytes at the same times lead to the same.
#[test]
fn it_does_not_matter_when_it_is_looked_at() {
    let run = |step: u64| {
        let mut rig = Rig::new(Config { rivals: 2, load: 0.3, noise: 1e-5, ..config() });
        rig.enable(&[17, 18, 19]);
        rig.want(&[17], order(Control::Follow, 2_000));
        rig.milliseconds(50);
        let mut now = 2_000_000;
        let mut heard = Vec::new();
        for until in [2_010_007, 2_300_000] {
            while now < until {
                now = (now + step).min(until);
                heard.extend(rig.cell.poll(0, Instant::from_micros(now)).unwrap_or_default());
            }
            rig.cell.receive(0, Instant::from_micros(now), &[1, 2, 3]);
        }
        let positions = [17, 18, 19].map(|address| rig.position(address).to_bits());
        (heard, positions, rig.cell.totals())
    };
    let once = run(1_000_000);
    assert_eq!(once, run(33));
    assert_eq!(once, run(1_700));
    assert!(once.0.len() > 100, "the rivals have talked");
}

#[test]
fn the_seed_decides_what_is_random() {
    let run = |seed| {
        let mut cell =
            Cell::new(Config { rivals: 3, load: 0.5, noise: 1e-4, seed, ..config() }).expect("a cell");
        (cell.poll(0, Instant::from_millis(300)), cell.totals())
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn time_does_not_go_back() {
    let mut cell = Cell::new(config()).expect("a cell");
    cell.receive(0, Instant::from_millis(10), &[1]);
    cell.receive(0, Instant::from_millis(5), &[2]);
    assert_eq!(cell.poll(0, Instant::from_millis(5)), None);
    let at = Instant::from_millis(10) + Duration::from_micros(25);
    assert_eq!(cell.poll(0, at), Some(vec![1, 2]));
}
