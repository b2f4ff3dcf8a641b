//! A master and simulated drives on a CAN bus of 1 Mbit/s.

use std::time::Duration;

use puente_canopen::NodeId;
use puente_canopen::boot::{Plan, Signs};
use puente_canopen::cob::Function;
use puente_canopen::dcf::List;
use puente_canopen::lss::Known;
use puente_canopen::manager::{Config, Member};
use puente_canopen::monitor::Supervision;
use puente_cell::can::{self, Cell, DriveConfig, Model};
use puente_line::Instant;
use puente_servos::{Action, Axis, Master, Node, Order, Progress, Report, Why, setup};

pub struct Rig {
    pub cell: Cell,
    pub master: Box<Master<'static, 4, 4, 4>>,
    pub now: Instant,
    pub reports: Vec<Option<(Report, bool)>>,
    pub fell: Vec<(usize, Why)>,
    /// Set-points of interpolated position that the master has sent.
    set_points: Vec<i32>,
}

impl Rig {
    pub fn new(axes: &[Axis], model: Model, sync: Duration) -> Self {
        let mut config = can::Config::new(1_000_000);
        for axis in axes {
            config = config.with(DriveConfig::new(axis.node.value(), model).expect("a node-ID"));
        }
        let cell = Cell::new(config);
        let members = axes.iter().map(|axis| {
            let mut list: heapless::Vec<u8, { setup::MOST }> = heapless::Vec::new();
            setup::push(&mut list, axis, sync).expect("room");
            let configuration = List::parse(list.to_vec().leak()).expect("a list");
            let mut wishes: heapless::Vec<u8, { setup::MOST_WATCH }> = heapless::Vec::new();
            setup::push_watch(&mut wishes, NodeId::MAX, 125).expect("room");
            let wishes = List::parse(wishes.to_vec().leak()).expect("a list");
            let product = cell.node(axis.node.value()).map(|node| node.identity().product);
            let plan = Plan {
                configuration,
                wishes,
                identity: Known { product, ..Known::default() },
                signs: Signs::Heartbeat(50),
                starts: true,
                ..Plan::NOTHING
            };
            let supervision = Supervision::Heartbeat { timeout: Duration::from_millis(150) };
            Member { plan, supervision, ..Member::new(axis.node) }
        });
        let members: Vec<_> = members.collect();
        let now = Instant::from_millis(1);
        let config = Config { sync, heartbeat: Duration::from_millis(50), ..Config::new(NodeId::MAX) };
        let mut master = Box::new(Master::new(config, members, axes.iter().copied(), now));
        master.start(now);
        let mut rig = Self {
            cell,
            master,
            now,
            reports: vec![None; axes.len()],
            fell: Vec::new(),
            set_points: Vec::new(),
        };
        for place in 0..axes.len() {
            rig.wait(|rig| rig.reports[place].is_some_and(|(report, _)| report.node == Node::Present));
        }
        rig
    }

    pub fn set(&mut self, place: usize, order: Order) {
        self.master.set(self.now, place, order);
    }

    pub fn report(&self, place: usize) -> Report {
        self.reports[place].expect("a report").0
    }

    pub fn run_ms(&mut self, time: u64) {
        let end = self.now + Duration::from_millis(time);
        while self.now < end {
            self.poll();
            let next = [self.master.poll_at(), self.cell.poll_at()].into_iter().flatten().min();
            self.now = next.unwrap_or(end).max(self.now).min(end);
            while let Some(heard) = self.cell.hear(self.now, 0) {
                self.master.receive(self.now, &heard.frame);
            }
        }
        self.poll();
    }

    /// The master is gone, or its cable.
    pub fn alone_ms(&mut self, time: u64) {
        let end = self.now + Duration::from_millis(time);
        while self.now < end {
            self.now = self.cell.poll_at().unwrap_or(end).max(self.now).min(end);
            while self.cell.hear(self.now, 0).is_some() {}
        }
    }

    fn poll(&mut self) {
        loop {
            match self.master.poll(self.now) {
                Action::Idle => return,
                Action::Transmit(frame) => {
                    if let (Some(Function::Rpdo(4, _)), Some(data)) =
                        (Function::of(frame.id()), frame.data().first_chunk())
                    {
                        self.set_points.push(i32::from_le_bytes(*data));
                    }
                    self.cell.send(self.now, 0, &frame);
                }
                Action::Reported { place, report, current } => self.reports[place] = Some((report, current)),
                Action::Fell { place, why } => self.fell.push((place, why)),
                Action::Manager(_) => {}
            }
        }
    }

    pub fn wait(&mut self, done: impl Fn(&Self) -> bool) {
        for _ in 0..30_000 {
            if done(self) {
                return;
            }
            self.run_ms(1);
        }
        panic!("it does not come: {:?}, {:?}", self.reports, self.fell);
    }

    /// Until a drive is where it is to be.
    pub fn reach(&mut self, place: usize, order: Order) {
        self.set(place, order);
        self.run_ms(1);
        self.wait(|rig| {
            assert_eq!(rig.master.order(place), order, "{:?}", rig.fell);
            let (report, current) = rig.reports[place].expect("a report");
            assert!(!matches!(report.progress, Progress::Failed(_)), "{order:?}: {report:?}");
            current && report.progress == Progress::Reached
        });
    }

    /// From now on its set-points are looked at.
    pub fn watch(&mut self) {
        self.set_points.clear();
    }

    pub fn watched(&self) -> Vec<i32> {
        self.set_points.clone()
    }

    /// Position units in a cycle.
    pub fn fastest(&self, set_points: &[i32]) -> u32 {
        set_points.windows(2).map(|pair| pair[1].abs_diff(pair[0])).max().unwrap_or(0)
    }

    /// Position units in a cycle more than in the one before, or less.
    pub fn hardest(&self, set_points: &[i32]) -> u32 {
        set_points.windows(3).map(|next| (next[2] - next[1]).abs_diff(next[1] - next[0])).max().unwrap_or(0)
    }

    pub fn position(&self, node: u8) -> f64 {
        self.cell.node(node).and_then(|node| node.drive()).expect("a drive").position()
    }

    pub fn velocity(&self, node: u8) -> f64 {
        self.cell.node(node).and_then(|node| node.drive()).expect("a drive").velocity()
    }
}
