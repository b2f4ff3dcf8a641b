//! Nodes on the bus: SDO, NMT, PDOs, SYNC, guarding, EMCY, LSS.

use std::time::Duration;

use proptest::prelude::*;
use puente_canopen::lss::{self, Known};
use puente_canopen::nmt::{Command, Sign, State};
use puente_canopen::sdo::{Abort, Outcome, Transfer};
use puente_canopen::{Address, Frame, Id, NodeId};
use puente_cell::can::{Config, DriveConfig, DriveFault, Fault, Model};
use puente_drives::cia402::State as Drive;
use puente_drives::cia402::object;
use puente_line::Instant;

use crate::bench::{Bench, lexium};

fn node(id: u8) -> DriveConfig {
    DriveConfig::new(id, Model::Node).unwrap()
}

/// Sets transmit PDO 1 of node 2 up: statusword, with a type and more.
fn tpdo(bench: &mut Bench, transmission: u8, inhibit: u16, timer: u16) {
    bench.write(2, 0x1800, 1, &0xC000_0182_u32.to_le_bytes());
    bench.write(2, 0x1800, 2, &[transmission]);
    bench.write(2, 0x1800, 3, &inhibit.to_le_bytes());
    bench.write(2, 0x1800, 5, &timer.to_le_bytes());
    bench.write(2, 0x1800, 1, &0x0000_0182_u32.to_le_bytes());
}

#[test]
fn nodes_boot_and_obey() {
    let mut bench = Bench::new([lexium(2), node(5)]);
    assert_eq!((bench.take(0x702), bench.take(0x705)), (vec![vec![0]], vec![vec![0]]));
    let state = |bench: &Bench, id| bench.cell.node(id).unwrap().state();
    assert_eq!(state(&bench, 2), State::PreOperational);
    bench.nmt(Command::Start, 0);
    assert_eq!((state(&bench, 2), state(&bench, 5)), (State::Operational, State::Operational));
    bench.nmt(Command::Stop, 5);
    assert_eq!((state(&bench, 2), state(&bench, 5)), (State::Operational, State::Stopped));
    // Stopped, it answers no SDO, but guarding.
    bench.say(0x605, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]);
    bench.send(Sign::request(NodeId::new(5).unwrap()));
    bench.run(5);
    assert_eq!((bench.take(0x585).len(), bench.take(0x705)), (0, vec![vec![0x04]]));
    bench.nmt(Command::ResetCommunication, 5);
    assert_eq!((bench.take(0x705), state(&bench, 5)), (vec![vec![0]], State::PreOperational));
}

#[test]
fn what_a_client_may_not_do_is_refused() {
    let mut bench = Bench::new([lexium(2)]);
    let cases: &[(u16, u8, &[u8], Abort)] = &[
        (0x3000, 0, &[0], Abort::NO_OBJECT),
        (0x1018, 5, &[0], Abort::NO_SUB_INDEX),
        (0x1018, 1, &[0; 4], Abort::READ_ONLY),
        (0x6041, 0, &[0; 2], Abort::READ_ONLY),
        (0x6040, 0, &[0; 4], Abort::TOO_LONG),
        (0x607A, 0, &[0; 2], Abort::TOO_SHORT),
        (0x6060, 0, &[2], Abort::VALUE),
        (0x6060, 0, &[8], Abort::VALUE),
        (0x6098, 0, &[0], Abort::VALUE),
        (0x6098, 0, &[15], Abort::VALUE),
        (0x60C2, 1, &[0], Abort::VALUE),
        (0x60C2, 2, &[1], Abort::VALUE),
        (0x1003, 0, &[1], Abort::VALUE),
        (0x1019, 0, &[1], Abort::VALUE),
        (0x1019, 0, &[241], Abort::VALUE),
        (0x1010, 1, &[0; 4], Abort::TRANSFER),
        (0x1800, 2, &[241], Abort::VALUE),
        (0x1400, 2, &[253], Abort::VALUE),
        (0x1800, 1, &0x4000_0601_u32.to_le_bytes(), Abort::VALUE),
        (0x1A00, 1, &0x6064_0020_u32.to_le_bytes(), Abort::UNSUPPORTED),
        (0x1A00, 0, &[9], Abort::VALUE),
    ];
    for (index, sub, data, code) in cases {
        assert_eq!(bench.try_write(2, *index, *sub, data), Err(*code), "{index:04X}h:{sub} {data:02X?}");
    }
    assert_eq!(bench.read(2, 0x2000, 0), Err(Abort::NO_OBJECT));
    // The mapping of a PDO that does not exist.
    bench.write(2, 0x1A00, 0, &[0]);
    assert_eq!(bench.try_write(2, 0x1A00, 1, &0x1008_0008_u32.to_le_bytes()), Err(Abort::NOT_MAPPABLE));
    assert_eq!(bench.try_write(2, 0x1A00, 1, &0x6064_0010_u32.to_le_bytes()), Err(Abort::NOT_MAPPABLE));
    for sub in 1..=3 {
        bench.write(2, 0x1A00, sub, &0x6064_0020_u32.to_le_bytes());
    }
    assert_eq!(bench.try_write(2, 0x1A00, 0, &[3]), Err(Abort::MAPPING_LENGTH));
    bench.write(2, 0x1A00, 0, &[2]);
    // One that exists.
    bench.write(2, 0x1800, 1, &0x4000_0182_u32.to_le_bytes());
    assert_eq!(bench.try_write(2, 0x1A00, 0, &[0]), Err(Abort::UNSUPPORTED));
    assert_eq!(bench.try_write(2, 0x1800, 1, &0x4000_0183_u32.to_le_bytes()), Err(Abort::VALUE));
    assert_eq!(bench.try_write(2, 0x1800, 3, &[1, 0]), Err(Abort::DEVICE_STATE));
}

