//! How the drives move.

use crate::{Rig, ms};
use puente_modbus::Mode;

const CLEAR_ALARM: u16 = 0x1022;
const ENABLE: u16 = 0x1023;
const FORWARD: u16 = 0x1024;
const REVERSE: u16 = 0x1025;
const ALARM: u16 = 0x0817;

/// A drive that jogs forward at 1000 r/min and has reached it.
fn jogging() -> Rig {
    let mut rig = Rig::of(Mode::Ascii);
    rig.write(1, 0x25, 1_000);
    rig.write(1, ENABLE, 1);
    rig.write(1, FORWARD, 1);
    rig.pass(ms(1_000));
    assert_eq!(rig.read(1, 0x0806), 1_000);
    rig
}

#[test]
fn jogs_forward_and_back() {
    let mut rig = jogging();
    let position = rig.drive(1).position();
    assert_eq!(rig.drive(1).status().to_string(), "S-RDY,COIN,AC-IN");
    rig.write(1, FORWARD, 0);
    assert_eq!(rig.drive(1).speed(), 0.0);
    assert!(rig.drive(1).position() > position);
    assert_eq!(rig.drive(1).status().to_string(), "S-RDY,COIN,AC-IN,TGON");

    rig.write(1, REVERSE, 1);
    assert_eq!(rig.read(1, 0x0806).cast_signed(), -1_000);
    let turning = rig.drive(1).position();
    rig.pass(ms(600));
    assert_eq!(turning - rig.drive(1).position(), 100_000, "10 turns of 10000 pulses in 0.6 s");
}

#[test]
fn the_ramp_takes_its_time() {
    let mut rig = Rig::of(Mode::Ascii);
    rig.write(1, 0x25, 1_000);
    rig.write(1, ENABLE, 1);
    let request = rig.frame(1, &[0x06, 0x10, 0x24, 0, 1]);
    rig.cell.receive(rig.now, &request);
    let start = rig.cell.poll_at().expect("a request is under way");
    // 5000 r/min per second from the end of the request on.
    for (after, low, high) in [(0, 0.0, 0.0), (50, 220.0, 260.0), (150, 720.0, 760.0), (250, 999.0, 1_001.0)]
    {
        rig.cell.poll(start + ms(after));
        let speed = rig.drive(1).speed();
        assert!((low..=high).contains(&speed), "{speed} r/min after {after} ms");
    }
}

#[test]
fn motion_does_not_depend_on_how_often_it_is_looked_at() {
    let run = |looks: u64| {
        let mut rig = jogging();
        rig.write(1, FORWARD, 0);
        rig.write(1, REVERSE, 1);
        for _ in 0..looks {
            rig.pass(ms(1_200 / looks));
        }
        (rig.drive(1).position(), rig.drive(1).monitor())
    };
    assert_eq!(run(1), run(400));
}

#[test]
fn nothing_moves_before_the_servo_is_on() {
    let mut rig = Rig::of(Mode::Ascii);
    rig.write(1, FORWARD, 1);
    rig.pass(ms(500));
    assert_eq!((rig.drive(1).position(), rig.read(1, FORWARD)), (0, 0));
    rig.write(1, ENABLE, 1);
    rig.pass(ms(500));
    assert_eq!(rig.drive(1).position(), 0, "the earlier direction is forgotten");
}

#[test]
fn both_directions_are_a_stop() {
    let mut rig = jogging();
    rig.write(1, REVERSE, 1);
    assert_eq!(rig.drive(1).speed(), 0.0);
}

#[test]
fn enabling_twice_changes_nothing() {
    let mut rig = jogging();
    rig.write(1, ENABLE, 1);
    assert_eq!(rig.read(1, 0x0806), 1_000);
}

