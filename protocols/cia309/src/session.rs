//! A client: what it has set, and the lines it sends.

use puente_canopen::NodeId;

use crate::command::{self, Request, Setting, To};
use crate::tokens::Tokens;
use crate::{Error, number};

/// Most numbers before a command: network and node.
const NUMBERS: usize = 2;

/// A line that is no command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refused {
    /// Its number; 0 where it has none that can be read.
    pub sequence: u32,
    /// Why.
    pub error: Error,
}

/// What a client has set.
#[derive(Clone, Copy, Debug)]
pub struct Session {
    /// The network of commands that name none.
    pub net: Option<u16>,
    /// The node of commands that name none.
    pub node: Option<NodeId>,
    /// Time-out of each SDO response, ms; none unless it was set.
    pub sdo_timeout: Option<u16>,
    /// Objects are read and written in blocks.
    pub sdo_block: bool,
}

impl Session {
    /// A new client; with a network where there is but one.
    pub const fn new(net: Option<u16>) -> Self {
        Self { net, node: None, sdo_timeout: None, sdo_block: false }
    }

    /// Sets something, other than what to tell of a network.
    pub fn set(&mut self, setting: Setting) {
        match setting {
            Setting::Network(net) => self.net = Some(net),
            Setting::Node(node) => self.node = Some(node),
            Setting::SdoTimeout(ms) => self.sdo_timeout = Some(ms),
            Setting::SdoBlock(on) => self.sdo_block = on,
            // Of a network, so that it is not the session's.
            Setting::Events(..) => {}
        }
    }

    /// Reads a line, with or without its end; `None` for one that says nothing, or nothing but a comment. `known` tells which
    /// networks there are. A line that has not come whole may be read as soon as it has come to the value of a
    /// [`Write`](crate::Command::Write).
    ///
    /// # Errors
    /// As CANopenNode: first node and network, then what follows the command.
    pub fn parse<'l>(
        &self,
        line: &'l [u8],
        known: impl Fn(u16) -> bool,
    ) -> Result<Option<Request<'l>>, Refused> {
        let mut sequence = 0;
        self.read(line, known, &mut sequence).map_err(|error| Refused { sequence, error })
    }

    fn read<'l>(
        &self,
        line: &'l [u8],
        known: impl Fn(u16) -> bool,
        sequence: &mut u32,
    ) -> Result<Option<Request<'l>>, Error> {
        let mut tokens = Tokens::new(line);
        let Some(first) = tokens.next()? else {
            return Ok(None);
        };
        *sequence = bracketed(first).ok_or(Error::Syntax)?;
        let (numbers, name) = numbers(&mut tokens)?;
        let (net, node) = match (numbers.as_slice(), command::of_network(name)) {
            ([net, node], _) => (Some(*net), Some(*node)),
            ([net], true) => (Some(*net), None),
            ([node], false) => (None, Some(*node)),
            _ => (None, None),
        };
        let net = match net {
            Some(net) => Some(u16::try_from(net).map_err(|_| Error::Net)?),
            None => self.net,
        };
        if node.is_some_and(|node| node > 127) {
            return Err(Error::Node);
        }
        let node = node.map(|node| node as u8);
        let to = To {
            net: match net {
                None => Err(Error::NoNet),
                Some(net) if known(net) => Ok(net),
                Some(_) => Err(Error::Net),
            },
            node: node.or(self.node.map(NodeId::value)),
        };
        let command = command::parse(name, to, tokens)?;
        if let command::Command::Set(Setting::Network(net)) = command
            && !known(net)
        {
            return Err(Error::Net);
        }
        Ok(Some(Request { sequence: *sequence, net, command }))
    }
}

/// The number in `[12]`.
fn bracketed(word: &[u8]) -> Option<u32> {
    let number = word.strip_prefix(b"[")?.strip_suffix(b"]")?;
    number::unsigned(number)?.try_into().ok()
}

/// The numbers before a command, and its name.
fn numbers<'l>(tokens: &mut Tokens<'l>) -> Result<(heapless::Vec<u32, NUMBERS>, &'l [u8]), Error> {
    let mut numbers = heapless::Vec::new();
    loop {
        let word = tokens.word()?;
        if !word.first().is_some_and(u8::is_ascii_digit) {
            return Ok((numbers, word));
        }
        let number = number::unsigned(word).and_then(|number| u32::try_from(number).ok());
        numbers.push(number.ok_or(Error::Syntax)?).map_err(|_| Error::Syntax)?;
    }
}