#[test]
fn objects_of_any_length_pass_the_bus() {
    let mut bench = Bench::new([node(5)]);
    let data: Vec<u8> = (0..100_000_u32).map(|at| (at.wrapping_mul(at) >> 3) as u8).collect();
    let address = Address::new(0x2000, 0);
    let began = bench.now;
    let write = Transfer::Download { address, size: 100_000, block: true };
    assert_eq!(bench.transfer(5, write, &data).0, Ok(Outcome::Written));
    let took = bench.now.since(began);
    // 14 286 segments of 111 to 135 bits.
    assert!((Duration::from_millis(1_586)..Duration::from_millis(2_000)).contains(&took), "{took:?}");
    for block in [false, true] {
        let (end, read) = bench.transfer(5, Transfer::Upload { address, block }, &[]);
        assert_eq!(end, Ok(Outcome::Read { size: 100_000, checked: true }));
        assert!(read == data);
    }
}

#[test]
fn what_was_stored_outlasts_a_reset() {
    let mut bench = Bench::new([DriveConfig::new(2, Model::FestoCmms).unwrap()]);
    bench.write(2, 0x1017, 0, &[100, 0]);
    bench.put(2, object::PROFILE_VELOCITY, 77);
    bench.nmt(Command::ResetNode, 2);
    assert_eq!(bench.get(2, object::PROFILE_VELOCITY), 1_000_000, "not stored");
    bench.put(2, object::PROFILE_VELOCITY, 77);
    bench.write(2, 0x1017, 0, &[100, 0]);
    bench.write(2, 0x1010, 1, b"save");
    bench.put(2, object::PROFILE_VELOCITY, 78);
    bench.nmt(Command::ResetNode, 2);
    assert_eq!(bench.get(2, object::PROFILE_VELOCITY), 77);
    bench.take(0x702);
    bench.run(1_000);
    assert_eq!(bench.take(0x702).len(), 10, "its heartbeat, too");
    bench.write(2, 0x1011, 1, b"load");
    bench.nmt(Command::ResetNode, 2);
    assert_eq!(bench.get(2, object::PROFILE_VELOCITY), 1_000_000);
    // Resetting the communication leaves the drive's values alone.
    bench.put(2, object::PROFILE_VELOCITY, 79);
    bench.write(2, 0x1017, 0, &[100, 0]);
    bench.nmt(Command::ResetCommunication, 2);
    assert_eq!(bench.get(2, object::PROFILE_VELOCITY), 79);
    assert_eq!(bench.read(2, 0x1017, 0), Ok(vec![0, 0]));
}

