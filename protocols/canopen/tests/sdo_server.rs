//! The SDO server: by the bytes of the standard, against our client, over a bus that loses frames, and told anything.

mod common;

use common::channel::{Channel, Far, NODE, READ, READ_BLOCK, Random, keep, write};
use common::objects::{Ours, WORD};
use common::{frame, hex, ms};
use proptest::prelude::*;
use puente_canopen::sdo::{self, Abort, Config, Dictionary, Failure, Outcome, Server, Transfer};
use puente_canopen::{Address, Frame, Id, NodeId};

/// What the server says to each message, in hexadecimal.
fn conversation(far: &mut Ours, lines: &[(&str, &[&str])]) {
    for (message, expected) in lines {
        let message = hex(message).try_into().expect("8 bytes");
        let said: Vec<_> = far.take(ms(1), message).iter().map(|said| said.to_vec()).collect();
        let expected: Vec<_> = expected.iter().map(|line| hex(line)).collect();
        assert_eq!(said, expected, "to {message:02X?}");
    }
}

#[test]
fn expedited_bytes() {
    let mut far = Ours::new(b"");
    conversation(
        &mut far,
        &[
            ("40 01 20 00 00 00 00 00", &["43 01 20 00 01 02 03 04"]),
            ("23 01 20 00 0A 0B 0C 0D", &["60 01 20 00 00 00 00 00"]),
            ("40 01 20 00 00 00 00 00", &["43 01 20 00 0A 0B 0C 0D"]),
            // Not said how many bytes: as many as the object has.
            ("22 01 20 00 01 00 00 00", &["60 01 20 00 00 00 00 00"]),
            ("2B 01 20 00 01 00 00 00", &["80 01 20 00 10 00 07 06"]),
            ("40 02 20 01 00 00 00 00", &["80 02 20 01 00 00 02 06"]),
            ("23 02 20 01 00 00 00 00", &["80 02 20 01 00 00 02 06"]),
            ("2F 00 20 00 07 00 00 00", &["60 00 20 00 00 00 00 00"]),
            ("40 00 20 00 00 00 00 00", &["4F 00 20 00 07 00 00 00"]),
            // Nothing is under way; E0h is reserved.
            ("60 00 00 00 00 00 00 00", &["80 00 20 00 01 00 04 05"]),
            ("E0 00 00 00 00 00 00 00", &["80 00 20 00 01 00 04 05"]),
            ("80 00 20 00 00 00 04 05", &[]),
        ],
    );
    assert_eq!(far.objects.values[&WORD], [1, 0, 0, 0]);
    assert_eq!(far.objects.written.len(), 3);
}

#[test]
fn segmented_bytes() {
    let mut far = Ours::new(b"123456789");
    conversation(
        &mut far,
        &[
            ("40 00 20 00 00 00 00 00", &["41 00 20 00 09 00 00 00"]),
            ("60 00 00 00 00 00 00 00", &["00 31 32 33 34 35 36 37"]),
            ("70 00 00 00 00 00 00 00", &["1B 38 39 00 00 00 00 00"]),
            ("21 00 20 00 08 00 00 00", &["60 00 20 00 00 00 00 00"]),
            ("00 41 42 43 44 45 46 47", &["20 00 00 00 00 00 00 00"]),
            ("1D 48 00 00 00 00 00 00", &["30 00 00 00 00 00 00 00"]),
        ],
    );
    assert_eq!(far.objects.values[&Address::new(0x2000, 0)], b"ABCDEFGH");
    // The toggle bit; one byte too many; one too few.
    let begin = ("21 00 20 00 08 00 00 00", &["60 00 20 00 00 00 00 00"] as &[_]);
    let first = ("00 31 32 33 34 35 36 37", &["20 00 00 00 00 00 00 00"] as &[_]);
    for last in [
        ("0D 38 00 00 00 00 00 00", "80 00 20 00 00 00 03 05"),
        ("1B 38 39 00 00 00 00 00", "80 00 20 00 12 00 07 06"),
        ("1F 00 00 00 00 00 00 00", "80 00 20 00 13 00 07 06"),
    ] {
        conversation(&mut far, &[begin, first, (last.0, &[last.1])]);
    }
    conversation(
        &mut far,
        &[
            ("40 00 20 00 00 00 00 00", &["41 00 20 00 08 00 00 00"]),
            ("70 00 00 00 00 00 00 00", &["80 00 20 00 00 00 03 05"]),
        ],
    );
    assert_eq!((far.objects.written.len(), far.objects.discarded), (1, 3));
}

