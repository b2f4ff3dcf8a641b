//! Against a node of another implementation, zencan-node.
//!
//! What it does otherwise than the standard is not asked of it: after a lost segment it wants the numbers of the block to go
//! on where they should begin anew, a block upload whose size is a multiple of seven ends one segment short, an abort in the
//! middle of a block upload is its end, and it aborts an object 0000h:0 in answer to the end of each.

mod common;

use common::channel::{Channel, Far, NODE, Random};
use common::server::Message;
use common::zencan::Peer;
use puente_canopen::sdo::{Abort, Config, Failure, Outcome, Transfer};
use puente_canopen::{Address, Frame, Id};
use puente_line::Instant;

impl Far for Peer {
    fn take(&mut self, now: Instant, message: Message) -> Vec<Message> {
        let frame = Frame::full(Id::base(0x600 + u16::from(NODE)), message);
        let own = Id::base(0x580 + u16::from(NODE));
        let said = Peer::take(self, now, Some(&frame));
        said.iter()
            .filter(|frame| frame.id() == own)
            .map(|frame| frame.data().try_into().expect("8 bytes"))
            .collect()
    }

    fn in_block(&self) -> (bool, bool) {
        (false, false)
    }
}

fn channel() -> Channel<Peer> {
    let mut channel = Channel::new(Peer::new(NODE, [1, 2, 3, 4]), Config::DEFAULT);
    let boot: Vec<_> = Peer::take(&mut channel.far, Instant::from_millis(999), None);
    assert_eq!(boot.first().map(|frame| frame.id()), Some(Id::base(0x700 + u16::from(NODE))));
    channel
}

#[test]
fn objects_are_read_and_written() {
    let mut channel = channel();
    let mut random = Random(3);
    let address = Address::new(0x2000, 0);
    for size in (1..30).chain([888, 889, 890, 1_780, 100_001]) {
        let data = random.bytes(size);
        for block in [false, true] {
            if !block && size > 800 {
                // Its buffer is as long as a block.
                continue;
            }
            channel.far.domain.0.lock().expect("a lock").clear();
            let write = Transfer::Download { address, size: size as u32, block };
            let (end, _) = channel.run(write, &data, &mut |_| false);
            assert_eq!(end, Ok(Outcome::Written), "{size} {block}");
            assert!(*channel.far.domain.0.lock().expect("a lock") == data, "{size} {block}");
            if block && size % 7 == 0 {
                continue;
            }
            let (end, read) = channel.run(Transfer::Upload { address, block }, &[], &mut |_| false);
            assert_eq!(end.map(|_| ()), Ok(()), "{size} {block}");
            assert!(read == data, "{size} {block}");
        }
    }
    let counters = channel.client.counters();
    assert_eq!((counters.timeouts, counters.repeated), (0, 0));
}

#[test]
fn its_identity_is_read_and_its_refusals_are_told() {
    let mut channel = channel();
    for sub in 1..=4 {
        let read = Transfer::Upload { address: Address::new(0x1018, sub), block: false };
        let (end, read) = channel.run(read, &[], &mut |_| false);
        assert_eq!((end, read), (Ok(Outcome::Read { size: 4, checked: true }), vec![sub, 0, 0, 0]));
    }
    let mut refused = |transfer| channel.run(transfer, &[0; 4], &mut |_| false).0;
    let missing = Transfer::Upload { address: Address::new(0x1019, 0), block: true };
    assert_eq!(refused(missing), Err(Failure::Aborted(Abort::NO_OBJECT)));
    let missing = Transfer::Upload { address: Address::new(0x2000, 1), block: false };
    assert!(matches!(refused(missing), Err(Failure::Aborted(_)) | Ok(_)));
    let read_only = Transfer::Download { address: Address::new(0x1018, 1), size: 4, block: false };
    assert_eq!(refused(read_only), Err(Failure::Aborted(Abort::READ_ONLY)));
}