#[test]
fn limits_stop_their_own_direction_only() {
    let mut rig = jogging();
    rig.drive_mut(1).set_limits(true, false);
    rig.pass(ms(500));
    assert_eq!(rig.drive(1).speed(), 0.0);
    assert!(rig.drive(1).status().forward_prohibited() && !rig.drive(1).status().reverse_prohibited());
    rig.write(1, FORWARD, 0);
    rig.write(1, REVERSE, 1);
    assert_eq!(rig.drive(1).speed().round(), -1_000.0, "free to go back");
    rig.drive_mut(1).set_limits(false, true);
    rig.pass(ms(500));
    assert_eq!(rig.drive(1).speed(), 0.0);
}

#[test]
fn servo_off_coasts() {
    let mut rig = jogging();
    let request = rig.frame(1, &[0x06, 0x10, 0x23, 0, 0]);
    rig.cell.receive(rig.now, &request);
    rig.pass(ms(220));
    let speed = rig.drive(1).speed();
    assert!((850.0..999.0).contains(&speed), "friction alone brakes: {speed}");
    assert!(!rig.drive(1).servo_on());
    rig.pass(ms(3_000));
    assert_eq!(rig.drive(1).speed(), 0.0);
}

#[test]
fn switching_on_while_it_coasts_stops_it_on_the_ramp() {
    let mut rig = jogging();
    rig.drive_mut(1).set_alarm(4);
    rig.drive_mut(1).set_alarm(0);
    let request = rig.frame(1, &[0x06, 0x10, 0x23, 0, 1]);
    rig.cell.receive(rig.now, &request);
    let mut speed = rig.drive(1).speed();
    while speed > 0.0 {
        rig.pass(ms(1));
        let next = rig.drive(1).speed();
        assert!(speed - next <= 6.0, "5000 r/min per second: from {speed} to {next}");
        speed = next;
    }
    assert!(rig.drive(1).servo_on());
}

#[test]
fn an_alarm_drops_the_servo_until_it_is_cleared() {
    let mut rig = jogging();
    rig.drive_mut(1).set_alarm(4);
    assert_eq!(rig.read(1, ALARM), 4);
    let status = rig.drive(1).status();
    assert!(status.alarm() && !status.ready() && !rig.drive(1).servo_on());
    assert_eq!(rig.ask(1, &[0x06, 0x10, 0x23, 0, 1]), [0x86, 4], "cannot be executed");

    rig.write(1, CLEAR_ALARM, 1);
    assert_eq!(rig.read(1, ALARM), 0);
    rig.pass(ms(3_000));
    assert_eq!(rig.drive(1).speed(), 0.0, "clearing does not start it again");
    assert_eq!((rig.read(1, ENABLE), rig.read(1, FORWARD)), (0, 0));
    rig.write(1, ENABLE, 1);
}

#[test]
fn the_alarm_history_keeps_the_last_ten() {
    let mut rig = Rig::of(Mode::Ascii);
    for number in 3..=14 {
        rig.drive_mut(1).set_alarm(number);
    }
    let reply = rig.ask(1, &[0x03, 0x07, 0xF1, 0, 10]);
    let numbers: Vec<u16> = puente_modbus::Words::from_bytes(&reply[2..]).iter().collect();
    assert_eq!(numbers, [14, 13, 12, 11, 10, 9, 8, 7, 6, 5]);
    rig.write(1, 0x1021, 1);
    assert_eq!(rig.read(1, 0x07F1), 0);
    assert_eq!(rig.read(1, ALARM), 14, "the present alarm stays");
}

#[test]
fn without_mains_the_servo_drops() {
    let mut rig = jogging();
    rig.drive_mut(1).set_mains(false);
    rig.pass(ms(3_000));
    assert_eq!(rig.drive(1).status().to_string(), "TGON");
    assert_eq!(rig.ask(1, &[0x06, 0x10, 0x23, 0, 1]), [0x86, 4]);
    rig.drive_mut(1).set_mains(true);
    rig.write(1, ENABLE, 1);
}

#[test]
fn the_other_drives_stand_still() {
    let rig = jogging();
    assert_eq!((rig.drive(2).position(), rig.drive(3).position()), (0, 0));
}