/// FACTS of the block download, and the upload of the same.
#[test]
fn block_bytes() {
    let mut far = Ours::new(b"");
    conversation(
        &mut far,
        &[
            ("C6 00 20 00 09 00 00 00", &["A4 00 20 00 7F 00 00 00"]),
            ("01 31 32 33 34 35 36 37", &[]),
            ("82 38 39 00 00 00 00 00", &["A2 02 7F 00 00 00 00 00"]),
            ("D5 C3 31 00 00 00 00 00", &["A1 00 00 00 00 00 00 00"]),
            // The client has not heard it.
            ("D5 C3 31 00 00 00 00 00", &["A1 00 00 00 00 00 00 00"]),
            ("A4 00 20 00 01 00 00 00", &["C6 00 20 00 09 00 00 00"]),
            ("A3 00 00 00 00 00 00 00", &["01 31 32 33 34 35 36 37"]),
            ("A2 00 02 00 00 00 00 00", &["01 31 32 33 34 35 36 37", "82 38 39 00 00 00 00 00"]),
            ("A2 02 7F 00 00 00 00 00", &["D5 C3 31 00 00 00 00 00"]),
            ("A1 00 00 00 00 00 00 00", &[]),
            // No CRC: none is given, and none asked for.
            ("A0 00 20 00 7F 00 00 00", &["C6 00 20 00 09 00 00 00"]),
            ("A3 00 00 00 00 00 00 00", &["01 31 32 33 34 35 36 37", "82 38 39 00 00 00 00 00"]),
            ("A2 02 7F 00 00 00 00 00", &["D5 00 00 00 00 00 00 00"]),
            ("A1 00 00 00 00 00 00 00", &[]),
            ("C2 00 20 00 01 00 00 00", &["A4 00 20 00 7F 00 00 00"]),
            ("81 41 00 00 00 00 00 00", &["A2 01 7F 00 00 00 00 00"]),
            ("D9 00 00 00 00 00 00 00", &["A1 00 00 00 00 00 00 00"]),
        ],
    );
    assert_eq!(far.objects.written.len(), 2);
    assert_eq!(far.objects.values[&Address::new(0x2000, 0)], b"A");
}

