//! A stream of MBAP frames, followed as a server does: every frame taken is emitted again as it came.
#![no_main]

use puente_modbus::mbap::{self, HEADER, Header, HeaderError};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut rest = data;
    while let Some((bytes, after)) = rest.split_first_chunk::<HEADER>() {
        match Header::parse(bytes) {
            Ok(header) => {
                let Some((pdu, after)) = after.split_at_checked(header.pdu_len.into()) else {
                    return;
                };
                let adu = mbap::emit(header.transaction, header.unit, pdu);
                assert_eq!(adu.as_slice(), &rest[..HEADER + pdu.len()]);
                rest = after;
            }
            Err(HeaderError::Protocol { received, length }) => {
                assert_ne!(received, 0);
                let Some((_, after)) = rest.split_at_checked(6 + usize::from(length)) else {
                    return;
                };
                rest = after;
            }
            Err(HeaderError::Length { received }) => {
                assert!(!(2..=254).contains(&received));
                return;
            }
        }
    }
});
