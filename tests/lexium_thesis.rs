//! The sessions that a thesis prints of a Lexium 23A (001, section 6.4), through controller mode against the simulated drive.
//! `tests/captures/lexium23a.txt` has them line by line, and each misprint beside what is done instead.

mod common;

use common::Document;
use common::can::{Adapter, await_open};
use common::client::Lines;
use puente_canopen::Frame;
use puente_cell::can::{Cell, Config, DriveConfig, Model};

const SESSIONS: &str = include_str!("captures/lexium23a.txt");

/// A line's frame, and what is said of it.
fn parsed(text: &str) -> Frame {
    let text = text.split('|').next().expect("a frame").trim();
    puente_frametext::parse(text.as_bytes()).unwrap_or_else(|mistake| panic!("{text}: {mistake}"))
}

/// Waits for this frame among all that come.
fn await_frame(client: &mut Lines, text: &str) {
    let wanted = parsed(text);
    println!("awaits {text}");
    let mut heard = Vec::new();
    loop {
        let line = client.line();
        let frame = parsed(line.strip_prefix(':').unwrap_or_else(|| panic!("{line}")));
        println!("  heard {line}");
        heard.push(line);
        if frame == wanted {
            return;
        }
        assert!(heard.len() < 200, "{text}: {heard:#?}");
    }
}

#[test]
fn the_sessions_of_the_thesis_replay() {
    let drive = DriveConfig::new(2, Model::Lexium23a).expect("node 2");
    let adapter = Adapter::wire(Cell::new(Config::new(1_000_000).with(drive)));
    let gateway = Document::new().canopen("can", &adapter, "heartbeat_ms = 0").start();
    await_open(&gateway);
    // But for what the gateway has said before: that it has booted, and the question of `await_open`.
    let frames = || {
        let mut frames = adapter.device().frames.clone();
        frames.retain(|frame| !matches!(frame.id().raw(), 0x77F | 0x7E5));
        frames
    };
    let mut client = Lines::connect(gateway.main);
    let mut lines = SESSIONS.lines().filter(|line| !line.starts_with('#') && !line.is_empty()).peekable();
    let mut sent = Vec::new();
    while let Some(line) = lines.next() {
        let (kind, text) = line.split_at(2);
        match kind {
            "> " | "+ " => {
                client.put(&format!(":{}\r", text.split('|').next().expect("a frame").trim()));
                let instead = lines.next_if(|line| line.starts_with("= "));
                sent.push(parsed(instead.map_or(text, |line| &line[2..])));
            }
            "< " | "~ " => await_frame(&mut client, text),
            "? " => {}
            _ => panic!("{line}"),
        }
        if !matches!(lines.peek(), Some(next) if next.starts_with(['<', '?', '~'])) {
            // The drive has the frame before the next one goes.
            common::until("the frame is on the bus", || frames().len() >= sent.len());
        }
    }
    assert_eq!(frames(), sent);
}
