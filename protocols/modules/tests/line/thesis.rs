//! Frames of the thesis.

use puente_drives::pid::State;
use puente_framed::{Kind, Reason, Session, frame, section};
use puente_modules::{Control, Form, Setting};

use crate::rig::Rig;

/// 3 axes of 255 bytes, built by hand.
const FRAME: &str = include_str!("../../../framed/tests/thesis.hex");

fn bytes() -> Vec<u8> {
    let code = FRAME.lines().map(|line| line.split('#').next().unwrap_or_default());
    let bytes = code.flat_map(str::split_whitespace);
    bytes.map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect()
}

/// A frame of the thesis for module 17.
fn setting(origin: u8, setting: Setting) -> Vec<u8> {
    let data = setting.emit(Form::Text).expect("it fits");
    frame_with(origin, &data)
}

fn frame_with(origin: u8, data: &[u8]) -> Vec<u8> {
    let mut buffer = heapless::Vec::<u8, 300>::new();
    frame::build(&mut buffer, origin, Kind::Plain, |body| Ok(section::push(body, 17, data)?))
        .expect("a frame");
    buffer.to_vec()
}

/// Who has answered, and how, since the last time.
fn answers(rig: &mut Rig, ghost: u8) -> Vec<(u8, Kind)> {
    let heard = std::mem::take(&mut rig.ghost_at(ghost).heard);
    let frames = heard.iter().map(|bytes| frame::parse(bytes).expect("a frame"));
    frames.filter(|frame| frame.destination() == ghost).map(|frame| (frame.origin, frame.kind)).collect()
}

/// Acceptance: the frame decodes, and is answered by each module, in turn.
#[test]
fn a_frame_of_the_thesis_is_answered_by_all_without_a_collision() {
    let mut rig = Rig::new(0.0, 1);
    rig.ghost(1);
    for address in [17, 18, 19, 20] {
        rig.module(address, Form::Text);
    }
    let bytes = bytes();
    let lrc = bytes[bytes.len() - 2];
    for _ in 0..5 {
        rig.ghost_at(1).frames = vec![bytes.clone()];
        rig.run_ms(15);
        assert_eq!(answers(&mut rig, 1), [17, 18, 19].map(|from| (from, Kind::Receipt { lrc })));
    }
    let collisions = |address: u8| rig.of(address).node.statistics().collisions;
    assert_eq!([17, 18, 19, 20].map(collisions), [0; 4]);
    assert_eq!(rig.of(20).node.statistics().attempts, 0, "it was not for this one");
}

/// Of the modules before it, none is there.
#[test]
fn the_turn_of_a_dead_module_passes() {
    let mut rig = Rig::new(0.0, 1);
    rig.ghost(1);
    rig.module(19, Form::Text);
    rig.ghost_at(1).frames = vec![bytes()];
    rig.run_ms(20);
    assert_eq!(answers(&mut rig, 1).iter().map(|(from, _)| *from).collect::<Vec<_>>(), [19]);
}

#[test]
fn a_frame_of_the_thesis_commands_nothing() {
    let mut rig = Rig::new(0.0, 1);
    rig.gateway(1, 2, &[(17, Form::Text)]);
    rig.module(17, Form::Text);
    rig.ghost(9);
    let order = puente_modules::Order { control: Control::Hold, ask: false };
    let wanted = Setting { kp: 0.5, ki: 0.0, kd: 0.0, set_point: 7.0, order: None };
    // Without current: gains count, from anyone. An order does not.
    rig.ghost_at(9).frames = vec![setting(9, Setting { order: Some(order), ..wanted }); 2];
    rig.run_ms(30);
    assert!(matches!(answers(&mut rig, 9)[..], [(17, Kind::Receipt { .. }), (17, Kind::Receipt { .. })]));
    assert_eq!(rig.of(17).state(), State::Disabled);
    rig.enable(1, &[0]);
    rig.want(1, 0, Control::Follow, 1_000_100);
    rig.run_ms(100);
    // Another commands: nothing of it counts.
    rig.ghost_at(9).frames = vec![setting(9, wanted)];
    rig.run_ms(30);
    let refusal = Kind::Refusal { reason: Reason::Meaningless, session: Session::NONE };
    assert_eq!(answers(&mut rig, 9), [(17, refusal)]);
    assert_eq!(rig.of(17).module.status().set_point, 1_000_100);
    // What makes no sense is refused.
    rig.ghost_at(9).frames = vec![frame_with(9, b"what?")];
    rig.run_ms(30);
    assert_eq!(answers(&mut rig, 9), [(17, refusal)]);
}
