//! The state machine.

use proptest::prelude::*;
use puente_drives::cia402::{
    Command, Controlword, Goal, Machine, Mode, Preset, Progress, State, Statusword, object, presets,
    transition,
};

use crate::drive::Drive;

fn name(state: State) -> &'static str {
    match state {
        State::NotReadyToSwitchOn => "not ready",
        State::SwitchOnDisabled => "switch on disabled",
        State::ReadyToSwitchOn => "ready",
        State::SwitchedOn => "switched on",
        State::OperationEnabled => "enabled",
        State::QuickStopActive => "quick stop",
        State::FaultReactionActive => "fault reaction",
        State::Fault => "fault",
    }
}

/// Works towards the goal until nothing changes any more, presets included; the controlwords that were sent.
fn work(machine: &mut Machine, drive: &mut Drive, presets: bool) -> (Vec<u16>, Progress) {
    let mut sent = Vec::new();
    for _ in 0..20 {
        let advice = machine.advise(Statusword(drive.status()));
        if drive.control != advice.word.0 {
            sent.push(advice.word.0);
            drive.write(advice.word.0);
        } else if advice.progress == Progress::Preset && presets {
            machine.set_preset();
        } else if advice.progress != Progress::OnTheWay || machine.goal() != Goal::Reset {
            return (sent, advice.progress);
        }
    }
    (sent, Progress::OnTheWay)
}

#[test]
fn statuswords_of_the_thesis() {
    let told = [
        (0x0240, State::SwitchOnDisabled),
        (0x0221, State::ReadyToSwitchOn),
        (0x0223, State::SwitchedOn),
        (0x0623, State::SwitchedOn),
        (0x0637, State::OperationEnabled),
        (0x0237, State::OperationEnabled),
        (0x9237, State::OperationEnabled),
        (0x8637, State::OperationEnabled),
        (0x9637, State::OperationEnabled),
    ];
    for (word, state) in told {
        assert_eq!(Statusword(word).state(), Some(state), "{word:04X}");
    }
    assert_eq!(Statusword(0x0001).state(), None);
    assert_eq!(Statusword(0x0001).to_string(), "0001h, which is no state");
    let names: Vec<_> = Statusword(0x9637).names().collect();
    let expected = [
        "ready-to-switch-on",
        "switched-on",
        "operation-enabled",
        "voltage-enabled",
        "no-quick-stop",
        "remote",
        "target-reached",
        "mode-12",
    ];
    assert_eq!(names, expected);
}

/// Each statusword tells one state at most, and each state has its words.
#[test]
fn masks() {
    let mut counts = [0_u32; 8];
    for word in 0..=u16::MAX {
        let fitting: Vec<_> =
            State::ALL.iter().filter(|state| word & state.pattern().0 == state.pattern().1).collect();
        assert!(fitting.len() <= 1, "{word:04X}");
        assert_eq!(Statusword(word).state().as_ref(), fitting.first().copied());
        if let Some(state) = fitting.first() {
            counts[State::ALL.iter().position(|other| other == *state).expect("a state")] += 1;
        }
    }
    // 5 bits tell it, or 6.
    assert_eq!(counts, [2_048, 2_048, 1_024, 1_024, 1_024, 1_024, 2_048, 2_048]);
}

/// The words of the thesis, 6.4.1: 06, 07, 0F.
#[test]
fn a_drive_is_enabled_and_disabled() {
    let mut drive = Drive::new("switch on disabled");
    let mut machine = Machine::new();
    machine.set_goal(Goal::Enabled);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x06, 0x07, 0x0F], Progress::Reached));
    assert_eq!(drive.numbers, [2, 3, 4]);
    machine.set_goal(Goal::QuickStopped);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x02], Progress::Reached));
    assert_eq!(drive.state, "quick stop");
    // It moves still: without current it would run out.
    machine.set_goal(Goal::Enabled);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![], Progress::OnTheWay));
    drive.flags |= Statusword::TARGET_REACHED;
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x00, 0x06, 0x07, 0x0F], Progress::Reached));
    assert_eq!(drive.numbers, [2, 3, 4, 11, 12, 2, 3, 4]);
    machine.set_goal(Goal::Off);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x07, 0x06, 0x00], Progress::Reached));
    assert_eq!(drive.numbers[8..], [5, 6, 7]);
    let mut drive = Drive::new("enabled");
    drive.control = 0x0F;
    machine.set_goal(Goal::Unpowered);
    assert_eq!(
        (work(&mut machine, &mut drive, true), drive.numbers),
        ((vec![0x00], Progress::Reached), vec![9])
    );
}

