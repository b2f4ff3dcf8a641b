//! Two gateways, three modules.

use std::time::Duration;

use puente_drives::pid::{Cause, Event, State};
use puente_modules::{Control, Form};

use crate::rig::Rig;

/// Gateway 1 with two axes and gateway 2 with one, all of them moving.
fn moving(noise: f64, seed: u64) -> Rig {
    let mut rig = Rig::new(noise, seed);
    rig.gateway(1, 5, &[(17, Form::Binary), (18, Form::Binary)]);
    rig.gateway(2, 5, &[(19, Form::Text)]);
    for (address, form) in [(17, Form::Binary), (18, Form::Binary), (19, Form::Text)] {
        rig.module(address, form);
    }
    rig.enable(1, &[0, 1]);
    rig.enable(2, &[0]);
    rig.want(1, 0, Control::Follow, 1_100_000);
    rig.want(1, 1, Control::Follow, 900_000);
    rig.want(2, 0, Control::Follow, 1_080_000);
    rig.run_ms(100);
    assert_eq!([17, 18, 19].map(|address| rig.of(address).state()), [State::Enabled; 3]);
    rig
}

/// Acceptance: one gateway dies mid-move; its axes stop, the other's do not notice.
#[test]
fn the_axes_of_a_dead_gateway_stop() {
    let mut rig = moving(0.0, 1);
    let before = rig.of(17).position;
    rig.kill(1);
    rig.run_ms(99);
    assert!(rig.of(17).position > before, "it was moving");
    rig.run_ms(10);
    for address in [17, 18] {
        assert_eq!(rig.of(address).state(), State::Fault(Cause::Communication));
    }
    let stopped = [17, 18].map(|address| rig.of(address).position);
    rig.run_ms(800);
    assert_eq!([17, 18].map(|address| rig.of(address).position), stopped);
    let gateway = rig.at(2);
    assert_eq!((gateway.fell.len(), gateway.missed.len(), gateway.master.statistics().failed), (0, 0, 0));
    assert!((rig.of(19).position - 1_080_000.0).abs() < 30.0, "{}", rig.of(19).position);
    assert_eq!(rig.of(19).state(), State::Enabled);
    assert_eq!(rig.at(2).events, [(0, Event::Enabled)]);
}

/// Whatever the cycles, even where the line cannot carry them: both get their share of it, in turn, and nobody's answers
/// meet another's frames.
#[test]
fn gateways_share_a_line_that_is_too_slow_for_them() {
    for (first, second) in [(2, 2), (0, 0), (2, 0), (5, 5)] {
        let mut rig = Rig::new(0.0, 1);
        rig.gateway(1, first, &[(17, Form::Text), (18, Form::Text)]);
        rig.gateway(2, second, &[(19, Form::Text)]);
        for address in [17, 18, 19] {
            rig.module(address, Form::Text);
        }
        rig.enable(1, &[0, 1]);
        rig.enable(2, &[0]);
        rig.run_ms(2_000);
        let cycles = [1, 2].map(|address| {
            let gateway = rig.at(address);
            let statistics = gateway.master.statistics();
            println!("{first} ms and {second} ms: {address}: {statistics:?}");
            assert_eq!((gateway.fell.len(), gateway.missed.len(), statistics.failed), (0, 0, 0));
            assert!(statistics.longest_cycle < Duration::from_millis(25), "{statistics:?}");
            assert!(statistics.line.collisions * 20 < statistics.cycles, "{statistics:?}");
            statistics.cycles
        });
        assert!(cycles[0].abs_diff(cycles[1]) * 20 < cycles[0], "{cycles:?}");
    }
}
