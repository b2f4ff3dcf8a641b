//! One drive: what is wanted of it, what it is told, and what it says.
//!
//! Whatever happens sets it to be looked at; then [`Drive::decide`] says anew what the drive shall be told, and what has to be
//! read or written, from what is wanted and what is known.

mod checks;
mod input;
mod job;
mod motion;
mod output;
mod power;
mod travel;

use core::time::Duration;

use heapless::Vec;
use puente_canopen::{Frame, boot, nmt};
use puente_drives::cia402::homing;
use puente_drives::cia402::object::{HOMING_METHOD, MODE};
use puente_drives::cia402::position::Handshake;
use puente_drives::cia402::{Command, Controlword, Goal, Machine, Mode, State};
use puente_line::Instant;

use crate::{Axis, Failure, Node, Order, Progress, Report, Why};
use input::Input;
pub(crate) use job::Job;
use output::Output;
use travel::{LIMITS_READ, Travel};

/// A word that brings nothing about is told again after this.
const REPEAT: Duration = Duration::from_millis(200);
/// A drive that does not go on is said to be stuck after this: brakes and contactors take their time.
const STUCK: Duration = Duration::from_secs(5);
/// A quick stop whose end is not told is taken for over after this.
const QUICK_STOP: Duration = Duration::from_secs(2);
/// The statusword is read when it has not come for so long, though something should have happened.
const SILENCE: Duration = Duration::from_millis(500);
/// The same for the word that answers another controlword.
const ANSWER: Duration = Duration::from_millis(50);
/// A mode that is told is shown within this.
const MODE_TIME: Duration = Duration::from_secs(1);
/// What tells that a drive stands may be old for so long.
const SETTLE: Duration = Duration::from_millis(20);
/// In cyclic modes a drive need not tell that it stands; after this it does.
const CYCLIC_STAND: Duration = Duration::from_millis(500);
/// A halt has stopped a drive within this.
const STAND: Duration = Duration::from_secs(5);
/// A drive may take so long to forget that it had found home.
const HOMING_GRACE: Duration = Duration::from_millis(500);

/// A drive.
#[derive(Clone, Debug)]
pub(crate) struct Drive {
    axis: Axis,
    /// The period of SYNC; zero: there is none.
    sync: Duration,
    node: Node,
    nmt: Option<nmt::State>,
    order: Order,
    /// What was wanted was taken back: current is not wanted before something else has been.
    void: bool,
    fell: Option<Why>,
    progress: Progress,
    trouble: Option<Failure>,
    input: Input,
    output: Output,
    machine: Machine,
    handshake: Handshake,
    homing: homing::Homing,
    job: Option<Job>,
    /// The job is in work.
    working: bool,
    /// It is being examined: this is the next step.
    examined: bool,
    check: usize,
    period_value: u8,
    /// What was not answered is not asked for again before.
    patient_until: Instant,
    /// In this mode its set-points are where it stands.
    preset: Option<Mode>,
    /// Set-points have been preset since it was told to be without current: it may be told to be under it.
    armed: bool,
    /// Where it stands, read for a preset.
    stands_at: Option<i64>,
    /// It has been under current since it was told to be.
    engaged: bool,
    /// Something moves, or may move, by what it was told.
    begun: bool,
    /// It is halted (bit 8).
    halted: bool,
    /// What moves by a serial number has been begun.
    taken: bool,
    /// Where it was to go last, and has not been kept from.
    target: Option<i32>,
    /// The set-point of the cyclic mode.
    set_point: i32,
    /// The move whose set-points are made here.
    travel: Option<Travel>,
    /// How fast it may be, as far as that has been read for what is wanted.
    limits: Vec<u32, LIMITS_READ>,
    /// SYNC cycles that the set-point has been told in since it was preset.
    streamed: u8,
    homed: bool,
    fault: Option<u16>,
    fault_read: bool,
    emergency: Option<u16>,
    /// What is waited for began then.
    since: Instant,
    mode_since: Option<Instant>,
    halt_since: Option<Instant>,
    quick_stop_since: Option<Instant>,
    due: bool,
    news: bool,
    wake: Option<Instant>,
}

