//! One gateway, its cycle, and its axes.

use puente_drives::pid::State;
use puente_modules::{Control, Form};

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
