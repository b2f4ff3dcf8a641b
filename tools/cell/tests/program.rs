//! The program `cell`, over TCP and over a pseudo terminal.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Output, Stdio};
use std::time::Duration;

use puente_drives::pid::State;
use puente_framed::frame::{self, MAX_FRAME};
use puente_framed::{Class, Decoder, Kind, section};
use puente_modules::{Control, Form, Order, Report, Setting};

/// A running cell; it ends with the test.
struct Program {
    child: Child,
    output: BufReader<ChildStdout>,
    /// What its `ready` line names.
    place: String,
}

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_cell"))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let output = BufReader::new(child.stdout.take().expect("its output"));
        let mut program = Self { child, output, place: String::new() };
        program.place = program.ready();
        program
    }

    /// What the next line `ready` names.
    fn ready(&mut self) -> String {
        let line = self.line();
        let place = line.split(' ').next_back().unwrap_or_default().to_string();
        assert!(line.starts_with("ready ") && !place.is_empty(), "{line}");
        place
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("a line");
        line.trim_end().to_owned()
    }

    /// Types a line.
    fn type_line(&mut self, line: &str) {
        let input = self.child.stdin.as_mut().expect("its input");
        writeln!(input, "{line}").expect("typed");
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
    connect_to(&program.place)
}

fn connect_to(place: &str) -> TcpStream {
    let client = TcpStream::connect(place).expect("a connection");
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

/// 17 is asked, and reports; each of the two stations hears both frames.
#[test]
fn stations_on_tcp_and_on_a_pseudo_terminal_share_a_framed_line() {
    let link = scratch("framed-line");
    let name = link.to_str().expect("a path");
    let line = ["--framed", "--baud", "115200", "--tcp", "127.0.0.1:0", "--pty", name];
    let mut program = Program::start(&line);
    assert_eq!(program.ready(), name);
    let mut far = OpenOptions::new().read(true).write(true).open(&link).expect("the far side");
    for _ in 0..2 {
        let mut near = connect(&program);
        let request = ask(17);
        near.write_all(&request).expect("sent");
        for heard in [frames(&mut near, 2), frames(&mut far, 2)] {
            assert_eq!(heard[0], request, "its echo");
            let report = frame::parse(&heard[1]).expect("a frame");
            assert_eq!((report.origin, report.kind), (17, Kind::Single(Class::Status)));
            let report = Report::parse(report.section_for(1).expect("for station 1").data).expect("a report");
            assert_eq!((report.state, report.position), (State::Disabled, 0));
        }
    }
    fs::remove_file(link).expect("removed");
}

#[test]
fn what_goes_wrong_on_a_framed_line_is_typed() {
    let mut program =
        Program::start(&["--framed", "--tcp", "127.0.0.1:0", "--module", "5", "--disturb", "5 mute on"]);
    for (typed, answer) in [
        ("status", "5 disabled, position 0, set-point 0, velocity 0, command 0.000"),
        ("17 mute on", "error station 17 cannot have that, or is not there"),
        ("5 broken", "error '5 broken' is no disturbance; see cell --help"),
        ("  5 torque 0.1 ", "ok"),
        ("noise 1e-5", "ok"),
        ("5 mute off", "ok"),
    ] {
        program.type_line(typed);
        assert_eq!(program.line(), answer, "{typed}");
        if typed == "status" {
            assert_eq!(program.line(), "ok characters=0 spoiled=0 flipped=0");
        }
    }
    let mut client = connect(&program);
    client.write_all(&ask(5)).expect("sent");
    assert_eq!(frames(&mut client, 2).len(), 2, "it can be heard again");
}

/// Asks a module what it is at, and nothing else.
fn ask(address: u8) -> Vec<u8> {
    let order = Order { control: Control::Observe, ask: true };
    let setting = Setting { order: Some(order), ..Setting::default() };
    let data = setting.emit(Form::Text).expect("text");
    let mut body = heapless::Vec::<u8, 64>::new();
    section::push(&mut body, address, &data).expect("room");
    let mut bytes = heapless::Vec::<u8, 80>::new();
    frame::emit(&mut bytes, 1, Kind::Single(Class::Data), &body).expect("a frame");
    bytes.to_vec()
}

/// The next so many frames on the line.
fn frames(line: &mut impl Read, count: usize) -> Vec<Vec<u8>> {
    let mut decoder = Box::new(Decoder::<MAX_FRAME>::new());
    let mut frames = Vec::new();
    while frames.len() < count {
        let mut byte = [0];
        line.read_exact(&mut byte).expect("a byte");
        decoder.push(byte[0]);
        while decoder.is_ready() && decoder.advance() {
            frames.push(decoder.frame_bytes().to_vec());
        }
    }
    frames
}

#[test]
fn help_shows_how_a_framed_line_is_served() {
    let output = Command::new(env!("CARGO_BIN_EXE_cell")).arg("--help").output().expect("the program runs");
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && output.stderr.is_empty());
    for part in ["cell --framed --tcp 127.0.0.1:7002", "--pty LINK", "--module LIST", "ADDRESS encoder"] {
        assert!(text.contains(part), "{part}: {text}");
    }
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
        (&["--framed", "--tcp", "nowhere"], 1, "cannot listen at nowhere"),
        (&["--framed", "--tcp", "127.0.0.1:0", "--disturb", "9 deaf on"], 1, "station 9 cannot have that"),
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
