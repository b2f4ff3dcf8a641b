//! How the modes of operation move the axis, against closed forms.

use puente_cell::can::{DriveConfig, DriveFault, Fault, Model};
use puente_drives::cia402::State;
use puente_drives::cia402::object;

use crate::bench::{Bench, lexium, starting};

const REACHED: u16 = 1 << 10;
const BIT_12: u16 = 1 << 12;
const BIT_13: u16 = 1 << 13;

/// A drive at 0 that takes 2 000 000 units/s² up and 1 000 000 down, and goes at 400 000 units/s.
fn at_zero(mode: i8) -> Bench {
    let mut bench = Bench::new([starting(lexium(2), 0.0)]);
    bench.put(2, object::PROFILE_ACCELERATION, 2_000_000);
    bench.put(2, object::PROFILE_DECELERATION, 1_000_000);
    bench.put(2, object::PROFILE_VELOCITY, 400_000);
    bench.enable(2, mode);
    bench
}

#[test]
fn a_profile_takes_the_time_of_its_trapezoid() {
    let mut bench = at_zero(1);
    bench.put(2, object::TARGET_POSITION, 1_000_000);
    bench.control(2, 0x1F);
    // Up 0.2 s and 40 000, down 0.4 s and 80 000, the rest at 400 000 a second.
    let expected = 1e3 * (0.2 + 0.4 + 880_000.0 / 400_000.0);
    let took = bench.until(5_000, |drive| drive.demand() == 1_000_000.0, 2);
    // One SDO lies between the command and here.
    assert!((expected - took).abs() < 1.0, "{took} and not {expected}");
    let half = Bench::status(&mut bench, 2);
    assert_eq!(half & REACHED, 0, "not in its window for its time yet");
    bench.run(30);
    assert_eq!(bench.status(2) & (REACHED | BIT_12), REACHED | BIT_12);
    assert_eq!(bench.drive(2).position(), 1_000_000.0);
}

#[test]
fn the_handshake_of_a_set_point() {
    let mut bench = at_zero(1);
    bench.run(30);
    assert_eq!(bench.status(2) & (REACHED | BIT_12), REACHED, "it stands where it should");
    bench.put(2, object::TARGET_POSITION, 100_000);
    assert_eq!(bench.status(2) & BIT_12, 0);
    bench.control(2, 0x1F);
    assert_eq!(bench.status(2) & (REACHED | BIT_12), BIT_12, "acknowledged");
    bench.control(2, 0x0F);
    assert_eq!(bench.status(2) & BIT_12, 0, "another one may come");
    // It waits for the first; a third one is not taken.
    bench.put(2, object::TARGET_POSITION, 200_000);
    bench.control(2, 0x1F);
    bench.control(2, 0x0F);
    assert_eq!(bench.status(2) & BIT_12, BIT_12, "nothing more can be taken");
    bench.put(2, object::TARGET_POSITION, 300_000);
    bench.control(2, 0x1F);
    let stopped = |drive: &puente_cell::can::Drive| drive.demand() >= 99_999.0;
    bench.until(2_000, stopped, 2);
    bench.run(5);
    bench.control(2, 0x0F);
    assert_eq!(bench.status(2) & (REACHED | BIT_12), 0, "the second is under way");
    bench.until(2_000, |drive| drive.demand() == 200_000.0, 2);
    bench.run(500);
    assert_eq!(bench.drive(2).position(), 200_000.0);
    assert_eq!(bench.status(2) & REACHED, REACHED);
}

#[test]
fn a_set_point_replaces_another_at_once() {
    let mut bench = at_zero(1);
    bench.put(2, object::TARGET_POSITION, 1_000_000);
    bench.control(2, 0x1F);
    bench.run(500);
    bench.control(2, 0x0F);
    bench.put(2, object::TARGET_POSITION, 0);
    bench.control(2, 0x3F);
    let from = bench.drive(2).demand();
    let mut most = from;
    while bench.drive(2).velocity() >= 0.0 {
        bench.run(1);
        most = bench.drive(2).demand().max(most);
    }
    // 400 000² / (2 · 1 000 000).
    assert!((most - from - 80_000.0).abs() < 1_000.0, "{from} {most}");
    bench.until(3_000, |drive| drive.position() == 0.0, 2);
}

