//! Homing.

use puente_drives::cia402::Statusword;
use puente_drives::cia402::homing::{Advice, Homing, Method, Progress, Status};
use puente_line::{Duration, Instant};

fn word(flags: u16) -> Statusword {
    Statusword(0x0237 | flags)
}

const COMPLETE: u16 = 0x1400;

fn homing() -> Homing {
    let mut homing = Homing::new(Duration::from_millis(500));
    homing.start(method(17));
    homing
}

fn advise(homing: &mut Homing, at: u64, flags: u16) -> Advice {
    homing.advise(Instant::from_millis(at), word(flags))
}

fn method(number: i8) -> Method {
    Method::new(number).expect("a method")
}

const RUNNING: Advice = Advice { bits: 0x10, progress: Progress::Running };

#[test]
fn the_status_table() {
    let told = [
        (0x0000, Status::InProgress),
        (0x0400, Status::Interrupted),
        (0x1000, Status::Attained),
        (0x1400, Status::Complete),
        (0x2000, Status::ErrorMoving),
        (0x2400, Status::ErrorStopped),
        (0x3400, Status::ErrorStopped),
    ];
    for (flags, status) in told {
        assert_eq!(Status::of(word(flags)), status, "{flags:04X}");
    }
}

/// The thesis, 6.4.2: 1F 00 starts it.
#[test]
fn home_is_found() {
    let mut homing = homing();
    assert_eq!(advise(&mut homing, 0, 0x0400), RUNNING);
    for flags in [0x0400, 0x0000, 0x0000, 0x1000] {
        assert_eq!(advise(&mut homing, 1, flags), RUNNING, "{flags:04X}");
    }
    assert_eq!(advise(&mut homing, 2, COMPLETE), Advice { bits: 0, progress: Progress::Complete });
    assert_eq!(advise(&mut homing, 3, 0x0000).progress, Progress::Complete, "it stays so");
}

#[test]
fn what_the_drive_said_before_does_not_count() {
    let mut homing = homing();
    for at in [0, 1, 499, 100_000] {
        assert_eq!(advise(&mut homing, at, COMPLETE), RUNNING);
    }
    assert_eq!(advise(&mut homing, 100_001, 0x0000), RUNNING);
    assert_eq!(advise(&mut homing, 100_002, COMPLETE).progress, Progress::Complete);
    // A method that does not move may never say that it is in progress.
    let mut homing = Homing::new(Duration::from_millis(500));
    homing.start(method(35));
    assert_eq!(advise(&mut homing, 1_000, COMPLETE), RUNNING);
    assert_eq!(advise(&mut homing, 1_499, COMPLETE), RUNNING);
    assert_eq!(advise(&mut homing, 1_500, COMPLETE).progress, Progress::Complete);
}

#[test]
fn what_goes_wrong() {
    let mut homing = homing();
    advise(&mut homing, 0, 0x0400);
    advise(&mut homing, 1, 0x0000);
    assert_eq!(advise(&mut homing, 2, 0x2000), RUNNING, "an error, but it moves");
    assert_eq!(advise(&mut homing, 3, 0x2400).progress, Progress::Failed);
    homing.start(method(17));
    advise(&mut homing, 4, 0x0400);
    let lost = homing.advise(Instant::from_millis(5), Statusword(0x0208));
    assert_eq!(lost, Advice { bits: 0, progress: Progress::Lost });
    // Begun anew while bit 4 is set: it falls first.
    homing.start(method(17));
    assert_eq!(advise(&mut homing, 6, 0x0400), RUNNING);
    homing.start(method(17));
    assert_eq!(advise(&mut homing, 7, 0x0000), Advice { bits: 0, progress: Progress::Running });
    assert_eq!(advise(&mut homing, 8, 0x0400), RUNNING);
    homing.cancel();
    assert_eq!(advise(&mut homing, 9, 0x0000), Advice { bits: 0, progress: Progress::Idle });
}

#[test]
fn methods() {
    let reserved: Vec<_> = (0..=127_i8).filter(|number| Method::new(*number).is_none()).take(8).collect();
    assert_eq!(reserved, [0, 15, 16, 31, 32, 36, 38, 39]);
    assert_eq!(Method::new(-3).map(Method::number), Some(-3));
    assert!(Method::new(37).is_some_and(Method::stands_still));
}
