//! A multicast DNS message from anybody. Whatever is answered is a message that fits, and is not answered in turn.
#![no_main]

use puente_mdns::{Host, LONGEST, PORT, Service};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let services = [Service { name: "_http", port: 80 }, Service { name: "_modbus", port: 502 }];
    let host = Host { name: "puente", address: [192, 168, 1, 111].into(), services: &services };
    for port in [PORT, 40_000] {
        if let Some(answer) = host.answer(data, port) {
            assert!(answer.bytes.len() <= LONGEST);
            assert_eq!(host.answer(&answer.bytes, PORT), None);
        }
    }
});
