//! An SDO client that is lent to a node, for a caller's transfer or to boot it.

use heapless::Vec;
use puente_line::Instant;

use super::types::Sdo;
use crate::boot::{Boot, Plan, Step, Verdict};
use crate::sdo::{self, Abort, Client, Failure, Outcome, SEGMENT, Transfer};
use crate::{Address, Frame, NodeId, nmt, object};

/// What a channel has to tell.
pub(super) enum Said {
    Frame(Frame),
    Sdo(Sdo),
    /// The member answers: it is being booted.
    Present,
    /// This is to be commanded to the node.
    Command(nmt::Command),
    /// The member has not taken this, and need not.
    Declined(Address, Abort),
    Booted,
    NotBooted(Verdict),
    /// The member does not answer.
    Absent,
}

/// Who asks.
#[derive(Clone, Debug)]
enum User<'a> {
    Nobody,
    Caller,
    /// Whether the member is there.
    Probe(Plan<'a>),
    Boot(Boot<'a>),
}

#[derive(Clone, Debug)]
pub(super) struct Channel<'a> {
    client: Client,
    node: Option<NodeId>,
    user: User<'a>,
    /// Bytes read for a boot.
    read: Vec<u8, SEGMENT>,
    /// Something was asked again since it was given to its user.
    repeated: bool,
}

impl<'a> Channel<'a> {
    pub const fn new() -> Self {
        let client = Client::new(NodeId::MIN, sdo::Config::DEFAULT);
        Self { client, node: None, user: User::Nobody, read: Vec::new(), repeated: false }
    }

    /// To whom it is lent.
    pub const fn node(&self) -> Option<NodeId> {
        self.node
    }

    /// A transfer, a probe or a boot is in work.
    pub const fn is_busy(&self) -> bool {
        !matches!(self.user, User::Nobody)
    }

    pub const fn boots(&self) -> bool {
        matches!(self.user, User::Probe(_) | User::Boot(_))
    }

    /// Whether it may be lent to another node: nothing is in work, and nothing is owed any more.
    pub fn is_free(&self, now: Instant) -> bool {
        self.node.is_none() || !self.is_busy() && self.client.quiet_until().is_some_and(|until| until <= now)
    }

    pub fn lend(&mut self, node: NodeId) {
        if self.node != Some(node) {
            self.client.serve(node);
            self.node = Some(node);
        }
    }

    pub const fn release(&mut self) {
        self.node = None;
    }

    pub fn counters(&self) -> sdo::Counters {
        self.client.counters()
    }

    pub fn submit(&mut self, transfer: Transfer, config: sdo::Config) -> Result<(), sdo::Busy> {
        if self.is_busy() {
            return Err(sdo::Busy);
        }
        self.client.set_config(config);
        self.client.submit(transfer)?;
        self.user = User::Caller;
        self.repeated = false;
        Ok(())
    }

    /// Asks the member whether it is there, and boots it if it is. A single question: it may well be missing.
    pub fn probe(&mut self, plan: Plan<'a>, config: sdo::Config) {
        self.read.clear();
        self.client.set_config(sdo::Config { retries: 0, ..config });
        if self.client.submit(READ_TYPE).is_ok() {
            self.user = User::Probe(plan);
            self.repeated = false;
        }
    }

    /// Boots the member, which is there.
    pub fn boot(&mut self, plan: Plan<'a>, config: sdo::Config) {
        self.client.set_config(config);
        self.user = User::Boot(Boot::new(plan));
        self.repeated = false;
    }

    /// The caller's transfer.
    pub fn client(&mut self) -> Option<&mut Client> {
        matches!(self.user, User::Caller).then_some(&mut self.client)
    }

    /// The node has booted: the caller's transfer has failed, a boot begins anew by itself.
    pub fn booted(&mut self, now: Instant) {
        self.client.booted(now);
        self.drop_boot(now);
    }

    /// The bus is off.
    pub fn lose(&mut self, now: Instant) {
        self.client.end(now, Failure::BusOff);
        self.drop_boot(now);
    }

    /// A boot is not needed any more.
    pub fn leave(&mut self, now: Instant) {
        self.drop_boot(now);
    }

    fn drop_boot(&mut self, now: Instant) {
        if self.boots() {
            let _ = self.client.brought(now);
            self.client.end(now, Failure::Cancelled);
            let _ = self.client.brought(now);
            self.user = User::Nobody;
        }
    }

    pub fn receive(&mut self, now: Instant, frame: &Frame) {
        self.client.receive(now, frame);
    }

