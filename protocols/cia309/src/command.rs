//! What a client commands.

use puente_canopen::lss::{Identity, Known, Mode, Part};
use puente_canopen::{Address, NodeId, nmt};

use crate::indication::Kinds;
use crate::tokens::{Tokens, is};
use crate::value::DataType;
use crate::{Error, help};

/// A command with its sequence number, and to whom.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request<'l> {
    /// The client's number for it; the reply repeats it.
    pub sequence: u32,
    /// Number of the network; `None` for a command that is of none.
    pub net: Option<u16>,
    /// What to do.
    pub command: Command<'l>,
}

/// What a client commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command<'l> {
    /// `r[ead] index sub [type]`: SDO upload.
    Read(NodeId, Address, DataType),
    /// `w[rite] index sub type value`: SDO download.
    Write {
        /// Whose object.
        node: NodeId,
        /// Which.
        address: Address,
        /// Data type of the value.
        kind: DataType,
        /// The value, to be read with a [`Decoder`](crate::value::Decoder): the rest of the line, comment included.
        value: &'l [u8],
    },
    /// `start`, `stop`, `preop[erational]`, `reset node`, `reset comm[unication]`; to all with `None`, node 0.
    Nmt(nmt::Command, Option<NodeId>),
    /// `set ...`.
    Set(Setting),
    /// `help [datatype|lss]`: the text.
    Help(&'static str),
    /// `led`.
    Led,
    /// `log`.
    Log,
    /// `lss_...`.
    Lss(Lss),
}

/// What a client may set, for itself alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// `set network`: the network of commands that name none.
    Network(u16),
    /// `set node`: the node of commands that name none.
    Node(NodeId),
    /// `set sdo_timeout`: for each response, ms.
    SdoTimeout(u16),
    /// `set sdo_block`: block transfer.
    SdoBlock(bool),
    /// `set events`, ours: what to tell unasked. Also `boot_up_indication`, as lely has it.
    Events(Kinds, bool),
}

/// Layer setting services.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lss {
    /// `lss_switch_glob 0|1`.
    SwitchGlobal(Mode),
    /// `lss_switch_sel vendor product revision serial`.
    Select(Identity),
    /// `lss_set_node`: 1 to 127, or 255 for none.
    SetNode(u8),
    /// `lss_conf_bitrate 0 index`.
    BitRate(u8),
    /// `lss_activate_bitrate ms`.
    Activate(u16),
    /// `lss_store`.
    Store,
    /// `lss_inquire_addr part`.
    Inquire(Part),
    /// `lss_inquire_addr`: all four parts.
    InquireAll,
    /// `lss_get_node`.
    NodeId,
    /// `_lss_fastscan [ms]`, CANopenNode's: time-out of each question.
    Fastscan(u16),
    /// `lss_allnodes`.
    AllNodes(AllNodes),
}

/// `lss_allnodes [ms [start store [type id]*4]]`: every node without node-ID gets one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AllNodes {
    /// Time-out of each question, ms.
    pub timeout: u16,
    /// The first node-ID that is given, 1 to 127.
    pub start: u8,
    /// They keep it.
    pub store: bool,
    /// Only those that fit.
    pub known: Known,
}

/// Time-out of a question of fastscan that is not said, ms.
pub const FASTSCAN_TIMEOUT: u16 = 100;
/// The first node-ID that `lss_allnodes` gives where none is said.
const FIRST_NODE: u8 = 2;

/// To whom, as it was said or set.
#[derive(Clone, Copy, Debug)]
pub(crate) struct To {
    /// The network, where there is such a one.
    pub net: Result<u16, Error>,
    /// The node, 0 to 127.
    pub node: Option<u8>,
}

impl To {
    /// One node, or all.
    fn any(self) -> Result<Option<NodeId>, Error> {
        let node = self.node.ok_or(Error::NoNode)?;
        self.net.map(|_| NodeId::new(node))
    }

