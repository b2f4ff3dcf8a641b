//! Nodes of CANopen buses and their objects, as every dialect for people has them.

mod value;

use core::fmt;

use puente_canopen::manager::Health;
use puente_canopen::sdo::Failure;
use puente_canopen::{Address, NodeId, nmt};

use super::Gateway;
use super::dictionary::Whose;
use crate::axis::{AxisError, CanRefusal, Commander, Ruling};
use crate::clock;
use crate::desk::{CanFailure, Class, Reason, SdoOrder, SdoPending, SdoTransfer};
pub(super) use value::{Shown, decode};

const COMMANDS: [(&str, nmt::Command); 5] = [
    ("start", nmt::Command::Start),
    ("stop", nmt::Command::Stop),
    ("preop", nmt::Command::EnterPreOperational),
    ("reset", nmt::Command::ResetNode),
    ("reset-communication", nmt::Command::ResetCommunication),
];

/// The NMT command of a word.
pub(super) fn command(word: &str) -> Option<nmt::Command> {
    COMMANDS.iter().find(|(name, _)| *name == word).map(|(_, command)| *command)
}

/// The word of an NMT command.
pub(super) fn command_name(command: nmt::Command) -> &'static str {
    COMMANDS.iter().find(|(_, known)| *known == command).map_or("", |(name, _)| name)
}

/// What became of a node, in a word.
pub(super) const fn word(health: Health) -> &'static str {
    match health {
        Health::Unmanaged => "unmanaged",
        Health::Absent => "absent",
        Health::Booting => "booting",
        Health::Booted => "booted",
        Health::Lost => "lost",
        Health::Refused(_) => "refused",
    }
}

/// Bytes in hexadecimal, without spaces.
pub(super) struct Hex<const N: usize>(pub [u8; N]);

impl<const N: usize> fmt::Display for Hex<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// An object: its index in hexadecimal and its sub-index, as in `6041:0` or `0x1018:1`; `6041` is `6041:0`.
pub(super) fn address(text: &str) -> Option<Address> {
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let index = index.strip_prefix("0x").unwrap_or(index);
    let sub = match sub.strip_prefix("0x") {
        Some(sub) => u8::from_str_radix(sub, 16),
        None => sub.parse(),
    };
    Some(Address::new(u16::from_str_radix(index, 16).ok()?, sub.ok()?))
}

/// Why something was not done, or did not end well.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Failed {
    /// Another client commands an axis that it acts on, or that axis has to stand still.
    Axis(AxisError),
    /// It is not a client's to send.
    Reserved(CanRefusal),
    /// What came of it.
    Can(CanFailure),
}

impl From<CanFailure> for Failed {
    fn from(failure: CanFailure) -> Self {
        Failed::Can(failure)
    }
}

impl Failed {
    /// The word that programs go by.
    pub(super) const fn code(&self) -> &'static str {
        match self {
            Failed::Axis(error) => error.code(),
            Failed::Reserved(_) => "reserved",
            Failed::Can(failure) => failure_code(failure),
        }
    }
}

impl fmt::Display for Failed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failed::Axis(error) => error.fmt(f),
            Failed::Reserved(refusal) => refusal.fmt(f),
            Failed::Can(failure) => failure.fmt(f),
        }
    }
}

/// An object that is being written.
pub(super) struct Writing {
    pending: SdoPending<'static>,
    ruling: Ruling,
}

impl Writing {
    /// Waits until all is written.
    pub(super) async fn end(&mut self, gateway: &Gateway) -> Result<(), CanFailure> {
        let result = self.pending.written().await;
        let sent = !matches!(result, Err(CanFailure::NotSent(_) | CanFailure::TooLong));
        gateway.axes.raw_ended(&self.ruling, sent);
        result
    }
}

