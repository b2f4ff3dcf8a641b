//! Properties of the codecs.

use proptest::collection::vec;
use proptest::prelude::*;
use puente_line::{Instant, Settings};
use puente_modbus::mbap::{self, Header};
use puente_modbus::reply::{Mismatch, Reply, objects};
use puente_modbus::request::{ReplyLength, Request};
use puente_modbus::server::Decoder;
use puente_modbus::{Exception, FrameError, Mode, Words, ascii, rtu};

/// A request and its normal reply, as PDUs.
type Pair = (Vec<u8>, Vec<u8>);

fn pair(request: Request<'_>, reply: Reply<'_>) -> Pair {
    (request.emit().to_vec(), reply.emit().to_vec())
}

fn words(most: usize) -> impl Strategy<Value = Vec<u8>> + Clone {
    vec(any::<[u8; 2]>(), 1..=most).prop_map(|words| words.concat())
}

/// Function codes without types, 2B with another MEI type than 0E among them.
fn opaque() -> impl Strategy<Value = (u8, Vec<u8>)> {
    let free = |function: &u8| !matches!(function, 1..=6 | 8 | 0x0F..=0x11 | 0x16 | 0x17 | 0x2B);
    prop_oneof![
        ((1..0x80_u8).prop_filter("opaque", free), vec(any::<u8>(), 0..=252)),
        vec(any::<u8>(), 0..=251).prop_map(|data| (0x2B, [vec![0x0D], data].concat())),
    ]
}

/// Any well-formed request with a reply to it.
fn pairs() -> impl Strategy<Value = Pair> {
    let bits = (any::<u16>(), 1..=2000_u16, vec(any::<u8>(), 250));
    let registers = (any::<u16>(), words(125));
    prop_oneof![
        bits.clone().prop_map(|(address, quantity, bits)| {
            let bits = &bits[..usize::from(quantity).div_ceil(8)];
            pair(Request::ReadCoils { address, quantity }, Reply::ReadCoils { bits })
        }),
        bits.prop_map(|(address, quantity, bits)| {
            let bits = &bits[..usize::from(quantity).div_ceil(8)];
            pair(Request::ReadDiscreteInputs { address, quantity }, Reply::ReadDiscreteInputs { bits })
        }),
        registers.clone().prop_map(|(address, bytes)| {
            let words = Words::from_bytes(&bytes);
            let quantity = words.len() as u16;
            pair(Request::ReadHoldingRegisters { address, quantity }, Reply::ReadHoldingRegisters { words })
        }),
        registers.prop_map(|(address, bytes)| {
            let words = Words::from_bytes(&bytes);
            let quantity = words.len() as u16;
            pair(Request::ReadInputRegisters { address, quantity }, Reply::ReadInputRegisters { words })
        }),
        (any::<u16>(), any::<bool>()).prop_map(|(address, on)| {
            pair(Request::WriteSingleCoil { address, on }, Reply::WriteSingleCoil { address, on })
        }),
        (any::<u16>(), any::<u16>()).prop_map(|(address, value)| {
            pair(
                Request::WriteSingleRegister { address, value },
                Reply::WriteSingleRegister { address, value },
            )
        }),
        (any::<u16>().prop_filter("listen only", |sub| *sub != 4), words(2), words(2)).prop_map(
            |(sub_function, sent, returned)| {
                let data = match returned.get(..sent.len()) {
                    Some(returned) if sub_function != 0 => returned,
                    _ => &sent,
                };
                pair(
                    Request::Diagnostics { sub_function, data: &sent },
                    Reply::Diagnostics { sub_function, data },
                )
            }
        ),
        (any::<u16>(), 1..=1968_u16, vec(any::<u8>(), 246)).prop_map(|(address, quantity, bits)| {
            let bits = &bits[..usize::from(quantity).div_ceil(8)];
            pair(
                Request::WriteMultipleCoils { address, quantity, bits },
                Reply::WriteMultipleCoils { address, quantity },
            )
        }),
        (any::<u16>(), words(123)).prop_map(|(address, bytes)| {
            let words = Words::from_bytes(&bytes);
            pair(
                Request::WriteMultipleRegisters { address, words },
                Reply::WriteMultipleRegisters { address, quantity: words.len() as u16 },
            )
        }),
        vec(any::<u8>(), 0..=251)
            .prop_map(|data| pair(Request::ReportServerId, Reply::ReportServerId { data: &data })),
        any::<(u16, u16, u16)>().prop_map(|(address, and_mask, or_mask)| {
            pair(
                Request::MaskWriteRegister { address, and_mask, or_mask },
                Reply::MaskWriteRegister { address, and_mask, or_mask },
            )
        }),
        (any::<(u16, u16)>(), words(121), words(125)).prop_map(|((read, write), written, values)| {
            pair(
                Request::ReadWriteMultipleRegisters {
                    read_address: read,
                    read_quantity: (values.len() / 2) as u16,
                    write_address: write,
                    words: Words::from_bytes(&written),
                },
                Reply::ReadWriteMultipleRegisters { words: Words::from_bytes(&values) },
            )
        }),
        (1..=3_u8, any::<[u8; 4]>(), vec(vec(any::<u8>(), 0..=40), 0..=5)).prop_map(
            |(code, [object, conformity, more, next], texts)| {
                let mut bytes = Vec::new();
                for (id, text) in texts.iter().enumerate() {
                    bytes.extend([id as u8, text.len() as u8]);
                    bytes.extend(text);
                }
                let count = texts.len() as u8;
                pair(
                    Request::ReadDeviceIdentification { code, object },
                    Reply::ReadDeviceIdentification { code, conformity, more, next, count, objects: &bytes },
                )
            }
        ),
        (opaque(), vec(any::<u8>(), 0..=252)).prop_map(|((function, data), answer)| {
            pair(Request::Other { function, data: &data }, Reply::Other { function, data: &answer })
        }),
    ]
}