    /// One node.
    fn one(self) -> Result<NodeId, Error> {
        match self.node {
            Some(0) => Err(Error::Node),
            _ => self.any()?.ok_or(Error::Node),
        }
    }
}

/// Whether the command is one of a network, not of a node: a single number before it is that of the network.
pub(crate) fn of_network(name: &[u8]) -> bool {
    let lss = |name: &[u8]| name.get(..4).is_some_and(|start| is(start, "lss_"));
    lss(name)
        || lss(name.get(1..).unwrap_or_default())
        || ["set", "help", "led", "log", "boot_up_indication"].iter().any(|other| is(name, other))
}

/// Reads what follows the name of a command.
pub(crate) fn parse<'l>(name: &[u8], to: To, mut args: Tokens<'l>) -> Result<Command<'l>, Error> {
    let command = match () {
        () if is(name, "r") || is(name, "read") => return read(to.one()?, args),
        () if is(name, "w") || is(name, "write") => return write(to.one()?, args),
        () if is(name, "start") => Command::Nmt(nmt::Command::Start, to.any()?),
        () if is(name, "stop") => Command::Nmt(nmt::Command::Stop, to.any()?),
        () if is(name, "preop") || is(name, "preoperational") => {
            Command::Nmt(nmt::Command::EnterPreOperational, to.any()?)
        }
        () if is(name, "reset") => {
            let node = to.any()?;
            Command::Nmt(reset(args.word()?)?, node)
        }
        () if is(name, "set") => Command::Set(setting(to, &mut args)?),
        () if is(name, "boot_up_indication") => {
            to.net?;
            Command::Set(Setting::Events(Kinds::BOOT_UP, able(args.word()?)?))
        }
        () if is(name, "help") => Command::Help(match args.next()? {
            None => help::COMMANDS,
            Some(word) if is(word, "datatype") => help::TYPES,
            Some(word) if is(word, "lss") => help::LSS,
            Some(_) => return Err(Error::Syntax),
        }),
        () if is(name, "led") => Command::Led,
        () if is(name, "log") => Command::Log,
        () => Command::Lss(lss(name, to, &mut args)?),
    };
    args.end()?;
    Ok(command)
}

fn address(args: &mut Tokens<'_>) -> Result<Address, Error> {
    let index = args.number(0, 0xFFFF)?;
    Ok(Address::new(index as u16, args.number(0, 0xFF)? as u8))
}

fn read<'l>(node: NodeId, mut args: Tokens<'l>) -> Result<Command<'l>, Error> {
    let address = address(&mut args)?;
    let kind = match args.next()? {
        None => DataType::Hex,
        Some(word) => DataType::parse(word).ok_or(Error::Syntax)?,
    };
    args.end()?;
    Ok(Command::Read(node, address, kind))
}

fn write<'l>(node: NodeId, mut args: Tokens<'l>) -> Result<Command<'l>, Error> {
    let address = address(&mut args)?;
    let kind = DataType::parse(args.word()?).ok_or(Error::Syntax)?;
    Ok(Command::Write { node, address, kind, value: args.rest() })
}

fn reset(word: &[u8]) -> Result<nmt::Command, Error> {
    match () {
        () if is(word, "node") => Ok(nmt::Command::ResetNode),
        () if is(word, "comm") || is(word, "communication") => Ok(nmt::Command::ResetCommunication),
        () => Err(Error::Syntax),
    }
}

fn setting(to: To, args: &mut Tokens<'_>) -> Result<Setting, Error> {
    let what = args.word()?;
    if is(what, "network") {
        return Ok(Setting::Network(args.number(0, 0xFFFF)? as u16));
    }
    let known = ["node", "sdo_timeout", "sdo_block", "events"].iter().any(|name| is(what, name));
    if !known {
        return Err(Error::Unsupported);
    }
    to.net?;
    Ok(match () {
        () if is(what, "node") => {
            Setting::Node(NodeId::new(args.number(1, 127)? as u8).ok_or(Error::Syntax)?)
        }
        () if is(what, "sdo_timeout") => Setting::SdoTimeout(args.number(1, 0xFFFF)? as u16),
        () if is(what, "sdo_block") => Setting::SdoBlock(args.number(0, 1)? == 1),
        () => {
            let kinds = Kinds::parse(args.word()?).ok_or(Error::Syntax)?;
            Setting::Events(kinds, args.number(0, 1)? == 1)
        }
    })
}

