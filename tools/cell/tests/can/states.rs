//! The power drive state machine of a simulated drive, told over the bus.

use puente_cell::can::{DriveConfig, DriveFault, Fault, Model};
use puente_drives::cia402::State::{self, *};
use puente_drives::cia402::object;

use crate::bench::{Bench, lexium};

/// Brings the drive into a state, by itself.
fn bring(bench: &mut Bench, state: State) {
    bench.control(2, 0);
    bench.control(2, 0x80);
    bench.control(2, 0);
    let words: &[u16] = match state {
        SwitchOnDisabled => &[],
        ReadyToSwitchOn => &[0x06],
        SwitchedOn => &[0x06, 0x07],
        OperationEnabled => &[0x06, 0x07, 0x0F],
        QuickStopActive => &[0x06, 0x07, 0x0F, 0x02],
        Fault => {
            bench.cell.suffer(bench.now, 2, puente_cell::can::Fault::Drive(DriveFault::OverCurrent));
            &[]
        }
        other => panic!("{other}"),
    };
    for word in words {
        bench.control(2, *word);
        bench.run(30);
    }
    assert_eq!(bench.drive(2).state(), state);
}

/// CiA 402, table of transitions: each command in each state, by the bits of the controlword.
#[test]
fn every_command_in_every_state() {
    let mut bench = Bench::new([lexium(2)]);
    // A quick stop that holds the axis.
    bench.put(2, object::QUICK_STOP_OPTION, 6);
    let states = [SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled, QuickStopActive, Fault];
    let table: [(u16, [State; 6]); 6] = [
        (0x06, [ReadyToSwitchOn, ReadyToSwitchOn, ReadyToSwitchOn, ReadyToSwitchOn, QuickStopActive, Fault]),
        (0x07, [SwitchOnDisabled, SwitchedOn, SwitchedOn, SwitchedOn, QuickStopActive, Fault]),
        (
            0x0F,
            [SwitchOnDisabled, ReadyToSwitchOn, OperationEnabled, OperationEnabled, OperationEnabled, Fault],
        ),
        (
            0x00,
            [SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, Fault],
        ),
        (
            0x02,
            [SwitchOnDisabled, SwitchOnDisabled, SwitchOnDisabled, QuickStopActive, QuickStopActive, Fault],
        ),
        (
            0x80,
            [
                SwitchOnDisabled,
                ReadyToSwitchOn,
                SwitchedOn,
                OperationEnabled,
                QuickStopActive,
                SwitchOnDisabled,
            ],
        ),
    ];
    for (word, expected) in table {
        for (from, to) in states.into_iter().zip(expected) {
            bring(&mut bench, from);
            bench.control(2, word);
            bench.run(30);
            assert_eq!(bench.drive(2).state(), to, "{word:02X}h in {from}");
            let (mask, value) = to.pattern();
            assert_eq!(bench.status(2) & mask, value);
        }
    }
}

/// The words that the thesis shows (6.4.1), in its order.
#[test]
fn the_statuswords_of_the_thesis() {
    let mut bench = Bench::new([lexium(2)]);
    bench.write(2, 0x1800, 1, &0x4000_0182_u32.to_le_bytes());
    assert_eq!(bench.status(2), 0x0240);
    bench.nmt(puente_canopen::nmt::Command::Start, 2);
    for word in [0x06, 0x07, 0x0F] {
        bench.control(2, word);
        bench.run(50);
    }
    let words: Vec<_> = bench.take(0x182);
    let expected = [[0x40, 0x02], [0x21, 0x02], [0x23, 0x02], [0x23, 0x06], [0x37, 0x06]];
    assert_eq!(words, expected);
}

#[test]
fn a_quick_stop_option_of_2_leads_on_by_itself() {
    let mut bench = Bench::new([lexium(2)]);
    bench.enable(2, 3);
    bench.put(2, object::TARGET_VELOCITY, 1_000_000);
    bench.run(500);
    bench.control(2, 0x02);
    assert_eq!(bench.drive(2).state(), QuickStopActive);
    // 1 000 000 / 20 000 000.
    let took = bench.until(100, |drive| drive.state() == SwitchOnDisabled, 2);
    assert!((49.0..51.0).contains(&took), "{took}");
}