#[test]
fn an_event_sends_a_pdo_and_its_inhibit_time_holds_it() {
    let mut bench = Bench::new([lexium(2)]);
    tpdo(&mut bench, 255, 100, 50);
    bench.run(100);
    assert_eq!(bench.take(0x182).len(), 0, "not operational");
    bench.nmt(Command::Start, 2);
    assert_eq!(bench.take(0x182), [[0x40, 0x02]]);
    // Three changes in 3 ms: the last one comes when the inhibit time of 10 ms is over.
    for word in [6, 7, 6] {
        bench.say(0x602, &[0x2B, 0x40, 0x60, 0, word, 0, 0, 0]);
        bench.run(1);
    }
    assert_eq!(bench.take(0x182), Vec::<Vec<u8>>::new());
    bench.run(10);
    assert_eq!(bench.take(0x182), [[0x21, 0x02]]);
    // Then its event timer.
    bench.run(500);
    assert_eq!(bench.take(0x182).len(), 10);
    bench.nmt(Command::EnterPreOperational, 2);
    bench.take(0x182);
    bench.run(500);
    assert_eq!(bench.take(0x182).len(), 0);
}

#[test]
fn synchronous_pdos() {
    for (transmission, syncs, expected) in [(1, 10, 10), (3, 10, 3), (240, 480, 2), (0, 10, 0)] {
        let mut bench = Bench::new([lexium(2)]);
        tpdo(&mut bench, transmission, 0, 0);
        bench.nmt(Command::Start, 2);
        for _ in 0..syncs {
            bench.say(0x080, &[]);
            bench.run(1);
        }
        let sent = bench.take(0x182).len();
        // Type 0: what has changed since the last, and the first is a change.
        assert_eq!(sent, expected.max(usize::from(transmission == 0)), "type {transmission}");
        bench.control(2, 6);
        assert_eq!(bench.take(0x182).len(), 0, "not before SYNC");
        if transmission < 2 {
            bench.say(0x080, &[]);
            bench.run(1);
            assert_eq!(bench.take(0x182), [[0x21, 0x02]]);
        }
    }
}

#[test]
fn pdos_are_asked_for() {
    let mut bench = Bench::new([lexium(2)]);
    let ask = Frame::remote(Id::base(0x182), 2);
    tpdo(&mut bench, 253, 0, 0);
    bench.nmt(Command::Start, 2);
    bench.send(ask);
    bench.run(1);
    assert_eq!(bench.take(0x182), [[0x40, 0x02]]);
    tpdo(&mut bench, 252, 0, 0);
    bench.send(ask);
    bench.run(1);
    assert_eq!(bench.take(0x182).len(), 0, "nothing has been sampled");
    bench.say(0x080, &[]);
    bench.run(1);
    bench.control(2, 6);
    bench.send(ask);
    bench.run(1);
    assert_eq!(bench.take(0x182), [[0x40, 0x02]], "as it was at SYNC");
}

#[test]
fn received_pdos() {
    let mut bench = Bench::new([lexium(2)]);
    bench.write(2, 0x1400, 1, &0x202_u32.to_le_bytes());
    bench.say(0x202, &[6, 0]);
    bench.run(1);
    assert_eq!(bench.drive(2).state(), Drive::SwitchOnDisabled, "not operational");
    bench.nmt(Command::Start, 2);
    bench.say(0x202, &[6, 0]);
    bench.run(1);
    assert_eq!(bench.drive(2).state(), Drive::ReadyToSwitchOn);
    bench.say(0x202, &[7]);
    bench.run(1);
    assert_eq!(bench.drive(2).state(), Drive::ReadyToSwitchOn, "too short");
    assert_eq!(bench.take(0x082)[0][..3], [0x10, 0x82, 0]);
    bench.say(0x202, &[7, 0, 9]);
    bench.run(1);
    assert_eq!(bench.drive(2).state(), Drive::SwitchedOn, "too long, and taken");
    assert_eq!(bench.take(0x082)[0][..3], [0x20, 0x82, 0]);
    // At SYNC.
    bench.write(2, 0x1400, 2, &[1]);
    bench.say(0x202, &[6, 0]);
    bench.run(10);
    assert_eq!(bench.drive(2).state(), Drive::SwitchedOn);
    bench.say(0x080, &[]);
    bench.run(1);
    assert_eq!(bench.drive(2).state(), Drive::ReadyToSwitchOn);
}