#[test]
fn relative_set_points_add_up() {
    let mut bench = at_zero(1);
    for _ in 0..3 {
        bench.put(2, object::TARGET_POSITION, -10_000);
        bench.control(2, 0x5F);
        bench.control(2, 0x0F);
        bench.run(1_000);
    }
    assert_eq!(bench.drive(2).position(), -30_000.0);
}

/// Bit 9: the first set-point is passed without a stop, which saves the time of stopping and starting.
#[test]
fn set_points_are_blended() {
    let mut times = Vec::new();
    for blend in [0, 0x200] {
        let mut bench = at_zero(1);
        bench.put(2, object::TARGET_POSITION, 400_000);
        bench.control(2, 0x1F);
        bench.control(2, 0x0F);
        bench.put(2, object::TARGET_POSITION, 800_000);
        bench.control(2, 0x1F | blend);
        times.push(bench.until(5_000, |drive| drive.demand() == 800_000.0, 2));
    }
    // Down to 0 and up again costs half of 0.4 s and half of 0.2 s.
    assert!((times[0] - times[1] - 300.0).abs() < 2.0, "{times:?}");
}

#[test]
fn velocities_follow_their_ramps() {
    let mut bench = at_zero(3);
    bench.run(20);
    assert_eq!(bench.status(2) & (REACHED | BIT_12), REACHED | BIT_12, "it stands, as it should");
    bench.put(2, object::TARGET_VELOCITY, 400_000);
    let took = bench.until(400, |drive| drive.velocity() >= 399_000.0, 2);
    assert!((198.0..212.0).contains(&took), "{took}");
    bench.run(20);
    assert_eq!(bench.status(2) & (REACHED | BIT_12), REACHED);
    bench.put(2, object::TARGET_VELOCITY, -400_000);
    assert_eq!(bench.status(2) & REACHED, 0);
    // Down 0.4 s, up the other way 0.2 s.
    let took = bench.until(800, |drive| drive.velocity() <= -399_000.0, 2);
    assert!((598.0..612.0).contains(&took), "{took}");
    // Halt: it stands and is still enabled; then it goes on.
    bench.control(2, 0x10F);
    bench.until(500, |drive| drive.velocity() == 0.0, 2);
    bench.run(20);
    assert_eq!(bench.status(2) & (REACHED | BIT_12), REACHED | BIT_12);
    bench.control(2, 0x0F);
    bench.until(500, |drive| drive.velocity() <= -399_000.0, 2);
}

#[test]
fn a_torque_accelerates() {
    let mut bench = at_zero(4);
    bench.put(2, object::TARGET_TORQUE, 100);
    bench.run(110);
    // 10 % less 5 % friction of 20 000 000, for 0.1 s; its slope takes 10 ms of that.
    let velocity = bench.drive(2).velocity();
    assert!((95_000.0..112_000.0).contains(&velocity), "{velocity}");
    assert_eq!(bench.get(2, object::TORQUE), 100);
    bench.put(2, object::TARGET_TORQUE, 0);
    bench.until(400, |drive| drive.velocity() == 0.0, 2);
}

#[test]
fn nothing_moves_when_it_goes_under_current() {
    let mut bench = Bench::new([starting(lexium(2), 123_456.0)]);
    bench.put(2, object::TARGET_POSITION, 900_000);
    bench.enable(2, 1);
    bench.run(1_000);
    assert_eq!(bench.drive(2).position(), 123_456.0);
}