fn line() -> Settings {
    Settings { baud: 19_200, format: "8E1".parse().expect("format") }
}

proptest! {
    #[test]
    fn requests_round_trip((request, _) in pairs()) {
        let parsed = Request::parse(&request).expect("well-formed");
        prop_assert_eq!(parsed.emit().to_vec(), request.to_vec());
        prop_assert_eq!(parsed.function(), request[0]);
    }

    #[test]
    fn replies_round_trip((request, reply) in pairs()) {
        let parsed = Reply::parse(&request, &reply).expect("its reply");
        prop_assert_eq!(parsed.emit().to_vec(), reply.to_vec());
        if let ReplyLength::Exact(length) = Request::parse(&request).expect("well-formed").expected() {
            prop_assert_eq!(length, reply.len());
        }
    }

    #[test]
    fn exceptions_pair_with_every_request((request, _) in pairs(), code in any::<u8>()) {
        let reply = [request[0] | 0x80, code];
        let parsed = Reply::parse(&request, &reply).expect("its exception");
        prop_assert_eq!(parsed, Reply::Exception { function: request[0], code });
        prop_assert_eq!(parsed.emit().to_vec(), reply.to_vec());
        prop_assert!(Reply::parse(&request, &[reply[0], code, 0]).is_err());
        prop_assert!(Reply::parse(&request, &reply[..1]).is_err());
    }

    /// A reply cut, stretched or with another function is none, where the request tells the length.
    #[test]
    fn other_lengths_do_not_pair((request, reply) in pairs(), cut in any::<prop::sample::Index>()) {
        let opaque = matches!(Request::parse(&request), Ok(Request::Other { .. }));
        let cut = &reply[..cut.index(reply.len())];
        let mut stretched = reply.clone();
        stretched.push(0);
        if !opaque {
            prop_assert!(Reply::parse(&request, cut).is_err());
            prop_assert!(Reply::parse(&request, &stretched).is_err());
        }
        let mut other = reply.clone();
        other[0] = if other[0] == 0x7F { 1 } else { other[0] + 1 };
        let function = Mismatch::Function { expected: request[0], received: other[0] };
        prop_assert_eq!(Reply::parse(&request, &other), Err(function));
    }

    /// Whatever comes out of arbitrary bytes is what these bytes say.
    #[test]
    fn arbitrary_pdus(request in vec(any::<u8>(), 0..=256), reply in vec(any::<u8>(), 0..=256)) {
        if let Ok(parsed) = Request::parse(&request) && request.len() <= 253 {
            prop_assert_eq!(parsed.emit().to_vec(), request.to_vec());
        }
        if let Ok(parsed) = Reply::parse(&request, &reply) && reply.len() <= 253 {
            prop_assert_eq!(parsed.emit().to_vec(), reply.to_vec());
        }
        prop_assert!(objects(&reply).map(|(_, text)| text.len() + 2).sum::<usize>() <= reply.len());
    }

    #[test]
    fn frames_round_trip(unit in any::<u8>(), transaction in any::<u16>(), pdu in vec(any::<u8>(), 1..=253)) {
        let adu = rtu::emit(unit, &pdu);
        prop_assert_eq!(rtu::parse(&adu), Ok((unit, &pdu[..])));
        let frame = ascii::parse(&ascii::emit(unit, &pdu)).expect("a frame");
        prop_assert_eq!((frame.unit, frame.pdu.as_slice()), (unit, &pdu[..]));
        let adu = mbap::emit(transaction, unit, &pdu);
        let header = Header::parse(adu.first_chunk().expect("a header"));
        prop_assert_eq!(header, Ok(Header { transaction, unit, pdu_len: pdu.len() as u8 }));
        prop_assert_eq!(&adu[mbap::HEADER..], &pdu[..]);
    }

    /// No single changed bit passes the CRC or the LRC.
    #[test]
    fn a_flipped_bit_is_found(unit in any::<u8>(), pdu in vec(any::<u8>(), 1..=253), bit in any::<prop::sample::Index>()) {
        let mut adu = rtu::emit(unit, &pdu);
        let bit = bit.index(adu.len() * 8);
        adu[bit / 8] ^= 1 << (bit % 8);
        prop_assert!(rtu::parse(&adu).is_err());
        let mut adu = ascii::emit(unit, &pdu);
        let bit = bit.min(adu.len() * 8 - 25);
        adu[bit / 8] ^= 1 << (bit % 8);
        // Bit 5 of a letter is its case, which is free.
        if !(bit % 8 == 5 && adu[bit / 8].is_ascii_alphabetic()) {
            prop_assert!(ascii::parse(&adu).is_err());
        }
    }

    #[test]
    fn arbitrary_bytes(bytes in vec(any::<u8>(), 0..600), header in any::<[u8; 7]>()) {
        if let Ok((unit, pdu)) = rtu::parse(&bytes) {
            prop_assert_eq!(rtu::emit(unit, pdu).to_vec(), bytes.to_vec());
        }
        if let Ok(frame) = ascii::parse(&bytes) {
            let adu = ascii::emit(frame.unit, &frame.pdu);
            prop_assert!(adu.starts_with(bytes.to_ascii_uppercase().trim_ascii_end()));
        }
        if let Ok(parsed) = Header::parse(&header) {
            let adu = mbap::emit(parsed.transaction, parsed.unit, &vec![0; parsed.pdu_len.into()]);
            prop_assert_eq!(&adu[..7], &header[..]);
        }
    }

    /// A server hears every request, whatever was on the line before, in whatever portions it comes.
    #[test]
    fn servers_hear_requests(
        (request, _) in pairs(),
        unit in any::<u8>(),
        garbage in vec(any::<u8>(), 0..40),
        portion in 1..20_usize,
        mode in prop_oneof![Just(Mode::Rtu), Just(Mode::Ascii)],
    ) {
        let mut decoder = Decoder::new(mode, line());
        let adu = match mode {
            Mode::Rtu => rtu::emit(unit, &request).to_vec(),
            Mode::Ascii => ascii::emit(unit, &request).to_vec(),
        };
        let mut now = Instant::from_millis(3_000);
        let mut heard = Vec::new();
        for chunk in garbage.chunks(portion) {
            decoder.receive(now, chunk);
        }
        while let Some(at) = decoder.poll_at() {
            now = now.max(at);
            heard.extend(decoder.poll(now));
        }
        for chunk in adu.chunks(portion) {
            decoder.receive(now, chunk);
        }
        while let Some(at) = decoder.poll_at() {
            now = now.max(at);
            heard.extend(decoder.poll(now));
        }
        let last = heard.last().cloned().expect("something was heard").expect("a request");
        prop_assert_eq!((last.unit, last.pdu.as_slice()), (unit, &request[..]));
    }
}

