//! SDO messages byte by byte, and transfers of all sizes.

mod common;

use common::channel::{Channel, From, Passing, READ, READ_BLOCK, Random, keep, write};
use common::server::Habits;
use common::{frame, hex, ms};
use proptest::prelude::*;
use puente_canopen::sdo::{
    self, Abort, Action, BlockSegment, Client, Config, Initiate, Outcome, Request, Response, Segment,
    Transfer,
};
use puente_canopen::{Address, NodeId};

/// Each line is a frame, `>` of the client and `<` of the server.
fn conversation(log: &[(From, Vec<u8>)]) -> Vec<String> {
    let line = |(from, bytes): &(From, Vec<u8>)| {
        let hex: Vec<_> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
        format!("{} {}", if *from == From::Client { '>' } else { '<' }, hex.join(" "))
    };
    log.iter().map(line).collect()
}

#[test]
fn the_block_download_of_the_facts() {
    let mut channel = Channel::with_server(Habits::default(), Config::DEFAULT, b"");
    channel.logs = true;
    let (end, _) = channel.run(write(9, true), b"123456789", &mut keep);
    assert_eq!(end, Ok(Outcome::Written));
    assert_eq!(channel.far.objects[&(0x2000, 0)], b"123456789");
    let expected = [
        "> C6 00 20 00 09 00 00 00",
        "< A4 00 20 00 7F 00 00 00",
        "> 01 31 32 33 34 35 36 37",
        "> 82 38 39 00 00 00 00 00",
        "< A2 02 7F 00 00 00 00 00",
        "> D5 C3 31 00 00 00 00 00",
        "< A1 00 00 00 00 00 00 00",
    ];
    assert_eq!(conversation(&channel.log), expected);
}

#[test]
fn a_block_upload_byte_by_byte() {
    let mut channel = Channel::with_server(Habits::default(), Config { block: 2, ..Config::DEFAULT }, b"");
    channel.far.objects.insert((0x2000, 0), (1..=16).collect());
    channel.logs = true;
    let (end, read) = channel.run(READ_BLOCK, b"", &mut keep);
    assert_eq!((end, read), (Ok(Outcome::Read { size: 16, checked: true }), (1..=16).collect()));
    let crc = sdo::crc(0, &(1..=16).collect::<Vec<_>>()).to_le_bytes();
    let expected = [
        "> A4 00 20 00 02 00 00 00".to_owned(),
        "< C6 00 20 00 10 00 00 00".to_owned(),
        "> A3 00 00 00 00 00 00 00".to_owned(),
        "< 01 01 02 03 04 05 06 07".to_owned(),
        "< 02 08 09 0A 0B 0C 0D 0E".to_owned(),
        "> A2 02 02 00 00 00 00 00".to_owned(),
        "< 81 0F 10 00 00 00 00 00".to_owned(),
        "> A2 01 02 00 00 00 00 00".to_owned(),
        format!("< D5 {:02X} {:02X} 00 00 00 00 00", crc[0], crc[1]),
        "> A1 00 00 00 00 00 00 00".to_owned(),
    ];
    assert_eq!(conversation(&channel.log), expected);
}

/// 001, 6.4.1: RPDO1 of node 2 is enabled.
#[test]
fn an_expedited_download_of_the_thesis() {
    let mut client = Client::new(NodeId::new(2).expect("a node-ID"), Config::DEFAULT);
    let address = Address::new(0x1400, 1);
    client.submit(Transfer::Download { address, size: 4, block: false }).expect("idle");
    assert_eq!(client.poll(ms(1)), Action::Fetch { offset: 0, count: 4 });
    client.supply(ms(1), &0x4000_0202_u32.to_le_bytes());
    assert_eq!(client.poll(ms(1)), Action::Transmit(frame(0x602, "23 00 14 01 02 02 00 40")));
    assert_eq!((client.poll(ms(1)), client.poll_at()), (Action::Idle, Some(ms(501))));
    client.receive(ms(2), &frame(0x582, "60 00 14 01 00 00 00 00"));
    assert_eq!(client.poll(ms(2)), Action::Done(Ok(Outcome::Written)));
    assert_eq!((client.poll(ms(2)), client.poll_at()), (Action::Idle, None));
}

#[test]
fn expedited_lengths_and_segments_of_others() {
    let cases = [
        ("2F 60 60 00 06 00 00 00", Initiate::Expedited([6].into_iter().collect())),
        ("2B 40 60 00 0F 00 00 00", Initiate::Expedited([0x0F, 0].into_iter().collect())),
        ("27 40 60 00 01 02 03 00", Initiate::Expedited([1, 2, 3].into_iter().collect())),
        ("22 40 60 00 01 02 03 04", Initiate::Unsized([1, 2, 3, 4])),
        ("21 08 10 00 15 00 00 00", Initiate::Segmented { size: Some(21) }),
        ("20 08 10 00 00 00 00 00", Initiate::Segmented { size: None }),
    ];
    for (bytes, expected) in cases {
        let parsed = Request::parse(&hex(bytes)).expect("a request");
        let Request::InitiateDownload { data, .. } = &parsed else { panic!("{parsed:?}") };
        assert_eq!((data, parsed.to_bytes().to_vec()), (&expected, hex(bytes)));
    }
    let response = Response::parse(&hex("4B 41 60 00 40 02 00 00")).expect("a response");
    let data = Initiate::Expedited([0x40, 0x02].into_iter().collect());
    assert_eq!(response, Response::InitiateUpload { address: Address::new(0x6041, 0), data });
    let segment = Segment { toggle: true, last: true, data: [0x41].into_iter().collect() };
    assert_eq!(Request::DownloadSegment(segment.clone()).to_bytes().to_vec(), hex("1D 41 00 00 00 00 00 00"));
    assert_eq!(Response::UploadSegment(segment).to_bytes().to_vec(), hex("1D 41 00 00 00 00 00 00"));
    assert_eq!(Request::UploadSegment { toggle: true }.to_bytes().to_vec(), hex("70 00 00 00 00 00 00 00"));
    assert!(Request::parse(&hex("E0 00 00 00 00 00 00 00")).is_err());
    // 001 shows requests of 6 bytes; an SDO has 8.
    assert!(Request::parse(&hex("2B 40 60 00 06 00")).is_err());
}