#[test]
fn homing_finds_what_it_is_told_to() {
    // Where home must be, from the machine's zero: switches at -300 000 and 6 700 000, the home switch from -150 000 to
    // -50 000, an index every 100 000.
    let cases = [
        (17, -300_000.0, 0.0),
        (1, -200_000.0, 0.0),
        (18, 6_700_000.0, 6_690_000.0),
        (2, 6_600_000.0, 6_690_000.0),
        (19, -150_000.0, -250_000.0),
        (20, -150_000.0, -250_000.0),
        (3, -200_000.0, -250_000.0),
        (4, -100_000.0, -250_000.0),
        (21, -50_000.0, 20_000.0),
        (22, -50_000.0, 20_000.0),
        (5, 0.0, 20_000.0),
        (6, -100_000.0, 20_000.0),
        (23, -150_000.0, -250_000.0),
        (24, -150_000.0, -250_000.0),
        (25, -50_000.0, -250_000.0),
        (26, -50_000.0, -250_000.0),
        (27, -50_000.0, 20_000.0),
        (28, -50_000.0, 20_000.0),
        (29, -150_000.0, 20_000.0),
        (30, -150_000.0, 20_000.0),
        (7, -200_000.0, -250_000.0),
        (10, 0.0, -250_000.0),
        (11, 0.0, 20_000.0),
        (14, -200_000.0, 20_000.0),
        // Begun on the switch.
        (19, -150_000.0, -100_001.0),
        (27, -50_000.0, -100_001.0),
        // Begun on the wrong side of it: at the limit switch it turns round.
        (27, -50_000.0, -250_000.0),
        (33, -100_000.0, -60_000.0),
        (34, 0.0, -60_000.0),
        (35, 1_234.0, 1_234.0),
        (37, 1_234.0, 1_234.0),
    ];
    for (method, home, start) in cases {
        let mut bench = Bench::new([starting(lexium(2), start)]);
        bench.put(2, object::HOMING_METHOD, method);
        bench.put(2, object::HOMING_SLOW, 10_000);
        bench.enable(2, 6);
        bench.control(2, 0x1F);
        assert!(!bench.drive(2).is_homed() || matches!(method, 35 | 37));
        bench.until(60_000, |drive| drive.is_homed(), 2);
        bench.run(100);
        assert_eq!(bench.status(2) & (REACHED | BIT_12 | BIT_13), REACHED | BIT_12, "{method} from {start}");
        // The machine's zero reads as minus home.
        let found = bench.drive(2).machine_position() - bench.drive(2).position();
        // A switch is seen in a step of the servo, 0.25 ms at 10 000 units/s, an index exactly.
        assert!((found - home).abs() <= 3.0, "{method} from {start}: {found} instead of {home}");
    }
}

#[test]
fn homing_that_fails_says_so() {
    // The home switch is behind it, and the method does not turn round.
    let mut bench = Bench::new([starting(lexium(2), 6_600_000.0)]);
    bench.put(2, object::HOMING_METHOD, 19);
    bench.enable(2, 6);
    bench.control(2, 0x1F);
    bench.run(2_000);
    assert_eq!(bench.status(2) & (REACHED | BIT_12 | BIT_13), REACHED | BIT_13);
    assert!(!bench.drive(2).is_homed());
    assert_eq!(bench.drive(2).velocity(), 0.0);
}

#[test]
fn homing_is_interrupted_and_begun_anew() {
    let mut bench = Bench::new([lexium(2)]);
    bench.enable(2, 6);
    bench.control(2, 0x1F);
    bench.run(100);
    assert_eq!(bench.status(2) & (REACHED | BIT_12 | BIT_13), 0, "in progress");
    bench.control(2, 0x0F);
    bench.run(200);
    assert_eq!(bench.status(2) & (REACHED | BIT_12 | BIT_13), REACHED, "interrupted");
    assert_eq!(bench.drive(2).velocity(), 0.0);
    bench.control(2, 0x1F);
    bench.run(100);
    bench.control(2, 0x11F);
    bench.run(200);
    assert_eq!(bench.drive(2).velocity(), 0.0, "halted");
    bench.control(2, 0x1F);
    bench.until(30_000, |drive| drive.is_homed(), 2);
}

/// CiA 402: the zero lies by the home offset from home.
#[test]
fn the_home_offset() {
    let mut bench = Bench::new([lexium(2)]);
    bench.put(2, object::HOMING_METHOD, 35);
    bench.put(2, object::HOME_OFFSET, 5_000);
    bench.enable(2, 6);
    bench.control(2, 0x1F);
    bench.run(50);
    assert_eq!(bench.get(2, object::POSITION), -5_000);
}

