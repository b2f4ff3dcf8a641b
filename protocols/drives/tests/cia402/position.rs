//! Profile position.

use proptest::prelude::*;
use puente_drives::cia402::position::{Advice, Handshake, Progress, SetPoint};
use puente_drives::cia402::{Controlword, Statusword};

const ACKNOWLEDGED: u16 = 1 << 12;
const REACHED: u16 = 1 << 10;

fn advise(handshake: &mut Handshake, flags: u16) -> Advice {
    handshake.advise(Statusword(0x0237 | flags))
}

/// The set-points of the thesis, 6.4.3, each by the rules of the standard.
#[test]
fn two_set_points() {
    let mut handshake = Handshake::new();
    assert_eq!(advise(&mut handshake, REACHED), Advice { bits: 0, target: None, progress: Progress::Idle });
    for target in [0x0050_4030, 0x0010_2030] {
        handshake.submit(SetPoint { immediately: false, ..SetPoint::absolute(target) });
        assert!(!handshake.is_free());
        // 402: 0F 00 and the target, then 202: 1F 00.
        let offer = Advice { bits: 0x10, target: Some(target), progress: Progress::Offered };
        assert_eq!(advise(&mut handshake, REACHED), offer);
        assert_eq!(advise(&mut handshake, REACHED), offer, "until it has been taken");
        let moving = Advice { bits: 0, target: None, progress: Progress::Moving };
        // Taken, but the drive has not yet forgotten that it had reached the last one.
        assert_eq!(advise(&mut handshake, ACKNOWLEDGED | REACHED), moving);
        assert!(handshake.is_free());
        assert_eq!(advise(&mut handshake, ACKNOWLEDGED), moving);
        assert_eq!(advise(&mut handshake, 0), moving);
        assert_eq!(advise(&mut handshake, REACHED).progress, Progress::Reached);
    }
}

#[test]
fn a_set_point_waits_for_the_end_of_the_last_handshake() {
    let mut handshake = Handshake::new();
    handshake.submit(SetPoint { relative: true, blended: true, ..SetPoint::absolute(-5) });
    let bits = 0x10 | 0x20 | 0x40 | 0x200;
    assert_eq!(
        advise(&mut handshake, ACKNOWLEDGED),
        Advice { bits: 0, target: None, progress: Progress::Offered }
    );
    assert_eq!(advise(&mut handshake, 0), Advice { bits, target: Some(-5), progress: Progress::Offered });
    // Another in its place: bit 4 falls first, or there is no edge.
    handshake.submit(SetPoint::absolute(7));
    assert_eq!(advise(&mut handshake, 0).bits, 0);
    let offer = Advice { bits: 0x10 | 0x20, target: Some(7), progress: Progress::Offered };
    assert_eq!(advise(&mut handshake, 0), offer);
}

#[test]
fn what_goes_wrong() {
    let mut handshake = Handshake::new();
    handshake.submit(SetPoint::absolute(1));
    advise(&mut handshake, 0);
    assert_eq!(advise(&mut handshake, ACKNOWLEDGED | 1 << 13).progress, Progress::FollowingError);
    assert_eq!(advise(&mut handshake, REACHED).progress, Progress::FollowingError, "it stays so");
    handshake.submit(SetPoint::absolute(1));
    advise(&mut handshake, 0);
    assert_eq!(
        handshake.advise(Statusword(0x0208)),
        Advice { bits: 0, target: None, progress: Progress::Lost }
    );
    handshake.clear();
    assert_eq!(advise(&mut handshake, 0).progress, Progress::Idle);
}

proptest! {
    /// A rising edge comes only after a word without the bit, with its target, and without an acknowledgement; nothing is reached
    /// that has not been acknowledged before.
    #[test]
    fn any_statuswords(steps in prop::collection::vec((0..32_u16, prop::option::weighted(0.2, any::<i32>())), 0..200)) {
        let mut handshake = Handshake::new();
        let (mut last, mut acknowledged, mut submitted) = (0, false, None);
        for (flags, submit) in steps {
            if let Some(target) = submit {
                handshake.submit(SetPoint::absolute(target));
                (submitted, acknowledged) = (Some(target), false);
            }
            let word = if flags & 16 == 0 || flags & 15 != 15 { 0x0237 } else { 0x0240 };
            let status = Statusword(word | (flags & 7) << 10 | (flags & 8) << 10);
            let advice = handshake.advise(status);
            let rises = advice.bits & !last & Controlword::MODE_4 != 0;
            if rises {
                prop_assert!(!status.has(ACKNOWLEDGED));
                prop_assert_eq!(advice.target, submitted);
            }
            acknowledged |= last & Controlword::MODE_4 != 0 && status.has(ACKNOWLEDGED);
            if advice.progress == Progress::Reached {
                prop_assert!(acknowledged);
            }
            prop_assert_eq!(advice.bits & !Controlword::OF_MODE, 0);
            last = advice.bits;
        }
    }
}