#[test]
fn abort_codes() {
    assert_eq!(Abort::ALL.len(), 31);
    assert_eq!(Abort::NO_OBJECT.to_string(), "0x06020000 object does not exist");
    assert_eq!(Abort(0x0606_0010).text(), None, "000, table 6 prints it for 0607 0010");
    assert!(Abort::ALL.iter().all(|code| code.text().is_some()));
}

#[test]
fn every_size_in_every_protocol() {
    let mut random = Random(7);
    let sizes = (0..40).chain([888, 889, 890, 1_777, 1_778, 1_779, 5_000]);
    for size in sizes {
        let data = random.bytes(size);
        for habit in 0..8 {
            let habits = Habits {
                block: [127, 3][habit & 1],
                crc: habit & 2 == 0,
                says_size: habit & 4 == 0,
                expedites: habit != 5,
                hasty: habit == 6,
            };
            for block in [false, true] {
                let config = Config { block: [127, 5][habit & 1], ..Config::DEFAULT };
                let mut channel = Channel::with_server(habits, config, &data);
                let (end, read) = channel.run(if block { READ_BLOCK } else { READ }, b"", &mut keep);
                let checked = habits.says_size
                    || (block && habits.crc)
                    || (!block && habits.expedites && matches!(size, 1..=4));
                let outcome = Outcome::Read { size: size as u32, checked };
                assert_eq!((end, read == data), (Ok(outcome), true), "{size} {habits:?} {block}");

                let (end, _) = channel.run(write(size, block), &data, &mut keep);
                assert_eq!(end, Ok(Outcome::Written), "{size} {habits:?} {block}");
                assert_eq!(channel.far.written, [((0x2000, 0), data.clone())]);
                assert_eq!(channel.far.aborts, []);
                let counters = channel.client.counters();
                assert_eq!((counters.transfers, counters.completed, counters.unpaired), (2, 2, 0));
            }
        }
    }
}

#[test]
fn a_server_may_prefer_the_plain_protocol_where_it_is_allowed() {
    for (threshold, end) in [(21, Action::Idle), (0, Action::Idle)] {
        let mut client = Client::new(NodeId::MIN, Config { threshold, ..Config::DEFAULT });
        client.submit(READ_BLOCK).expect("idle");
        assert!(matches!(client.poll(ms(0)), Action::Transmit(_)));
        client.receive(ms(1), &frame(0x581, "4B 00 20 00 34 12 00 00"));
        let action = client.poll(ms(1));
        if threshold == 0 {
            assert_eq!((action, client.counters().unpaired), (end, 1));
        } else {
            assert_eq!(action, Action::Data([0x34, 0x12].into_iter().collect()));
            assert_eq!(client.poll(ms(1)), Action::Done(Ok(Outcome::Read { size: 2, checked: true })));
        }
    }
}

/// Of 1 MB in either direction one segment of a hundred is lost, and what is lost comes again.
#[test]
fn a_megabyte_with_a_hundredth_of_the_segments_lost() {
    let data = Random(1).bytes(1_000_000);
    for seed in 0..4 {
        let habits = Habits { hasty: seed == 3, ..Habits::default() };
        let mut channel = Channel::with_server(habits, Config::DEFAULT, &data);
        let mut random = Random(seed);
        let (mut all, mut gone) = (0, 0);
        let mut lost = |passing: Passing| {
            let lost = passing.segment && random.chance(10);
            all += 1;
            gone += u32::from(lost);
            lost
        };
        let (end, read) = channel.run(READ_BLOCK, b"", &mut lost);
        assert_eq!(end, Ok(Outcome::Read { size: 1_000_000, checked: true }), "{seed}");
        assert!(read == data);
        let (end, _) = channel.run(write(data.len(), true), &data, &mut lost);
        assert_eq!(end, Ok(Outcome::Written), "{seed}");
        assert!(channel.far.written[0].1 == data);
        assert!(all > 300_000 && gone * 105 > all, "{gone} of {all}");
    }
}

/// Of a read any frame may be lost, acknowledgements too.
#[test]
fn a_megabyte_read_with_a_hundredth_of_all_frames_lost() {
    let data = Random(2).bytes(1_000_000);
    for seed in 0..3 {
        let mut channel = Channel::with_server(Habits::default(), Config::DEFAULT, &data);
        let mut random = Random(seed);
        let (end, read) = channel.run(READ_BLOCK, b"", &mut |_| random.chance(10));
        assert_eq!(end, Ok(Outcome::Read { size: 1_000_000, checked: true }), "{seed}");
        assert!(read == data);
    }
}

proptest! {
    #[test]
    fn messages_are_made_as_they_are_taken(bytes: [u8; 8]) {
        if let Ok(request) = Request::parse(&bytes) {
            prop_assert_eq!(Request::parse(&request.to_bytes()), Ok(request));
        }
        if let Ok(response) = Response::parse(&bytes) {
            prop_assert_eq!(Response::parse(&response.to_bytes()), Ok(response));
        }
        if let Ok(segment) = BlockSegment::parse(&bytes) {
            prop_assert_eq!(segment.to_bytes(), bytes);
        }
        prop_assert!(Request::parse(&bytes[..7]).is_err());
    }
}