#[test]
fn guarding_alternates_and_the_life_time_ends() {
    let mut bench = Bench::new([lexium(2)]);
    bench.write(2, 0x100C, 0, &[100, 0]);
    bench.write(2, 0x100D, 0, &[3]);
    bench.run(1_000);
    assert_eq!(bench.take(0x082).len(), 0, "nobody has guarded yet");
    bench.take(0x702);
    let guard = Sign::request(NodeId::new(2).unwrap());
    for _ in 0..3 {
        bench.send(guard);
        bench.run(100);
    }
    assert_eq!(bench.take(0x702), [[0x7F], [0xFF], [0x7F]]);
    bench.enable(2, 3);
    bench.nmt(Command::Start, 2);
    bench.send(guard);
    bench.run(299);
    assert_eq!(bench.drive(2).state(), Drive::OperationEnabled);
    bench.run(5);
    // 6007h: a fault; 1029h: pre-operational.
    assert_eq!(bench.take(0x082)[0][..3], [0x30, 0x81, 0x11]);
    assert_eq!(bench.drive(2).state(), Drive::Fault);
    assert_eq!(bench.cell.node(2).unwrap().state(), State::PreOperational);

    bench.cell.suffer(bench.now, 2, Fault::WrongToggle);
    bench.nmt(Command::ResetCommunication, 2);
    bench.take(0x702);
    for _ in 0..3 {
        bench.send(guard);
        bench.run(10);
    }
    assert_eq!(bench.take(0x702), [[0x7F], [0x7F], [0x7F]]);
}

#[test]
fn a_heartbeat_that_is_watched() {
    let mut bench = Bench::new([lexium(2)]);
    // Node 127, 300 ms.
    bench.write(2, 0x1016, 1, &0x007F_012C_u32.to_le_bytes());
    bench.write(2, 0x6007, 0, &[3, 0]);
    bench.enable(2, 3);
    bench.run(1_000);
    assert_eq!(bench.take(0x082).len(), 0, "it has not been heard yet");
    for _ in 0..5 {
        bench.say(0x77F, &[5]);
        bench.run(250);
    }
    assert_eq!(bench.drive(2).state(), Drive::OperationEnabled);
    bench.run(60);
    assert_eq!(bench.take(0x082)[0][..2], [0x30, 0x81]);
    assert_eq!(bench.drive(2).state(), Drive::SwitchOnDisabled, "after a quick stop");
}

#[test]
fn emergencies_keep_their_inhibit_time() {
    let mut bench = Bench::new([lexium(2)]);
    bench.write(2, 0x1015, 0, &[100, 0]);
    bench.cell.suffer(bench.now, 2, Fault::Emergencies(6));
    let began = bench.now;
    bench.run(100);
    let at: Vec<_> = bench
        .heard
        .iter()
        .filter(|(_, frame)| frame.id() == Id::base(0x082))
        .map(|(at, _)| at.since(began).as_millis())
        .collect();
    assert_eq!(at, [0, 10, 20, 30, 40, 50]);
    assert_eq!(bench.read(2, 0x1003, 0), Ok(vec![4]), "its history has no more");
    assert_eq!(bench.read(2, 0x1003, 1).unwrap()[2], 5, "the last first");
}

/// Runs an LSS command to its end.
fn lss(bench: &mut Bench, command: lss::Command) -> Result<lss::Outcome, lss::Failure> {
    let mut master = lss::Master::new(Duration::from_millis(20));
    master.submit(command).unwrap();
    loop {
        match master.poll(bench.now) {
            lss::Action::Transmit(frame) => bench.send(frame),
            lss::Action::Done(end) => return end,
            lss::Action::Idle => {
                bench.now = [master.poll_at(), bench.cell.poll_at()]
                    .into_iter()
                    .flatten()
                    .min()
                    .expect("due")
                    .max(bench.now);
                while let Some(heard) = bench.cell.hear(bench.now, 0) {
                    master.receive(bench.now, &heard.frame);
                    bench.heard.push((heard.at, heard.frame));
                }
            }
        }
    }
}

