//! Whatever a server says, the client neither panics nor spins, asks for no more than there is and ends each transfer once.
#![no_main]

use puente_canopen::sdo::{Action, BlockSegment, Client, Config, Request, Response, Transfer};
use puente_canopen::{Address, Frame, Id, NodeId};
use puente_fuzz::Operands;
use puente_line::Instant;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let block = operands.byte();
    let config = Config { block, threshold: operands.byte(), ..Config::DEFAULT };
    let mut client = Client::new(NodeId::MIN, config);
    let mut now = Instant::ZERO;
    let address = Address::new(0x2000, 1);
    let (mut open, mut size) = (false, 0);
    while !operands.0.is_empty() {
        let kind = operands.byte();
        if !open {
            size = u32::from(operands.byte());
            let block = kind & 1 != 0;
            let transfer = match kind & 2 {
                0 => Transfer::Upload { address, block },
                _ => Transfer::Download { address, size, block },
            };
            assert!(client.submit(transfer).is_ok());
            open = true;
        }
        let mut bytes = [0; 8];
        bytes[1..4].copy_from_slice(&address.to_bytes());
        let count = if kind & 4 == 0 { 1 } else { 8 };
        let said = operands.bytes(count);
        bytes[..said.len()].copy_from_slice(said);
        if let Ok(request) = Request::parse(&bytes) {
            assert_eq!(Request::parse(&request.to_bytes()), Ok(request));
        }
        if let Ok(response) = Response::parse(&bytes) {
            assert_eq!(Response::parse(&response.to_bytes()), Ok(response));
        }
        if let Ok(segment) = BlockSegment::parse(&bytes) {
            assert_eq!(segment.to_bytes(), bytes);
        }
        if kind & 8 != 0 {
            now += operands.pause();
        }
        if kind & 0xF0 == 0xF0 {
            client.cancel(now);
        }
        client.receive(now, &Frame::full(Id::base(0x581), bytes));
        for polls in 0.. {
            assert!(polls < 1_000, "it spins");
            match client.poll(now) {
                Action::Fetch { offset, count } => {
                    assert!(count > 0 && offset + count as u32 <= size);
                    client.supply(now, &[kind; 7][..count]);
                }
                Action::Done(_) => {
                    assert!(open);
                    open = false;
                }
                Action::Idle => break,
                Action::Transmit(_) | Action::Data(_) => {}
            }
        }
        assert_eq!(client.is_busy(), open);
        assert!(client.poll_at().is_none_or(|at| at > now), "polling would spin");
    }
});