impl Drive {
    pub fn new(axis: Axis, sync: Duration, now: Instant) -> Self {
        Self {
            axis,
            sync,
            node: Node::Absent,
            nmt: None,
            order: Order::Observe,
            void: false,
            fell: None,
            progress: Progress::Idle,
            trouble: None,
            input: Input::default(),
            output: Output::new(now),
            machine: Machine::new(),
            handshake: Handshake::new(),
            homing: homing::Homing::new(HOMING_GRACE),
            job: None,
            working: false,
            examined: false,
            check: 0,
            period_value: 0,
            patient_until: now,
            preset: None,
            armed: false,
            stands_at: None,
            engaged: false,
            begun: false,
            halted: false,
            taken: false,
            target: None,
            set_point: 0,
            travel: None,
            limits: Vec::new(),
            streamed: 0,
            homed: false,
            fault: None,
            fault_read: false,
            emergency: None,
            since: now,
            mode_since: None,
            halt_since: None,
            quick_stop_since: None,
            due: true,
            news: true,
            wake: None,
        }
    }

    pub const fn axis(&self) -> &Axis {
        &self.axis
    }

    pub const fn order(&self) -> Order {
        self.order
    }

    /// Something else is wanted, or the same again.
    pub fn set(&mut self, now: Instant, order: Order) {
        if !order.wants_current() {
            self.void = false;
        } else if self.void {
            return;
        }
        if order == self.order {
            return;
        }
        if self.order == Order::Observe {
            // Somebody else may have told it something.
            self.distrust();
        }
        self.order = order;
        self.trouble = None;
        self.stands_at = None;
        self.mode_since = None;
        self.taken = false;
        self.limits.clear();
        self.since = now;
        self.due = true;
        match order {
            Order::Hold | Order::Move(_) if !self.hears() => self.fall(Why::NotPresent),
            Order::Hold | Order::Move(_) => {}
            Order::Stop => {
                self.output.leave_all();
                self.command(Controlword::of(Command::QuickStop), 0);
                self.output.repeat();
            }
            Order::Reset { .. } => {
                self.output.leave_all();
                self.machine.set_goal(Goal::Reset);
            }
            Order::Off => self.output.leave_all(),
            Order::Observe => {
                self.output.leave_all();
                self.output.drop_urging();
            }
        }
    }

    /// Whether orders reach it.
    fn hears(&self) -> bool {
        self.node == Node::Present && self.not_operational().is_none()
    }

    fn not_operational(&self) -> Option<nmt::State> {
        self.nmt.filter(|state| *state != nmt::State::Operational)
    }

    fn distrust(&mut self) {
        self.output.forget();
        self.armed = false;
        self.preset = None;
        self.engaged = false;
        self.halted = false;
        self.target = None;
        self.travel = None;
    }

    /// What was wanted is not wanted any more. What was to be under current is told a quick stop, in case it hears that.
    fn fall(&mut self, why: Why) {
        self.fell = Some(why);
        self.void = true;
        self.order = Order::Observe;
        self.progress = Progress::Idle;
        self.trouble = None;
        self.output.leave_all();
        let words = [self.output.word(), self.output.told()];
        if words.into_iter().flatten().any(|word| word.has(Controlword::ENABLE_OPERATION)) {
            self.command(Controlword::of(Command::QuickStop), 0);
            self.output.repeat();
        }
        self.target = None;
        self.due = true;
        self.news = true;
    }

    /// Tells a word with a mode's bits. One that puts it under current is told only after a preset.
    fn command(&mut self, word: Controlword, bits: u16) {
        let word = word.with_mode(bits);
        if word.has(Controlword::ENABLE_OPERATION) {
            if !self.armed {
                return;
            }
        } else if self.output.word() != Some(word) {
            self.armed = false;
            self.preset = None;
            self.engaged = false;
            self.begun = false;
            self.halted = false;
            self.target = None;
            self.travel = None;
        }
        self.output.set_word(word);
    }