#[test]
fn a_fault_is_told_and_reset_when_its_cause_is_gone() {
    for (model, over_current) in [(Model::FestoCmms, 0x2320_u16), (Model::Lexium23a, 0x2310)] {
        let mut bench = Bench::new([DriveConfig::new(2, model).unwrap()]);
        bench.enable(2, 3);
        bench.cell.suffer(bench.now, 2, Fault::Drive(DriveFault::OverCurrent));
        bench.run(1);
        let told = bench.take(0x082);
        assert_eq!(told[0][..3], [over_current as u8, (over_current >> 8) as u8, 0x03]);
        assert_eq!(bench.get(2, object::ERROR_CODE) as u16, over_current);
        assert_eq!(bench.read(2, 0x1001, 0), Ok(vec![3]));
        assert_eq!(bench.status(2) & 0x4F, 0x08);
        bench.control(2, 0x80);
        bench.run(1);
        assert_eq!(bench.take(0x082), [[0; 8]]);
        assert_eq!(bench.drive(2).state(), SwitchOnDisabled);

        bench.cell.suffer(bench.now, 2, Fault::Drive(DriveFault::Hot(true)));
        for word in [0, 0x80, 0, 0x80] {
            bench.control(2, word);
            assert_eq!(bench.drive(2).state(), State::Fault, "it is hot");
        }
        bench.cell.suffer(bench.now, 2, Fault::Drive(DriveFault::Hot(false)));
        bench.control(2, 0x80);
        assert_eq!(bench.drive(2).state(), State::Fault, "no edge");
        bench.control(2, 0);
        bench.control(2, 0x80);
        assert_eq!(bench.drive(2).state(), SwitchOnDisabled);
        // The last first, in its history.
        assert_eq!(bench.read(2, 0x1003, 0), Ok(vec![2]));
        assert_eq!(bench.read(2, 0x1003, 1).unwrap()[..2], [0x10, 0x43]);
        bench.write(2, 0x1003, 0, &[0]);
        assert_eq!(bench.read(2, 0x1003, 0), Ok(vec![0]));
    }
}

/// Thesis, 6.4: AL401 whenever the drive is reset while it is under current.
#[test]
fn a_reset_under_current_is_an_alarm_of_the_lexium() {
    for command in [puente_canopen::nmt::Command::ResetNode, puente_canopen::nmt::Command::ResetCommunication]
    {
        let mut bench = Bench::new([lexium(2), DriveConfig::new(3, Model::FestoCmms).unwrap()]);
        bench.nmt(command, 0);
        assert_eq!(bench.take(0x082).len(), 0, "not under current");
        bench.enable(2, 1);
        bench.enable(3, 1);
        bench.take(0x702);
        bench.nmt(command, 0);
        assert_eq!((bench.take(0x702), bench.take(0x703).len()), (vec![vec![0]], 3));
        assert_eq!(bench.take(0x082)[0][3..5], [0x01, 0x04]);
        assert_eq!((bench.drive(2).state(), bench.drive(3).state()), (State::Fault, SwitchOnDisabled));
    }
}

/// Thesis, 6.4.2 and 6.4.3, over PDOs 1 to 3. What its traces leave out is in brackets: settled after a change of mode, the
/// search, and home complete, where they end with home attained.
#[test]
fn homing_and_two_targets_as_in_the_thesis() {
    let mut bench = Bench::new([lexium(2)]);
    for (parameter, cob_id) in [(0x1400, 0x202_u32), (0x1401, 0x302), (0x1402, 0x402), (0x1800, 0x182)] {
        bench.write(2, parameter, 1, &(0x4000_0000 | cob_id).to_le_bytes());
    }
    bench.put(2, object::HOMING_METHOD, 21);
    bench.nmt(puente_canopen::nmt::Command::Start, 2);
    for word in [0x06, 0x07, 0x0F] {
        bench.say(0x202, &[word, 0]);
        bench.run(50);
    }
    let words = |bench: &mut Bench| -> Vec<u16> {
        bench.take(0x182).iter().map(|data| u16::from_le_bytes([data[0], data[1]])).collect()
    };
    words(&mut bench);
    bench.say(0x302, &[0x0F, 0, 6]);
    bench.run(50);
    assert_eq!(words(&mut bench), [0x0237, 0x0637], "homing mode [settled]");
    bench.say(0x202, &[0x1F, 0]);
    bench.run(10_000);
    assert_eq!(words(&mut bench), [0x0237, 0x9237, 0x9637], "[it searches], home attained, [complete]");
    bench.say(0x302, &[0x0F, 0, 1]);
    bench.run(50);
    assert_eq!(words(&mut bench), [0x8237, 0x8637], "profile position");
    bench.say(0x202, &[0x1F, 0]);
    bench.run(8_000);
    words(&mut bench);
    for target in [0x0050_4030_u32, 0x0010_2030] {
        let [a, b, c, d] = target.to_le_bytes();
        bench.say(0x402, &[0x0F, 0, a, b, c, d]);
        bench.run(50);
        assert_eq!(words(&mut bench), [0x8637]);
        bench.say(0x202, &[0x1F, 0]);
        bench.run(8_000);
        assert_eq!(words(&mut bench), [0x9237, 0x9637], "under way, arrived");
        assert_eq!(bench.get(2, object::POSITION), i64::from(target));
    }
}
