//! Whatever the bus says, the codecs take it or leave it; what they take they make again.
#![no_main]

use puente_canopen::dcf::List;
use puente_canopen::emcy::Emergency;
use puente_canopen::lss;
use puente_canopen::monitor::{Action, Event, Supervision};
use puente_canopen::nmt::{Command, Sign};
use puente_canopen::pdo::{self, CobId, Mapped};
use puente_canopen::time::TimeOfDay;
use puente_canopen::{Frame, Id, Monitor, NodeId, cob, sync};
use puente_fuzz::Operands;
use puente_line::{Duration, Instant};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    if let Ok(list) = List::parse(data) {
        assert!(list.entries().all(|entry| !entry.data.is_empty()));
    }
    let mut operands = Operands(data);
    let timeout = Duration::from_millis(300);
    let supervision = match operands.byte() & 1 {
        0 => Supervision::Heartbeat { timeout },
        _ => Supervision::Guarding { time: timeout / 3, factor: 2 },
    };
    let mut now = Instant::ZERO;
    let mut monitor = Monitor::new(NodeId::MIN, supervision, now);
    let mut lost = false;
    while !operands.0.is_empty() {
        let kind = operands.byte();
        let number = u16::from_le_bytes([operands.byte(), operands.byte()]);
        let id = match kind & 3 {
            0 => Id::base(number & 0x780 | 1),
            1 => Id::extended(u32::from(number) << 13 | u32::from(kind)),
            _ => Id::base(number),
        };
        let frame = match kind & 4 {
            0 => Frame::new(id, operands.bytes(usize::from(kind >> 4) % 9)).expect("8 bytes at most"),
            _ => Frame::remote(id, kind >> 4),
        };
        let extended = matches!(id, Id::Extended(_));
        assert!(frame.bits() <= Frame::worst_bits(extended, frame.data().len() as u8));
        if let Some((command, to)) = Command::parse(&frame) {
            assert_eq!(command.frame(to), frame);
        }
        if let Some(sign) = Sign::parse(&frame) {
            assert_eq!(sign.frame(), frame);
        }
        if let Some((from, emergency)) = Emergency::parse(&frame) {
            assert!(emergency.frame(from).data().starts_with(frame.data()));
        }
        if let Some(time) = TimeOfDay::parse(cob::TIME, &frame) {
            assert_eq!(TimeOfDay::from_unix_millis(time.to_unix_millis()), Some(time));
        }
        let _ = sync::parse(cob::SYNC, &frame);
        if let Some(request) = lss::Request::parse(&frame) {
            assert_eq!(lss::Request::parse(&request.frame()), Some(request));
        }
        if let Some(response) = lss::Response::parse(&frame) {
            assert_eq!(lss::Response::parse(&response.frame()), Some(response));
        }
        let cob_id = CobId::from_raw(u32::from(number) << 16 | u32::from(kind));
        assert_eq!(CobId::from_raw(cob_id.raw()), cob_id);
        let mapping = [
            Mapped::new(1, 0, kind),
            Mapped::new(2, 0, number as u8),
            Mapped::new(3, 0, (number >> 8) as u8),
        ];
        let taken = pdo::values(&mapping, frame.data()).count();
        let mut values = [kind; 8];
        let fit =
            mapping.iter().filter(|mapped| pdo::put(&mapping, &mut values, mapped.address, 0x5A5A)).count();
        assert!(taken <= fit || frame.data().is_empty());
        now += operands.pause();
        monitor.receive(now, &frame);
        loop {
            match monitor.poll(now) {
                Action::Event(event) => {
                    assert!(!(lost && matches!(event, Event::Lost(_) | Event::Changed { .. })));
                    lost = matches!(event, Event::Lost(_)) || lost && matches!(event, Event::Toggle);
                }
                Action::Transmit(asked) => assert!(asked.is_remote()),
                Action::Idle => break,
            }
        }
        assert_eq!(monitor.is_lost(), lost);
        assert!(monitor.poll_at().is_none_or(|at| at > now), "polling would spin");
    }
});