    /// What has come of it so far; a command only where there is `room` for one.
    pub fn brought(&mut self, now: Instant, room: bool) -> Option<Said> {
        while self.client.is_busy() || self.boots() {
            if !self.client.is_busy() {
                match self.step(room) {
                    Ok(()) => {}
                    Err(said) => return said,
                }
            }
            match self.client.brought(now)? {
                sdo::Action::Data(part) => {
                    if let Some(said) = self.data(now, part) {
                        return Some(said);
                    }
                }
                sdo::Action::Done(end) => {
                    if let Some(said) = self.done(end) {
                        return Some(said);
                    }
                }
                _ => return None,
            }
        }
        None
    }

    /// What is to be sent, or what is lacking for that.
    pub fn poll(&mut self, now: Instant) -> Option<Said> {
        // A boot supplies what is lacking itself.
        for _ in 0..2 {
            match self.client.poll(now) {
                sdo::Action::Transmit(frame) => return Some(Said::Frame(frame)),
                sdo::Action::Fetch { offset, count } if self.boots() => self.supply(now, offset, count),
                sdo::Action::Fetch { offset, count } => return Some(Said::Sdo(Sdo::Fetch { offset, count })),
                sdo::Action::Data(part) => return self.data(now, part),
                sdo::Action::Done(end) => return self.done(end),
                sdo::Action::Idle => return None,
            }
        }
        None
    }

    /// When to poll again, or when it may be taken back.
    pub fn poll_at(&self) -> Option<Instant> {
        self.node?;
        self.client.poll_at().or_else(|| self.client.quiet_until().filter(|_| !self.is_busy()))
    }

    /// The next step of a boot; `Err` where there is something to say, or nothing to be done now.
    fn step(&mut self, room: bool) -> Result<(), Option<Said>> {
        let User::Boot(boot) = &mut self.user else {
            return Err(None);
        };
        self.read.clear();
        let transfer = match boot.step() {
            Step::Read(address) => Transfer::Upload { address, block: false },
            Step::Write { address, value } => {
                let mut buffer = [0; 2];
                let size = u32::try_from(value.bytes(&mut buffer).len()).unwrap_or(u32::MAX);
                Transfer::Download { address, size, block: false }
            }
            Step::Command(_) if !room => return Err(None),
            Step::Command(command) => {
                let _ = boot.done(Ok(&[]));
                return Err(Some(Said::Command(command)));
            }
            Step::Done => {
                self.user = User::Nobody;
                return Err(Some(Said::Booted));
            }
        };
        // It is not busy.
        self.client.submit(transfer).map_err(|_| None)
    }

    fn supply(&mut self, now: Instant, offset: u32, count: usize) {
        let User::Boot(boot) = &self.user else {
            return;
        };
        if let Step::Write { value, .. } = boot.step() {
            let mut buffer = [0; 2];
            let bytes = value.bytes(&mut buffer);
            let from = usize::try_from(offset).unwrap_or(usize::MAX);
            let part = bytes.get(from..).and_then(|rest| rest.get(..count)).unwrap_or_default();
            self.client.supply(now, part);
        }
    }

    fn data(&mut self, now: Instant, part: Vec<u8, SEGMENT>) -> Option<Said> {
        match self.user {
            User::Caller => Some(Said::Sdo(Sdo::Data(part))),
            // More than any of the values that are looked at has; how much more does not matter.
            User::Probe(_) | User::Boot(_) if self.read.extend_from_slice(&part).is_err() => {
                self.client.end(now, Failure::Cancelled);
                None
            }
            _ => None,
        }
    }

    /// Whether responses to its last user may still come where all went well.
    pub const fn has_repeated(&self) -> bool {
        self.repeated
    }

    fn done(&mut self, end: Result<Outcome, Failure>) -> Option<Said> {
        self.repeated |= self.client.has_repeated();
        match &mut self.user {
            User::Nobody => None,
            User::Caller => {
                self.user = User::Nobody;
                Some(Said::Sdo(Sdo::Done(end)))
            }
            User::Probe(plan) => {
                let (user, said) = match end {
                    Ok(_) | Err(Failure::Aborted(_) | Failure::Cancelled) => {
                        (User::Boot(Boot::new(*plan)), Said::Present)
                    }
                    Err(_) => (User::Nobody, Said::Absent),
                };
                self.user = user;
                Some(said)
            }
            User::Boot(boot) => {
                let long = end == Err(Failure::Cancelled) && !self.read.is_empty();
                let result = if long { Ok(&self.read[..]) } else { end.map(|_| &self.read[..]) };
                let Err(verdict) = boot.done(result) else {
                    return boot.declined().map(|(address, code)| Said::Declined(address, code));
                };
                self.user = User::Nobody;
                Some(Said::NotBooted(verdict))
            }
        }
    }
}

const READ_TYPE: Transfer = Transfer::Upload { address: object::DEVICE_TYPE, block: false };