    /// What became of its node.
    pub fn booting(&mut self) {
        self.node = Node::Booting;
        self.news = true;
    }

    /// It has booted by itself: nothing of what it was told counts.
    pub fn rebooted(&mut self, now: Instant) {
        let was_wanted = self.order.wants_current();
        self.distrust();
        self.input = Input::default();
        self.homed = false;
        self.fault = None;
        self.fault_read = false;
        self.nmt = None;
        self.examined = false;
        self.since = now;
        self.quick_stop_since = None;
        self.booting();
        if was_wanted {
            self.fall(Why::Rebooted);
        }
        self.due = true;
    }

    /// It is configured, and started. One of two may be.
    pub fn booted(&mut self, now: Instant) {
        if self.node == Node::Duplicate {
            return;
        }
        self.node = Node::Booting;
        self.nmt = None;
        self.examined = true;
        self.check = 0;
        self.patient_until = now;
        if let Some(method) = self.axis.homing.method {
            self.output.note(HOMING_METHOD, method.number().into());
        }
        self.due = true;
        self.news = true;
    }

    pub fn refused(&mut self, verdict: boot::Verdict) {
        self.gone(Node::Refused(verdict), Why::NotPresent);
    }

    pub fn lost(&mut self) {
        self.gone(Node::Lost, Why::Lost);
    }

    /// There are two of it, until it boots.
    pub fn duplicate(&mut self) {
        self.gone(Node::Duplicate, Why::NotPresent);
    }

    fn gone(&mut self, node: Node, why: Why) {
        if self.node != Node::Duplicate {
            self.node = node;
        }
        self.examined = false;
        self.news = true;
        if self.order.wants_current() {
            self.fall(why);
        }
    }

    /// It is back without a boot: it is looked at anew.
    pub fn resumed(&mut self, now: Instant) {
        if self.node == Node::Lost {
            self.booted(now);
        }
    }

    /// It says its network state.
    pub fn network(&mut self, state: nmt::State) {
        self.nmt = Some(state);
        if let Some(state) = self.not_operational()
            && self.node == Node::Present
            && self.order.wants_current()
        {
            self.fall(Why::NotOperational(state));
        }
        self.due = true;
    }

    /// The bus is off: what it was told is not known.
    pub fn cut_off(&mut self) {
        if self.order.wants_current() {
            self.fall(Why::Bus);
        }
        if self.order != Order::Observe {
            self.output.repeat();
        }
    }

    /// It reports an error, or that it is over.
    pub fn emergency(&mut self, code: Option<u16>) {
        self.emergency = code;
        self.news = true;
    }

    /// Takes a frame of the bus.
    pub fn receive(&mut self, now: Instant, frame: &Frame) {
        let before = self.input.state();
        if self.input.receive(now, &self.axis, frame) {
            self.heard(now, before);
        }
    }

    /// Something of it is known anew.
    fn heard(&mut self, now: Instant, before: Option<State>) {
        self.due = true;
        self.news = true;
        let state = self.input.state();
        if state != before {
            self.since = now;
            self.quick_stop_since = (state == Some(State::QuickStopActive)).then_some(now);
        }
        if matches!(state, Some(State::Fault | State::FaultReactionActive)) {
            self.fault_read &= state == before;
        } else {
            self.fault = None;
            self.fault_read = false;
        }
        let told = self.output.told().is_some_and(|word| word.has(Controlword::ENABLE_OPERATION));
        self.engaged |= told && self.armed && state == Some(State::OperationEnabled);
    }

    /// Looks at it, where there is something to look at.
    pub fn advance(&mut self, now: Instant) {
        if self.wake.is_some_and(|wake| wake <= now) {
            self.due = true;
        }
        if core::mem::take(&mut self.due) {
            self.decide(now);
        }
    }