#[test]
fn nodes_without_a_node_id_get_one() {
    let serials = [9_001, 77];
    let fresh = serials.map(|serial| DriveConfig::unconfigured(Model::Lexium23a, serial));
    let mut bench = Bench::new(fresh.into_iter().chain([node(5)]));
    bench.run(100);
    assert_eq!(bench.heard.len(), 1, "only node 5 boots");
    for id in [10, 11] {
        let found = lss(&mut bench, lss::Command::Fastscan(Known::default()));
        assert!(matches!(found, Ok(lss::Outcome::Identity(_))), "{found:?}");
        assert!(lss(&mut bench, lss::Command::ConfigureNodeId(id)).is_ok());
        assert!(lss(&mut bench, lss::Command::Store).is_ok());
        assert!(lss(&mut bench, lss::Command::SwitchGlobal(lss::Mode::Waiting)).is_ok());
        bench.run(5);
        assert_eq!(bench.take(0x700 + u16::from(id)), [[0]]);
        assert_eq!(bench.read(id, 0x1200, 1).unwrap(), (0x600 + u32::from(id)).to_le_bytes());
    }
    let mut given: Vec<_> = [10, 11].map(|id| bench.read(id, 0x1018, 4).unwrap()).into();
    given.sort();
    assert_eq!(given, [9_001_u32.to_le_bytes().to_vec(), 77_u32.to_le_bytes().to_vec()]);
    let none = lss(&mut bench, lss::Command::Fastscan(Known::default()));
    assert!(none.is_err(), "{none:?}");
    // Stored.
    bench.cell.suffer(bench.now, 10, Fault::Reset);
    bench.run(5);
    assert_eq!(bench.take(0x70A), [[0]]);
}

#[test]
fn nodes_go_wrong() {
    let mut bench = Bench::new([lexium(2), lexium(3)]);
    bench.write(2, 0x1017, 0, &[10, 0]);
    bench.write(3, 0x1017, 0, &[10, 0]);
    let beats = |bench: &mut Bench| {
        bench.take(0x702);
        bench.take(0x703);
        bench.run(100);
        (bench.take(0x702).len(), bench.take(0x703).len())
    };
    assert_eq!(beats(&mut bench), (10, 10));
    let suffer = |bench: &mut Bench, fault| assert!(bench.cell.suffer(bench.now, 2, fault));
    suffer(&mut bench, Fault::Mute(true));
    assert_eq!(beats(&mut bench).0, 0);
    suffer(&mut bench, Fault::Mute(false));
    assert_eq!(beats(&mut bench).0, 10);
    suffer(&mut bench, Fault::Die);
    assert_eq!(beats(&mut bench), (0, 10));
    suffer(&mut bench, Fault::Reset);
    bench.run(5);
    assert_eq!(bench.take(0x702), [[0]], "it boots, and has forgotten its heartbeat");
    bench.write(2, 0x1017, 0, &[10, 0]);
    suffer(&mut bench, Fault::BusOff);
    assert!((9..=10).contains(&beats(&mut bench).0), "off for 1.4 ms");
    suffer(&mut bench, Fault::Identity(0xBAD));
    assert_eq!(bench.read(2, 0x1018, 2).unwrap(), 0xBAD_u32.to_le_bytes());
    suffer(&mut bench, Fault::Slow(Duration::from_millis(30)));
    let began = bench.now;
    bench.read(2, 0x1000, 0).unwrap();
    assert!(bench.now.since(began) >= Duration::from_millis(30));
    suffer(&mut bench, Fault::SdoDead(true));
    let dead = bench.transfer(2, Transfer::Upload { address: Address::new(0x1000, 0), block: false }, &[]);
    assert!(matches!(dead.0, Err(puente_canopen::sdo::Failure::Timeout { .. })));
    assert_eq!(beats(&mut bench).1, 10);
    suffer(&mut bench, Fault::SdoDead(false));
    bench.read(2, 0x1000, 0).unwrap();
    suffer(&mut bench, Fault::SdoDies(2));
    bench.read(2, 0x1000, 0).unwrap();
    bench.read(2, 0x1000, 0).unwrap();
    let dead = bench.transfer(2, Transfer::Upload { address: Address::new(0x1000, 0), block: false }, &[]);
    assert!(matches!(dead.0, Err(puente_canopen::sdo::Failure::Timeout { .. })));
    // Lower than all heartbeats: nobody gets through meanwhile.
    let noise = Frame::new(Id::base(0x001), &[]).unwrap();
    bench.take(0x703);
    suffer(&mut bench, Fault::Babble(noise, Duration::from_millis(50)));
    bench.run(49);
    assert_eq!(bench.take(0x703).len(), 0);
    bench.run(50);
    assert!(bench.take(0x703).len() > 5, "what has waited, and what is due");
    assert!(!bench.cell.suffer(Instant::ZERO, 9, Fault::Die), "there is no node 9");
}

