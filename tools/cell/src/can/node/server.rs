//! The SDO server of a node.

use std::collections::VecDeque;
use std::time::Duration;

use puente_canopen::sdo::{Abort, Dictionary};
use puente_canopen::{Address, Frame, NodeId, sdo};
use puente_line::Instant;

use super::super::drive::Drive;
use super::{Objects, write};

/// The server with what may be wrong with it.
pub struct Server {
    server: Option<sdo::Server>,
    /// It says so many messages more, and hears nothing after that; any number where it is well.
    pub says: Option<u32>,
    /// It hears each message so much later.
    pub delay: Duration,
    coming: VecDeque<(Instant, Frame)>,
    reading: Vec<u8>,
    writing: Option<(Address, Vec<u8>)>,
}

impl Server {
    /// The server of a node, if that has a node-ID.
    pub fn new(node: Option<NodeId>) -> Self {
        Self {
            server: node.map(sdo::Server::new),
            says: None,
            delay: Duration::ZERO,
            coming: VecDeque::new(),
            reading: Vec::new(),
            writing: None,
        }
    }

    /// Nothing is under way any more.
    pub fn reset(&mut self, node: Option<NodeId>) {
        *self = Self { says: self.says, delay: self.delay, ..Self::new(node) };
    }

    fn is_dead(&self) -> bool {
        self.says == Some(0)
    }

    pub fn receive(&mut self, now: Instant, frame: &Frame, access: &mut Access<'_>) {
        if !self.is_dead() {
            self.coming.push_back((now + self.delay, *frame));
            self.catch_up(now, access);
        }
    }

    fn catch_up(&mut self, now: Instant, access: &mut Access<'_>) {
        while let Some((at, frame)) = self.coming.pop_front_if(|(at, _)| *at <= now)
            && let Some(server) = &mut self.server
        {
            let mut transfer = Transfer { reading: &mut self.reading, writing: &mut self.writing, access };
            server.receive(at, &frame, &mut transfer);
        }
    }

    pub fn poll(&mut self, now: Instant, idle: bool, access: &mut Access<'_>) -> Option<Frame> {
        if self.is_dead() {
            return None;
        }
        self.catch_up(now, access);
        let server = self.server.as_mut().filter(|server| idle || !server.is_streaming())?;
        let mut transfer = Transfer { reading: &mut self.reading, writing: &mut self.writing, access };
        let said = server.poll(now, &mut transfer)?;
        if let Some(left) = &mut self.says {
            *left = left.saturating_sub(1);
        }
        Some(said)
    }

    pub fn poll_at(&self, idle: bool) -> Option<Instant> {
        if self.is_dead() {
            return None;
        }
        let server = self.server.as_ref().filter(|server| idle || !server.is_streaming());
        let coming = self.coming.front().map(|(at, _)| *at);
        [server.and_then(sdo::Server::poll_at), coming].into_iter().flatten().min()
    }
}

/// The objects of a node, as a client gets at them.
pub struct Access<'a> {
    objects: &'a mut Objects,
    drive: Option<&'a Drive>,
    written: Vec<Address>,
}

impl<'a> Access<'a> {
    pub fn new(objects: &'a mut Objects, drive: Option<&'a Drive>) -> Self {
        Self { objects, drive, written: Vec::new() }
    }

    /// What has been written, for the node to act upon.
    pub fn take_written(self) -> Vec<Address> {
        self.written
    }
}

struct Transfer<'a, 'b> {
    reading: &'a mut Vec<u8>,
    writing: &'a mut Option<(Address, Vec<u8>)>,
    access: &'a mut Access<'b>,
}

impl Dictionary for Transfer<'_, '_> {
    fn upload(&mut self, address: Address) -> Result<u32, Abort> {
        *self.reading = self.access.objects.read(address)?.to_vec();
        Ok(self.reading.len() as u32)
    }

    fn read(&mut self, offset: u32, into: &mut [u8]) {
        let from = self.reading.iter().skip(offset as usize);
        into.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    }

    fn download(&mut self, address: Address, size: Option<u32>) -> Result<(), Abort> {
        self.access.objects.check(address, size.map(|size| size as usize))?;
        *self.writing = Some((address, Vec::new()));
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        let (_, value) = self.writing.as_mut().ok_or(Abort::GENERAL)?;
        value.extend_from_slice(bytes);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Abort> {
        let (address, value) = self.writing.take().ok_or(Abort::GENERAL)?;
        let objects = &mut *self.access.objects;
        objects.check(address, Some(value.len()))?;
        write::check(objects, address, &value)?;
        if let Some(drive) = self.access.drive {
            drive.check(objects, address, &value)?;
        }
        objects.write(address, &value);
        self.access.written.push(address);
        Ok(())
    }

    fn discard(&mut self) {
        *self.writing = None;
    }

    fn length(&self, address: Address) -> Option<u32> {
        self.access.objects.length(address).map(|length| length as u32)
    }
}