#[test]
fn malformed_requests_get_their_exception() {
    use Exception::{IllegalDataValue as Value, IllegalFunction as Function};
    let cases: &[(&[u8], Exception)] = &[
        (&[], Function),
        (&[0x00], Function),
        (&[0x80], Function),
        (&[0x83, 0x02], Function),
        (&[0xFF, 0x00, 0x00, 0x00, 0x01], Function),
        // Quantities one too small and one too large.
        (&[0x01, 0, 0, 0x00, 0x00], Value),
        (&[0x01, 0, 0, 0x07, 0xD1], Value),
        (&[0x02, 0, 0, 0x07, 0xD1], Value),
        (&[0x03, 0, 0, 0x00, 0x00], Value),
        (&[0x03, 0, 0, 0x00, 0x7E], Value),
        (&[0x04, 0, 0, 0x00, 0x7E], Value),
        (&[0x0F, 0, 0, 0x00, 0x00, 0], Value),
        (&[0x10, 0, 0, 0x00, 0x00, 0], Value),
        (&[0x17, 0, 0, 0x00, 0x00, 0, 0, 0, 1, 2, 0, 0], Value),
        (&[0x17, 0, 0, 0x00, 0x7E, 0, 0, 0, 1, 2, 0, 0], Value),
        (&[0x17, 0, 0, 0x00, 0x01, 0, 0, 0, 0, 0], Value),
        // Byte counts that are not what the quantity calls for, or not what is there.
        (&[0x0F, 0, 0, 0, 9, 1, 0xFF], Value),
        (&[0x0F, 0, 0, 0, 8, 1], Value),
        (&[0x10, 0, 0, 0, 1, 3, 0, 0, 0], Value),
        (&[0x10, 0, 0, 0, 2, 4, 0, 0], Value),
        (&[0x17, 0, 0, 0, 1, 0, 0, 0, 1, 2, 0], Value),
        // Structure.
        (&[0x03, 0, 0, 0], Value),
        (&[0x03, 0, 0, 0, 1, 0], Value),
        (&[0x05, 0, 0, 0x12, 0x34], Value),
        (&[0x05, 0, 0, 0xFF, 0xFF], Value),
        (&[0x06, 0, 0, 0], Value),
        (&[0x08, 0], Value),
        (&[0x11, 0], Value),
        (&[0x16, 0, 0, 0, 0, 0], Value),
        (&[0x2B, 0x0E, 1], Value),
        (&[0x2B, 0x0E, 0, 0], Value),
        (&[0x2B, 0x0E, 5, 0], Value),
    ];
    for (pdu, exception) in cases {
        assert_eq!(Request::parse(pdu), Err(*exception), "{pdu:02X?}");
    }
    let longest = [&[0x10, 0, 0, 0, 124, 248][..], &[0; 248]].concat();
    assert_eq!(Request::parse(&longest), Err(Value));
    let longest = [&[0x0F, 0, 0, 0x07, 0xB1, 247][..], &[0; 247]].concat();
    assert_eq!(Request::parse(&longest), Err(Value));
}

