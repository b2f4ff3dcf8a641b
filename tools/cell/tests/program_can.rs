//! The program `cell canopen`, with clients of both kinds on one bus.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

/// A running cell; it ends with the test.
struct Program {
    child: Child,
    output: BufReader<ChildStdout>,
}

impl Program {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_cell"))
            .arg("canopen")
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program starts");
        let output = BufReader::new(child.stdout.take().expect("its output"));
        Self { child, output }
    }

    fn line(&mut self) -> String {
        let mut line = String::new();
        self.output.read_line(&mut line).expect("a line");
        line.trim_end().to_owned()
    }

    fn connect(&mut self) -> Client {
        let line = self.line();
        let place = line.strip_prefix("ready ").and_then(|rest| rest.split(' ').next_back()).expect("ready");
        let stream = TcpStream::connect(place).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(10))).expect("set");
        Client(stream)
    }

    fn type_line(&mut self, line: &str) -> String {
        writeln!(self.child.stdin.as_mut().expect("its input"), "{line}").expect("typed");
        self.line()
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

struct Client(TcpStream);

impl Client {
    fn say(&mut self, text: &str) {
        self.0.write_all(text.as_bytes()).expect("sent");
    }

    /// What comes up to an end.
    fn until(&mut self, end: &str) -> String {
        let mut text = String::new();
        while !text.ends_with(end) {
            let mut byte = [0];
            self.0.read_exact(&mut byte).unwrap_or_else(|error| panic!("{error} after {text:?}"));
            text.push(byte[0].into());
        }
        text
    }
}

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id()))
}

#[test]
fn clients_of_both_kinds_are_on_one_bus() {
    let (log, pcap) = (path("can-log"), path("can-pcap"));
    let mut program = Program::start(&[
        "--slcan",
        "127.0.0.1:0",
        "--socketcand",
        "127.0.0.1:0",
        "--drive",
        "2=lexium23a",
        "--log",
        log.to_str().expect("a path"),
        "--pcap",
        pcap.to_str().expect("a path"),
    ]);
    let (mut slcan, mut socketcand) = (program.connect(), program.connect());
    // Its boot-up is over before they listen.
    let mut node = String::new();
    while !node.contains("pre-operational") {
        node = program.type_line("status");
        assert!(program.line().starts_with("ok frames="));
    }
    assert_eq!(socketcand.until(">"), "< hi >");
    socketcand.say("< open can0 >< rawmode >");
    assert_eq!(socketcand.until(">") + &socketcand.until(">"), "< ok >< ok >");
    slcan.say("\rS8\rO\rt12301\r");
    // An empty line and two commands are answered, the frame is not: it lacks a byte.
    assert_eq!(slcan.until("\u{7}"), "\r\r\r\u{7}");
    slcan.say("t602840416000000000000\r");
    assert_eq!(slcan.until("\u{7}"), "\u{7}", "a digit too many");
    slcan.say("t60284041600000000000\r");
    assert_eq!(slcan.until("\r"), "z\r");
    assert_eq!(slcan.until("\r"), "t58284B41600040020000\r", "statusword 0240h");
    let stamped = |text: String| {
        text.split(' ')
            .enumerate()
            .filter(|(at, _)| *at != 3)
            .map(|(_, word)| word.to_owned() + " ")
            .collect::<String>()
    };
    assert_eq!(stamped(socketcand.until(">")), "< frame 602 4041600000000000 > ");
    assert_eq!(stamped(socketcand.until(">")), "< frame 582 4B41600040020000 > ");
    socketcand.say("< send 000 2 81 00 >");
    assert_eq!(slcan.until("\r"), "t00028100\r");
    assert_eq!(slcan.until("\r"), "t7021 00\r".replace(' ', ""));
    assert_eq!(stamped(socketcand.until(">")), "< frame 702 00 > ");

    assert_eq!(program.type_line("2:mute"), "ok");
    assert_eq!(program.type_line("3:mute"), "error there is no node 3");
    assert!(program.type_line("2:dance").starts_with("error"));
    let node = program.type_line("status");
    assert_eq!(
        node,
        "2 lexium23a pre-operational, switch on disabled, mode none, position 20000, velocity 0"
    );
    assert!(program.line().starts_with("ok frames="));
    slcan.say("t60284041600000000000\rF\r");
    assert_eq!(slcan.until("\r") + &slcan.until("\r"), "z\rF00\r");

    let lines = fs::read_to_string(&log).expect("a log");
    let ids: Vec<_> = lines.lines().map(|line| &line[line.find("can0 ").expect("can0") + 5..][..3]).collect();
    assert_eq!(ids[..5], ["702", "602", "582", "000", "702"]);
    let bytes = fs::read(&pcap).expect("a capture");
    assert_eq!(bytes[..4], [0xD4, 0xC3, 0xB2, 0xA1]);
    assert_eq!(bytes[20..24], 227_u32.to_le_bytes());
    assert_eq!(bytes[24 + 16..24 + 16 + 9], [0, 0, 0x07, 0x02, 1, 0, 0, 0, 0], "boot-up of node 2");
    let _ = (fs::remove_file(log), fs::remove_file(pcap));
}

/// Who goes leaves the bus; who comes later hears nothing of before.
#[test]
fn clients_come_and_go() {
    let mut program = Program::start(&["--slcan", "127.0.0.1:0", "--node", "5=node"]);
    let mut first = program.connect();
    // The boot-up of the node has waited for somebody to acknowledge it; this is answered after it.
    first.say("O\rr7051\r");
    first.until("t70517F\r");
    let place = first.0.peer_addr().expect("its place");
    for _ in 0..40 {
        let mut other = Client(TcpStream::connect(place).expect("it listens"));
        other.0.set_read_timeout(Some(Duration::from_secs(10))).expect("set");
        other.say("O\rt00028205\r");
        assert_eq!(other.until("z\r"), "\rz\r");
        assert_eq!(other.until("\r"), "t705100\r");
        assert_eq!(first.until("\r") + &first.until("\r"), "t00028205\rt705100\r");
    }
}
