//! Our own SDO server, with objects of any length.

use std::collections::BTreeMap;

use puente_canopen::sdo::{Abort, Dictionary, Server};
use puente_canopen::{Address, Frame, Id, NodeId};
use puente_line::Instant;

use super::channel::{Far, NODE};
use super::server::Message;

/// Objects that are there are read and written; 2001h takes and has four bytes, no more and no less.
#[derive(Default)]
pub struct Objects {
    pub values: BTreeMap<Address, Vec<u8>>,
    reading: Vec<u8>,
    writing: Option<(Address, Vec<u8>)>,
    /// Finished writes, and those that ended early.
    pub written: Vec<(Address, Vec<u8>)>,
    pub discarded: usize,
}

pub const WORD: Address = Address::new(0x2001, 0);

impl Dictionary for Objects {
    fn upload(&mut self, address: Address) -> Result<u32, Abort> {
        self.reading = self.values.get(&address).ok_or(Abort::NO_OBJECT)?.clone();
        Ok(self.reading.len() as u32)
    }

    fn read(&mut self, offset: u32, into: &mut [u8]) {
        let offset = offset as usize;
        into.copy_from_slice(&self.reading[offset..offset + into.len()]);
    }

    fn download(&mut self, address: Address, size: Option<u32>) -> Result<(), Abort> {
        assert_eq!(self.writing, None, "the last one has not ended");
        match (self.length(address), size) {
            (Some(length), Some(size)) if length != size => return Err(Abort::LENGTH),
            _ if !self.values.contains_key(&address) => return Err(Abort::NO_OBJECT),
            _ => self.writing = Some((address, Vec::new())),
        }
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        self.writing.as_mut().expect("begun").1.extend(bytes);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Abort> {
        let (address, value) = self.writing.take().expect("begun");
        self.values.insert(address, value.clone());
        self.written.push((address, value));
        Ok(())
    }

    fn discard(&mut self) {
        self.discarded += usize::from(self.writing.take().is_some());
    }

    fn length(&self, address: Address) -> Option<u32> {
        (address == WORD).then_some(4)
    }
}

/// The server as the far side of a channel.
pub struct Ours {
    pub server: Server,
    pub objects: Objects,
}

impl Ours {
    /// With `value` at 2000h, and four bytes at 2001h.
    pub fn new(value: &[u8]) -> Self {
        let mut objects = Objects::default();
        objects.values.insert(Address::new(0x2000, 0), value.to_vec());
        objects.values.insert(WORD, vec![1, 2, 3, 4]);
        Self { server: Server::new(NodeId::new(NODE).expect("a node-ID")), objects }
    }
}

impl Far for Ours {
    fn take(&mut self, now: Instant, message: Message) -> Vec<Message> {
        let frame = Frame::full(Id::base(0x600 + u16::from(NODE)), message);
        self.server.receive(now, &frame, &mut self.objects);
        std::iter::from_fn(|| self.server.poll(now, &mut self.objects))
            .map(|frame| {
                assert_eq!(frame.id(), Id::base(0x580 + u16::from(NODE)));
                frame.data().try_into().expect("8 bytes")
            })
            .collect()
    }

    fn in_block(&self) -> (bool, bool) {
        (false, false)
    }
}
