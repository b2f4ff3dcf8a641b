//! Whatever slaves say, the LSS master neither panics nor spins, and ends each command once.
#![no_main]

use puente_canopen::lss::{Action, Command, Known, Master, Mode, Part, Request};
use puente_canopen::{Frame, Id};
use puente_fuzz::Operands;
use puente_line::{Duration, Instant};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let mut master = Master::new(Duration::from_millis(10));
    let mut now = Instant::ZERO;
    let mut open = false;
    while !operands.0.is_empty() {
        let kind = operands.byte();
        let command = match kind & 7 {
            0 => Command::SwitchGlobal(Mode::Waiting),
            1 => Command::Select(Default::default()),
            2 => Command::ConfigureNodeId(kind),
            3 => Command::ConfigureBitTiming { table: 0, index: kind >> 4 },
            4 => Command::Inquire(Part::Serial),
            5 => Command::InquireNodeId,
            6 => Command::Store,
            _ => Command::Fastscan(Known { vendor: (kind & 8 != 0).then_some(1), ..Known::default() }),
        };
        assert_eq!(master.submit(command).is_err(), open);
        open = true;
        now += operands.pause();
        let data = operands.bytes(8);
        master.receive(now, &Frame::new(Id::base(0x7E4), data).expect("8 bytes at most"));
        for polls in 0.. {
            assert!(polls < 10, "it spins");
            match master.poll(now) {
                Action::Transmit(frame) => assert!(Request::parse(&frame).is_some()),
                Action::Done(_) => {
                    assert!(open);
                    open = false;
                }
                Action::Idle => break,
            }
        }
        assert!(master.poll_at().is_none_or(|at| at > now), "polling would spin");
    }
});