#[test]
fn a_node_with_other_switches_and_a_short_circuit() {
    let mut bench = Bench::new([lexium(2), node(3)]);
    bench.run(10);
    bench.take(0x702);
    let id = NodeId::new(2).expect("a node-ID");
    assert!(bench.cell.suffer(bench.now, 3, Fault::Id(id)));
    bench.run(5);
    assert_eq!(bench.take(0x702), [[0]]);
    assert_eq!(bench.cell.nodes().iter().filter(|node| node.id() == Some(id)).count(), 2);
    assert!(!bench.cell.suffer(bench.now, 3, Fault::Die), "there is no node 3 any more");
    assert!(bench.cell.suffer(bench.now, 0, Fault::Short(true)));
    bench.say(0x080, &[]);
    bench.run(10);
    let offs = bench.cell.counters(0).bus_offs();
    assert!(offs > 0);
    assert!(bench.cell.suffer(bench.now, 0, Fault::Short(false)));
    bench.run(10);
    assert_eq!((bench.cell.pending(0), bench.cell.counters(0).bus_offs()), (0, offs), "it came through");
}

/// Two nodes of the same number: what both say alike is heard once, what differs destroys both until they are off the bus.
#[test]
fn two_nodes_of_one_number() {
    let mut bench = Bench::new([lexium(2), lexium(2)]);
    assert_eq!(bench.take(0x702).len(), 1, "the same boot-up at the same time");
    let serial = Address::new(0x1018, 4);
    let read = bench.transfer(2, Transfer::Upload { address: serial, block: false }, &[]);
    assert!(read.0.is_ok(), "they have the same serial number here");
    let mut bench = Bench::new([lexium(2), DriveConfig { serial: 7, ..lexium(2) }]);
    bench.say(0x602, &[0x40, 0x18, 0x10, 4, 0, 0, 0, 0]);
    bench.run(100);
    assert!(bench.cell.totals().errors >= 32);
    let heard = bench.take(0x582);
    assert_ne!(heard.len(), 1, "none, or both after each other");
}

/// The load of a cycle is what its frames have in bits, no more.
#[test]
fn the_measured_load_is_the_computed_one() {
    let drives: Vec<_> = (2..5).map(lexium).collect();
    let mut bench = Bench::new(drives);
    for id in 2..5_u8 {
        bench.write(id, 0x1800, 1, &(0xC000_0180 + u32::from(id)).to_le_bytes());
        bench.write(id, 0x1800, 2, &[1]);
        bench.write(id, 0x1800, 1, &(0x4000_0180 + u32::from(id)).to_le_bytes());
        bench.write(id, 0x1400, 1, &(0x200 + u32::from(id)).to_le_bytes());
        bench.write(id, 0x1400, 2, &[1]);
    }
    bench.nmt(Command::Start, 0);
    bench.run(1);
    let before = bench.cell.totals();
    let sync = Frame::new(Id::base(0x080), &[]).unwrap();
    for _ in 0..1_000 {
        bench.send(sync);
        for id in 2..5 {
            bench.say(0x200 + id, &[0, 0]);
        }
        bench.run(1);
    }
    let after = bench.cell.totals();
    let frame = |id, data: &[u8]| Frame::new(Id::base(id), data).unwrap().bits();
    let cycle: u32 = sync.bits()
        + (2..5).map(|id| frame(0x200 + id, &[0, 0]) + frame(0x180 + id, &[0x40, 0x02])).sum::<u32>();
    assert_eq!(after.bits - before.bits, 1_000 * u64::from(cycle));
    assert_eq!(after.frames - before.frames, 7_000);
}

