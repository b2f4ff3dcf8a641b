//! Whatever the line says, a station neither panics nor spins, stays within its bounds and reports every frame once.
#![no_main]

use std::collections::HashSet;
use std::time::Duration;

use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::station::{Action, Config};
use puente_framed::window::Ticket;
use puente_framed::{Class, Kind, Number, Reason, Session, Station, section};
use puente_fuzz::{Operands, line};
use puente_line::Instant;

type Own = Station<2, 2, 4, 77, 96>;

/// A well-formed frame from somebody else, of any kind.
fn foreign(operands: &mut Operands<'_>, session: Session) -> Vec<u8> {
    let number = Number::new(u16::from(operands.byte()));
    let class = Class::Data;
    let kind = match operands.byte() & 7 {
        0 => Kind::Plain,
        1 => Kind::Opening { sender: session.sender },
        2 => Kind::Consent { session, window: operands.byte() % 8 + 1 },
        3 => Kind::Acknowledgement { next: operands.byte(), held: operands.byte(), session },
        4 => Kind::Refusal { reason: Reason::Session, session },
        5 => Kind::Single(class),
        _ => Kind::Numbered { number, class, session },
    };
    let mut body = heapless::Vec::<u8, MAX_FRAME>::new();
    let data = operands.bytes(usize::from(number.value()) / 2);
    section::push(&mut body, 1, data).expect("room");
    let mut buffer = heapless::Vec::<u8, MAX_FRAME>::new();
    frame::emit(&mut buffer, 2 + operands.byte() % 3, kind, &body).expect("a frame");
    buffer.to_vec()
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let mut now = Instant::from_millis(5_000);
    let mut station = Own::new(Config::new(1, line(), 96), now, u64::from(operands.byte()));
    let mut open = HashSet::new();
    // The session that the station itself asks for or consents to, so that frames of it come up.
    let mut session = Session { sender: 1, receiver: 1 };
    while !operands.0.is_empty() {
        let event = operands.byte();
        let bytes = match event & 7 {
            0 => operands.bytes(usize::from(event >> 3)).to_vec(),
            1..=3 => foreign(&mut operands, session),
            4 => {
                let peer = 2 + event % 3;
                let mut body = heapless::Vec::<u8, MAX_FRAME>::new();
                section::push(&mut body, peer, operands.bytes(usize::from(event))).expect("room");
                if let Ok(Ticket(ticket)) = station.submit(now, peer, Class::Data, &body) {
                    assert!(open.insert((peer, ticket)), "a ticket came twice");
                }
                Vec::new()
            }
            5 => {
                station.carrier(now);
                Vec::new()
            }
            6 => {
                station.line_error(now);
                Vec::new()
            }
            _ => {
                now += operands.pause();
                Vec::new()
            }
        };
        let mut heard = bytes;
        let mut at = 0;
        // Twice as many steps as bytes can bring about, or it spins.
        for _ in 0..20_000 {
            match station.poll(now) {
                Action::Transmit(bytes) => {
                    let frame = frame::parse(bytes).expect("it sends frames");
                    match frame.kind {
                        Kind::Opening { sender } => session = Session { sender, receiver: 1 },
                        Kind::Consent { session: offered, .. } => session = offered,
                        _ => {}
                    }
                    // Its echo, or another's voice.
                    if event & 0x80 == 0 {
                        heard.extend(bytes);
                    }
                }
                Action::Jam(_) | Action::Heard(_) | Action::Posted(_) | Action::Free => {}
                Action::Received { body, .. } => assert!(body.len() <= 96),
                Action::Done { to, ticket: Ticket(ticket), .. } => {
                    assert!(open.remove(&(to, ticket)), "reported twice");
                }
                Action::Idle => {
                    assert!(station.poll_at().is_none_or(|at| at > now), "polling would spin");
                    let Some(byte) = heard.get(at) else {
                        break;
                    };
                    now += Duration::from_micros(573);
                    station.receive(now, *byte);
                    at += 1;
                }
            }
        }
        assert_eq!(at, heard.len(), "it spins");
        assert!((2..5).all(|peer| station.outstanding(peer) <= 4));
    }
});
