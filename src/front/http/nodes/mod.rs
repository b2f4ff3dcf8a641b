//! Nodes of CANopen buses: what is known of them, their objects, NMT.

mod path;
mod value;
mod view;

use embedded_io_async::{Read, Write};
use puente_canopen::{Address, NodeId, nmt};
use puente_eds::Error;

use super::super::Gateway;
use super::super::dictionary::{Held, Named, Whose, named};
use super::super::inbox::Inbox;
use super::Fault;
use super::api::Call;
use super::head::Method;
use super::problem::Problem;
use super::reply::Reply;
use crate::axis::Commander;
use crate::clock;
use crate::front::objects::{Writing, address, collect, command_nodes, read, write};
pub(super) use path::Path;

/// Longest data sheet, in bytes.
pub(super) const EDS: usize = 1 << 20;
/// Longest object that is read, in bytes: so much of it is in each place for a client.
pub(super) const OBJECT: usize = 128;

/// What was asked for.
pub(super) enum Task {
    All(u8),
    Node(Whose),
    Command(u8, Option<NodeId>, nmt::Command),
    Emergencies(Whose),
    Sheet(Whose),
    /// A data sheet is to come.
    Upload(Whose),
    /// It has come.
    Uploaded(Option<Held>),
    Forget(Whose),
    Objects(Whose),
    Read(Whose, Address, Named),
    /// What is written is on its way already.
    Write(Whose, Address, Named, Writing),
}

/// Understands a request for the nodes of a bus. A write begins at once: no place is kept for what is written.
pub(super) fn understand(
    gateway: &Gateway,
    by: Commander,
    bus: &str,
    path: Path<'_>,
    method: Method,
    body: &[u8],
) -> Result<Task, Problem> {
    let index = gateway.settings.bus(bus).filter(|bus| gateway.desk.net_of(*bus).is_some());
    let bus = index.ok_or(Problem::UnknownBus)?;
    let whose = |node: &str| -> Result<_, Problem> {
        Ok(Whose { bus, node: id(node)?.ok_or(Problem::UnknownNode)? })
    };
    Ok(match path {
        Path::All => Task::All(bus),
        Path::Node(node) => Task::Node(whose(node)?),
        Path::Command(node, command) => Task::Command(bus, id(node)?, command),
        Path::Emergencies(node) => Task::Emergencies(whose(node)?),
        Path::Sheet(node) => match method {
            Method::Put => Task::Upload(whose(node)?),
            Method::Delete => Task::Forget(whose(node)?),
            _ => Task::Sheet(whose(node)?),
        },
        Path::Objects(node) => Task::Objects(whose(node)?),
        Path::Object(node, object, kind) => {
            let (whose, address) = (whose(node)?, address(object).ok_or(Problem::Object)?);
            let kind = match kind {
                Some(name) => named(name).ok_or(Problem::Type)?,
                None => gateway.dictionaries.kind(whose, address),
            };
            match method {
                Method::Put => {
                    let data = value::bytes(body, kind)?;
                    Task::Write(whose, address, kind, write(gateway, by, false, whose, address, &data)?)
                }
                _ => Task::Read(whose, address, kind),
            }
        }
    })
}

/// A node, or with 0 all.
fn id(text: &str) -> Result<Option<NodeId>, Problem> {
    match text.parse() {
        Ok(0) => Ok(None),
        Ok(id) => NodeId::new(id).map(Some).ok_or(Problem::UnknownNode),
        Err(_) => Err(Problem::UnknownNode),
    }
}

/// Takes in a data sheet of `length` bytes as it comes. It is heard to its end, so that its client hears what is wrong with it.
pub(super) async fn receive<R: Read>(
    gateway: &Gateway,
    whose: Whose,
    inbox: &mut Inbox<'_, R>,
    length: usize,
) -> Result<Result<Task, Problem>, Fault> {
    let mut upload = gateway.dictionaries.begin(whose).ok_or(Problem::Busy)?;
    let mut missing = length;
    let mut read: Result<(), Error> = Ok(());
    while missing > 0 {
        let data = inbox.data();
        let piece = data.get(..data.len().min(missing)).unwrap_or_default();
        let count = piece.len();
        read = read.and_then(|()| upload.push(piece));
        inbox.consume(count);
        missing -= count;
        if missing > 0 {
            if inbox.ended() {
                return Err(Problem::Request("the request ends too early").into());
            }
            inbox.fill().await?;
        }
    }
    Ok(read.and_then(|()| upload.end()).map(Task::Uploaded).map_err(Problem::Eds))
}

