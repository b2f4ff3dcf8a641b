//! Whatever either end says, the codec takes it or leaves it; what it takes it makes again. And the client neither panics nor
//! spins.
#![no_main]

use puente_canopen::{Frame, Id};
use puente_fuzz::Operands;
use puente_line::Instant;
use puente_slcan::{Action, Client, Command, Config, Lines, Rate, Reply};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut lines = Lines::new();
    for byte in data {
        let Some((end, Some(line))) = lines.push(*byte) else { continue };
        if let Ok(command) = Command::parse(line) {
            let text = command.emit();
            assert_eq!(Command::parse(&text[..text.len() - 1]), Ok(command));
        }
        if let Ok(reply) = Reply::parse(end, line) {
            let text = reply.emit();
            assert!(matches!(text.last(), Some(b'\r' | 7)));
            if reply != Reply::Refused {
                assert_eq!(Reply::parse(end, &text[..text.len() - 1]), Ok(reply));
            }
        }
    }
    let mut operands = Operands(data);
    let mut client = Client::new(Config { rate: Rate::K500 });
    client.connected();
    let mut now = Instant::ZERO;
    while !operands.0.is_empty() {
        now += operands.pause();
        let _ = client.submit(now, &Frame::remote(Id::base(operands.byte().into()), 0));
        let count = usize::from(operands.byte()) % 40;
        for byte in operands.bytes(count) {
            client.receive(now, *byte);
        }
        for polls in 0.. {
            assert!(polls < 100, "it spins");
            client.expire(now);
            if client.poll(now) == Action::Idle {
                break;
            }
        }
        assert!(client.poll_at().is_none_or(|at| at > now), "it would spin");
    }
});
