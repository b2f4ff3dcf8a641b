//! Host alone: the options of the program, and its settings in a file.
//!
//! Settings: what is wrong with them is said with its place, before anything is opened; what is printed is accepted.

mod common;

use std::fs;
use std::net::TcpListener;
use std::path::PathBuf;

use common::{run_to_end, scratch};

const GOOD: &str = r#"
version = 1
[net]
bind = "127.0.0.1"
port = 18080
modbus_port = 18502
clients = 4
lease_ms = 400
idle_s = 60
[[bus]]
name = "a"
protocol = "modbus-rtu"
port = "/dev/does-not-exist"
baud = 19200
format = "8E1"
units = "1-16,20"
reply_timeout_ms = 100
turnaround_ms = 50
rest_ms = 2
quarantine_ms = 150
queue_timeout_ms = 2000
echo = "verify"
[[bus]]
name = "b"
protocol = "modbus-ascii"
port = "tcp:192.0.2.1:4001"
format = "7E1"
units = "30-40"
[[axis]]
name = "x"
bus = "a"
drive = "edb"
address = 1
max_rpm = 1500
[axis.registers]
jog_enable = 0x2023
status = 0x0902
[[axis]]
name = "y"
bus = "b"
drive = "edb"
address = 1
[[bus]]
name = "f"
protocol = "framed"
port = "tcp:192.0.2.1:7002"
baud = 500000
format = "8N1"
station = 3
policy = "thesis"
cycle_ms = 5
ipg = 4
slot = 16
attempts = 12
window = 2
echo = "off"
[[axis]]
name = "z"
bus = "f"
drive = "pid"
address = 17
payload = "binary"
gains = [0.5, 0.25, 0.0]
"#;