#[test]
fn mismatches_say_what_was_expected() {
    let length = |expected, received| Err(Mismatch::Length { expected, received });
    let field = |expected, received| Err(Mismatch::Field { expected, received });
    // A late reply: two registers where one was asked for, and the other way round.
    assert_eq!(Reply::parse(&[3, 0, 0, 0, 1], &[3, 4, 0, 1, 0, 2]), length(4, 6));
    assert_eq!(Reply::parse(&[3, 0, 0, 0, 2], &[3, 2, 0, 1]), length(6, 4));
    // The length fits, the byte count does not.
    assert_eq!(Reply::parse(&[3, 0, 0, 0, 1], &[3, 4, 0, 1]), length(4, 6));
    assert_eq!(Reply::parse(&[0x11], &[0x11, 3, 1]), length(3, 5));
    // The request, echoed.
    assert_eq!(Reply::parse(&[3, 0, 0, 0, 1], &[3, 0, 0, 0, 1]), length(4, 5));
    assert_eq!(Reply::parse(&[6, 0, 0x25, 0, 0x64], &[6, 0, 0x26, 0, 0x64]), field(0x25, 0x26));
    assert_eq!(Reply::parse(&[6, 0, 0x25, 0, 0x64], &[6, 0, 0x25, 0, 0x65]), field(0x64, 0x65));
    assert_eq!(Reply::parse(&[5, 0, 1, 0xFF, 0], &[5, 0, 1, 0, 0]), field(0xFF00, 0));
    assert_eq!(Reply::parse(&[0x10, 0, 1, 0, 1, 2, 0, 9], &[0x10, 0, 1, 0, 2]), field(1, 2));
    assert_eq!(Reply::parse(&[0x16, 0, 1, 0, 2, 0, 3], &[0x16, 0, 1, 0, 2, 0, 4]), field(3, 4));
    assert_eq!(Reply::parse(&[8, 0, 0, 0xA5, 0x37], &[8, 0, 0, 0xA5, 0x38]), field(0xA537, 0xA538));
    assert_eq!(Reply::parse(&[8, 0, 0x0B, 0, 0], &[8, 0, 0x0C, 0, 7]), field(0x0B, 0x0C));
    assert!(Reply::parse(&[8, 0, 0x0B, 0, 0], &[8, 0, 0x0B, 0, 7]).is_ok());
    // Force Listen Only Mode has no reply.
    assert!(Reply::parse(&[8, 0, 4, 0, 0], &[8, 0, 4, 0, 0]).is_err());
    // Another object than the one asked for; another category.
    let one = [0x2B, 0x0E, 4, 0x83, 0, 0, 1, 2, 1, b'x'];
    assert!(Reply::parse(&[0x2B, 0x0E, 4, 2], &one).is_ok());
    assert_eq!(Reply::parse(&[0x2B, 0x0E, 4, 1], &one), field(1, 2));
    assert_eq!(Reply::parse(&[0x2B, 0x0E, 1, 2], &one), field(1, 4));
    // Nothing is the reply to a malformed request.
    let malformed = Mismatch::Request(Exception::IllegalDataValue);
    assert_eq!(Reply::parse(&[3, 0, 0, 0, 0], &[3, 0]), Err(malformed));
}