/// The same calls and the same seed: the same frames at the same moments, whatever goes wrong.
#[test]
fn everything_is_repeatable() {
    let run = |seed| {
        let drives = vec![lexium(2), DriveConfig::new(3, Model::FestoCmms).unwrap()];
        let mut bench = Bench::with(Config { drives, errors: 0.1, seed, ..Config::new(500_000) });
        bench.write(2, 0x1801, 1, &0x4000_0282_u32.to_le_bytes());
        bench.write(3, 0x1017, 0, &[7, 0]);
        bench.nmt(Command::Start, 0);
        bench.enable(2, 6);
        bench.control(2, 0x1F);
        bench.run(3_000);
        bench.cell.suffer(bench.now, 2, Fault::Drive(DriveFault::OverCurrent));
        bench.run(500);
        bench.heard
    };
    let (one, other) = (run(1), run(2));
    assert!(one.len() > 400);
    assert_eq!(one, run(1));
    assert_ne!(one, other);
}

/// Any frame; often an SDO, a PDO or a word of the master to one of the nodes.
fn any_frame() -> impl Strategy<Value = Frame> {
    let write =
        (prop::sample::select(vec![0x2F_u8, 0x2B, 0x23, 0x40, 0x21, 0xC6, 0xA4, 0xA3]), any::<[u8; 4]>());
    let index = prop::sample::select(vec![
        0x1005_u16, 0x100C, 0x100D, 0x1010, 0x1014, 0x1015, 0x1016, 0x1017, 0x1019, 0x1029, 0x1400, 0x1600,
        0x1800, 0x1A00, 0x2000, 0x6007, 0x6040, 0x605A, 0x6060, 0x607A, 0x607D, 0x6081, 0x6083, 0x6085,
        0x6098, 0x6099, 0x60C1, 0x60C2, 0x60FF,
    ]);
    let sdo = (2..6_u16, write, index, 0..4_u8).prop_map(|(node, (command, [a, b, c, d]), index, sub)| {
        let [low, high] = index.to_le_bytes();
        Frame::full(Id::base(0x600 + node), [command, low, high, sub, a, b, c, d])
    });
    let control =
        (2..6_u16, prop::sample::select(vec![0, 2, 6, 7, 0x0F, 0x1F, 0x3F, 0x5F, 0x80, 0x10F]), -1..11_i8)
            .prop_map(|(node, word, mode): (u16, u16, i8)| {
                let [low, high] = word.to_le_bytes();
                Frame::new(Id::base(0x300 + node), &[low, high, mode as u8]).unwrap()
            });
    let id = prop_oneof![Just(0_u16), Just(0x080), Just(0x7E5), 0x180..0x700_u16];
    let others =
        (id, prop::collection::vec(any::<u8>(), 0..=8), any::<bool>()).prop_map(|(id, data, remote)| {
            if remote { Frame::remote(Id::base(id), 1) } else { Frame::new(Id::base(id), &data).unwrap() }
        });
    prop_oneof![3 => sdo, 3 => control, 2 => others]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Whatever they are told, nodes neither panic nor spin, and the drive is where it can be.
    #[test]
    fn told_anything(frames in prop::collection::vec((any_frame(), 0..40_u64), 1..80)) {
        let models = [Model::Lexium23a, Model::FestoCmms, Model::Generic, Model::Node];
        let nodes = (2..).zip(models).map(|(id, model)| DriveConfig::new(id, model).unwrap());
        let mut bench = Bench::new(nodes);
        bench.nmt(Command::Start, 0);
        for (id, cob_id) in [(2, 0x302_u32), (3, 0x303)] {
            bench.write(id, 0x1401, 1, &cob_id.to_le_bytes());
        }
        for (frame, pause) in frames {
            bench.send(frame);
            bench.run(pause);
            let standing = bench.cell.nodes().iter().filter_map(|node| node.drive());
            for drive in standing {
                prop_assert!(drive.machine_position().abs() <= 6_720_000.0 && drive.velocity().is_finite());
            }
        }
    }
}
