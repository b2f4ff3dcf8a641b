//! Somebody who talks to the nodes of a cell: frames, SDOs, and what has been heard.

use std::time::Duration;

use puente_canopen::sdo::{self, Abort, Action, Client, Failure, Outcome, Transfer};
use puente_canopen::{Address, Frame, Id, NodeId, nmt};
use puente_cell::can::{AxisConfig, Cell, Config, Drive, DriveConfig, Model};
use puente_drives::cia402::object::{self, Object};
use puente_line::Instant;

pub struct Bench {
    pub cell: Cell,
    pub now: Instant,
    /// All frames of the nodes, with the moment.
    pub heard: Vec<(Instant, Frame)>,
}

pub fn lexium(node: u8) -> DriveConfig {
    DriveConfig::new(node, Model::Lexium23a).unwrap()
}

/// An axis that begins somewhere.
pub fn starting(config: DriveConfig, start: f64) -> DriveConfig {
    DriveConfig { axis: AxisConfig { start, ..AxisConfig::default() }, ..config }
}

impl Bench {
    pub fn new(drives: impl IntoIterator<Item = DriveConfig>) -> Self {
        let drives = drives.into_iter().collect();
        Self::with(Config { drives, ..Config::new(1_000_000) })
    }

    pub fn with(config: Config) -> Self {
        let mut bench = Self { cell: Cell::new(config), now: Instant::ZERO, heard: Vec::new() };
        bench.run(1);
        bench
    }

    /// Lets milliseconds pass.
    pub fn run(&mut self, millis: u64) {
        self.run_for(Duration::from_millis(millis));
    }

    pub fn run_for(&mut self, time: Duration) {
        self.now += time;
        while let Some(heard) = self.cell.hear(self.now, 0) {
            self.heard.push((heard.at, heard.frame));
        }
    }

    pub fn send(&mut self, frame: Frame) {
        self.cell.send(self.now, 0, &frame);
    }

    /// A data frame, from bytes.
    pub fn say(&mut self, id: u16, data: &[u8]) {
        self.send(Frame::new(Id::base(id), data).unwrap());
    }

    pub fn nmt(&mut self, command: nmt::Command, node: u8) {
        self.send(command.frame(NodeId::new(node)));
        self.run(1);
    }

    /// What has been heard with an identifier since the last call, the data of each.
    pub fn take(&mut self, id: u16) -> Vec<Vec<u8>> {
        let is = |frame: &Frame| frame.id() == Id::Base(id);
        let found = self.heard.iter().filter(|(_, frame)| is(frame)).map(|(_, frame)| frame.data().to_vec());
        let found = found.collect();
        self.heard.retain(|(_, frame)| !is(frame));
        found
    }

    pub fn transfer(
        &mut self,
        node: u8,
        transfer: Transfer,
        data: &[u8],
    ) -> (Result<Outcome, Failure>, Vec<u8>) {
        let mut client = Client::new(NodeId::new(node).unwrap(), sdo::Config::DEFAULT);
        client.submit(transfer).unwrap();
        let mut read = Vec::new();
        loop {
            match client.poll(self.now) {
                Action::Transmit(frame) => {
                    self.cell.send(self.now, 0, &frame);
                }
                Action::Fetch { offset, count } => {
                    client.supply(self.now, &data[offset as usize..][..count]);
                }
                Action::Data(part) => read.extend_from_slice(&part),
                Action::Done(end) => return (end, read),
                Action::Idle => {
                    let next = [client.poll_at(), self.cell.poll_at()].into_iter().flatten().min();
                    self.now = next.expect("something is due").max(self.now);
                    while let Some(heard) = self.cell.hear(self.now, 0) {
                        client.receive(self.now, &heard.frame);
                        self.heard.push((heard.at, heard.frame));
                    }
                }
            }
        }
    }

    pub fn try_write(&mut self, node: u8, index: u16, sub: u8, data: &[u8]) -> Result<(), Abort> {
        let size = data.len() as u32;
        let transfer = Transfer::Download { address: Address::new(index, sub), size, block: false };
        match self.transfer(node, transfer, data).0 {
            Ok(_) => Ok(()),
            Err(Failure::Aborted(code)) => Err(code),
            Err(other) => panic!("{other}"),
        }
    }

    pub fn write(&mut self, node: u8, index: u16, sub: u8, data: &[u8]) {
        let done = self.try_write(node, index, sub, data);
        assert_eq!(done, Ok(()), "{index:04X}h:{sub}");
    }

    pub fn read(&mut self, node: u8, index: u16, sub: u8) -> Result<Vec<u8>, Abort> {
        let transfer = Transfer::Upload { address: Address::new(index, sub), block: false };
        match self.transfer(node, transfer, &[]) {
            (Ok(_), data) => Ok(data),
            (Err(Failure::Aborted(code)), _) => Err(code),
            (Err(other), _) => panic!("{other}"),
        }
    }

    /// Writes an object of CiA 402.
    pub fn put(&mut self, node: u8, object: Object, value: i64) {
        let bytes = value.to_le_bytes();
        self.write(node, object.address.index, object.address.sub, &bytes[..object.kind.size()]);
    }

    pub fn get(&mut self, node: u8, object: Object) -> i64 {
        let bytes = self.read(node, object.address.index, object.address.sub).unwrap();
        object.kind.read(&bytes).unwrap()
    }

    /// The statusword, as the dictionary has it.
    pub fn status(&mut self, node: u8) -> u16 {
        self.get(node, object::STATUSWORD) as u16
    }

    pub fn control(&mut self, node: u8, word: u16) {
        self.put(node, object::CONTROLWORD, word.into());
    }

    /// Goes under current in a mode.
    pub fn enable(&mut self, node: u8, mode: i8) {
        self.put(node, object::MODE, mode.into());
        for word in [0x06, 0x07, 0x0F] {
            self.control(node, word);
        }
        self.run(30);
        assert_eq!(self.status(node) & 0x6F, 0x27);
    }

    pub fn drive(&self, node: u8) -> &Drive {
        self.cell.node(node).unwrap().drive().unwrap()
    }

    /// Lets time pass until something is so, looking every 0.1 ms; the milliseconds it took.
    pub fn until(&mut self, most: u64, mut so: impl FnMut(&Drive) -> bool, node: u8) -> f64 {
        let begin = self.now;
        while !so(self.drive(node)) {
            self.run_for(Duration::from_micros(100));
            assert!(self.now.since(begin) < Duration::from_millis(most), "{:?}", self.drive(node));
        }
        self.now.since(begin).as_secs_f64() * 1e3
    }
}
