//! Frames from manuals, theses and other implementations, byte for byte.

use std::time::Duration;

use puente_line::{Instant, Settings};
use puente_modbus::mbap::{self, Header, HeaderError};
use puente_modbus::reply::{Reply, objects};
use puente_modbus::request::Request;
use puente_modbus::{Exception, FrameError, Words, ascii, lrc, rtu};

/// Unit and PDU; LRC; CRC as sent, low byte first.
const FRAMES: &[(&[u8], u8, [u8; 2])] = &[
    // The thesis' exchanges with an EDB drive (tables 4.5 and 4.6), and its JOG frame (figure 4.13).
    (&[0x01, 0x03, 0x10, 0x00, 0x00, 0x01], 0xEB, [0x80, 0xCA]),
    (&[0x01, 0x03, 0x02, 0x00, 0x36], 0xC4, [0x38, 0x52]),
    (&[0x01, 0x03, 0x09, 0x01, 0x00, 0x01], 0xF1, [0xD6, 0x56]),
    (&[0x01, 0x03, 0x02, 0x01, 0x63], 0x96, [0xF9, 0xFD]),
    (&[0x01, 0x06, 0x00, 0x25, 0x00, 0x64], 0x70, [0x99, 0xEA]),
    // ESTUN's manuals.
    (&[0x01, 0x03, 0x00, 0x70, 0x00, 0x02], 0x8A, [0xC5, 0xD0]),
    (&[0x01, 0x03, 0x04, 0x00, 0x00, 0x00, 0x00], 0xF8, [0xFA, 0x33]),
    (&[0x01, 0x06, 0x00, 0x70, 0x00, 0x01], 0x88, [0x49, 0xD1]),
    (&[0x01, 0x03, 0x02, 0x00, 0x00, 0x02], 0xF8, [0xC5, 0xB3]),
    // The manual prints A3 D3.
    (&[0x01, 0x03, 0x04, 0x00, 0xB1, 0x1F, 0x40], 0xE8, [0xA3, 0xD4]),
    (&[0x01, 0x06, 0x02, 0x00, 0x00, 0x64], 0x93, [0x89, 0x99]),
    (&[0x01, 0x03, 0x02, 0x01, 0x00, 0x01], 0xF8, [0xD4, 0x72]),
    (&[0x01, 0x03, 0x01, 0x01, 0x00, 0x02], 0xF8, [0x94, 0x37]),
    // EDB: clear alarm, current alarm; computed.
    (&[0x01, 0x06, 0x10, 0x22, 0x00, 0x01], 0xC6, [0xEC, 0xC0]),
    (&[0x01, 0x03, 0x08, 0x17, 0x00, 0x01], 0xDC, [0x36, 0x6E]),
    // ESTUN's exception example, completed; computed.
    (&[0x03, 0x06, 0x00, 0x02, 0x00, 0x06], 0xEF, [0xA9, 0xEA]),
    (&[0x03, 0x86, 0x03], 0x74, [0xA3, 0xA1]),
    // pymodbus and the specification; the CRC of the last one computed.
    (&[0xFE, 0x04, 0x00, 0x03, 0x00, 0x01], 0xFA, [0xD5, 0xC5]),
    (&[0x00, 0x83, 0x02], 0x7B, [0x91, 0x31]),
    (&[0x11, 0x03, 0x00, 0x6B, 0x00, 0x03], 0x7E, [0x76, 0x87]),
    (&[0x00, 0x03, 0x00, 0x7C, 0x00, 0x02], 0x7F, [0x04, 0x02]),
];

fn settings(baud: u32) -> Settings {
    Settings { baud, format: "8E1".parse().expect("format") }
}

#[test]
fn checks_alone() {
    assert_eq!(rtu::crc(b"123456789"), 0x4B37);
    assert_eq!(rtu::crc(&[0x02, 0x07]).to_le_bytes(), [0x41, 0x12]);
    assert_eq!(lrc::lrc(&[0x02, 0x07]), 0xF7);
    let data = [0x12, 0x34, 0x23, 0x45, 0x34, 0x56, 0x45, 0x67];
    assert_eq!(lrc::lrc(&data), 0x1C);
    assert_eq!(rtu::crc(&data).to_le_bytes(), [0xE2, 0xDB]);
}

#[test]
fn frames_in_rtu() {
    for (payload, _, check) in FRAMES {
        let (unit, pdu) = payload.split_first().expect("unit");
        let frame = [*payload, check].concat();
        assert_eq!(rtu::emit(*unit, pdu), *frame);
        assert_eq!(rtu::parse(&frame), Ok((*unit, pdu)));
    }
}

