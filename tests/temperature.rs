//! Host alone: no gateway runs.
//!
//! The temperature that a board makes of its chip's sensor.

#[path = "../src/port/nucleo/calibration.rs"]
mod calibration;

use calibration::degrees;

/// Values as an STM32F429 has them.
const CHIP: [u16; 2] = [943, 1205];

#[test]
fn the_points_of_calibration_and_those_between_and_beyond_are_on_one_line() {
    for (conversion, expected) in [(943, 30), (1205, 110), (1074, 70), (861, 5), (1214, 113), (940, 29)] {
        assert_eq!(degrees(conversion, CHIP), Some(expected), "{conversion}");
    }
}

#[test]
fn a_chip_without_calibration_tells_no_temperature() {
    for bad in [[0xFFFF, 0xFFFF], [0, 0], [1205, 943], [943, 944]] {
        assert_eq!(degrees(1000, bad), None, "{bad:?}");
    }
}

#[test]
fn a_sensor_that_is_stuck_tells_no_temperature() {
    assert_eq!(degrees(0, CHIP), None);
    assert_eq!(degrees(0xFFFF, CHIP), None);
}