#[test]
fn writes_are_known_as_such() {
    let writes = |pdu: &[u8]| Request::parse(pdu).expect("well-formed").is_write();
    for read in [
        &[3, 0, 0, 0, 1][..],
        &[1, 0, 0, 0, 1],
        &[0x11],
        &[0x2B, 0x0E, 1, 0],
        &[8, 0, 0, 1, 2],
        &[8, 0, 0x0B, 0, 0],
    ] {
        assert!(!writes(read), "{read:02X?}");
    }
    for write in [
        &[6, 0, 0, 0, 1][..],
        &[8, 0, 1, 0, 0],
        &[8, 0, 4, 0, 0],
        &[8, 0, 0x0A, 0, 0],
        &[8, 0, 0x14, 0, 0],
        &[0x16, 0, 0, 0, 0, 0, 0],
        &[0x41],
    ] {
        assert!(writes(write), "{write:02X?}");
    }
}

#[test]
fn a_server_keeps_bounded_results() {
    let mut decoder = Decoder::new(Mode::Rtu, line());
    let now = Instant::from_millis(1);
    for value in 0..10 {
        decoder.receive(now, &rtu::emit(1, &[6, 0, 0, 0, value]));
    }
    let heard: Vec<u8> =
        std::iter::from_fn(|| decoder.poll(now)).map(|frame| frame.expect("a request").pdu[4]).collect();
    assert_eq!(heard, [6, 7, 8, 9]);
}

#[test]
fn a_server_reports_a_damaged_burst_once() {
    let mut decoder = Decoder::new(Mode::Rtu, line());
    let now = Instant::from_millis(1);
    decoder.receive(now, &[1, 6, 0, 0x25, 0, 0x64, 0x99, 0xEB]);
    assert_eq!(decoder.poll(now), None);
    let silent = decoder.poll_at().expect("a silence to wait for");
    assert_eq!(silent, now + rtu::t3_5(line()));
    let check = FrameError::Check { expected: 0xEA99, received: 0xEB99 };
    assert_eq!(decoder.poll(silent), Some(Err(check)));
    assert_eq!((decoder.poll(silent), decoder.poll_at()), (None, None));
}

/// The rest of a request that a pause has cut may itself look like the beginning of a longer one: nobody waits for that.
#[test]
fn the_rest_of_a_request_does_not_hold_it_back() {
    let mut requests =
        (0..=u16::MAX).map(|value| rtu::emit(1, &[6, 0, 0x25, (value >> 8) as u8, value as u8]));
    let adu = requests.find(|adu| adu[6] == 6).expect("a CRC that begins with 6");
    let mut decoder = Decoder::new(Mode::Rtu, line());
    let later = Instant::from_millis(500);
    decoder.receive(Instant::ZERO, &adu[..5]);
    decoder.receive(later, &adu[5..]);
    assert!(matches!(decoder.poll(later), Some(Err(FrameError::TooShort))));
    assert!(matches!(decoder.poll(later), Some(Ok(_))));
}

#[test]
fn half_a_request_is_not_completed_a_second_later() {
    let mut decoder = Decoder::new(Mode::Rtu, line());
    let adu = rtu::emit(1, &[6, 0, 0x25, 0, 0x64]);
    for (pause, heard) in [(900, true), (1_100, false)] {
        let start = Instant::from_millis(10_000);
        let later = Instant::from_millis(10_000 + pause);
        decoder.receive(start, &adu[..5]);
        decoder.receive(later, &adu[5..]);
        let frames = std::iter::from_fn(|| decoder.poll(later)).filter(Result::is_ok).count();
        assert_eq!(frames == 1, heard, "{pause} ms");
        decoder = Decoder::new(Mode::Rtu, line());
    }
}