#[test]
fn frames_in_ascii() {
    for (payload, check, _) in FRAMES {
        let (unit, pdu) = payload.split_first().expect("unit");
        let digits: String = payload.iter().chain([check]).map(|byte| format!("{byte:02X}")).collect();
        let text = format!(":{digits}\r\n");
        assert_eq!(ascii::emit(*unit, pdu), text.as_bytes());
        for text in [text.clone(), text.to_lowercase(), text.trim_end().to_string()] {
            let frame = ascii::parse(text.as_bytes()).expect("a frame");
            assert_eq!((frame.unit, frame.pdu.as_slice()), (*unit, pdu));
        }
    }
}

#[test]
fn texts_as_printed() {
    assert_eq!(ascii::emit(1, &[6, 0, 0x25, 0, 0x64]), b":01060025006470\r\n");
    assert_eq!(ascii::emit(1, &[3, 9, 1, 0, 1]), b":010309010001F1\r\n");
    assert_eq!(ascii::emit(0, &[3, 0, 0x7C, 0, 2]), b":0003007C00027F\r\n");
}

#[test]
fn damaged_frames_say_why() {
    assert_eq!(rtu::parse(&[1, 3, 0]), Err(FrameError::TooShort));
    assert_eq!(rtu::parse(&[0; 257]), Err(FrameError::TooLong));
    let printed = [0x01, 0x03, 0x04, 0x00, 0xB1, 0x1F, 0x40, 0xA3, 0xD3];
    assert_eq!(rtu::parse(&printed), Err(FrameError::Check { expected: 0xD4A3, received: 0xD3A3 }));

    let text = |text: &str| ascii::parse(text.as_bytes()).expect_err("no frame");
    assert_eq!(text(":01060025006471\r\n"), FrameError::Check { expected: 0x70, received: 0x71 });
    assert_eq!(text(":0106002500647"), FrameError::OddDigits);
    assert_eq!(text(":0106002500647\r\n"), FrameError::OddDigits);
    assert_eq!(text(":01060G25006470\r\n"), FrameError::NotHex { at: 6 });
    assert_eq!(text("01060025006470\r\n"), FrameError::NotHex { at: 0 });
    assert_eq!(text(":0106\r0025006470\r\n"), FrameError::NotHex { at: 5 });
    assert_eq!(text(":0106:0025006470\r\n"), FrameError::NotHex { at: 5 });
    assert_eq!(text(":01FF\r\n"), FrameError::TooShort);
    assert_eq!(text(":\r\n"), FrameError::TooShort);
    assert_eq!(text(""), FrameError::NotHex { at: 0 });
    assert_eq!(text(&format!(":{}", "00".repeat(256))), FrameError::TooLong);
}

#[test]
fn mbap_headers() {
    let frame = mbap::emit(0x1234, 0x11, &[3, 0, 0x6B, 0, 3]);
    assert_eq!(frame, [0x12, 0x34, 0, 0, 0, 6, 0x11, 3, 0, 0x6B, 0, 3]);
    let header = frame.first_chunk().expect("a header");
    assert_eq!(Header::parse(header), Ok(Header { transaction: 0x1234, unit: 0x11, pdu_len: 5 }));

    for length in [0, 1, 255, 300, u16::MAX] {
        let [high, low] = length.to_be_bytes();
        assert_eq!(Header::parse(&[0, 1, 0, 0, high, low, 1]), Err(HeaderError::Length { received: length }));
    }
    assert_eq!(Header::parse(&[0, 1, 0, 0, 0, 2, 7]), Ok(Header { transaction: 1, unit: 7, pdu_len: 1 }));
    assert_eq!(Header::parse(&[0, 1, 0, 0, 0, 254, 7]), Ok(Header { transaction: 1, unit: 7, pdu_len: 253 }));
    assert_eq!(
        Header::parse(&[0, 1, 0xAB, 0xCD, 0x01, 0x2C, 7]),
        Err(HeaderError::Protocol { received: 0xABCD, length: 300 })
    );
}

#[test]
fn what_fits_no_frame_is_not_emitted() {
    for pdu in [&[][..], &[0x41; 254]] {
        assert!(rtu::emit(1, pdu).is_empty());
        assert!(ascii::emit(1, pdu).is_empty());
        assert!(mbap::emit(1, 1, pdu).is_empty());
    }
    assert_eq!(rtu::emit(1, &[0x41; 253]).len(), rtu::MAX_ADU);
    assert_eq!(ascii::emit(1, &[0x41; 253]).len(), ascii::MAX_ADU);
    assert_eq!(mbap::emit(1, 1, &[0x41; 253]).len(), mbap::MAX_ADU);
}