#[test]
fn blocks_that_go_wrong() {
    let mut far = Ours::new(b"123456789");
    let begin = ("C6 00 20 00 09 00 00 00", &["A4 00 20 00 7F 00 00 00"] as &[_]);
    let segments: &[(_, &[&str])] = &[
        begin,
        ("01 31 32 33 34 35 36 37", &[]),
        ("82 38 39 00 00 00 00 00", &["A2 02 7F 00 00 00 00 00"]),
        ("82 38 39 00 00 00 00 00", &["A2 02 7F 00 00 00 00 00"]),
    ];
    for (end, answer) in [
        ("D5 C4 31 00 00 00 00 00", "80 00 20 00 04 00 04 05"),
        ("D9 C3 31 00 00 00 00 00", "80 00 20 00 04 00 04 05"),
        ("40 00 20 00 00 00 00 00", "80 00 20 00 01 00 04 05"),
    ] {
        conversation(&mut far, segments);
        conversation(&mut far, &[(end, &[answer])]);
    }
    // More than was announced; block sizes; an acknowledgement of more than was sent.
    conversation(
        &mut far,
        &[
            ("C6 00 20 00 06 00 00 00", &["A4 00 20 00 7F 00 00 00"]),
            ("01 31 32 33 34 35 36 37", &[]),
            ("82 38 39 00 00 00 00 00", &["80 00 20 00 12 00 07 06"]),
            ("A4 00 20 00 00 00 00 00", &["80 00 20 00 02 00 04 05"]),
            ("A4 00 20 00 80 00 00 00", &["80 00 20 00 02 00 04 05"]),
            ("A4 00 20 00 01 00 00 00", &["C6 00 20 00 09 00 00 00"]),
            ("A2 00 01 00 00 00 00 00", &["80 00 20 00 01 00 04 05"]),
            ("A4 00 20 00 01 00 00 00", &["C6 00 20 00 09 00 00 00"]),
            ("A3 00 00 00 00 00 00 00", &["01 31 32 33 34 35 36 37"]),
            ("A2 02 01 00 00 00 00 00", &["80 00 20 00 03 00 04 05"]),
        ],
    );
    // Only a part of the block came.
    conversation(
        &mut far,
        &[
            begin,
            ("82 38 39 00 00 00 00 00", &["A2 00 7F 00 00 00 00 00"]),
            ("01 31 32 33 34 35 36 37", &[]),
            ("83 38 39 00 00 00 00 00", &["A2 01 7F 00 00 00 00 00"]),
            ("81 38 39 00 00 00 00 00", &["A2 01 7F 00 00 00 00 00"]),
            ("D5 C3 31 00 00 00 00 00", &["A1 00 00 00 00 00 00 00"]),
        ],
    );
    assert_eq!(far.objects.values[&Address::new(0x2000, 0)], b"123456789");
}

#[test]
fn every_size_in_every_protocol() {
    let mut random = Random(7);
    let sizes = (0..40).chain([888, 889, 890, 1_777, 1_778, 1_779, 5_000]);
    for size in sizes {
        let data = random.bytes(size);
        for (block, segments) in [(false, 0), (true, 1), (true, 3), (true, 127), (true, 255)] {
            let config = Config { block: segments.clamp(1, 127), ..Config::DEFAULT };
            let mut channel = Channel::new(Ours::new(&data), config);
            channel.far.server.set_block(segments);
            let (end, read) = channel.run(if block { READ_BLOCK } else { READ }, b"", &mut keep);
            let outcome = Outcome::Read { size: size as u32, checked: true };
            assert_eq!((end, read == data), (Ok(outcome), true), "{size} {block} {segments}");
            let (end, _) = channel.run(write(size, block), &data, &mut keep);
            assert_eq!(end, Ok(Outcome::Written), "{size} {block} {segments}");
            assert_eq!(channel.far.objects.written, [(Address::new(0x2000, 0), data.clone())]);
            let counters = channel.client.counters();
            assert_eq!((counters.completed, counters.unpaired, counters.repeated), (2, 0, 0));
            assert!(channel.far.server.is_idle());
        }
    }
}

#[test]
fn short_data_may_be_read_the_plain_way() {
    let config = Config { threshold: 20, ..Config::DEFAULT };
    for size in [1, 4, 5, 20, 21] {
        let data = Random(size).bytes(size as usize);
        let mut channel = Channel::new(Ours::new(&data), config);
        channel.logs = true;
        let (end, read) = channel.run(READ_BLOCK, b"", &mut keep);
        assert_eq!((end.map(|_| ()), read), (Ok(()), data));
        assert_eq!(channel.log[1].1[0] >> 5 == 6, size > 20, "a block upload");
    }
}

