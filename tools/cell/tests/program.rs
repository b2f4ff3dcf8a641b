//! The program `cell`, over TCP and over a pseudo terminal.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// A running cell; it ends with the test.
struct Program {
    child: Child,
    /// What its `ready` line names.
    place: String,
}

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_cell"))
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let mut ready = String::new();
        let stdout = child.stdout.take().expect("its output");
        BufReader::new(stdout).read_line(&mut ready).expect("a line");
        let place = ready.trim_end().split(' ').next_back().unwrap_or_default().to_string();
        assert!(ready.starts_with("ready ") && !place.is_empty(), "{ready}");
        Self { child, place }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A path of its own in the directory for tests.
fn scratch(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id()))
}

fn exchange(line: &mut (impl Read + Write), request: &[u8], reply: &[u8]) {
    line.write_all(request).expect("sent");
    let mut received = vec![0; reply.len()];
    line.read_exact(&mut received).expect("a reply");
    assert_eq!(String::from_utf8_lossy(&received), String::from_utf8_lossy(reply));
}

fn connect(program: &Program) -> TcpStream {
    let client = TcpStream::connect(&program.place).expect("a connection");
    client.set_read_timeout(Some(Duration::from_secs(10))).expect("a timeout");
    client
}

const WRITE: &[u8] = b":01060025006470\r\n";

#[test]
fn answers_one_tcp_client_after_the_other() {
    let log = scratch("cell.log");
    let log_name = log.to_str().expect("a path");
    let program = Program::start(&["--listen", "127.0.0.1:0", "--fault", "2=exception:6", "--log", log_name]);
    exchange(&mut connect(&program), WRITE, WRITE);
    let mut client = connect(&program);
    exchange(&mut client, b":0206002500646F\r\n:01060025006470\r\n", b":02860672\r\n:01060025006470\r\n");
    drop(program);
    let text = fs::read_to_string(&log).expect("a log");
    let frames: Vec<&str> =
        text.lines().filter_map(|line| line.split_once(' ')).map(|(_, frame)| frame).collect();
    assert_eq!(frames[0], "> 010600250064");
    assert_eq!(frames[1], "< 3A30313036303032353030363437300D0A");
    let count = |direction| frames.iter().filter(|frame| frame.starts_with(direction)).count();
    assert_eq!((count('>'), count('<')), (3, 3));
    fs::remove_file(log).expect("removed");
}

#[test]
fn answers_on_a_pseudo_terminal() {
    let link = scratch("cell-line");
    let name = link.to_str().expect("a path");
    let open = || -> File { OpenOptions::new().read(true).write(true).open(&link).expect("the far side") };
    let rtu = ["--protocol", "modbus-rtu", "--baud", "19200", "--format", "8E1"];
    for _ in 0..2 {
        // The second start replaces the link that the first one left.
        let _program = Program::start(&[&["--pty", name], &rtu[..]].concat());
        let write = b"\x01\x06\x00\x25\x00\x64\x99\xEA";
        exchange(&mut open(), write, write);
        exchange(&mut open(), write, write);
    }
    fs::remove_file(link).expect("removed");
}

fn refused(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cell")).args(arguments).output().expect("the program runs")
}

#[test]
fn says_in_a_sentence_what_is_wrong() {
    let file = scratch("cell-file");
    fs::write(&file, "kept").expect("a file");
    let name = file.to_str().expect("a path");
    for (arguments, code, expected) in [
        (&["--pty", name][..], 1, "a file of this name exists"),
        (&["--device", name], 1, "cannot open the serial device"),
        (&["--listen", "nowhere"], 1, "cannot listen at nowhere"),
        (&["--listen", "127.0.0.1:0", "--fault", "9=silent"], 1, "unit 9, which is not in the cell"),
        (&["--baud", "fast"], 2, "expected 1 to 10000000"),
    ] {
        let output = refused(arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{error}");
        assert!(error.starts_with("cell: ") && error.contains(expected), "{error}");
        assert!(output.stdout.is_empty(), "never ready");
    }
    assert_eq!(fs::read_to_string(&file).expect("still there"), "kept");
    fs::remove_file(file).expect("removed");
}