#[test]
fn silences() {
    let times = |baud| (rtu::t1_5(settings(baud)).as_micros(), rtu::t3_5(settings(baud)).as_micros());
    assert_eq!(times(4_800), (3_438, 8_021));
    assert_eq!(times(9_600), (1_719, 4_011));
    assert_eq!(times(19_200), (860, 2_006));
    assert_eq!(times(19_201), (750, 1_750));
    assert_eq!(times(115_200), (750, 1_750));
}

#[test]
fn device_identification_of_pymodbus() {
    let adu = [
        0x04, 0x2B, 0x0E, 0x01, 0x81, 0x00, 0x01, 0x01, 0x00, 0x06, b'f', b'o', b'o', b'b', b'a', b'r', 0xD7,
        0x3B,
    ];
    let (unit, pdu) = rtu::parse(&adu).expect("a frame");
    let request = Request::ReadDeviceIdentification { code: 1, object: 0 }.emit();
    let reply = Reply::parse(&request, pdu).expect("its reply");
    let Reply::ReadDeviceIdentification {
        code: 1,
        conformity: 0x81,
        more: 0,
        next: 1,
        count: 1,
        objects: bytes,
    } = reply
    else {
        panic!("{reply:?}");
    };
    assert_eq!(unit, 4);
    assert_eq!(objects(bytes).collect::<Vec<_>>(), [(0, &b"foobar"[..])]);
    assert_eq!(reply.emit(), pdu);
}

#[test]
fn mask_write_of_pymodbus() {
    let request = Request::MaskWriteRegister { address: 4, and_mask: 0xF2, or_mask: 0x25 };
    let pdu = request.emit();
    assert_eq!(pdu, [0x16, 0x00, 0x04, 0x00, 0xF2, 0x00, 0x25]);
    assert_eq!(Request::parse(&pdu), Ok(request));
    assert_eq!(
        Reply::parse(&pdu, &pdu),
        Ok(Reply::MaskWriteRegister { address: 4, and_mask: 0xF2, or_mask: 0x25 })
    );
}

#[test]
fn exceptions() {
    assert_eq!(Exception::IllegalDataAddress.pdu(3), [0x83, 2]);
    assert_eq!(Exception::GatewayTargetFailed.pdu(0x2B), [0xAB, 0x0B]);
    for code in 0..=u8::MAX {
        if let Some(exception) = Exception::from_code(code) {
            assert_eq!(exception as u8, code);
        }
    }
    let known: Vec<u8> = (0..=u8::MAX).filter(|code| Exception::from_code(*code).is_some()).collect();
    assert_eq!(known, [1, 2, 3, 4, 5, 6, 8, 10, 11]);
    // The exception of ESTUN's example belongs to its request.
    assert_eq!(Reply::parse(&[6, 0, 2, 0, 6], &[0x86, 3]), Ok(Reply::Exception { function: 6, code: 3 }));
}

#[test]
fn words_are_big_endian() {
    let words = Words::from_bytes(&[0x12, 0x34, 0x56, 0x78, 0x9A]);
    assert_eq!(words.len(), 2);
    assert_eq!(words.iter().collect::<Vec<_>>(), [0x1234, 0x5678]);
    assert_eq!((words.get(1), words.get(2)), (Some(0x5678), None));
    assert_eq!(words.as_bytes(), [0x12, 0x34, 0x56, 0x78]);
    assert!(Words::from_bytes(&[1]).is_empty());
}

#[test]
fn an_ascii_frame_may_pause_for_a_second() {
    for (pause, frames) in [(1_000, 1), (1_001, 0)] {
        let mut decoder = ascii::Decoder::new();
        let mut now = Instant::from_millis(5_000);
        let mut found = 0;
        for (index, character) in b":010309010001F1\r\n".iter().enumerate() {
            if index == 9 {
                now += Duration::from_millis(pause);
            }
            found += usize::from(matches!(decoder.push(now, *character), Some(Ok(_))));
        }
        assert_eq!(found, frames, "{pause} ms");
    }
}

#[test]
fn a_colon_starts_over() {
    let mut decoder = ascii::Decoder::new();
    let found: Vec<_> = b"rubbish:0106:0103:010309010001F1\r\n\r\n:01060025006470\n"
        .iter()
        .filter_map(|character| decoder.push(Instant::ZERO, *character))
        .map(|result| result.expect("a frame").pdu.to_vec())
        .collect();
    assert_eq!(found, [vec![3, 9, 1, 0, 1], vec![6, 0, 0x25, 0, 0x64]]);
}
