//! The dialects of CAN: CiA 309-3, and frames as text in controller mode and bridge mode, mixed with other lines at will.

mod cia309;
mod frames;
mod led;
mod lss;
mod news;
mod raw;
pub(super) mod slcan;
pub(super) mod socketcand;

use core::fmt::Write as _;

use embedded_io_async::{Read, Write};
use heapless::Vec;
use puente_canopen::{Address, Frame, NodeId, nmt};
use puente_cia309::command::{Lss, Setting};
use puente_cia309::reply::Answer;
use puente_cia309::value::DataType;
use puente_cia309::{Command, Error, Reply as Response, Request, Session};
use puente_frametext::Mode;

use super::inbox::Inbox;
use super::lines::Reply;
use super::{End, Gateway, Guest, send};
use crate::port::limits::CANOPEN;
use news::Followed;

/// A client, as far as it speaks these dialects.
pub(super) struct Client<'g> {
    gateway: &'g Gateway,
    guest: Guest,
    session: Session,
    /// What its last line was.
    last: Last,
    /// The buses of which it is told something unasked.
    followed: Vec<Followed<'g>, CANOPEN>,
}

/// What a line was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Last {
    /// CiA 309-3: an empty line is answered.
    Cia309,
    /// A frame: those of the bus come back so.
    Frame(Mode),
    /// Of another dialect.
    Other,
}

/// What takes its time. What it is about has been read.
#[derive(Clone, Copy)]
pub(super) struct Task {
    /// The number of the bus.
    bus: u8,
    work: Work,
}

#[derive(Clone, Copy)]
enum Work {
    /// Sends a frame.
    Frame(Frame),
    /// Does a command, by its sequence number.
    Command(u32, Action),
}

#[derive(Clone, Copy)]
enum Action {
    Read(NodeId, Address, DataType),
    /// The value is what the client says next.
    Write(NodeId, Address, DataType),
    Nmt(nmt::Command, Option<NodeId>),
    Lss(Lss),
    Help(&'static str),
    Led,
    Log,
}

impl<'g> Client<'g> {
    /// One that has said nothing yet.
    pub(super) fn new(gateway: &'g Gateway, guest: Guest) -> Self {
        let session = Session::new(gateway.only_net());
        Self { gateway, guest, session, last: Last::Other, followed: Vec::new() }
    }

    /// The client has said a line.
    pub(super) fn said(&mut self, last: Last) {
        self.last = last;
        self.follow_frames();
    }

    /// It has said nothing, in a line.
    pub(super) fn said_nothing(&self, reply: &mut Reply) {
        if self.last == Last::Cia309 {
            let _ = reply.push_str("\r\n");
        }
    }

    /// Reads a line of CiA 309-3 and answers it where that takes no time. Besides what is to be done: how much of the line has been read,
    /// with its end. One that is not whole may be a write whose value has begun.
    pub(super) fn command(&mut self, line: &[u8], whole: bool, reply: &mut Reply) -> (usize, Option<Task>) {
        self.said(Last::Cia309);
        let request = self.session.parse(line, |net| self.gateway.can_bus(net).is_some());
        let (sequence, outcome) = match request {
            Ok(None) => {
                self.said_nothing(reply);
                return (line.len(), None);
            }
            Ok(Some(request)) if !whole && !matches!(request.command, Command::Write { .. }) => {
                (request.sequence, Err(Error::Syntax))
            }
            Ok(Some(Request { sequence, command: Command::Write { value: [], .. }, .. })) if whole => {
                (sequence, Err(Error::Syntax))
            }
            Ok(Some(request)) => {
                let bus = request.net.and_then(|net| self.gateway.can_bus(net));
                (request.sequence, self.begin(bus, request.command))
            }
            Err(refused) => (refused.sequence, Err(refused.error)),
        };
        let (read, answer) = match outcome {
            Ok(Begun::Task(bus, action, left)) => {
                let task = Task { bus, work: Work::Command(sequence, action) };
                return (line.len() - left, Some(task));
            }
            Ok(Begun::Done) => (line.len(), Answer::Ok),
            Err(error) => (line.len(), Answer::Error(error)),
        };
        let _ = write!(reply, "{}", Response { sequence, answer });
        (read, None)
    }

