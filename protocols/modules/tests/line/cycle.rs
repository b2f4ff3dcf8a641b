//! One gateway, its cycle, and its axes.

use puente_drives::pid::{Event, State};
use puente_framed::{Kind, frame, section};
use puente_modules::{Control, Form, Setting};

use crate::rig::Rig;

#[test]
fn an_axis_is_enabled_moves_and_is_disabled() {
    for form in [Form::Text, Form::Binary] {
        let mut rig = Rig::new(0.0, 1);
        rig.gateway(1, 2, &[(17, form)]);
        rig.module(17, form);
        rig.enable(1, &[0]);
        rig.want(1, 0, Control::Follow, 1_005_000);
        rig.run_ms(500);
        let report = rig.at(1).last(0).expect("a report");
        assert_eq!((report.state, report.refused), (State::Enabled, None));
        assert!((report.position - 1_005_000).abs() < 20, "{report:?}");
        assert_eq!(report.position, rig.of(17).position as i32);
        rig.want(1, 0, Control::Hold, 0);
        rig.run_ms(10);
        assert_eq!(rig.at(1).last(0).map(|report| report.state), Some(State::Held));
        rig.want(1, 0, Control::Off, 0);
        rig.run_ms(10);
        assert_eq!(rig.of(17).state(), State::Disabled);
        let gateway = rig.at(1);
        assert_eq!((gateway.fell.len(), gateway.missed.len()), (0, 0));
        let statistics = gateway.master.statistics();
        assert_eq!(
            (statistics.failed, statistics.overruns, statistics.line.collisions),
            (0, 0, 0),
            "{statistics:?}"
        );
    }
}

/// Three axes in text take more than there is of 2 ms: they are asked in turn, and nothing is late.
#[test]
fn axes_are_asked_in_turn_where_there_is_no_time_for_all() {
    let axes = [(17, Form::Text), (18, Form::Text), (19, Form::Text)];
    let mut rig = Rig::new(0.0, 1);
    rig.gateway(1, 2, &axes);
    for (address, form) in axes {
        rig.module(address, form);
    }
    rig.enable(1, &[0, 1, 2]);
    for axis in 0..3 {
        rig.want(1, axis, Control::Follow, 1_234_567);
    }
    rig.run_ms(500);
    let (reports, before) = (rig.at(1).reports.len(), rig.at(1).master.statistics());
    rig.run_ms(300);
    let gateway = rig.at(1);
    let statistics = gateway.master.statistics();
    assert_eq!((statistics.overruns, statistics.missed), (before.overruns, 0), "{statistics:?}");
    assert_eq!(statistics.line.collisions, before.line.collisions, "{statistics:?}");
    assert!((149..=151).contains(&(statistics.cycles - before.cycles)), "{statistics:?}");
    let axes: Vec<_> = gateway.reports[reports..].iter().map(|(_, axis, _)| *axis).collect();
    assert!(axes.len() >= 149, "at least one a cycle");
    assert!(axes.windows(2).all(|pair| pair[1] == (pair[0] + 1) % 3), "{axes:?}");
}

/// An event comes soon, even where one cycle follows the other at once: a module does not rest after an answer.
#[test]
fn an_event_gets_a_word_in() {
    for cycle in [0, 2] {
        let mut rig = Rig::new(0.0, 1);
        rig.gateway(1, cycle, &[(17, Form::Text)]);
        rig.module(17, Form::Text);
        rig.run_ms(20);
        rig.want(1, 0, Control::Hold, 0);
        // The amplifier takes 20 ms.
        rig.run_ms(30);
        assert_eq!(rig.at(1).events, [(0, Event::Enabled)], "{cycle} ms");
    }
}

/// A client's frames go between two cycles, even where those follow each other without a pause, and their answers come back
/// whole.
#[test]
fn a_client_gets_his_turn() {
    for cycle in [0, 2] {
        let mut rig = Rig::new(0.0, 1);
        rig.gateway(1, cycle, &[(17, Form::Binary)]);
        rig.module(17, Form::Binary);
        rig.module(18, Form::Binary);
        rig.enable(1, &[0]);
        let setting = Setting { kp: 1.0, ..Setting::default() };
        let data = setting.emit(Form::Binary).expect("it fits");
        for origin in [0, 200] {
            let mut frame = heapless::Vec::<u8, 300>::new();
            frame::build(&mut frame, origin, Kind::Plain, |body| Ok(section::push(body, 18, &data)?))
                .expect("a frame");
            let before = rig.at(1).master.statistics();
            rig.at_mut(1).heard.clear();
            rig.at_mut(1).client = vec![frame.to_vec(); 10];
            rig.run_ms(40);
            let gateway = rig.at(1);
            let client = if origin == 0 { 1 } else { origin };
            let answers = gateway.heard.iter().filter(|bytes| {
                let frame = frame::parse(bytes).expect("a frame");
                assert_ne!(frame.origin, origin, "not what he has said himself");
                frame.origin == 18 && frame.destination() == client
            });
            assert_eq!(answers.count(), 10, "{cycle} ms, {origin}");
            let after = gateway.master.statistics();
            assert!(after.cycles - before.cycles >= 10, "a cycle between any two");
            assert_eq!(after.line.collisions, before.line.collisions, "{cycle} ms, {origin}");
            assert_eq!((gateway.missed.len(), gateway.fell.len()), (0, 0));
        }
        assert_eq!(rig.at(1).posted, [true; 20]);
        assert_eq!(rig.of(17).state(), State::Held);
    }
}

#[test]
fn a_gateway_that_does_not_hear_itself() {
    let axes = [(17, Form::Text), (18, Form::Binary)];
    let mut rig = Rig::new(0.0, 1);
    rig.gateway_without_echo(1, 2, &axes);
    for (address, form) in axes {
        rig.module(address, form);
    }
    rig.enable(1, &[0, 1]);
    rig.want(1, 0, Control::Follow, 1_005_000);
    rig.want(1, 1, Control::Follow, 995_000);
    rig.run_ms(500);
    let reports = [0, 1].map(|axis| rig.at(1).last(axis).expect("a report").position);
    assert!((reports[0] - 1_005_000).abs() < 20 && (reports[1] - 995_000).abs() < 20, "{reports:?}");
    let statistics = rig.at(1).master.statistics();
    assert_eq!((statistics.failed, statistics.overruns, rig.at(1).fell.len()), (0, 0, 0), "{statistics:?}");
    assert!(statistics.cycles > 280, "{statistics:?}");
}
