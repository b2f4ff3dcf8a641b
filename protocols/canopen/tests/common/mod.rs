//! What the tests share.
#![allow(dead_code)]

pub mod bus;
pub mod channel;
pub mod objects;
pub mod server;
pub mod zencan;

use proptest::prelude::*;
use puente_canopen::{Frame, Id};
use puente_line::Instant;

pub fn ms(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

/// Bytes written in hexadecimal.
pub fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect()
}

/// A data frame with a base identifier.
pub fn frame(id: u16, bytes: &str) -> Frame {
    Frame::new(Id::base(id), &hex(bytes)).expect("a frame")
}

pub fn data(frame: &Frame) -> Vec<u8> {
    frame.data().to_vec()
}

/// Any frame; often one of node 1 or 2.
pub fn any_frame() -> impl Strategy<Value = Frame> {
    let of_a_node = (0..16_u16, 0..3_u16).prop_map(|(function, node)| Id::base(function << 7 | node));
    let id = prop_oneof![
        4 => of_a_node,
        1 => any::<u16>().prop_map(Id::base),
        1 => any::<u32>().prop_map(Id::extended),
    ];
    let bytes = prop::collection::vec(any::<u8>(), 0..=8);
    (id, bytes, prop::bool::weighted(0.1)).prop_map(|(id, bytes, remote)| match remote {
        false => Frame::new(id, &bytes).expect("8 bytes at most"),
        true => Frame::remote(id, bytes.len() as u8),
    })
}