/// Begins to write an object, where its axis does not forbid it. A client that is `gone` starts no motion.
pub(super) fn write(
    gateway: &Gateway,
    by: Commander,
    gone: bool,
    Whose { bus, node }: Whose,
    address: Address,
    data: &[u8],
) -> Result<Writing, Failed> {
    let ruling = gateway.axes.judge_sdo(by, bus, node, address, data);
    let ruling = ruling.map_err(|leased| Failed::Axis(AxisError::Leased(leased)))?;
    let transfer = SdoTransfer::Write { address, data, block: false };
    let order = SdoOrder { seat: by.seat, bus, node, class: ruling.class, transfer, timeout: None };
    let pending = match gone && ruling.motion.is_some() {
        true => Err(CanFailure::NotSent(Reason::Stopped)),
        false => gateway.desk.sdo(clock::now(), order),
    };
    if pending.is_err() {
        gateway.axes.raw_ended(&ruling, false);
    }
    Ok(Writing { pending: pending?, ruling })
}

/// Sends an NMT command, where no axis forbids it.
pub(super) fn command_nodes(
    gateway: &Gateway,
    by: Commander,
    bus: u8,
    node: Option<NodeId>,
    command: nmt::Command,
) -> Result<(), Failed> {
    let ruling = gateway.axes.judge_can(by, bus, &command.frame(node)).map_err(|refusal| match refusal {
        CanRefusal::Leased(leased) => Failed::Axis(AxisError::Leased(leased)),
        reserved => Failed::Reserved(reserved),
    })?;
    let sent = gateway.desk.nmt(clock::now(), bus, command, node, &ruling.permits);
    gateway.axes.frame_ended(&ruling.permits, sent.is_ok());
    Ok(sent.map_err(CanFailure::NotSent)?)
}

/// Begins to read an object.
pub(super) fn read(
    gateway: &Gateway,
    by: Commander,
    Whose { bus, node }: Whose,
    address: Address,
) -> Result<SdoPending<'static>, CanFailure> {
    let transfer = SdoTransfer::Read { address, block: false };
    let order = SdoOrder { seat: by.seat, bus, node, class: Class::Free, transfer, timeout: None };
    gateway.desk.sdo(clock::now(), order)
}

/// All of what is read; how many bytes that are, none where they have no room.
pub(super) async fn collect(
    pending: &mut SdoPending<'_>,
    room: &mut [u8],
) -> Result<Option<usize>, CanFailure> {
    let mut filled = 0;
    loop {
        let free = room.get_mut(filled..).unwrap_or_default();
        let mut more = [0];
        let count = if free.is_empty() { pending.read(&mut more).await? } else { pending.read(free).await? };
        match count {
            0 => return Ok(Some(filled)),
            _ if filled == room.len() => return Ok(None),
            count => filled += count,
        }
    }
}

/// The word for what became of a transfer.
pub(super) const fn failure_code(failure: &CanFailure) -> &'static str {
    match failure {
        CanFailure::NotSent(_) => "not-sent",
        CanFailure::TooLong => "too-large",
        CanFailure::Sdo(Failure::Aborted(_)) => "abort",
        CanFailure::Sdo(Failure::Timeout { .. }) => "no-reply",
        CanFailure::Sdo(_) => "sdo",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_have_an_index_and_a_sub_index() {
        for (text, expected) in [
            ("6041", Some((0x6041, 0))),
            ("0x6041:0", Some((0x6041, 0))),
            ("1a00:12", Some((0x1A00, 12))),
            ("1A00:0x0C", Some((0x1A00, 12))),
            ("", None),
            ("6041:", None),
            ("6041:256", None),
            ("16041:0", None),
            ("604g", None),
            ("6041:0:0", None),
        ] {
            assert_eq!(address(text), expected.map(|(index, sub)| Address::new(index, sub)), "{text}");
        }
    }

    #[test]
    fn commands_have_words() {
        for word in ["start", "stop", "preop", "reset", "reset-communication"] {
            let found = command(word).expect("a command");
            assert_eq!(command_name(found), word);
        }
        assert_eq!(command("jog"), None);
    }
}
