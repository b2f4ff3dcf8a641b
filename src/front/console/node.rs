//! Nodes of CANopen buses on the console.

use puente_canopen::{Address, NodeId};
use puente_line::millis;

use super::super::dictionary::{Named, Whose};
use super::super::lines::Reply;
use super::super::objects::{self, Failed, Hex, Shown, Writing, decode, word};
use super::super::{Gateway, Guest};
use super::command::NodeCommand;
use super::{Told, error, say, separated};
use crate::clock;
use crate::desk::{CanFailure, SdoPending};

/// Longest object that is read, in bytes.
const OBJECT: usize = 64;

/// An object that is being read or written.
pub(in crate::front) struct Task {
    whose: Whose,
    address: Address,
    kind: Named,
    transfer: Transfer,
}

enum Transfer {
    Read(SdoPending<'static>),
    Write(Writing),
}

/// What has come of it: the bytes that were read, none where they are too many.
pub(in crate::front) struct Outcome {
    whose: Whose,
    address: Address,
    kind: Named,
    reads: bool,
    result: Result<Option<usize>, CanFailure>,
    bytes: [u8; OBJECT],
}

fn bus(gateway: &Gateway, name: &str, reply: &mut Reply) -> Result<u8, Told> {
    let bus = gateway.settings.bus(name).filter(|bus| gateway.desk.net_of(*bus).is_some());
    bus.ok_or_else(|| error(reply, "unknown-bus", "no CANopen bus has this name; 'bus' lists the buses"))
}

/// Lists the nodes of a bus.
pub(super) fn list(gateway: &Gateway, name: &str, reply: &mut Reply) -> Result<(), Told> {
    let bus = bus(gateway, name, reply)?;
    say(reply, format_args!("ok bus={name} nodes="));
    separated(reply, gateway.desk.nodes(bus).map(|(node, _)| node.value()));
    Ok(())
}

/// Does what can be done at once, and answers it; else there is a task.
pub(super) fn begin(
    gateway: &Gateway,
    guest: Guest,
    gone: bool,
    name: &str,
    node: NodeId,
    command: NodeCommand<'_>,
    reply: &mut Reply,
) -> Result<Task, Told> {
    let bus = bus(gateway, name, reply)?;
    let whose = Whose { bus, node };
    let (address, kind, value) = match command {
        NodeCommand::Status => {
            status(gateway, whose, reply);
            return Err(Told);
        }
        NodeCommand::Emergencies => {
            emergencies(gateway, whose, reply);
            return Err(Told);
        }
        NodeCommand::Nmt(command) => {
            return Err(match objects::command_nodes(gateway, guest.commander(), bus, Some(node), command) {
                Ok(()) => {
                    say(
                        reply,
                        format_args!("ok node={} sent={}", node.value(), objects::command_name(command)),
                    );
                    Told
                }
                Err(failure) => failed(whose, &failure, reply),
            });
        }
        NodeCommand::Read(address, kind) => (address, kind, None),
        NodeCommand::Write(address, value, kind) => (address, kind, Some(value)),
    };
    let kind = kind.unwrap_or_else(|| gateway.dictionaries.kind(whose, address));
    let by = guest.commander();
    let begun = match value {
        None => objects::read(gateway, by, whose, address).map(Transfer::Read).map_err(Failed::Can),
        Some(value) => match decode::<OBJECT>(value.as_bytes(), kind.1) {
            Some(data) => objects::write(gateway, by, gone, whose, address, &data).map(Transfer::Write),
            None => {
                let text = format_args!("'{value}' is no value of type {}", kind.0);
                return Err(error(reply, "value", text));
            }
        },
    };
    match begun {
        Ok(transfer) => Ok(Task { whose, address, kind, transfer }),
        Err(failure) => Err(failed(whose, &failure, reply)),
    }
}

fn failed(whose: Whose, failure: &Failed, reply: &mut Reply) -> Told {
    error(reply, failure.code(), format_args!("node {}: {failure}", whose.node.value()))
}

fn status(gateway: &Gateway, whose: Whose, reply: &mut Reply) {
    let Some(status) = gateway.desk.node(whose.bus, whose.node) else { return };
    say(reply, format_args!("ok node={} state=", whose.node.value()));
    match status.state {
        Some(state) => say(reply, format_args!("{state}")),
        None => say(reply, format_args!("?")),
    }
    say(reply, format_args!(" health={}", word(status.health)));
    if let puente_canopen::manager::Health::Refused(verdict) = status.health {
        say(reply, format_args!(" verdict=\"{verdict}\""));
    }
    match status.heard {
        Some(at) => say(reply, format_args!(" heard_ms={}", millis(clock::now().since(at)))),
        None => say(reply, format_args!(" heard_ms=?")),
    }
    match status.emergency {
        Some(emergency) => say(reply, format_args!(" emergency=\"{emergency}\"")),
        None => say(reply, format_args!(" emergency=none")),
    }
    say(reply, format_args!(" duplicate={}", u8::from(status.duplicate)));
    if let Some(held) = gateway.dictionaries.held(whose) {
        say(reply, format_args!(" objects={}", held.objects));
    }
}

/// The oldest first.
fn emergencies(gateway: &Gateway, whose: Whose, reply: &mut Reply) {
    let all = gateway.desk.emergencies(whose.bus, whose.node);
    say(reply, format_args!("ok node={} emergencies={}", whose.node.value(), all.len()));
    let now = clock::now();
    for (at, emergency) in &all {
        say(
            reply,
            format_args!(
                " code={:04X} text=\"{}\" register={:02X} vendor={} age_ms={}",
                emergency.code,
                puente_canopen::emcy::describe(emergency.code),
                emergency.register,
                Hex(emergency.vendor),
                millis(now.since(*at)),
            ),
        );
    }
}

/// Waits for the node.
pub(super) async fn finish(gateway: &Gateway, task: &mut Task) -> Outcome {
    let Task { whose, address, kind, transfer } = task;
    let mut bytes = [0; OBJECT];
    let (reads, result) = match transfer {
        Transfer::Read(pending) => (true, objects::collect(pending, &mut bytes).await),
        Transfer::Write(writing) => (false, writing.end(gateway).await.map(|()| Some(0))),
    };
    Outcome { whose: *whose, address: *address, kind: *kind, reads, result, bytes }
}

/// Writes the reply.
pub(super) fn tell(gateway: &Gateway, outcome: &Outcome, reply: &mut Reply) {
    let Outcome { whose, address, kind: (name, kind), reads, result, bytes } = outcome;
    let length = match result {
        Ok(Some(length)) => *length,
        Ok(None) => {
            let text = format_args!("the object has more than {OBJECT} bytes; read it in CiA 309-3");
            error(reply, "too-long", text);
            return;
        }
        Err(failure) => {
            failed(*whose, &Failed::Can(*failure), reply);
            return;
        }
    };
    let Address { index, sub } = address;
    say(reply, format_args!("ok node={} object={index:04X}:{sub} type={name}", whose.node.value()));
    if *reads {
        let bytes = bytes.get(..length).unwrap_or_default();
        say(reply, format_args!(" value=\"{}\"", Line(Shown { bytes, kind: *kind })));
    } else {
        say(reply, format_args!(" written=1"));
    }
    gateway.dictionaries.look(*whose, *address, |found| {
        if let Some(name) = found.name.or(found.group) {
            say(reply, format_args!(" name=\"{}\"", Line(name)));
        }
    });
}

/// What is shown within a line, and within quotes.
struct Line<T>(T);

impl<T: core::fmt::Display> core::fmt::Display for Line<T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        use core::fmt::Write as _;
        struct Escaped<'a, 'b>(&'a mut core::fmt::Formatter<'b>);
        impl core::fmt::Write for Escaped<'_, '_> {
            fn write_str(&mut self, text: &str) -> core::fmt::Result {
                text.chars().try_for_each(|letter| match letter {
                    '"' => self.0.write_char('\''),
                    letter if letter.is_control() => self.0.write_char('?'),
                    letter => self.0.write_char(letter),
                })
            }
        }
        write!(Escaped(f), "{}", self.0)
    }
}
