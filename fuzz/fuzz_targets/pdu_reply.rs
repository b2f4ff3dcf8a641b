//! A reply PDU that pairs with a request has its function, the length it calls for, and is emitted again as it came.
#![no_main]

use puente_fuzz::Operands;
use puente_modbus::MAX_PDU;
use puente_modbus::reply::{Reply, objects};
use puente_modbus::request::{ReplyLength, Request};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let length = operands.byte();
    let request = operands.bytes(length.into());
    let reply = operands.0;
    assert!(objects(reply).map(|(_, text)| 2 + text.len()).sum::<usize>() <= reply.len());
    let Ok(parsed) = Reply::parse(request, reply) else {
        return;
    };
    assert_eq!(request[0], reply[0] & 0x7F);
    let asked = Request::parse(request).expect("it has a reply");
    match (parsed, asked.expected()) {
        (Reply::Exception { .. }, _) => assert_eq!(reply.len(), 2),
        (_, ReplyLength::Exact(length)) => assert_eq!(reply.len(), length),
        (_, ReplyLength::Never) => panic!("no reply is defined"),
        (_, ReplyLength::Counted | ReplyLength::Unknown) => {}
    }
    if reply.len() <= MAX_PDU {
        assert_eq!(parsed.emit(), reply);
    }
});
