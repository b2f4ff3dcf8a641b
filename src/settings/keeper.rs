//! Changes the settings while the gateway runs, one change at a time, and ends a trial that nobody confirms.
//!
//! Clients have the document received in the one [`Form`] there is; a [task](keep) of its own writes it to flash, so that
//! a client which goes away changes nothing. A change counts with the next start, which follows at once.

use core::cell::Cell;

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::signal::Signal;
use embassy_time::with_timeout;
use puente_line::{Duration, Instant};

use super::store::{self, Store};
use super::{Problem, Settings, json, record};
use crate::clock;
use crate::desk::Desk;
use crate::port::limits::{AXES, BUSES, MODBUS, NODES, WRITES};
use crate::port::{Flash, restart};

/// Bytes of the largest settings document, written as compactly as it is read: what a client may send. Buses besides
/// those that may be Modbus buses are CANopen buses, which have less to say. Of what is written to nodes there is room for a third of the longest: for all of it where it is short, or where some nodes have less.
pub const DOCUMENT: usize =
    384 + MODBUS * 448 + (BUSES - MODBUS) * 304 + AXES * 288 + NODES * (304 + WRITES * 48 / 3);
/// How long a start with network settings on trial waits for somebody who can reach it.
pub const TRIAL: Duration = Duration::from_secs(60);
/// How long a restart waits until the answer that tells of it is out,
const ANSWER: embassy_time::Duration = embassy_time::Duration::from_secs(3);
/// and until the drives have confirmed their stops.
const FAREWELL: Duration = Duration::from_secs(5);

/// Where the settings in force come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// They are built in.
    Factory,
    /// From flash.
    Flash,
    /// From a file.
    File,
}

impl Source {
    /// As told to clients.
    pub const fn name(self) -> &'static str {
        match self {
            Source::Factory => "factory",
            Source::Flash => "flash",
            Source::File => "file",
        }
    }
}

/// Why the settings stay as they are.
#[derive(Clone, Debug, PartialEq)]
pub enum Refusal {
    /// The document is not the JSON that is expected.
    Text(json::Error),
    /// The document does not hold.
    Settings(Problem),
    /// There is no flash.
    ReadOnly,
    /// Other settings are on trial.
    OnTrial,
    /// No settings are on trial.
    NoTrial,
    /// An axis may be in motion.
    Moving,
    /// The flash failed.
    Flash,
}

/// What a document is received in, and written to flash from.
pub struct Form {
    bytes: [u8; DOCUMENT],
    length: usize,
}

impl Default for Form {
    fn default() -> Self {
        Self::new()
    }
}

impl Form {
    /// An empty one, for a static.
    pub const fn new() -> Self {
        Self { bytes: [0; DOCUMENT], length: 0 }
    }

    /// All of it.
    pub fn buffer(&mut self) -> &mut [u8] {
        &mut self.bytes
    }
}

/// What is to be done.
enum Task {
    /// The record on the form is the new settings.
    Adopt,
    /// The settings on trial are to stay.
    Confirm,
}

/// Who changes the settings.
pub struct Keeper {
    source: Source,
    /// What an empty flash stands for; none for what is built in.
    base: Option<&'static Settings>,
    has_flash: bool,
    trial: Mutex<CriticalSectionRawMutex, Cell<Option<Instant>>>,
    forms: Channel<CriticalSectionRawMutex, &'static mut Form, 1>,
    orders: Channel<CriticalSectionRawMutex, (&'static mut Form, Task), 1>,
    outcome: Signal<CriticalSectionRawMutex, Result<(), Refusal>>,
    answered: Signal<CriticalSectionRawMutex, ()>,
}

impl Keeper {
    /// Whose settings come from `source`. `base` is what an empty flash stands for, none for what is built in. Where
    /// the settings are `on_trial`, that runs from the start of the gateway.
    pub fn new(
        form: &'static mut Form,
        source: Source,
        base: Option<&'static Settings>,
        has_flash: bool,
    ) -> Self {
        let forms = Channel::new();
        // There is room for it.
        let _ = forms.try_send(form);
        Self {
            source,
            base,
            has_flash,
            trial: Mutex::new(Cell::new(None)),
            forms,
            orders: Channel::new(),
            outcome: Signal::new(),
            answered: Signal::new(),
        }
    }

    /// The settings in force are on trial from now on.
    pub fn try_out(&self, now: Instant) {
        self.trial.lock(|trial| trial.set(Some(now + TRIAL)));
    }

    /// Where the settings in force come from.
    pub fn source(&self) -> Source {
        self.source
    }

    /// How long the settings in force stay without being confirmed; none where they do.
    pub fn trial_left(&self, now: Instant) -> Option<Duration> {
        self.trial_end().map(|end| end.since(now))
    }

    fn trial_end(&self) -> Option<Instant> {
        self.trial.lock(Cell::get)
    }

    /// The form, where nobody has it.
    pub fn lend(&self) -> Option<Lent<'_>> {
        let form = self.forms.try_receive().ok()?;
        form.length = 0;
        Some(Lent { keeper: self, form: Some(form) })
    }

    /// The answer that tells of the restart is out.
    pub fn answered(&self) {
        self.answered.signal(());
    }
}

/// The form as long as somebody has it.
pub struct Lent<'k> {
    keeper: &'k Keeper,
    form: Option<&'static mut Form>,
}

impl Drop for Lent<'_> {
    fn drop(&mut self) {
        if let Some(form) = self.form.take() {
            let _ = self.keeper.forms.try_send(form);
        }
    }
}

