//! A board has 20 KB for a CANopen bus: eight drives, and nodes without a drive besides.

use puente_canopen::manager::Manager;
use puente_servos::Master;

#[test]
fn a_master_is_small() {
    let (whole, manager) = (size_of::<Master<'_, 8, 8, 4>>(), size_of::<Manager<'_, 8, 4>>());
    let drive = (whole - manager) / 8;
    assert!(drive <= 650, "{drive} bytes a drive");
    assert!(whole <= 12 * 1024, "{whole} bytes, of them {manager} for the manager");
}