#[test]
fn no_current_before_the_set_points_are_where_the_drive_stands() {
    let mut drive = Drive::new("switch on disabled");
    let mut machine = Machine::new();
    machine.set_goal(Goal::Enabled);
    // Too early: it does not count.
    machine.set_preset();
    assert_eq!(work(&mut machine, &mut drive, false), (vec![0x06, 0x07], Progress::Preset));
    assert_eq!(drive.state, "switched on");
    machine.set_preset();
    // Something went wrong in between: what was preset may be wrong now.
    drive.state = "ready";
    assert_eq!(work(&mut machine, &mut drive, false).1, Progress::OnTheWay, "07 has been said already");
    drive.write(0x06);
    assert_eq!(work(&mut machine, &mut drive, false), (vec![0x07], Progress::Preset));
    machine.set_goal(Goal::Off);
    machine.set_goal(Goal::Enabled);
    assert_eq!(work(&mut machine, &mut drive, false), (vec![], Progress::Preset));
}

#[test]
fn a_fault_is_reset_by_an_edge_and_only_when_asked() {
    let mut drive = Drive::new("fault");
    drive.control = 0x0F;
    let mut machine = Machine::new();
    machine.set_goal(Goal::Enabled);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x00], Progress::Fault));
    assert_eq!(drive.state, "fault");
    machine.set_goal(Goal::Reset);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x80, 0x00], Progress::Reached));
    assert_eq!((drive.state, &drive.numbers[..]), ("switch on disabled", &[15][..]));
    // Its cause is still there; and another attempt is another edge.
    let mut drive = Drive::new("fault");
    drive.broken = true;
    machine.set_goal(Goal::Reset);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x80], Progress::OnTheWay));
    drive.broken = false;
    assert_eq!((work(&mut machine, &mut drive, true).1, drive.state), (Progress::OnTheWay, "fault"));
    machine.set_goal(Goal::Reset);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x00, 0x80, 0x00], Progress::Reached));
    // The bit that another master left set is no edge.
    let mut drive = Drive::new("fault");
    drive.control = 0x80;
    let mut machine = Machine::new();
    machine.set_goal(Goal::Reset);
    assert_eq!(work(&mut machine, &mut drive, true), (vec![0x00, 0x80, 0x00], Progress::Reached));
}

#[test]
fn a_drive_that_does_not_listen_is_told_of() {
    let mut drive = Drive::new("switch on disabled");
    drive.flags = 0;
    let mut machine = Machine::new();
    machine.set_goal(Goal::Enabled);
    assert_eq!(machine.advise(Statusword(drive.status())).progress, Progress::Local);
    assert_eq!(machine.advise(Statusword(0x0001)).progress, Progress::Unknown);
}

/// The table of the crate against the one of the tests' drive.
#[test]
fn transitions() {
    for state in State::ALL {
        for last in [0x00, 0x80] {
            for word in 0..=0xFF_u16 {
                let mut drive = Drive::new(name(state));
                drive.control = last;
                let command = Controlword(word).command(Controlword(last));
                drive.write(word);
                let expected = transition(state, command).map(|found| (found.number, name(found.to)));
                let got = drive.numbers.first().map(|number| (*number, drive.state));
                assert_eq!(expected, got, "{state}, {word:02X} after {last:02X}");
            }
        }
    }
    for command in Command::ALL {
        assert_eq!(Controlword::of(command).command(Controlword(0)), command);
    }
}