impl Lent<'_> {
    /// Bytes on the form.
    pub fn length(&self) -> usize {
        self.form.as_ref().map_or(0, |form| form.length)
    }

    /// Appends bytes, as many as there is room for: how many those are.
    pub fn append(&mut self, bytes: &[u8]) -> usize {
        let Some(form) = &mut self.form else { return 0 };
        let room = form.bytes.get_mut(form.length..).unwrap_or_default();
        let count = room.len().min(bytes.len());
        room.iter_mut().zip(bytes).for_each(|(place, byte)| *place = *byte);
        form.length += count;
        count
    }

    /// Reads the document on the form, and writes what is to be kept in its place. Nothing else changes. Tells whether
    /// it will be on trial.
    #[inline(never)]
    pub fn draft(&mut self, in_force: &Settings) -> Result<bool, Refusal> {
        let form = self.form.as_ref().ok_or(Refusal::Flash)?;
        let mut settings = Settings::blank();
        let text = form.bytes.get(..form.length).unwrap_or_default();
        json::read(text, &mut settings).map_err(Refusal::Text)?;
        settings.check().map_err(Refusal::Settings)?;
        self.write(in_force, Some(&settings), &settings)
    }

    /// As [`draft`](Self::draft), for the settings that an empty flash stands for.
    #[inline(never)]
    pub fn draft_factory(&mut self, in_force: &Settings) -> Result<bool, Refusal> {
        match self.keeper.base {
            Some(base) => self.write(in_force, None, base),
            None => self.write(in_force, None, &Settings::factory()),
        }
    }

    fn write(
        &mut self,
        in_force: &Settings,
        stored: Option<&Settings>,
        new: &Settings,
    ) -> Result<bool, Refusal> {
        if !self.keeper.has_flash {
            return Err(Refusal::ReadOnly);
        }
        if self.keeper.trial_end().is_some() {
            return Err(Refusal::OnTrial);
        }
        let form = self.form.as_mut().ok_or(Refusal::Flash)?;
        let on_trial = new.net.leads_elsewhere(&in_force.net);
        let confirmed = (self.keeper.source == Source::Flash).then_some(in_force);
        let written = if on_trial {
            record::emit(&mut form.bytes, confirmed, Some(stored))
        } else {
            record::emit(&mut form.bytes, stored, None)
        };
        // The form has room for the largest two.
        form.length = written.map_err(|_| Refusal::Flash)?;
        Ok(on_trial)
    }

    /// Puts the drafted settings into flash. No motion is let in any more, and the gateway starts anew as soon as the
    /// answer that tells of it [is out](Keeper::answered).
    pub async fn adopt(self) -> Result<(), Refusal> {
        self.order(Task::Adopt).await
    }

    /// Confirms the settings on trial.
    pub async fn confirm(self) -> Result<(), Refusal> {
        if self.keeper.trial_end().is_none() {
            return Err(Refusal::NoTrial);
        }
        self.order(Task::Confirm).await
    }

    async fn order(mut self, task: Task) -> Result<(), Refusal> {
        let form = self.form.take().ok_or(Refusal::Flash)?;
        // Of an earlier client that did not wait for it.
        self.keeper.outcome.reset();
        self.keeper.orders.send((form, task)).await;
        self.keeper.outcome.wait().await
    }
}

/// Carries out what is asked of the keeper, for ever. One task, where there is flash.
pub async fn keep(keeper: &'static Keeper, desk: &'static Desk, mut store: Store<Flash>) -> ! {
    loop {
        let (form, task) = match select(keeper.orders.receive(), clock::at(keeper.trial_end())).await {
            Either::First(order) => order,
            Either::Second(()) => {
                log::warn!("nobody has confirmed the network settings: back to the last confirmed ones");
                come_to_rest(desk).await;
                restart()
            }
        };
        let adopts = matches!(task, Task::Adopt);
        let outcome = match task {
            Task::Adopt => adopt(desk, &mut store, form).await,
            Task::Confirm => confirm(keeper, &mut store, form).await,
        };
        let restarts = adopts && outcome.is_ok();
        let _ = keeper.forms.try_send(form);
        keeper.outcome.signal(outcome);
        if restarts {
            // The client may be gone.
            let _ = with_timeout(ANSWER, keeper.answered.wait()).await;
            log::info!("starting anew, with new settings");
            restart()
        }
    }
}

async fn adopt(desk: &Desk, store: &mut Store<Flash>, form: &mut Form) -> Result<(), Refusal> {
    if !desk.close_at_rest(clock::now()) {
        return Err(Refusal::Moving);
    }
    match store.keep(&mut form.bytes, form.length).await {
        Ok(()) => Ok(()),
        Err(error) => {
            desk.reopen();
            log::error!("the settings cannot be kept: {error:?}");
            Err(Refusal::Flash)
        }
    }
}

async fn confirm(keeper: &Keeper, store: &mut Store<Flash>, form: &mut Form) -> Result<(), Refusal> {
    match store.confirm(&mut form.bytes).await {
        Ok(()) => {
            keeper.trial.lock(|trial| trial.set(None));
            Ok(())
        }
        Err(store::Error::NoTrial) => Err(Refusal::NoTrial),
        Err(error) => {
            log::error!("the settings cannot be confirmed: {error:?}");
            Err(Refusal::Flash)
        }
    }
}

/// Stops the axes that are under a lease, as at the end of the gateway.
async fn come_to_rest(desk: &Desk) {
    desk.close(clock::now());
    let end = clock::now() + FAREWELL;
    while !desk.at_rest() && clock::now() < end {
        embassy_time::Timer::after_millis(5).await;
    }
    if !desk.at_rest() {
        log::error!("an axis may still move: its stop was not confirmed");
    }
}

#[cfg(test)]
mod tests;
