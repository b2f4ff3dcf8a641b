//! Taking a drive to a state.

use super::{Command, Controlword, State, Statusword};

/// Where a drive is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// Without current. One under current is taken out of operation first, so that it stops by its own means (605Ch); one in a
    /// quick stop stays there until it says that it stands (bit 10), which not all do.
    Off,
    /// Without current at once: what moves runs out.
    Unpowered,
    /// Under current, after its set-points have been preset.
    Enabled,
    /// Stopping as quickly as it may, whatever it does (605Ah). One without current stays without.
    QuickStopped,
    /// Out of a fault, without current. Asked for again, it is another attempt.
    Reset,
}

/// How far a drive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// It is where it is to be.
    Reached,
    /// It is on its way: the word has still to take effect.
    OnTheWay,
    /// Before it goes under current its set-points must be where it stands ([`super::presets`]); then
    /// [`Machine::set_preset`] lets it go on.
    Preset,
    /// It is in fault, and only [`Goal::Reset`] leads out.
    Fault,
    /// The controlword does not count: the drive is not in remote control.
    Local,
    /// The statusword tells no state.
    Unknown,
}

/// What to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Advice {
    /// The controlword that the drive should have now.
    pub word: Controlword,
    /// How far it is.
    pub progress: Progress,
}

/// Takes a drive to a state, a transition at a time: each statusword gives the controlword to be sent.
///
/// A drive goes under current only from switched on, with the mode's bits 0, and only after [`Machine::set_preset`] since it
/// got there; whatever it was told before is forgotten. A fault is never reset unless that is the goal. A fault reset has its
/// edge: the bit goes back to 0 before and after.
#[derive(Clone, Debug)]
pub struct Machine {
    goal: Goal,
    word: Controlword,
    preset: bool,
    /// The bit of a fault reset has still to be 0.
    again: bool,
}

impl Default for Machine {
    fn default() -> Self {
        Self::new()
    }
}

impl Machine {
    /// One that wants the drive off.
    pub const fn new() -> Self {
        Self { goal: Goal::Off, word: Controlword(0), preset: false, again: false }
    }

    /// Sets where the drive is to be.
    pub fn set_goal(&mut self, goal: Goal) {
        if goal != self.goal {
            self.preset = false;
        }
        self.again = goal == Goal::Reset;
        self.goal = goal;
    }

    /// Where it is to be.
    pub const fn goal(&self) -> Goal {
        self.goal
    }

    /// The set-points are where the drive stands. Counts until it is under current or elsewhere.
    pub const fn set_preset(&mut self) {
        self.preset = true;
    }

    /// The word that was advised last, without a mode's bits.
    pub const fn word(&self) -> Controlword {
        self.word
    }

    /// What to do about a drive that says `status`. To be called with every new statusword, once a word has been sent.
    pub fn advise(&mut self, status: Statusword) -> Advice {
        let Some(state) = status.state() else {
            return Advice { word: self.word, progress: Progress::Unknown };
        };
        if state != State::SwitchedOn {
            self.preset = false;
        }
        // What a quick stop has not brought to a stand would run out without current.
        let stands = status.has(Statusword::TARGET_REACHED);
        let (command, progress) = match self.goal {
            Goal::Off => off(state, stands),
            Goal::Unpowered => unpowered(state),
            Goal::Enabled => enabled(state, stands, self.preset),
            Goal::QuickStopped => quick_stopped(state),
            Goal::Reset if matches!(state, State::Fault | State::FaultReactionActive) => self.reset(state),
            Goal::Reset => off(state, stands),
        };
        self.word = Controlword::of(command);
        let local = !status.has(Statusword::REMOTE) && progress == Progress::OnTheWay;
        Advice { word: self.word, progress: if local { Progress::Local } else { progress } }
    }

    /// The bit is 0 at the beginning of each attempt, and then 1 until the drive has understood.
    fn reset(&mut self, state: State) -> (Command, Progress) {
        let low = state != State::Fault || self.again;
        self.again &= state != State::Fault;
        (if low { Command::DisableVoltage } else { Command::FaultReset }, Progress::OnTheWay)
    }
}

const fn off(state: State, stands: bool) -> (Command, Progress) {
    match state {
        State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::ReadyToSwitchOn | State::Fault => {
            (Command::DisableVoltage, Progress::Reached)
        }
        State::OperationEnabled => (Command::SwitchOn, Progress::OnTheWay),
        State::SwitchedOn => (Command::Shutdown, Progress::OnTheWay),
        State::QuickStopActive if !stands => (Command::QuickStop, Progress::OnTheWay),
        State::QuickStopActive | State::FaultReactionActive => (Command::DisableVoltage, Progress::OnTheWay),
    }
}

const fn unpowered(state: State) -> (Command, Progress) {
    let progress = if state.is_powered() { Progress::OnTheWay } else { Progress::Reached };
    (Command::DisableVoltage, progress)
}

const fn enabled(state: State, stands: bool, preset: bool) -> (Command, Progress) {
    match state {
        State::NotReadyToSwitchOn => (Command::DisableVoltage, Progress::OnTheWay),
        State::SwitchOnDisabled => (Command::Shutdown, Progress::OnTheWay),
        State::ReadyToSwitchOn => (Command::SwitchOn, Progress::OnTheWay),
        State::SwitchedOn if preset => (Command::EnableOperation, Progress::OnTheWay),
        State::SwitchedOn => (Command::SwitchOn, Progress::Preset),
        State::OperationEnabled => (Command::EnableOperation, Progress::Reached),
        State::QuickStopActive if !stands => (Command::QuickStop, Progress::OnTheWay),
        // By way of switch on disabled: many drives do not have transition 16, and it presets nothing.
        State::QuickStopActive => (Command::DisableVoltage, Progress::OnTheWay),
        State::FaultReactionActive | State::Fault => (Command::DisableVoltage, Progress::Fault),
    }
}

const fn quick_stopped(state: State) -> (Command, Progress) {
    match state {
        State::OperationEnabled => (Command::QuickStop, Progress::OnTheWay),
        State::FaultReactionActive => (Command::QuickStop, Progress::OnTheWay),
        _ => (Command::QuickStop, Progress::Reached),
    }
}