impl Call<'_> {
    /// Carries a task out and sends the reply.
    pub(super) async fn nodes<W: Write>(&self, task: Task, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        let dictionaries = &self.gateway.dictionaries;
        match task {
            Task::All(bus) => self.list(bus, reply).await?,
            Task::Node(whose) => {
                let status = self.gateway.desk.node(whose.bus, whose.node).ok_or(Problem::UnknownBus)?;
                reply.value(&view::Node::new(&self.findings(whose, status))).await?;
            }
            Task::Command(bus, node, command) => {
                command_nodes(self.gateway, self.by, bus, node, command)?;
                reply.value(&view::Commanded::new(node, command)).await?;
            }
            Task::Emergencies(whose) => self.emergencies(whose, reply).await?,
            Task::Sheet(whose) => reply.value(&view::Sheet::new(dictionaries.held(whose))).await?,
            // It has come before it is answered.
            Task::Upload(_) => return Err(Problem::Busy.into()),
            Task::Uploaded(held) => reply.value(&view::Sheet::new(held)).await?,
            Task::Forget(whose) => {
                dictionaries.forget(whose);
                reply.value(&view::Sheet::new(None)).await?;
            }
            Task::Objects(whose) => self.objects(whose, reply).await?,
            Task::Read(whose, address, kind) => {
                let mut bytes = [0; OBJECT];
                let mut pending = read(self.gateway, self.by, whose, address)?;
                let length = collect(&mut pending, &mut bytes).await?.ok_or(Problem::ObjectTooLong)?;
                let bytes = bytes.get(..length).unwrap_or_default();
                self.object(whose, address, kind, Some(bytes), reply).await?;
            }
            Task::Write(whose, address, kind, mut writing) => {
                writing.end(self.gateway).await?;
                self.object(whose, address, kind, None, reply).await?;
            }
        }
        Ok(())
    }

    fn findings(&self, whose: Whose, status: puente_canopen::manager::Status) -> view::Findings<'_> {
        let settings = self.gateway.settings;
        let id = whose.node.value();
        let name = settings.buses.get(usize::from(whose.bus)).map(|bus| &bus.name);
        let axis = settings.axes.iter().find(|axis| Some(&axis.bus) == name && axis.address == id);
        view::Findings {
            now: clock::now(),
            node: whose.node,
            status,
            settings: settings.nodes.iter().find(|node| Some(&node.bus) == name && node.id == id),
            axis: axis.map(|axis| axis.name.as_str()),
            held: self.gateway.dictionaries.held(whose),
        }
    }

    async fn list<W: Write>(&self, bus: u8, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        reply.put(format_args!("[")).await?;
        for (number, (node, status)) in self.gateway.desk.nodes(bus).enumerate() {
            reply.put(format_args!("{}", if number > 0 { "," } else { "" })).await?;
            let write = |room: &mut [u8]| {
                serde_json_core::to_slice(&view::Node::new(&self.findings(Whose { bus, node }, status)), room)
                    .ok()
            };
            reply.append(write).await?;
        }
        reply.put(format_args!("]")).await?;
        Ok(reply.finish().await?)
    }

    async fn emergencies<W: Write>(&self, whose: Whose, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        let now = clock::now();
        reply.put(format_args!("[")).await?;
        for (number, (at, emergency)) in
            self.gateway.desk.emergencies(whose.bus, whose.node).iter().enumerate()
        {
            reply.put(format_args!("{}", if number > 0 { "," } else { "" })).await?;
            reply.json(&view::Dated::new(now, *at, *emergency)).await?;
        }
        reply.put(format_args!("]")).await?;
        Ok(reply.finish().await?)
    }

    async fn objects<W: Write>(&self, whose: Whose, reply: &mut Reply<'_, W>) -> Result<(), Fault> {
        reply.put(format_args!("[")).await?;
        let mut number = 0;
        while self.gateway.dictionaries.nth(whose, number, |_| ()).is_some() {
            let comma = if number > 0 { "," } else { "" };
            reply.put(format_args!("{comma}")).await?;
            let known =
                |number| self.gateway.dictionaries.nth(whose, number, |found| view::Known::new(&found));
            // Copied out and written at once, so that no place for a client keeps room for it.
            let write = |room: &mut [u8]| {
                known(number).map_or(Some(0), |known| {
                    serde_json_core::to_slice(&view::Object::listed(whose.node, &known), room).ok()
                })
            };
            reply.append(write).await?;
            number += 1;
        }
        reply.put(format_args!("]")).await?;
        Ok(reply.finish().await?)
    }

    /// An object with what is known of it, and its value where it was read.
    async fn object<W: Write>(
        &self,
        whose: Whose,
        address: Address,
        kind: Named,
        bytes: Option<&[u8]>,
        reply: &mut Reply<'_, W>,
    ) -> Result<(), Fault> {
        let write = |room: &mut [u8]| {
            let known = self.gateway.dictionaries.look(whose, address, |found| view::Known::new(&found));
            serde_json_core::to_slice(
                &view::Object::new(whose.node, address, known.as_ref(), kind, bytes),
                room,
            )
            .ok()
        };
        reply.append(write).await?;
        Ok(reply.finish().await?)
    }
}

#[cfg(test)]
mod tests;