#[test]
fn a_blocked_axis_is_a_following_error() {
    let mut bench = at_zero(1);
    bench.cell.suffer(bench.now, 2, Fault::Drive(DriveFault::Blocked(true)));
    bench.put(2, object::TARGET_POSITION, 1_000_000);
    bench.control(2, 0x1F);
    // 100 000 units away: 0.2 s for the first 40 000, then 0.15 s; and 20 ms of time-out, and its ramp.
    let took = bench.until(1_000, |drive| drive.state() == State::FaultReactionActive, 2);
    assert!((369.0..372.0).contains(&took), "{took}");
    assert_eq!(bench.status(2) & BIT_13, BIT_13);
    bench.run(1_000);
    assert_eq!(bench.drive(2).state(), State::Fault);
    assert_eq!(bench.take(0x082)[0][..2], [0x11, 0x86]);
}

#[test]
fn a_limit_switch_stops_it_and_it_can_go_back() {
    let mut bench = Bench::new([starting(lexium(2), -200_000.0)]);
    bench.enable(2, 3);
    bench.put(2, object::TARGET_VELOCITY, -500_000);
    bench.run(2_000);
    assert_eq!(bench.drive(2).velocity(), 0.0);
    assert_eq!(bench.status(2) & 0x0880, 0x0880, "internal limit, warning");
    assert_eq!(bench.drive(2).state(), State::OperationEnabled);
    let told = bench.take(0x082);
    assert_eq!((told.len(), &told[0][..5]), (1, &[0x12, 0x86, 0x00, 0x14, 0x00][..]));
    bench.put(2, object::TARGET_VELOCITY, -100_000);
    bench.run(100);
    assert_eq!(bench.drive(2).velocity(), 0.0);
    bench.put(2, object::TARGET_VELOCITY, 100_000);
    bench.run(500);
    assert!((bench.drive(2).velocity() - 100_000.0).abs() < 1.0);
    assert_eq!(bench.status(2) & 0x0880, 0);
}

#[test]
fn software_limits_count_once_home_is_known() {
    let mut bench = Bench::new([starting(lexium(2), 0.0)]);
    bench.put(2, object::LIMIT_LOW, -10_000);
    bench.put(2, object::LIMIT_HIGH, 50_000);
    bench.put(2, object::HOMING_METHOD, 37);
    bench.enable(2, 6);
    bench.control(2, 0x1F);
    bench.run(50);
    bench.put(2, object::MODE, 1);
    bench.put(2, object::TARGET_POSITION, 500_000);
    bench.control(2, 0x0F);
    bench.control(2, 0x1F);
    bench.run(2_000);
    assert_eq!(bench.drive(2).position(), 50_000.0);
    assert_eq!(bench.status(2) & 0x0800, 0x0800);
}

/// Set-points every millisecond over the bus: the demand is the line between them.
#[test]
fn interpolated_positions_are_followed() {
    for model in [Model::Lexium23a, Model::FestoCmms] {
        let mut bench = Bench::new([starting(DriveConfig::new(2, model).unwrap(), 0.0)]);
        // RPDO4 has the set-point, and is taken at SYNC.
        bench.write(2, 0x1403, 1, &0x8000_0502_u32.to_le_bytes());
        bench.write(2, 0x1603, 0, &[0]);
        bench.write(2, 0x1603, 1, &0x60C1_0120_u32.to_le_bytes());
        bench.write(2, 0x1603, 0, &[1]);
        bench.write(2, 0x1403, 2, &[1]);
        bench.write(2, 0x1403, 1, &0x0000_0502_u32.to_le_bytes());
        bench.write(2, 0x1800, 2, &[1]);
        bench.write(2, 0x1800, 1, &0x4000_0182_u32.to_le_bytes());
        bench.nmt(puente_canopen::nmt::Command::Start, 2);
        bench.enable(2, 7);
        bench.control(2, 0x1F);
        assert_eq!(bench.status(2) & BIT_12, BIT_12);
        bench.take(0x182);
        for cycle in 1..=1_000_i32 {
            bench.say(0x502, &(100 * cycle).to_le_bytes());
            bench.run_for(std::time::Duration::from_micros(500));
            bench.say(0x080, &[]);
            bench.run_for(std::time::Duration::from_micros(500));
        }
        let cycles = bench.drive(2).cycles();
        assert_eq!((cycles.syncs, cycles.missed), (1_000, 0), "{model:?}");
        assert_eq!(bench.take(0x182).len(), 1_000);
        bench.run(50);
        assert_eq!(bench.drive(2).position(), 100_000.0);
    }
}
