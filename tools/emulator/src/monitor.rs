//! QEMU's monitor, over QMP on its standard input and output.

use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::process::{ChildStdin, ChildStdout};

use serde_json::{Value, json};

pub(super) struct Monitor {
    to: Option<ChildStdin>,
    from: Option<BufReader<ChildStdout>>,
    /// QMP takes commands once its capabilities are agreed upon.
    open: bool,
}

impl Monitor {
    pub(super) fn new(to: Option<ChildStdin>, from: Option<ChildStdout>) -> Self {
        Self { to, from: from.map(BufReader::new), open: false }
    }

    /// What QEMU says to a command of its human monitor.
    pub(super) fn ask(&mut self, command: &str) -> io::Result<String> {
        if !self.open {
            self.execute(&json!({ "execute": "qmp_capabilities" }))?;
            self.open = true;
        }
        let arguments = json!({ "command-line": command });
        let answer = self.execute(&json!({ "execute": "human-monitor-command", "arguments": arguments }))?;
        Ok(answer.as_str().unwrap_or_default().to_owned())
    }

    fn execute(&mut self, command: &Value) -> io::Result<Value> {
        let (Some(to), Some(from)) = (&mut self.to, &mut self.from) else {
            return Err(ErrorKind::NotConnected.into());
        };
        writeln!(to, "{command}")?;
        let mut line = String::new();
        while from.read_line(&mut line)? > 0 {
            // Among the answers are a greeting and events.
            let mut said: Value = serde_json::from_str(&line)?;
            if let Some(error) = said.get("error") {
                return Err(io::Error::other(error.to_string()));
            }
            if let Some(answer) = said.get_mut("return") {
                return Ok(answer.take());
            }
            line.clear();
        }
        Err(ErrorKind::UnexpectedEof.into())
    }
}
