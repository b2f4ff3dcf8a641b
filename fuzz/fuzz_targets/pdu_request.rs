//! A request PDU that is taken is emitted again as it came; one that is not gets exception 1 or 3.
#![no_main]

use puente_modbus::request::{ReplyLength, Request};
use puente_modbus::{Exception, MAX_PDU};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    match Request::parse(data) {
        Ok(request) => {
            assert_eq!(request.function(), data[0]);
            if data.len() <= MAX_PDU {
                assert_eq!(request.emit(), data);
                if let ReplyLength::Exact(length) = request.expected() {
                    assert!((2..=MAX_PDU).contains(&length));
                }
            }
        }
        Err(exception) => {
            let no_function = !matches!(data.first(), Some(1..0x80));
            assert_eq!(exception == Exception::IllegalFunction, no_function);
            assert!(no_function || exception == Exception::IllegalDataValue);
        }
    }
});