    fn decide(&mut self, now: Instant) {
        self.wake = None;
        if !self.working {
            self.job = None;
        }
        let progress = self.pursue(now);
        self.news |= progress != self.progress;
        self.progress = progress;
        if self.job.is_none() {
            self.job = self.errand(now);
        }
    }

    /// To be looked at again then.
    fn wake_at(&mut self, at: Instant) {
        self.wake = Some(self.wake.map_or(at, |wake| wake.min(at)));
    }

    /// Whether `time` has passed since `then`; otherwise it will be looked at when it has.
    fn passed(&mut self, now: Instant, then: Instant, time: Duration) -> bool {
        let at = then + time;
        if at > now {
            self.wake_at(at);
        }
        at <= now
    }

    /// A frame that stops something.
    pub fn urgent(&mut self, now: Instant) -> Option<Frame> {
        if !self.output.stops() {
            return None;
        }
        let frame = self.output.word_frame(now, &self.axis);
        self.due = true;
        frame
    }

    /// The next frame, besides set-points of cyclic modes.
    pub fn frame(&mut self, now: Instant) -> Option<Frame> {
        let frame = self.output.frame(now, &self.axis)?;
        self.due = true;
        Some(frame)
    }

    /// The set-point of a SYNC cycle.
    pub fn cycle(&mut self) -> Option<Frame> {
        if !self.follows() {
            return None;
        }
        if let Some(travel) = &mut self.travel {
            let (set_point, there) = travel.step(self.target);
            self.set_point = set_point;
            self.due |= there;
        }
        self.streamed = self.streamed.saturating_add(1);
        self.due |= self.streamed == PRESET_CYCLES;
        output::set_point(&self.axis, self.set_point)
    }

    /// That it has lost what was wanted.
    pub fn take_fall(&mut self) -> Option<Why> {
        self.fell.take()
    }

    /// Whether there is something to be reported.
    pub fn take_news(&mut self) -> bool {
        core::mem::take(&mut self.news)
    }

    /// Whether what is known is since it was told what is wanted.
    pub fn is_current(&self) -> bool {
        self.order == Order::Observe || self.output.is_told() && self.input.is_since(self.output.told_at())
    }

    pub fn report(&self, emergency: Option<puente_canopen::emcy::Emergency>) -> Report {
        Report {
            node: self.node,
            status: self.input.status,
            mode: self.input.mode,
            position: self.input.position,
            velocity: self.input.velocity,
            progress: self.progress,
            homed: self.homed,
            emergency,
            fault: self.fault,
        }
    }

    /// Whether it is to be looked at.
    pub const fn is_due(&self) -> bool {
        self.due
    }

    /// Whether set-points of its cyclic mode go out.
    pub fn follows(&self) -> bool {
        let wanted = self.armed && self.order.wants_current();
        self.axis.cyclic().is_some_and(|mode| {
            wanted && self.input.mode == Some(mode) && (self.preset == Some(mode) || self.engaged)
        })
    }

    /// When it is to be looked at, or has something to say; frames only where the bus is `up`.
    pub fn poll_at(&self, up: bool) -> Option<Instant> {
        let now = self.due || self.news || self.fell.is_some() || up && self.output.is_due(&self.axis);
        if now { Some(Instant::ZERO) } else { self.wake }
    }

    /// The mode that it is to show is told, until it shows it.
    fn await_mode(&mut self, now: Instant, mode: Mode) -> Result<Progress, Failure> {
        self.output.set(MODE, mode.code().into());
        let since = *self.mode_since.get_or_insert(now);
        if self.passed(now, since, MODE_TIME) {
            return Err(Failure::Mode(mode));
        }
        let told_at = self.output.told_at();
        if self.output.is_told() && self.passed(now, told_at, REPEAT) {
            self.output.doubt(MODE);
        }
        Ok(Progress::Running)
    }
}

/// A set-point that waits for SYNC has been taken after so many cycles.
const PRESET_CYCLES: u8 = 2;
