//! Host alone: no gateway runs.
//!
//! The MAC address that a board makes from its chip's unique id.

#[path = "../src/port/nucleo/mac.rs"]
mod mac;

use std::collections::HashSet;

/// A unique id as the chips have it: lot and wafer as text, X and Y on the wafer.
fn unique_id(x: u16, y: u16, wafer: u8) -> [u8; 12] {
    let ([x0, x1], [y0, y1]) = (x.to_le_bytes(), y.to_le_bytes());
    [x0, x1, y0, y1, wafer, b'Q', b'6', b'1', b'4', b'3', b'7', b'3']
}

#[test]
fn is_locally_administered_and_unicast() {
    for x in 0..64 {
        let [first, ..] = mac::from_unique_id(&unique_id(x, 7, 3));
        assert_eq!(first & 0b11, 0b10, "{first:02x}");
    }
}

/// A board that changes its address with a new firmware disappears from the tables of its network.
#[test]
fn stays_the_same_from_version_to_version() {
    assert_eq!(mac::from_unique_id(&unique_id(1, 2, 3)), [0xb2, 0xdf, 0xdf, 0x8d, 0x8f, 0x60]);
}

#[test]
fn differs_between_the_chips_of_a_lot() {
    let mut seen = HashSet::new();
    for wafer in 1..=25 {
        for x in 0..40 {
            for y in 0..40 {
                assert!(seen.insert(mac::from_unique_id(&unique_id(x, y, wafer))), "{wafer} {x} {y}");
            }
        }
    }
}