/// Any frame may be lost, but for those that begin a transfer, which nobody repeats.
#[test]
fn a_megabyte_with_a_hundredth_of_all_frames_lost() {
    let data = Random(1).bytes(1_000_000);
    for seed in 0..6 {
        let mut channel = Channel::new(Ours::new(&data), Config::DEFAULT);
        let mut random = Random(seed);
        let mut gone = 0;
        let mut place = 0;
        let mut lost = |_| {
            place += 1;
            let lost = place > 2 && random.chance(10);
            gone += u32::from(lost);
            lost
        };
        let (end, read) = channel.run(READ_BLOCK, b"", &mut lost);
        assert_eq!(end, Ok(Outcome::Read { size: 1_000_000, checked: true }), "{seed}");
        assert!(read == data);
        let mut random = Random(seed + 100);
        let mut place = 0;
        let mut lost = |_| {
            place += 1;
            place > 2 && random.chance(10)
        };
        let (end, _) = channel.run(write(data.len(), true), &data, &mut lost);
        assert_eq!(end, Ok(Outcome::Written), "{seed}");
        assert!(channel.far.objects.written[0].1 == data);
        assert!(gone > 1_000);
    }
}

/// Whichever single frame of a block download is lost, acknowledgements among them, it is written in the end.
#[test]
fn any_one_frame_of_a_block_download_may_be_lost() {
    let data: Vec<u8> = (0..56).collect();
    for place in 3..=14 {
        let mut channel = Channel::new(Ours::new(b""), Config::DEFAULT);
        channel.far.server.set_block(5);
        let mut at = 0;
        let (end, _) = channel.run(write(data.len(), true), &data, &mut |_| {
            at += 1;
            at == place
        });
        assert_eq!(end, Ok(Outcome::Written), "{place}");
        assert_eq!(channel.far.objects.written, [(Address::new(0x2000, 0), data.clone())], "{place}");
    }
}

#[test]
fn a_silent_client_is_given_up() {
    let mut far = Ours::new(&[1; 100]);
    for message in ["40 00 20 00 00 00 00 00", "C6 00 20 00 09 00 00 00", "A4 00 20 00 7F 00 00 00"] {
        assert_eq!(far.take(ms(1_000), hex(message).try_into().expect("8 bytes")).len(), 1);
        assert_eq!(far.server.poll_at(), Some(ms(4_000)));
        assert_eq!(far.server.poll(ms(3_999), &mut far.objects), None);
        let abort = frame(0x585, "80 00 20 00 00 00 04 05");
        assert_eq!(far.server.poll(ms(4_000), &mut far.objects), Some(abort));
        assert_eq!((far.server.poll_at(), far.server.is_idle()), (None, true));
    }
    assert_eq!(far.objects.discarded, 1);
}

#[test]
fn a_transfer_ends_where_another_begins_and_where_the_client_aborts() {
    let mut far = Ours::new(&[1; 100]);
    let begin = ("C6 00 20 00 09 00 00 00", &["A4 00 20 00 7F 00 00 00"] as &[_]);
    conversation(&mut far, &[begin, ("80 00 20 00 00 00 00 08", &[])]);
    assert!(far.server.is_idle());
    let plain = ("21 00 20 00 08 00 00 00", &["60 00 20 00 00 00 00 00"] as &[_]);
    conversation(&mut far, &[plain, ("40 01 20 00 00 00 00 00", &["43 01 20 00 01 02 03 04"])]);
    conversation(&mut far, &[plain, plain]);
    assert_eq!(far.objects.discarded, 3);
    far.server.reset(&mut far.objects);
    assert_eq!((far.objects.discarded, far.server.poll_at()), (4, None));
}

/// What the frames of others, remote frames and short ones are to it: nothing. The thesis shows requests of six bytes.
#[test]
fn only_requests_of_eight_bytes_are_answered() {
    let mut far = Ours::new(b"");
    let own = Id::base(0x600 + u16::from(NODE));
    for frame in [
        Frame::new(own, &hex("2B 40 60 00 06 00")).expect("a frame"),
        Frame::remote(own, 8),
        frame(0x604, "40 01 20 00 00 00 00 00"),
        Frame::new(Id::extended(0x605), &hex("40 01 20 00 00 00 00 00")).expect("a frame"),
    ] {
        far.server.receive(ms(0), &frame, &mut far.objects);
        assert_eq!((far.server.poll_at(), far.server.poll(ms(0), &mut far.objects)), (None, None));
    }
}

