//! Whatever a client says, the SDO server neither panics nor spins, asks for no byte that an object does not have and leaves
//! none open.
#![no_main]

use puente_canopen::sdo::{Abort, Dictionary, Server};
use puente_canopen::{Address, Frame, Id, NodeId};
use puente_fuzz::Operands;
use puente_line::Instant;

#[derive(Default)]
struct Objects {
    size: u32,
    written: Option<u32>,
}

impl Dictionary for Objects {
    fn upload(&mut self, address: Address) -> Result<u32, Abort> {
        self.size = u32::from(address.index);
        if address.sub == 0 { Ok(self.size) } else { Err(Abort::NO_SUB_INDEX) }
    }

    fn read(&mut self, offset: u32, into: &mut [u8]) {
        assert!(offset as usize + into.len() <= self.size as usize);
    }

    fn download(&mut self, address: Address, _: Option<u32>) -> Result<(), Abort> {
        assert!(self.written.is_none(), "the last one is open");
        self.written = Some(0);
        match address.sub {
            0 => Ok(()),
            _ => {
                self.written = None;
                Err(Abort::READ_ONLY)
            }
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        let written = self.written.as_mut().expect("open");
        *written += bytes.len() as u32;
        if *written > 1_000 { Err(Abort::MEMORY) } else { Ok(()) }
    }

    fn finish(&mut self) -> Result<(), Abort> {
        self.written.take().map(|_| ()).ok_or(Abort::GENERAL)
    }

    fn discard(&mut self) {
        assert!(self.written.take().is_some(), "nothing is open");
    }

    fn length(&self, address: Address) -> Option<u32> {
        Some(u32::from(address.index & 7))
    }
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let mut server = Server::new(NodeId::MIN);
    server.set_block(operands.byte());
    let mut objects = Objects::default();
    let mut now = Instant::ZERO;
    while !operands.0.is_empty() {
        let kind = operands.byte();
        let mut bytes = [0; 8];
        let said = operands.bytes(if kind & 1 == 0 { 8 } else { 4 });
        bytes[..said.len()].copy_from_slice(said);
        if kind & 6 == 0 {
            now += 4 * operands.pause();
        }
        server.receive(now, &Frame::full(Id::base(0x601), bytes), &mut objects);
        if kind & 8 == 0 {
            let said = std::iter::from_fn(|| server.poll(now, &mut objects)).take(200).count();
            assert!(said <= 128, "it spins");
            assert!(server.poll_at().is_none_or(|at| at > now), "polling would spin");
        }
        assert!(!server.is_idle() || objects.written.is_none());
        if kind == 0xF0 {
            server.reset(&mut objects);
        }
    }
});
