//! A master and devices, with a bus between them on which each frame takes 100 us.

use std::time::Duration;

use puente_canopen::boot::{Plan, Signs};
use puente_canopen::dcf::List;
use puente_canopen::manager::{self, Config, Member};
use puente_canopen::monitor::Supervision;
use puente_canopen::{Frame, Id, NodeId};
use puente_drives::cia402::{Mode, Profile};
use puente_line::Instant;
use puente_servos::{Action, Axis, Master, Node, Order, Progress, Report, Why, setup};

use crate::device::Device;

const TICK: Duration = Duration::from_micros(100);

pub struct Rig {
    pub master: Master<'static, 4, 4, 4>,
    pub devices: Vec<Device>,
    pub now: Instant,
    /// What the master sent, and when.
    pub sent: Vec<(Instant, Frame)>,
    pub reports: Vec<Option<(Report, bool)>>,
    pub fell: Vec<(usize, Why)>,
    pub manager: Vec<manager::Action>,
    /// Frames are not heard.
    pub cut: bool,
    /// They are on the bus.
    under_way: Vec<Frame>,
}

pub fn axis(id: u8, profile: &'static Profile) -> Axis {
    Axis::new(NodeId::new(id).expect("a node-ID"), profile)
}

pub fn cyclic(id: u8, mode: Mode) -> Axis {
    Axis { cyclic: Some(mode), ..axis(id, &Profile::GENERIC) }
}

impl Rig {
    pub fn new(axes: &[Axis], sync: Duration) -> Self {
        let devices = axes.iter().map(|axis| Device::new(axis.node.value())).collect();
        Self::with(axes, sync, devices, |plan| plan)
    }

    pub fn with(
        axes: &[Axis],
        sync: Duration,
        devices: Vec<Device>,
        mut change: impl FnMut(Plan<'static>) -> Plan<'static>,
    ) -> Self {
        let members = axes.iter().map(|axis| {
            let mut list: heapless::Vec<u8, { setup::MOST }> = heapless::Vec::new();
            setup::push(&mut list, axis, sync).expect("room");
            let list: &'static [u8] = Box::leak(list.to_vec().into_boxed_slice());
            let configuration = List::parse(list).expect("a list");
            let plan = Plan { configuration, signs: Signs::Heartbeat(50), starts: true, ..Plan::NOTHING };
            let supervision = Supervision::Heartbeat { timeout: Duration::from_millis(150) };
            Member { plan: change(plan), supervision, ..Member::new(axis.node) }
        });
        let members: Vec<_> = members.collect();
        let now = Instant::from_millis(1);
        let config = Config { sync, ..Config::new(NodeId::MAX) };
        let mut master = Master::new(config, members, axes.iter().copied(), now);
        master.start(now);
        let reports = vec![None; axes.len()];
        Self {
            master,
            devices,
            now,
            sent: vec![],
            reports,
            fell: vec![],
            manager: vec![],
            cut: false,
            under_way: vec![],
        }
    }

    pub fn set(&mut self, place: usize, order: Order) {
        self.master.set(self.now, place, order);
    }

    pub fn report(&self, place: usize) -> Report {
        self.reports[place].expect("a report").0
    }

    pub fn progress(&self, place: usize) -> Progress {
        self.report(place).progress
    }

    /// Polls until there is nothing to do.
    pub fn poll(&mut self) {
        for round in 0.. {
            assert!(round < 1_000, "it never rests");
            match self.master.poll(self.now) {
                Action::Idle => {
                    assert!(
                        self.master.poll_at().is_none_or(|at| at > self.now),
                        "it wants to be polled at once"
                    );
                    break;
                }
                Action::Transmit(frame) => {
                    self.sent.push((self.now, frame));
                    self.under_way.push(frame);
                }
                Action::Reported { place, report, current } => self.reports[place] = Some((report, current)),
                Action::Fell { place, why } => self.fell.push((place, why)),
                Action::Manager(action) => self.manager.push(action),
            }
        }
    }

    /// Lets time pass.
    pub fn run(&mut self, time: Duration) {
        let end = self.now + time;
        while self.now < end {
            self.now += TICK;
            for frame in std::mem::take(&mut self.under_way) {
                self.devices.iter_mut().filter(|_| !self.cut).for_each(|device| device.hear(&frame));
            }
            if self.now.as_micros().is_multiple_of(1_000) {
                self.devices.iter_mut().for_each(|device| device.tick(self.now));
            }
            for device in &mut self.devices {
                for frame in device.out.drain(..) {
                    if !self.cut {
                        self.master.receive(self.now, &frame);
                    }
                }
            }
            self.poll();
        }
    }

    pub fn run_ms(&mut self, time: u64) {
        self.run(Duration::from_millis(time));
    }

    /// Until a drive is where it is to be.
    pub fn reach(&mut self, place: usize, order: Order) {
        self.set(place, order);
        for _ in 0..5_000 {
            self.run_ms(1);
            if self.reports[place]
                .is_some_and(|(report, current)| current && report.progress == Progress::Reached)
            {
                return;
            }
        }
        panic!("{order:?} is not reached: {:?}", self.report(place));
    }

    /// Until all drives are there.
    pub fn boot(mut self) -> Self {
        for _ in 0..2_000 {
            self.run_ms(1);
            if self
                .reports
                .iter()
                .all(|report| report.is_some_and(|(report, _)| report.node == Node::Present))
            {
                self.sent.clear();
                return self;
            }
        }
        panic!("they do not boot: {:?} {:?}", self.reports, self.manager);
    }

    /// The data of what was sent with a COB-ID.
    pub fn told(&self, id: u16) -> Vec<Vec<u8>> {
        let frames = self.sent.iter().filter(|(_, frame)| frame.id() == Id::base(id));
        frames.map(|(_, frame)| frame.data().to_vec()).collect()
    }
}
