//! Whatever the bus says, the manager neither panics nor spins, sends nothing while the bus is off, and ends each transfer once.
#![no_main]

use std::collections::BTreeSet;

use puente_canopen::boot::{Plan, Signs};
use puente_canopen::dcf::List;
use puente_canopen::manager::{Action, Config, Event, Manager, Member, Sdo};
use puente_canopen::monitor::Supervision;
use puente_canopen::nmt::Command;
use puente_canopen::sdo::Transfer;
use puente_canopen::{Address, Frame, Id, NodeId, cob, lss};
use puente_fuzz::Operands;
use puente_line::{Duration, Instant};

fn node(id: u8) -> NodeId {
    NodeId::new(id).expect("a node-ID")
}

fn members() -> [Member<'static>; 3] {
    const LIST: &[u8] = &[1, 0, 0, 0, 0, 0x14, 1, 9, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9];
    let configuration = List::parse(LIST).expect("a list");
    let plan = Plan { configuration, device_type: Some(0), starts: true, ..Plan::NOTHING };
    let heartbeat = Supervision::Heartbeat { timeout: Duration::from_millis(100) };
    let guarding = Supervision::Guarding { time: Duration::from_millis(30), factor: 2 };
    [
        Member { plan, supervision: heartbeat, ..Member::new(node(1)) },
        Member { supervision: guarding, optional: true, ..Member::new(node(2)) },
        Member { plan: Plan { signs: Signs::Heartbeat(100), ..plan }, reset: true, ..Member::new(node(3)) },
    ]
}

struct Run {
    manager: Manager<'static, 3, 2>,
    now: Instant,
    /// Nodes with a transfer of the caller.
    open: BTreeSet<u8>,
    lss: bool,
    up: bool,
    /// What each node was asked for last.
    asked: [[u8; 3]; 4],
}

impl Run {
    fn event(&mut self, operands: &mut Operands<'_>) {
        let (kind, of) = (operands.byte(), 1 + (operands.byte() & 3));
        let now = self.now;
        match kind % 12 {
            0 => {
                let number = u16::from_le_bytes([operands.byte(), operands.byte()]);
                let frame = match kind & 0x10 {
                    0 => Frame::new(Id::base(number), operands.bytes(usize::from(kind >> 5))),
                    _ => Some(Frame::remote(Id::base(number), kind >> 5)),
                };
                self.manager.receive(now, &frame.expect("8 bytes at most"));
            }
            1 => {
                let frame = Frame::new(Id::Base(node(of).error_control()), &[operands.byte()]);
                self.manager.receive(now, &frame.expect("a byte"));
            }
            2 | 3 => {
                let mut bytes = [0; 8];
                bytes[1..4].copy_from_slice(&self.asked[usize::from(of) - 1]);
                let said = operands.bytes(if kind & 0x10 == 0 { 1 } else { 8 });
                bytes[..said.len()].copy_from_slice(said);
                self.manager.receive(now, &Frame::full(Id::Base(node(of).sdo_response()), bytes));
            }
            4 => self.now += operands.pause(),
            5 => {
                if let Some(at) = self.manager.poll_at() {
                    self.now = self.now.max(at);
                }
            }
            6 => {
                let (address, block) = (Address::new(0x2000, of), kind & 0x10 != 0);
                let transfer = match kind & 0x20 {
                    0 => Transfer::Upload { address, block },
                    _ => Transfer::Download { address, size: u32::from(operands.byte()), block },
                };
                if self.manager.submit(now, node(of), transfer).is_ok() {
                    assert!(self.open.insert(of), "two transfers with one node");
                }
            }
            7 => self.manager.cancel(now, node(of)),
            8 => self.manager.pause(node(of), kind & 0x10 != 0),
            9 => {
                let command = Command::from_code(operands.byte()).unwrap_or(Command::Start);
                let to = NodeId::new(of & 3);
                assert!(self.manager.command(now, command, to).is_ok() <= self.up);
            }
            10 => {
                let command = lss::Command::Fastscan(lss::Known::default());
                assert_eq!(self.manager.lss(now, command, None).is_err(), self.lss);
                self.lss = true;
            }
            _ => {
                self.up = kind & 0x10 != 0;
                self.manager.bus(now, self.up);
            }
        }
    }

    /// Polls until there is nothing to do; with a full port, only what is told.
    fn settle(&mut self, full: bool) {
        for polls in 0.. {
            assert!(polls < 2_000, "it spins");
            let action = match full {
                true => self.manager.report(self.now).unwrap_or(Action::Idle),
                false => self.manager.poll(self.now),
            };
            match action {
                Action::Idle => break,
                Action::Transmit(frame) => self.sent(&frame, full),
                Action::Sdo(of, Sdo::Fetch { offset, count }) => {
                    assert!(self.open.contains(&of.value()) && offset + count as u32 <= 255);
                    self.manager.supply(self.now, of, &[7; 7][..count]);
                }
                Action::Sdo(of, Sdo::Data(_)) => assert!(self.open.contains(&of.value())),
                Action::Sdo(of, Sdo::Done(_)) => assert!(self.open.remove(&of.value())),
                Action::Node(of, Event::Booted | Event::NotBooted(_) | Event::Missing) => {
                    assert!((1..=3).contains(&of.value()));
                }
                Action::Lss(_) => assert!(std::mem::take(&mut self.lss)),
                Action::Node(..) | Action::Bus(_) => {}
            }
        }
        assert!(full || self.manager.poll_at().is_none_or(|at| at > self.now), "polling would spin");
    }

    fn sent(&mut self, frame: &Frame, full: bool) {
        assert!(self.up && !full);
        if let Some(cob::Function::SdoRequest(of)) = cob::Function::of(frame.id())
            && let Some(asked) = self.asked.get_mut(usize::from(of.value()) - 1)
            && let Some(address) = frame.data().get(1..4)
        {
            asked.copy_from_slice(address);
        }
    }
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let mut operands = Operands(data);
    let now = Instant::from_millis(1_000);
    let sync = Duration::from_millis(10 * u64::from(operands.byte() & 3));
    let config = Config { sync, babble: 20, ..Config::new(node(127)) };
    let mut manager = Manager::new(config, members(), now);
    manager.start(now);
    let mut run = Run { manager, now, open: BTreeSet::new(), lss: false, up: true, asked: [[0, 0x10, 0]; 4] };
    while !operands.0.is_empty() {
        run.event(&mut operands);
        let full = operands.byte() & 7 == 7;
        run.settle(full);
    }
    run.manager.bus(run.now, true);
    run.up = true;
    (1..=4).for_each(|of| run.manager.pause(node(of), false));
    let end = run.now + Duration::from_secs(20);
    run.settle(false);
    while let Some(at) = run.manager.poll_at().filter(|at| *at < end) {
        run.now = run.now.max(at);
        run.settle(false);
    }
    assert!(run.open.is_empty() && !run.lss, "left alone, all ends");
});
