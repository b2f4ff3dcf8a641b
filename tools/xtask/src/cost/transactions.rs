//! What is measured: each a request and its reply on an open connection.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::Duration;

use puente_emulator::Emulator;
use puente_modbus::mbap;
use puente_modbus::request::Request;

const PATIENCE: Duration = Duration::from_secs(5);
const UNIT: u8 = 1;

/// An open connection.
pub struct Connection {
    stream: TcpStream,
    /// Of Modbus/TCP: number of the last transaction.
    number: u16,
}

pub struct Transaction {
    /// As in the table,
    pub name: &'static str,
    /// and as on the command line.
    pub short: &'static str,
    pub connect: fn(&Emulator) -> Result<Connection, String>,
    exchange: fn(&mut Connection) -> std::io::Result<()>,
    /// Transactions of a batch, and batches.
    pub batch: u32,
    pub batches: usize,
}

impl Transaction {
    /// The error says why there is no good reply.
    pub fn exchange(&self, connection: &mut Connection) -> Result<(), String> {
        (self.exchange)(connection).map_err(|error| error.to_string())
    }
}

pub const ALL: &[Transaction] = &[
    Transaction {
        name: "TCP echo of 12 bytes",
        short: "echo",
        connect: |board| connect(board.echo),
        exchange: |connection| connection.say(b"hello puente", |reply| reply == b"hello puente"),
        batch: 50,
        batches: 7,
    },
    Transaction {
        name: "Modbus/TCP, refused by the gateway itself",
        short: "refused",
        connect: |board| connect(board.modbus),
        exchange: |connection| connection.modbus(&[0], &[0x80, 1]),
        batch: 50,
        batches: 7,
    },
    Transaction {
        name: "Modbus/TCP FC3 x 1",
        short: "fc3",
        connect: |board| connect(board.modbus),
        exchange: |connection| connection.read(1),
        batch: 10,
        batches: 9,
    },
    Transaction {
        name: "Modbus/TCP FC3 x 125",
        short: "fc3x125",
        connect: |board| connect(board.modbus),
        exchange: |connection| connection.read(125),
        batch: 2,
        batches: 5,
    },
    Transaction {
        name: "Modbus ASCII FC3 x 1",
        short: "ascii",
        connect: |board| connect(board.main),
        exchange: |connection| {
            connection.say(b":010309010001F1\r\n", |reply| reply.starts_with(b":010302") && ends(reply))
        },
        batch: 10,
        batches: 9,
    },
    Transaction {
        name: "console, `bus a status`",
        short: "console",
        connect: |board| connect(board.main),
        exchange: |connection| {
            connection.say(b"bus a status\r\n", |reply| reply.starts_with(b"ok ") && ends(reply))
        },
        batch: 50,
        batches: 7,
    },
    Transaction {
        name: "CiA 309-3, SDO read of 4 bytes",
        short: "sdo",
        connect: |board| connect(board.main),
        exchange: |connection| {
            connection.say(b"[1] 2 read 0x1000 0 u32\r\n", |reply| reply == b"[1] 131474\r\n")
        },
        batch: 10,
        batches: 9,
    },
    Transaction {
        name: "HTTP GET of an axis",
        short: "http",
        connect: |board| connect(board.main),
        exchange: |connection| connection.say(b"GET /api/axes/x HTTP/1.1\r\nHost: x\r\n\r\n", is_page),
        batch: 6,
        batches: 7,
    },
];

fn connect(address: SocketAddr) -> Result<Connection, String> {
    let stream = || {
        let stream = TcpStream::connect(address)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        Ok(stream)
    };
    let stream = stream().map_err(|error: std::io::Error| format!("{address}: {error}"))?;
    Ok(Connection { stream, number: 0 })
}

/// Whether a line is complete.
fn ends(reply: &[u8]) -> bool {
    reply.ends_with(b"\r\n")
}

/// Whether a reply of HTTP is complete, and a good one.
fn is_page(reply: &[u8]) -> bool {
    let text = String::from_utf8_lossy(reply).to_ascii_lowercase();
    let Some((head, body)) = text.split_once("\r\n\r\n") else { return false };
    let length = head.lines().find_map(|line| line.strip_prefix("content-length:")?.trim().parse().ok());
    head.starts_with("http/1.1 200") && length == Some(body.len())
}

impl Connection {
    /// Sends a request, and reads until the reply is complete.
    fn say(&mut self, request: &[u8], complete: impl Fn(&[u8]) -> bool) -> std::io::Result<()> {
        self.stream.write_all(request)?;
        let mut reply = Vec::new();
        let mut buffer = [0; 2048];
        while !complete(&reply) {
            let length = self.stream.read(&mut buffer)?;
            reply.extend_from_slice(&buffer[..length]);
            // A line that is complete and not as wanted is an error.
            if length == 0 || (ends(&reply) && !complete(&reply) && !reply.starts_with(b"HTTP")) {
                let reply = String::from_utf8_lossy(&reply).into_owned();
                return Err(std::io::Error::other(format!("answered '{}'", reply.trim_end())));
            }
        }
        Ok(())
    }

    /// A Modbus/TCP transaction whose reply begins with `expected`.
    fn modbus(&mut self, pdu: &[u8], expected: &[u8]) -> std::io::Result<()> {
        self.number = self.number.wrapping_add(1);
        self.stream.write_all(&mbap::emit(self.number, UNIT, pdu))?;
        let mut header = [0; mbap::HEADER];
        self.stream.read_exact(&mut header)?;
        let header =
            mbap::Header::parse(&header).map_err(|error| std::io::Error::other(format!("{error:?}")))?;
        let mut reply = vec![0; usize::from(header.pdu_len)];
        self.stream.read_exact(&mut reply)?;
        if header.transaction == self.number && reply.starts_with(expected) {
            return Ok(());
        }
        Err(std::io::Error::other(format!("answered {reply:02X?}")))
    }

    /// Reads so many holding registers of the drive: those of its parameters.
    fn read(&mut self, quantity: u16) -> std::io::Result<()> {
        let request = Request::ReadHoldingRegisters { address: 0, quantity };
        self.modbus(&request.emit(), &[3, quantity as u8 * 2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_is_complete_with_its_last_byte() {
        let page = b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}";
        assert!(is_page(page));
        assert!(!is_page(&page[..page.len() - 1]));
        assert!(!is_page(b"HTTP/1.1 404 Not Found\r\nContent-Length: 2\r\n\r\n{}"));
    }
}
