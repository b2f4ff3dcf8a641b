//! A gateway to test, and a client that sees every byte.

use std::io::{BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use puente_cell::Cell;
use puente_modbus::Mode;
use serde_json::Value;

use super::common::client::connect;
use super::common::http::{Reply, line};
use super::common::wire::{Script, Wire, cell, script};
use super::common::{self, Document, fast};

/// Longest that anything here may take.
const PATIENCE: Duration = Duration::from_secs(20);

/// A running gateway with two simulated drives, axes x and y, and an axis `dead` whose bus never answers.
pub struct Gateway {
    pub gateway: common::Gateway,
    _drives: Wire<Cell>,
    _silence: Wire<Script>,
}

impl Gateway {
    pub fn start(clients: u16) -> Self {
        let drives = cell(Mode::Rtu, fast(), &[1, 2]);
        let silence = script(Mode::Rtu, fast(), |_, _| Vec::new());
        let document = Document::new()
            .net(&format!("clients = {clients}"))
            .bus("a", Mode::Rtu, fast(), &drives, "units = \"1-9\"")
            .bus("b", Mode::Rtu, fast(), &silence, "units = \"10-19\"\nreply_timeout_ms = 100")
            .axis("x", "a", 1, "")
            .axis("y", "a", 2, "max_rpm = 200")
            .axis("dead", "b", 10, "");
        Self { gateway: document.start(), _drives: drives, _silence: silence }
    }

    pub fn connect(&self) -> Client {
        Client { stream: BufReader::new(connect(self.gateway.main)) }
    }

    /// One request on its own connection.
    pub fn ask(&self, request: &str, body: &str) -> Reply {
        self.ask_as(request, "", body)
    }

    /// The same with more header fields, each ending with CRLF.
    pub fn ask_as(&self, request: &str, fields: &str, body: &str) -> Reply {
        let mut client = self.connect();
        client.send(&format!(
            "{request} HTTP/1.1\r\nHost: {}\r\n{fields}Content-Length: {}\r\n\r\n{body}",
            self.gateway.main,
            body.len()
        ));
        client.reply()
    }

    pub fn axis(&self, name: &str) -> Value {
        self.ask(&format!("GET /api/axes/{name}"), "").json()
    }

    /// Reads the axis until it is as wished.
    pub fn await_axis(&self, name: &str, wish: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let axis = self.axis(name);
            if wish(&axis) {
                return axis;
            }
            assert!(start.elapsed() < PATIENCE, "{axis}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    pub fn origin(&self) -> String {
        format!("http://{}", self.gateway.main)
    }
}

pub struct Client {
    stream: BufReader<TcpStream>,
}

impl Client {
    pub fn send(&mut self, text: &str) {
        self.send_bytes(text.as_bytes()).expect("sent");
    }

    pub fn send_bytes(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.stream.get_mut().write_all(bytes)
    }

    /// Says that nothing more will come.
    pub fn finish(&mut self) {
        self.stream.get_ref().shutdown(Shutdown::Write).expect("shut down");
    }

    pub fn reply(&mut self) -> Reply {
        Reply::read(&mut self.stream)
    }

    /// A reply without its body.
    pub fn head(&mut self) -> Reply {
        Reply::head(&mut self.stream)
    }

    pub fn line(&mut self) -> String {
        line(&mut self.stream)
    }

    /// Whether the gateway has closed; what it still says is an error.
    pub fn closed(&mut self) -> bool {
        let mut rest = Vec::new();
        match self.stream.read_to_end(&mut rest) {
            Ok(_) => {
                assert!(rest.is_empty(), "{rest:?}");
                true
            }
            Err(error) => error.kind() == std::io::ErrorKind::ConnectionReset,
        }
    }
}
