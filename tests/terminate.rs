//! Host alone: a board is not ended by a signal.

mod common;

use common::rig::Rig;
use puente_modbus::Mode;

/// The commander goes on feeding its lease: only the end of the gateway can be why the axis stops.
#[test]
fn ending_the_gateway_stops_the_axes_first() {
    let mut rig = Rig::new(Mode::Ascii, 5000);
    let (_commander, _) = rig.jogging();
    let ended = rig.gateway.terminate();
    assert!(ended.success(), "{ended}: {}", rig.gateway.log());
    assert!(!rig.turns());
}