    fn begin(&mut self, bus: Option<u8>, command: Command<'_>) -> Result<Begun, Error> {
        // A place that is kept for stops; what of NMT is one is judged later.
        if self.guest.stop_only && !matches!(command, Command::Nmt(..) | Command::Help(_)) {
            return Err(Error::State);
        }
        let (action, left) = match command {
            Command::Read(node, address, kind) => (Action::Read(node, address, kind), 0),
            Command::Write { node, address, kind, value } => {
                (Action::Write(node, address, kind), value.len())
            }
            Command::Nmt(command, node) => (Action::Nmt(command, node), 0),
            Command::Lss(command) => (Action::Lss(command), 0),
            Command::Help(text) => (Action::Help(text), 0),
            Command::Led => (Action::Led, 0),
            Command::Log => (Action::Log, 0),
            Command::Set(setting) => {
                self.set(bus, setting);
                return Ok(Begun::Done);
            }
        };
        // Help is of no network.
        let bus = match (bus, action) {
            (Some(bus), _) => bus,
            (None, Action::Help(_)) => 0,
            (None, _) => return Err(Error::NoNet),
        };
        Ok(Begun::Task(bus, action, left))
    }

    fn set(&mut self, bus: Option<u8>, setting: Setting) {
        self.session.set(setting);
        if let (Setting::Events(kinds, on), Some(bus)) = (setting, bus) {
            self.follow_events(bus, kinds, on);
        }
    }

    /// Does what takes its time, and answers.
    pub(super) async fn serve<R: Read, W: Write>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
        task: Task,
    ) -> Result<(), End> {
        match task.work {
            Work::Frame(frame) => self.send_frame(inbox, writer, task.bus, &frame).await,
            Work::Command(sequence, action) => match action {
                Action::Read(node, address, kind) => {
                    self.read(inbox, writer, cia309::Object { bus: task.bus, sequence, node, address, kind })
                        .await
                }
                Action::Write(node, address, kind) => {
                    self.write(inbox, writer, cia309::Object { bus: task.bus, sequence, node, address, kind })
                        .await
                }
                Action::Nmt(command, node) => {
                    let answer = self.nmt(inbox.ended(), task.bus, command, node);
                    say(writer, sequence, answer).await
                }
                Action::Lss(command) => self.lss(inbox, writer, task.bus, sequence, command).await,
                Action::Help(text) => send(writer, text.as_bytes()).await,
                Action::Led => self.led(inbox, writer, task.bus).await,
                Action::Log => self.log(writer, task.bus).await,
            },
        }
    }
}

/// What has become of a command at once.
enum Begun {
    /// It is done.
    Done,
    /// It is to be done on a bus; so many bytes of the line are left for it.
    Task(u8, Action, usize),
}

/// Answers a command.
async fn say<W: Write>(writer: &mut W, sequence: u32, answer: Answer) -> Result<(), End> {
    let mut reply = heapless::String::<128>::new();
    let _ = write!(reply, "{}", Response { sequence, answer });
    send(writer, reply.as_bytes()).await
}

impl Gateway {
    /// The bus of a CiA 309-3 network.
    fn can_bus(&self, net: u16) -> Option<u8> {
        self.can_buses().find(|(_, other)| *other == net).map(|(bus, _)| bus)
    }

    /// The CANopen buses: their numbers among all, and those of their networks.
    fn can_buses(&self) -> impl Iterator<Item = (u8, u16)> {
        let buses = (0..).zip(&self.settings.buses);
        buses.filter_map(|(index, bus)| Some((index, bus.canopen()?.net)))
    }

    /// The number of the network, where there is but one.
    fn only_net(&self) -> Option<u16> {
        let mut nets = self.can_buses().map(|(_, net)| net);
        nets.next().filter(|_| nets.next().is_none())
    }
}