fn able(word: &[u8]) -> Result<bool, Error> {
    match () {
        () if is(word, "enable") => Ok(true),
        () if is(word, "disable") => Ok(false),
        () => Err(Error::Syntax),
    }
}

fn lss(name: &[u8], to: To, args: &mut Tokens<'_>) -> Result<Lss, Error> {
    const NAMES: [&str; 10] = [
        "lss_switch_glob",
        "lss_switch_sel",
        "lss_set_node",
        "lss_conf_bitrate",
        "lss_activate_bitrate",
        "lss_store",
        "lss_inquire_addr",
        "lss_get_node",
        "_lss_fastscan",
        "lss_allnodes",
    ];
    let service = NAMES.iter().position(|known| is(name, known)).ok_or(Error::Unsupported)?;
    to.net?;
    Ok(match service {
        0 => Lss::SwitchGlobal(match args.number(0, 1)? {
            0 => Mode::Waiting,
            _ => Mode::Configuration,
        }),
        1 => Lss::Select(Identity {
            vendor: args.number(0, u32::MAX)?,
            product: args.number(0, u32::MAX)?,
            revision: args.number(0, u32::MAX)?,
            serial: args.number(0, u32::MAX)?,
        }),
        2 => match args.number(0, 0xFF)? as u8 {
            id @ (1..=127 | 255) => Lss::SetNode(id),
            _ => return Err(Error::LssNode),
        },
        3 => {
            args.number(0, 0)?;
            match args.number(0, 9)? as u8 {
                // The table has no such index.
                5 => return Err(Error::Syntax),
                index => Lss::BitRate(index),
            }
        }
        4 => Lss::Activate(args.number(0, 0xFFFF)? as u16),
        5 => Lss::Store,
        6 if args.is_empty() => Lss::InquireAll,
        6 => Lss::Inquire(Part::from_number(args.number(0, 3)? as u8).ok_or(Error::Syntax)?),
        7 => Lss::NodeId,
        8 => Lss::Fastscan(timeout(args)?),
        _ => Lss::AllNodes(all_nodes(args)?),
    })
}

/// The time-out of fastscan, where there is one; 0 is none.
fn timeout(args: &mut Tokens<'_>) -> Result<u16, Error> {
    let said = if args.is_empty() { 0 } else { args.number(0, 0xFFFF)? as u16 };
    Ok(if said == 0 { FASTSCAN_TIMEOUT } else { said })
}

fn all_nodes(args: &mut Tokens<'_>) -> Result<AllNodes, Error> {
    let timeout = timeout(args)?;
    let mut all = AllNodes { timeout, start: FIRST_NODE, store: true, known: Known::default() };
    if !args.is_empty() {
        all.start = args.number(1, 127)? as u8;
        all.store = args.number(0, 1)? == 1;
    }
    if !args.is_empty() {
        all.known.vendor = scan(args)?;
        all.known.product = scan(args)?;
        all.known.revision = scan(args)?;
        all.known.serial = scan(args)?;
    }
    Ok(all)
}

/// How a part of the identity is looked for: 0 it is found out, 1 whatever it is, 2 it is known. To find a node whatever a part
/// of it is, that part is found out: the next question has to name it.
fn scan(args: &mut Tokens<'_>) -> Result<Option<u32>, Error> {
    let how = args.number(0, 2)?;
    let value = args.number(0, u32::MAX)?;
    Ok((how == 2).then_some(value))
}
