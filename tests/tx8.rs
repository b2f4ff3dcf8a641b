//! Host alone: the simulated table is in the gateway's own process.

mod common;

use common::client::{Lines, figure, value};
use common::{Gateway, until};

/// Brings an axis to a position and gives what it says of itself then. Whatever a busy machine lets happen meanwhile, be it
/// the end of a lease or a module that hears nothing for too long, is put right as a client would.
fn bring(client: &mut Lines, axis: &str, target: i32) -> String {
    let mut status = String::new();
    until("it arrives", || {
        status = client.ask(&format!("axis {axis} status"));
        if value(&status, "event").is_some_and(|event| event != "none") {
            client.ask(&format!("axis {axis} clear"));
        }
        if matches!(value(&status, "state"), Some("disabled" | "fault")) {
            client.ask(&format!("axis {axis} enable"));
        }
        client.ask(&format!("axis {axis} move {target}"));
        let position = value(&status, "position").and_then(|text| text.parse::<i32>().ok());
        let near = position.is_some_and(|position| (position - target).abs() <= 10);
        near && value(&status, "velocity") == Some("0")
    });
    status
}

#[test]
fn the_example_moves_the_table() {
    let gateway = Gateway::example("tx8.toml");
    let mut client = Lines::connect(gateway.main);
    assert_eq!(client.ask("axis"), "ok axes=x,y,z");
    for (axis, target) in [("x", 5_000), ("y", -3_000), ("z", 800)] {
        let status = bring(&mut client, axis, target);
        assert_eq!(value(&status, "state"), Some("following"), "{status}");
        assert!(figure(&status, "age_ms") < 100, "{status}");
    }
    assert!(figure(&client.ok("bus b status"), "cycles") > 0);
}