#[test]
fn refusals_reach_the_client() {
    let mut channel = Channel::new(Ours::new(b""), Config::DEFAULT);
    for block in [false, true] {
        let missing = Transfer::Upload { address: Address::new(0x3000, 0), block };
        assert_eq!(channel.run(missing, b"", &mut keep).0, Err(Failure::Aborted(Abort::NO_OBJECT)));
        let long = Transfer::Download { address: WORD, size: 9, block };
        assert_eq!(channel.run(long, &[0; 9], &mut keep).0, Err(Failure::Aborted(Abort::LENGTH)));
    }
}

/// Nothing but its length, which changes from write to write.
#[derive(Default)]
struct Sparse {
    open: bool,
    size: u32,
}

impl Dictionary for Sparse {
    fn upload(&mut self, address: Address) -> Result<u32, Abort> {
        Ok(self.size.max(address.index.into()))
    }

    fn read(&mut self, offset: u32, into: &mut [u8]) {
        assert!(offset as usize + into.len() <= self.size.max(0xFFFF) as usize);
    }

    fn download(&mut self, _: Address, size: Option<u32>) -> Result<(), Abort> {
        assert!(!self.open);
        self.open = true;
        self.size = size.unwrap_or(0) % 10_000;
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        assert!(self.open && bytes.len() <= 7);
        Ok(())
    }

    fn finish(&mut self) -> Result<(), Abort> {
        assert!(self.open);
        self.open = false;
        Ok(())
    }

    fn discard(&mut self) {
        self.open = false;
    }
}

proptest! {
    /// Whatever it is told, it neither spins nor leaves an object open when it is idle.
    #[test]
    fn told_anything(messages in prop::collection::vec((0..32_u8, any::<[u8; 8]>(), 0..4_000_u64), 1..60)) {
        let mut server = Server::new(NodeId::MIN);
        let mut objects = Sparse::default();
        let mut now = ms(0);
        for (kind, mut message, pause) in messages {
            // Commands of a client more often than others.
            message[0] = match kind {
                0..8 => [0x21, 0x40, 0xA4, 0xC6, 0xA3, 0xA2, 0xA1, 0x60][usize::from(kind)],
                8..12 => message[0] & 0x0F | (kind & 1) << 7,
                _ => message[0],
            };
            now += std::time::Duration::from_millis(pause / 4 * u64::from(pause % 4 == 0));
            server.receive(now, &Frame::full(Id::base(0x601), message), &mut objects);
            let said = std::iter::from_fn(|| server.poll(now, &mut objects)).take(200).count();
            prop_assert!(said <= 128, "it spins");
            prop_assert!(server.poll_at().is_none_or(|at| at > now));
            prop_assert!(!server.is_idle() || !objects.open);
        }
    }

    /// What a client writes over a bus that loses frames is what is there, or it is told that it may not be.
    #[test]
    fn what_is_confirmed_is_there(size in 0..2_000_usize, block: bool, segments in 1..=127_u8, loss in 0..80_u64, seed: u64) {
        let data = Random(seed).bytes(size);
        let mut channel = Channel::new(Ours::new(b"old"), Config { block: segments, ..Config::DEFAULT });
        channel.far.server.set_block(segments);
        let mut random = Random(seed ^ 1);
        let (end, _) = channel.run(write(size, block), &data, &mut |_| random.chance(loss));
        match end {
            Ok(_) => prop_assert_eq!(&channel.far.objects.values[&Address::new(0x2000, 0)], &data),
            Err(_) => {
                let now = &channel.far.objects.values[&Address::new(0x2000, 0)];
                prop_assert!(now == b"old" || *now == data);
            }
        }
        channel.far.objects.values.insert(Address::new(0x2000, 0), data.clone());
        let read = if block { READ_BLOCK } else { READ };
        let (end, read) = channel.run(read, b"", &mut |_| random.chance(loss));
        if let Ok(Outcome::Read { checked: true, .. }) = end {
            prop_assert!(read == data);
        }
        let _ = sdo::crc(0, &read);
    }
}
