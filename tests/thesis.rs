//! The exchanges that the thesis prints for an EDB drive (002_*.txt, tables 4.5 and 4.6, figure 4.13), byte for byte.

mod common;

use common::client::{Lines, Modbus, send_and_close};
use common::{Document, Gateway, thesis, until, wire};
use puente_modbus::Mode;

const SEARCH: (&str, &str) = (":010310000001EB", ":0103020036C4");
const STATUS: (&str, &str) = (":010309010001F1", ":010302016396");
/// Pn037 = 100 r/min.
const JOG_SPEED: (&str, &str) = (":01060025006470", ":01060025006470");

/// Drive 1 in the state that the thesis found its drive in.
fn thesis_drive(mode: Mode) -> (wire::Wire<puente_cell::Cell>, Gateway) {
    let line = wire::cell(mode, thesis(), &[1]);
    {
        let mut cell = line.device();
        let drive = cell.drive_mut(1).expect("drive 1");
        drive.force(0x1000, 0x0036);
        drive.force(0x0901, 0x0163);
    }
    let gateway = Document::new().bus("a", mode, thesis(), &line, "").axis("x", "a", 1, "").start();
    (line, gateway)
}

#[test]
fn the_frames_of_the_thesis_give_its_replies_and_are_on_the_wire_as_they_are() {
    let (line, gateway) = thesis_drive(Mode::Ascii);
    let mut client = Lines::connect(gateway.main);
    let mut sent = String::new();
    for (request, reply) in [SEARCH, STATUS, JOG_SPEED] {
        assert_eq!(client.ask(request), reply);
        sent = sent + request + "\r\n";
    }
    assert_eq!(String::from_utf8_lossy(&line.bytes()), sent);
    let speed = line.device().drive(1).expect("drive 1").read(0x0025);
    assert_eq!(speed, Ok(100), "the drive has the new JOG speed");
}

/// A Modbus ASCII frame is answered as Modbus ASCII whatever the line speaks; the CRCs are of FACTS 1.8.
#[test]
fn on_an_rtu_line_the_same_frames_go_with_a_crc() {
    let (line, gateway) = thesis_drive(Mode::Rtu);
    let mut client = Lines::connect(gateway.main);
    for (request, reply) in [SEARCH, STATUS, JOG_SPEED] {
        assert_eq!(client.ask(request), reply);
    }
    let sent = [
        [0x01, 0x03, 0x10, 0x00, 0x00, 0x01, 0x80, 0xCA],
        [0x01, 0x03, 0x09, 0x01, 0x00, 0x01, 0xD6, 0x56],
        [0x01, 0x06, 0x00, 0x25, 0x00, 0x64, 0x99, 0xEA],
    ];
    assert_eq!(line.bytes(), sent.concat());
}

#[test]
fn modbus_tcp_reads_the_same_values() {
    for mode in common::MODES {
        let (_line, gateway) = thesis_drive(mode);
        for port in [gateway.main, gateway.modbus] {
            let mut client = Modbus::connect(port);
            assert_eq!(client.read(1, 0x1000, 1), Ok(vec![0x0036]));
            assert_eq!(client.read(1, 0x0901, 1), Ok(vec![0x0163]));
            assert_eq!(client.write(1, 0x0025, 100), Ok(()));
        }
    }
}

/// `printf ':010309010001F1\r\n' | nc 127.0.0.1 8080`: nc closes its side and still gets the answer.
#[test]
fn the_factory_settings_answer_the_first_command_of_the_readme() {
    let gateway = Gateway::factory();
    let reply = send_and_close(gateway.main, b":010309010001F1\r\n");
    // Ready, waiting, mains present, motor stopped.
    assert_eq!(String::from_utf8_lossy(&reply), ":01030201A455\r\n");
}

#[test]
fn the_factory_settings_have_three_drives_that_can_be_jogged() {
    let gateway = Gateway::factory();
    let mut client = Lines::connect(gateway.main);
    assert_eq!(client.ask("axis"), "ok axes=x,y,z");
    for name in ["x", "y", "z"] {
        client.ok(&format!("axis {name} enable"));
        client.ok(&format!("axis {name} jog -120"));
        until("the motor turns at the speed asked for", || {
            client.ok(&format!("axis {name} status")).contains(" speed_rpm=-120 ")
        });
        client.ok(&format!("axis {name} stop"));
        until("the motor stands", || client.ok(&format!("axis {name} status")).contains(" speed_rpm=0 "));
    }
}
