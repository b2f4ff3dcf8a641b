//! Host alone: the simulated drives are in the gateway's own process.

mod common;

use common::client::{Lines, value};
use common::http::insist;
use common::{Gateway, until};

/// The example as it is delivered: three drives boot, answer by every way of access, and one of them moves.
#[test]
fn the_example_has_three_drives() {
    let gateway = Gateway::example("keops.toml");
    let mut client = Lines::connect(gateway.main);
    assert_eq!(client.ask("axis"), "ok axes=u,v,w");
    for node in 2..=4 {
        until("it has booted", || {
            value(&client.ask(&format!("node can {node} status")), "health") == Some("booted")
        });
    }
    assert_eq!(client.ask("node can"), "ok bus=can nodes=2,3,4");
    assert_eq!(client.ask("[7] 1 3 read 0x1000 0 u32"), "[7] 131474");
    assert_eq!(client.ask("node can 3 read 1000 u32"), "ok node=3 object=1000:0 type=u32 value=\"131474\"");
    assert_eq!(
        client.ask("node can 4 read 6083:0 u32"),
        "ok node=4 object=6083:0 type=u32 value=\"20000\"",
        "as the example has it written"
    );
    assert!(client.ask("node can 2 read 9999:1").starts_with("error abort "));
    // Whoever changes the settings gets all of them first: nodes were left out once.
    let text = include_str!("../examples/keops.toml");
    let settings: serde_json::Value = toml::from_str(text).expect("a document");
    let told = insist(gateway.main, "GET /api/config", "").json();
    for list in ["bus", "axis", "node"] {
        let count = |document: &serde_json::Value| document[list].as_array().map(Vec::len);
        assert_eq!(count(&told), count(&settings), "{list}: {told}");
    }
    assert_eq!(told["node"][0]["id"], settings["node"][0]["id"]);
}
