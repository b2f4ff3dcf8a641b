//! Layer setting services.

use core::fmt::Write as _;
use core::pin::pin;

use embedded_io_async::{Read, Write};
use heapless::String;
use puente_canopen::lss::{self, Failure, Identity, Known, Mode, Outcome, Part};
use puente_cia309::Error;
use puente_cia309::command::{AllNodes, Lss};
use puente_cia309::reply::Answer;
use puente_line::Duration;

use super::super::inbox::Inbox;
use super::super::{End, send};
use super::cia309::unsent;
use super::raw::Unsent;
use super::{Client, say};
use crate::desk::LssFailure;

/// Highest node-ID.
const LAST_NODE: u8 = 127;

impl Client<'_> {
    /// Does one of the commands.
    pub(super) async fn lss<R: Read, W: Write>(
        &mut self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
        bus: u8,
        sequence: u32,
        command: Lss,
    ) -> Result<(), End> {
        let single = match command {
            Lss::SwitchGlobal(mode) => lss::Command::SwitchGlobal(mode),
            Lss::Select(identity) => lss::Command::Select(identity),
            Lss::SetNode(id) => lss::Command::ConfigureNodeId(id),
            Lss::BitRate(index) => lss::Command::ConfigureBitTiming { table: 0, index },
            Lss::Activate(delay) => lss::Command::ActivateBitTiming { delay },
            Lss::Store => lss::Command::Store,
            Lss::Inquire(part) => lss::Command::Inquire(part),
            Lss::NodeId => lss::Command::InquireNodeId,
            Lss::InquireAll => {
                let answer = self.inquire(inbox, bus).await?;
                return say(writer, sequence, answer).await;
            }
            Lss::Fastscan(timeout) => {
                let answer = match self.scan(inbox, bus, Known::default(), timeout).await? {
                    Ok(identity) => Answer::Identity(identity),
                    Err(error) => Answer::Error(error),
                };
                return say(writer, sequence, answer).await;
            }
            Lss::AllNodes(all) => {
                let answer = self.all_nodes(inbox, writer, bus, all).await?;
                return say(writer, sequence, answer).await;
            }
        };
        let answer = match self.one(inbox, bus, single, None).await? {
            Ok(Outcome::Done) => Answer::Ok,
            Ok(Outcome::Part(part)) => Answer::Part(part),
            Ok(Outcome::NodeId(id)) => Answer::NodeId(id),
            Ok(Outcome::Identity(identity)) => Answer::Identity(identity),
            Err(error) => Answer::Error(error),
        };
        say(writer, sequence, answer).await
    }

    /// One service. Nodes have `timeout` ms for each answer, or as the bus has it.
    async fn one<R: Read>(
        &self,
        inbox: &mut Inbox<'_, R>,
        bus: u8,
        command: lss::Command,
        timeout: Option<u16>,
    ) -> Result<Result<Outcome, Error>, End> {
        if let Err(why) = self.gateway.may_configure(self.guest, inbox.ended(), bus) {
            return Ok(Err(unsent(why)));
        }
        let timeout = timeout.map(|ms| Duration::from_millis(ms.into()));
        let service = pin!(self.gateway.desk.lss(self.guest.seat, bus, command, timeout));
        let done = Self::during(inbox, service).await?;
        Ok(done.map_err(|failure| match failure {
            LssFailure::NotSent(reason) => unsent(Unsent::NotSent(reason)),
            LssFailure::Lss(failure) => error(command, failure),
        }))
    }

    /// All four parts of an identity.
    async fn inquire<R: Read>(&self, inbox: &mut Inbox<'_, R>, bus: u8) -> Result<Answer, End> {
        let mut identity = Identity::default();
        for part in Part::ALL {
            match self.one(inbox, bus, lss::Command::Inquire(part), None).await? {
                Ok(Outcome::Part(value)) => identity.set(part, value),
                Ok(_) => return Ok(Answer::Error(Error::State)),
                Err(error) => return Ok(Answer::Error(error)),
            }
        }
        Ok(Answer::Identity(identity))
    }

    async fn scan<R: Read>(
        &self,
        inbox: &mut Inbox<'_, R>,
        bus: u8,
        known: Known,
        timeout: u16,
    ) -> Result<Result<Identity, Error>, End> {
        Ok(match self.one(inbox, bus, lss::Command::Fastscan(known), Some(timeout)).await? {
            Ok(Outcome::Identity(identity)) => Ok(identity),
            Ok(_) => Err(Error::State),
            Err(error) => Err(error),
        })
    }

    /// Gives every node without node-ID one, and tells of each as CANopenNode does.
    async fn all_nodes<R: Read, W: Write>(
        &self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
        bus: u8,
        all: AllNodes,
    ) -> Result<Answer, End> {
        for (found, id) in (all.start..=LAST_NODE).enumerate() {
            let identity = match self.scan(inbox, bus, all.known, all.timeout).await? {
                Ok(identity) => identity,
                Err(Error::TimeOut) => {
                    tell(writer, format_args!("# Found {found} nodes, search finished.\n")).await?;
                    return Ok(Answer::Ok);
                }
                Err(error) => return Ok(Answer::Error(error)),
            };
            let store = all.store.then_some(lss::Command::Store);
            let steps = [
                Some(lss::Command::ConfigureNodeId(id)),
                store,
                Some(lss::Command::SwitchGlobal(Mode::Waiting)),
            ];
            for step in steps.into_iter().flatten() {
                if let Err(error) = self.one(inbox, bus, step, Some(all.timeout)).await? {
                    return Ok(Answer::Error(error));
                }
            }
            let who = Answer::Identity(identity);
            tell(writer, format_args!("# Node-ID {id} assigned to: {who}\n")).await?;
        }
        tell(writer, format_args!("# Not all nodes scanned!\n")).await?;
        Ok(Answer::Ok)
    }
}

async fn tell<W: Write>(writer: &mut W, line: core::fmt::Arguments<'_>) -> Result<(), End> {
    let mut text = String::<96>::new();
    let _ = text.write_fmt(line);
    send(writer, text.as_bytes()).await
}

/// The number of a failure.
fn error(command: lss::Command, failure: Failure) -> Error {
    match (command, failure) {
        (_, Failure::Timeout | Failure::Nobody) => Error::TimeOut,
        (_, Failure::Vanished) => Error::State,
        (_, Failure::Refused { error: 255, .. }) => Error::LssVendor,
        (lss::Command::ConfigureNodeId(_), _) => Error::LssNode,
        (lss::Command::ConfigureBitTiming { .. }, _) => Error::LssBitRate,
        (lss::Command::Store, Failure::Refused { error: 2, .. }) => Error::LssMedia,
        (lss::Command::Store, _) => Error::LssStore,
        _ => Error::State,
    }
}