/// Exit code, standard output, standard error.
fn run(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = run_to_end(arguments);
    let text = |bytes| String::from_utf8(bytes).expect("text");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

fn file(text: &str) -> PathBuf {
    let path = scratch("settings.toml");
    fs::write(&path, text).expect("a file");
    path
}

fn run_with(settings: &str, arguments: &[&str]) -> (Option<i32>, String, String) {
    let path = file(settings);
    let result = run(&[&["--config", path.to_str().expect("a path")], arguments].concat());
    fs::remove_file(path).expect("removed");
    result
}

#[test]
fn good_settings_pass_the_check_and_nothing_is_opened() {
    // Neither the devices nor the ports could be opened.
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("an address").port().to_string();
    let (code, out, err) = run_with(GOOD, &["--check", "--port", &port]);
    assert_eq!((code, out.as_str(), err.as_str()), (Some(0), "ok the settings are valid\n", ""));
    assert_eq!(run(&["--check"]).0, Some(0), "so do the factory settings");
}

#[test]
fn printed_settings_are_accepted_and_print_the_same() {
    for settings in [None, Some(GOOD)] {
        let (code, printed, err) = match settings {
            None => run(&["--print-config"]),
            Some(settings) => run_with(settings, &["--print-config"]),
        };
        assert_eq!((code, err.as_str()), (Some(0), ""));
        let again = run_with(&printed, &["--print-config"]);
        assert_eq!(again, (Some(0), printed.clone(), String::new()));
        assert_eq!(run_with(&printed, &["--check"]).0, Some(0));
    }
}

#[test]
fn what_was_set_is_printed() {
    let (_, printed, _) = run_with(GOOD, &["--print-config"]);
    for line in GOOD.lines().filter(|line| line.contains('=') && !line.contains("0x")) {
        assert!(printed.lines().any(|other| other == line), "{line} is not in\n{printed}");
    }
    for line in ["jog_enable = 8227", "status = 2306"] {
        assert!(printed.lines().any(|other| other == line), "{line} is not in\n{printed}");
    }
}

#[test]
fn options_override_the_file() {
    let options = ["--bind", "127.0.0.9", "--port", "7", "--modbus-port", "8", "--print-config"];
    let (code, printed, _) = run_with(GOOD, &options);
    assert_eq!(code, Some(0));
    for line in ["bind = \"127.0.0.9\"", "port = 7", "modbus_port = 8"] {
        assert!(printed.lines().any(|other| other == line), "{line} is not in\n{printed}");
    }
}

/// Replaces a part of the good settings, and tells what the message must contain.
#[test]
fn bad_settings_are_refused_with_their_place() {
    let cases: &[(&str, &str, &[&str])] = &[
        ("clients = 4", "clients = 0", &["[net] clients", "1 to 64"]),
        ("clients = 4", "clients = 65", &["[net] clients"]),
        ("lease_ms = 400", "lease_ms = 49", &["[net] lease_ms", "50 to 5000"]),
        ("lease_ms = 400", "lease_ms = 5001", &["[net] lease_ms"]),
        ("lease_ms = 400", "lease_ms = -1", &["8", "lease_ms"]),
        ("idle_s = 60", "idle_s = 4", &["[net] idle_s"]),
        ("port = 18080", "port = 65536", &["5", "port"]),
        ("port = 18080", "port = 18502", &["[net] modbus_port", "differ"]),
        ("bind = \"127.0.0.1\"", "bind = \"localhost\"", &["4", "bind"]),
        ("clients = 4", "client = 4", &["7", "client", "unknown"]),
        ("[net]", "[nett]", &["nett", "unknown"]),
        ("name = \"b\"", "name = \"a\"", &["[[bus]] \"a\" name", "unique"]),
        ("name = \"b\"", "name = \"\"", &["[[bus]] \"\" name"]),
        ("name = \"b\"", "name = \"b b\"", &["[[bus]] \"b b\" name"]),
        ("name = \"b\"", "name = \"seventeen-letters\"", &["name"]),
        ("protocol = \"modbus-rtu\"", "protocol = \"modbus\"", &["protocol", "modbus-rtu"]),
        ("protocol = \"modbus-rtu\"", "", &["protocol", "missing"]),
        (
            "protocol = \"modbus-ascii\"",
            "protocol = \"modbus-rtu\"",
            &["[[bus]] \"b\" format", "8 data bits"],
        ),
        ("port = \"/dev/does-not-exist\"", "port = \"\"", &["[[bus]] \"a\" port"]),
        ("port = \"/dev/does-not-exist\"", "port = \"COM3\"", &["[[bus]] \"a\" port"]),
        ("tcp:192.0.2.1:4001", "tcp:192.0.2.1", &["[[bus]] \"b\" port"]),
        ("tcp:192.0.2.1:4001", "tcp:192.0.2.1:0", &["[[bus]] \"b\" port"]),
        ("tcp:192.0.2.1:4001", "tcp::4001", &["[[bus]] \"b\" port"]),
        ("tcp:192.0.2.1:4001", "/dev/does-not-exist", &["[[bus]] \"b\" port", "\"a\""]),
        ("baud = 19200", "baud = 0", &["[[bus]] \"a\" baud"]),
        ("baud = 19200", "bauds = 19200", &["14", "bauds", "unknown"]),
        ("format = \"8E1\"", "format = \"8X1\"", &["15", "format"]),
        ("format = \"8E1\"", "format = \"9E1\"", &["15", "format"]),
        ("units = \"1-16,20\"", "units = \"0-16\"", &["16", "units", "1 to 247"]),
        ("units = \"1-16,20\"", "units = \"16-1\"", &["16", "units"]),
        ("units = \"30-40\"", "units = \"20-40\"", &["[[bus]] \"b\" units", "unit 20", "\"a\""]),
        ("reply_timeout_ms = 100", "reply_timeout_ms = 0", &["[[bus]] \"a\" reply_timeout_ms"]),
        ("turnaround_ms = 50", "turnaround_ms = 10001", &["[[bus]] \"a\" turnaround_ms"]),
        ("rest_ms = 2", "rest_ms = 10001", &["[[bus]] \"a\" rest_ms"]),
        ("quarantine_ms = 150", "quarantine_ms = 60001", &["[[bus]] \"a\" quarantine_ms"]),
        ("queue_timeout_ms = 2000", "queue_timeout_ms = 1", &["[[bus]] \"a\" queue_timeout_ms"]),
        ("echo = \"verify\"", "echo = \"on\"", &["22", "echo"]),
        ("station = 3", "station = 0", &["[[bus]] \"f\" station", "1 to 254"]),
        ("policy = \"thesis\"", "policy = \"token\"", &["policy", "truncated"]),
        ("slot = 16", "slot = 16\nunits = \"1\"", &["[[bus]] \"f\" units", "no such key"]),
        ("rest_ms = 2", "rest_ms = 2\nwindow = 1", &["[[bus]] \"a\" window", "no such key"]),
        ("echo = \"off\"", "echo = \"strip\"", &["[[bus]] \"f\" echo", "verify"]),
        ("payload = \"binary\"", "max_rpm = 1", &["[[axis]] \"z\" max_rpm", "no such key"]),
        ("gains = [0.5, 0.25, 0.0]", "gains = [0.5, 0.25]", &["gains"]),
        ("gains = [0.5, 0.25, 0.0]", "gains = [0.5, -1, 0]", &["[[axis]] \"z\" gains", "three numbers"]),
        ("bus = \"f\"\n", "bus = \"b\"\n", &["[[axis]] \"z\" drive", "edb"]),
        ("address = 17", "address = 3", &["[[axis]] \"z\" address", "station"]),
        ("name = \"y\"", "name = \"x\"", &["[[axis]] \"x\" name", "unique"]),
        ("bus = \"b\"\n", "bus = \"c\"\n", &["[[axis]] \"y\" bus", "\"c\""]),
        ("bus = \"b\"\n", "bus = \"a\"\n", &["[[axis]] \"y\" address", "\"x\""]),
        ("address = 1\nmax", "address = 0\nmax", &["[[axis]] \"x\" address", "1 to 247"]),
        ("address = 1\nmax", "address = 248\nmax", &["[[axis]] \"x\" address"]),
        ("drive = \"edb\"\naddress = 1\nmax", "drive = \"abc\"\naddress = 1\nmax", &["drive", "edb"]),
        ("max_rpm = 1500", "max_rpm = 0", &["[[axis]] \"x\" max_rpm"]),
        ("jog_enable = 0x2023", "jog_enabled = 1", &["jog_enabled", "unknown"]),
        ("jog_enable = 0x2023", "jog_enable = 65536", &["jog_enable"]),
        ("status = 0x0902", "jog_forward = 0x2023", &["[[axis]] \"x\" registers", "2023h"]),
        ("clients = 4", "clients = ", &["7"]),
        ("version = 1", "version = 2", &["version: 2 is not known, this firmware reads version 1"]),
        ("version = 1", "version = 2\ncolour = 1", &["version: 2 is not known"]),
        ("idle_s = 60", "dhcp = 1", &["8", "dhcp"]),
        ("idle_s = 60", "address = \"10.0.0.1\"", &["8", "address", "as in 192.168.1.111/24"]),
        ("idle_s = 60", "address = \"10.0.0.1/31\"", &["[net] address", "1 to 30"]),
        ("idle_s = 60", "address = \"10.0.0.0/24\"", &["[net] address", "a host can have"]),
        ("idle_s = 60", "address = \"127.0.0.1/8\"", &["[net] address", "a host can have"]),
        ("idle_s = 60", "address = \"224.0.0.1/24\"", &["[net] address", "a host can have"]),
        ("idle_s = 60", "router = \"10.0.0.1\"", &["[net] router", "of the network"]),
        ("idle_s = 60", "router = \"192.168.1.111\"", &["[net] router", "another host"]),
        ("idle_s = 60", "hostname = \"\"", &["[net] hostname", "1 to 32"]),
        ("idle_s = 60", "hostname = \"-a\"", &["[net] hostname"]),
        ("idle_s = 60", "hostname = \"a.b\"", &["[net] hostname"]),
        ("idle_s = 60", "hostname = \"0123456789abcdef0123456789abcdef0\"", &["8", "hostname"]),
    ];
    for (good, bad, expected) in cases {
        assert_eq!(GOOD.matches(good).count(), 1, "{good}");
        let settings = GOOD.replace(good, bad);
        // Without --check too: it does not start.
        for arguments in [&["--check"][..], &[]] {
            let (code, out, err) = run_with(&settings, arguments);
            assert_eq!((code, out.as_str()), (Some(1), ""), "{bad}: {err}");
            assert!(err.starts_with("error: "), "{bad}: {err}");
            assert!(err.contains("settings.toml"), "{bad}: names no file: {err}");
            for text in *expected {
                assert!(err.contains(text), "{bad}: no '{text}' in: {err}");
            }
        }
    }
}

#[test]
fn settings_without_a_bus_or_that_cannot_be_read_are_refused() {
    for (settings, expected) in [("", "bus"), ("[net]\n", "bus"), ("bus = []\n", "no [[bus]]"), ("\0", "1")] {
        let (code, _, err) = run_with(settings, &["--check"]);
        assert_eq!(code, Some(1));
        assert!(err.contains(expected), "{settings:?}: {err}");
    }
    let (code, _, err) = run(&["--config", "/does/not/exist.toml", "--check"]);
    assert!(code == Some(1) && err.contains("/does/not/exist.toml"), "{err}");
}

#[test]
fn bad_options_are_refused() {
    let bad: [&[&str]; 9] = [
        &["--port"],
        &["--port", "65536"],
        &["--port", "x"],
        &["--modbus-port", "-1"],
        &["--bind", "localhost"],
        &["--config"],
        &["--nonsense"],
        &["stray"],
        &["--check=yes"],
    ];
    for arguments in bad {
        let (code, out, err) = run(arguments);
        assert_eq!((code, out.as_str()), (Some(1), ""), "{arguments:?}");
        assert!(err.starts_with("error: ") && err.contains("--help"), "{arguments:?}: {err}");
    }
    assert_eq!(run(&["--help"]).0, Some(0));
    assert_eq!(run(&["--version"]).1, concat!("puente ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn a_port_that_is_taken_is_told() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = taken.local_addr().expect("an address");
    for option in ["--port", "--modbus-port"] {
        let other = if option == "--port" { "--modbus-port" } else { "--port" };
        let (code, out, err) = run(&[option, &address.port().to_string(), other, "0"]);
        assert_eq!((code, out.as_str()), (Some(1), ""));
        assert!(err.contains(&format!("cannot listen on {address}")), "{err}");
    }
}