#[test]
fn what_is_preset() {
    let actual = |target| Some(Preset::Actual { target, actual: object::POSITION });
    assert_eq!(presets(Mode::ProfilePosition), actual(object::TARGET_POSITION));
    assert_eq!(presets(Mode::InterpolatedPosition), actual(object::INTERPOLATION_SET_POINT));
    assert_eq!(presets(Mode::ProfileVelocity), Some(Preset::Zero { target: object::TARGET_VELOCITY }));
    assert_eq!(presets(Mode::CyclicTorque), Some(Preset::Zero { target: object::TARGET_TORQUE }));
    assert_eq!((presets(Mode::Homing), presets(Mode::JOG)), (None, None));
}

fn goals() -> impl Strategy<Value = Goal> {
    prop::sample::select(vec![Goal::Off, Goal::Enabled, Goal::QuickStopped, Goal::Reset, Goal::Unpowered])
}

proptest! {
    /// From anywhere, with disturbances: a drive gets where it is to be, or the progress says why not.
    #[test]
    fn goals_are_reached(
        start in prop::sample::select(vec!["switch on disabled", "ready", "switched on", "enabled", "quick stop", "fault"]),
        control: u16, goals in prop::collection::vec(goals(), 1..6),
    ) {
        let mut drive = Drive::new(start);
        drive.control = control;
        drive.flags |= Statusword::TARGET_REACHED;
        let mut machine = Machine::new();
        for goal in goals {
            machine.set_goal(goal);
            let before = drive.state;
            let (_, progress) = work(&mut machine, &mut drive, true);
            match (goal, drive.state) {
                (Goal::Enabled, "fault") => prop_assert_eq!(progress, Progress::Fault),
                (Goal::Enabled, state) => prop_assert_eq!((state, progress), ("enabled", Progress::Reached)),
                (Goal::QuickStopped, state) => prop_assert!(state != "enabled" && progress == Progress::Reached),
                (Goal::Reset, state) => prop_assert!(matches!(state, "switch on disabled" | "ready"), "{}", state),
                (_, state) => prop_assert!(matches!(state, "switch on disabled" | "ready" | "fault"), "{}", state),
            }
            if before == "fault" && goal != Goal::Reset {
                prop_assert_eq!(drive.state, "fault");
            }
        }
    }

    /// Whatever the drive says: no enable without a preset since it was switched on, no fault reset but when asked, none of
    /// the mode's bits.
    #[test]
    fn any_statuswords(
        steps in prop::collection::vec((prop_oneof![any::<u16>(), words()], prop::option::of(goals()), any::<bool>()), 0..100),
    ) {
        let mut machine = Machine::new();
        let (mut preset, mut last) = (false, Controlword(0));
        for (word, goal, set) in steps {
            if let Some(goal) = goal {
                if goal != machine.goal() {
                    preset = false;
                }
                machine.set_goal(goal);
            }
            if set {
                machine.set_preset();
                preset = true;
            }
            let status = Statusword(word);
            if status.state().is_some_and(|state| state != State::SwitchedOn) {
                preset = false;
            }
            let advice = machine.advise(status);
            prop_assert_eq!(advice.word.0 & Controlword::OF_MODE, 0);
            if status.state().is_some() {
                match advice.word.command(Controlword(0)) {
                    Command::EnableOperation => {
                        let enabled = status.state() == Some(State::OperationEnabled);
                        prop_assert!(machine.goal() == Goal::Enabled && (preset || enabled));
                    }
                    Command::FaultReset => prop_assert_eq!(machine.goal(), Goal::Reset),
                    _ => {}
                }
            } else {
                prop_assert_eq!(advice.word, last);
            }
            last = advice.word;
        }
    }
}

fn words() -> impl Strategy<Value = u16> {
    prop::sample::select(vec![0x0240, 0x0221, 0x0223, 0x0237, 0x0607, 0x0208, 0x020F])
}
