//! The pump of a CANopen bus: it listens while it sends, and nothing that it sends holds SYNC up but the frame on the wire.

use core::future::{Future, pending, poll_fn};
use core::pin::pin;
use core::task::Poll;

use puente_canopen::Frame;
use puente_canopen::manager::{Action as Managed, Sdo};
use puente_canopen::sdo::{Config, Transfer};
use puente_line::{Duration, Instant};
use puente_servos::{Action, Order as Wanted};

use super::super::{Taken, Undelivered};
use super::{BLOCK, Drives, Exchange, Order, Room};
use crate::clock;
use crate::port::{CanEvent, CanPort, CanReader, CanWriter, NotTaken};

/// The pump shows life so often,
const SIGN: Duration = Duration::from_millis(500);
/// and may be late by this: more than anything above it takes of the processor.
const LATE: Duration = Duration::from_millis(500);
/// While the port takes nothing, the manager is asked so often what it has to tell.
const STUCK: Duration = Duration::from_millis(5);
/// Frames that are taken from the port at once.
const BATCH: usize = 16;
/// A plain read is asked again so often, for an adapter may lose a frame. Blocks have their own repetition.
const REPEATS: u8 = 1;

/// What a pump works with.
pub struct Setup {
    /// Where the manager lives. No other pump works it.
    pub room: &'static Room,
    /// How long a node has for each answer to an SDO.
    pub sdo_timeout: Duration,
}

/// Works the manager of a bus, for ever.
pub async fn pump(port: &mut impl CanPort, setup: Setup, clients: &impl Exchange, drives: &impl Drives) -> ! {
    let (mut reader, mut writer) = port.split();
    let mut pump = Pump { setup, clients, drives, up: false, sync: None, frame: None };
    loop {
        let now = clock::now();
        let expiry = clients.orders(now, |order| pump.take(now, order));
        let room = pump.setup.room;
        let ends = drives.outputs(now, |place, wanted| room.work(|master| master.set(now, place, wanted)));
        pump.act(now);
        clients.counted(reader.counters(), room.look(|manager| manager.counters()));
        drives.alive(clock::now() + SIGN + LATE);
        let wake = [expiry, ends].into_iter().flatten().fold(pump.wake(now), Instant::min);
        let Step { mut heard, sent } = wait(&mut reader, &mut writer, pump.next(), wake, drives).await;
        let now = clock::now();
        match sent {
            Some(Ok(())) => pump.sent(now),
            Some(Err(NotTaken(_))) => pump.down(now, &mut writer),
            None => {}
        }
        for _ in 0..BATCH {
            let Some(event) = heard else { break };
            pump.heard(now, event, &mut writer);
            heard = at_once(reader.read()).await;
        }
        if let Some(event) = heard {
            pump.heard(now, event, &mut writer);
        }
    }
}

/// What a future has to say without waiting. It is asked with the waker of the task: a timer takes no other on a board.
async fn at_once<R>(future: impl Future<Output = R>) -> Option<R> {
    let mut future = pin!(future);
    poll_fn(|context| match future.as_mut().poll(context) {
        Poll::Ready(done) => Poll::Ready(Some(done)),
        Poll::Pending => Poll::Ready(None),
    })
    .await
}

/// Whose a frame is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Whose {
    Manager,
    Client,
}

struct Pump<'c, C, D> {
    setup: Setup,
    clients: &'c C,
    drives: &'c D,
    /// The port can send.
    up: bool,
    /// SYNC, which goes before the frame that waits for the port. Nothing else does, not even a stop: what a drive was told
    /// before must not follow it. A stop is the next frame.
    sync: Option<Frame>,
    frame: Option<(Frame, Whose)>,
}

impl<C: Exchange, D: Drives> Pump<'_, C, D> {
    /// Hands an order to the manager; false where it has to wait.
    fn take(&self, now: Instant, order: Order) -> bool {
        self.setup.room.work(|master| match order {
            Order::Transfer(node, transfer, timeout) => {
                let (Transfer::Upload { block, .. } | Transfer::Download { block, .. }) = transfer;
                let config = Config {
                    timeout: timeout.unwrap_or(self.setup.sdo_timeout),
                    retries: if block { Config::DEFAULT.retries } else { REPEATS },
                    block: BLOCK as u8,
                    ..Config::DEFAULT
                };
                master.submit_with(now, node, transfer, Some(config)).is_ok()
            }
            Order::Cancel(node) => {
                master.manager_mut().cancel(now, node);
                true
            }
            Order::Resume(node) => {
                master.manager_mut().pause(node, false);
                true
            }
            Order::Nmt(command, node) => master.command(now, command, node).is_ok(),
            Order::Lss(command, timeout) => master.manager_mut().lss(now, command, timeout).is_ok(),
            Order::CancelLss => {
                master.manager_mut().cancel_lss();
                true
            }
        })
    }

    /// Does what the manager asks for until it is idle, or has given a frame that the port has not taken yet. Clients' own
    /// frames come after its.
    fn act(&mut self, now: Instant) {
        let room = self.setup.room;
        if self.sync.is_none() {
            self.sync = room.work(|master| master.sync(now));
        }
        while self.frame.is_none() {
            match room.work(|master| master.poll(now)) {
                Action::Idle => break,
                Action::Transmit(frame) => self.frame = Some((frame, Whose::Manager)),
                action => self.tell(now, action),
            }
        }
        self.report(now);
        if self.frame.is_none() {
            let (up, frame) = (self.up, &mut self.frame);
            self.clients.outgoing(now, |outgoing| {
                if !up {
                    return Taken::Never(Undelivered::LineDown);
                }
                *frame = Some((*outgoing, Whose::Client));
                Taken::Yes
            });
        }
    }

    /// What goes out next.
    fn next(&self) -> Option<&Frame> {
        self.sync.as_ref().or(self.frame.as_ref().map(|(frame, _)| frame))
    }

    /// When to go on, whatever happens.
    fn wake(&self, now: Instant) -> Instant {
        let due = self.setup.room.work(|master| match self.frame {
            None => master.poll_at(),
            Some(_) => Some(master.manager().sync_at().map_or(now + STUCK, |at| at.min(now + STUCK))),
        });
        due.map_or(now + SIGN, |due| due.min(now + SIGN))
    }

    /// Tells what the manager has to tell.
    fn report(&self, now: Instant) {
        while let Some(action) = self.setup.room.work(|master| master.report(now)) {
            self.tell(now, action);
        }
    }

    fn tell(&self, now: Instant, action: Action) {
        let (room, clients) = (self.setup.room, self.clients);
        let action = match action {
            Action::Manager(action) => action,
            Action::Reported { place, report, current } => {
                return self.drives.reported(now, place, report, current);
            }
            Action::Fell { place, why } => {
                // What is wanted from now on is wanted in the knowledge of this.
                room.work(|master| master.set(now, place, Wanted::Observe));
                return self.drives.fell(now, place, why);
            }
            // Neither is something to tell.
            Action::Transmit(_) | Action::Idle => return,
        };
        match action {
            Managed::Sdo(node, Sdo::Fetch { offset, count }) => {
                let supply = |bytes: &[u8]| room.work(|master| master.manager_mut().supply(now, node, bytes));
                clients.fetch(node, offset, count, supply);
            }
            Managed::Sdo(node, Sdo::Data(bytes)) => {
                if !clients.read(node, &bytes) {
                    room.work(|master| master.manager_mut().pause(node, true));
                }
            }
            Managed::Sdo(node, Sdo::Done(end)) => clients.done(now, node, end),
            Managed::Node(node, event) => clients.happened(now, node, event),
            Managed::Bus(event) => clients.happened_on_bus(now, event),
            Managed::Lss(end) => clients.lss(end),
            Managed::Transmit(_) | Managed::Idle => {}
        }
    }

    /// Something has come from the port.
    fn heard(&mut self, now: Instant, event: CanEvent, writer: &mut impl CanWriter) {
        match event {
            CanEvent::Frame(frame) => {
                self.setup.room.work(|master| master.receive(now, &frame));
                self.clients.heard(now, &frame);
                self.report(now);
            }
            CanEvent::State(state) => {
                self.clients.state(now, state);
                self.drives.line(!state.sends());
                if state.sends() {
                    self.up = true;
                    self.setup.room.work(|master| {
                        master.start(now);
                        master.bus(now, true);
                    });
                } else {
                    self.down(now, writer);
                }
            }
            // The counters of the port have them.
            CanEvent::Lost(_) => {}
        }
    }

    /// The port has taken the frame that was next.
    fn sent(&mut self, now: Instant) {
        match self.gone() {
            Some((frame, Whose::Manager)) => self.clients.sent(now, &frame),
            Some((frame, Whose::Client)) => {
                // A client may be a node, too.
                self.setup.room.work(|master| master.receive(now, &frame));
                self.clients.posted(now, Ok(()));
            }
            None => {}
        }
    }

    /// The port cannot send: what was to go does not.
    fn down(&mut self, now: Instant, writer: &mut impl CanWriter) {
        writer.discard();
        self.up = false;
        while let Some((_, whose)) = self.gone() {
            if whose == Whose::Client {
                self.clients.posted(now, Err(Undelivered::LineDown));
            }
        }
        self.setup.room.work(|master| master.bus(now, false));
    }

    fn gone(&mut self) -> Option<(Frame, Whose)> {
        match self.sync.take() {
            Some(sync) => Some((sync, Whose::Manager)),
            None => self.frame.take(),
        }
    }
}

/// What came of waiting.
struct Step {
    heard: Option<CanEvent>,
    sent: Option<Result<(), NotTaken>>,
}

/// Waits for a frame or another event of the bus, until the port has taken the `next` frame, until something is wanted, or
/// until it is time. All of them are looked at each time, so that none holds another up.
async fn wait(
    reader: &mut impl CanReader,
    writer: &mut impl CanWriter,
    next: Option<&Frame>,
    wake: Instant,
    drives: &impl Drives,
) -> Step {
    let mut heard = pin!(reader.read());
    let mut sent = pin!(async {
        match next {
            Some(frame) => writer.write(frame).await,
            None => pending().await,
        }
    });
    let mut changed = pin!(drives.changed());
    let mut time = pin!(clock::at(Some(wake)));
    poll_fn(|context| {
        let sent = ready(sent.as_mut().poll(context));
        let heard = ready(heard.as_mut().poll(context));
        let changed = changed.as_mut().poll(context).is_ready();
        let time = time.as_mut().poll(context).is_ready();
        if sent.is_some() || heard.is_some() || changed || time {
            Poll::Ready(Step { heard, sent })
        } else {
            Poll::Pending
        }
    })
    .await
}

fn ready<T>(poll: Poll<T>) -> Option<T> {
    match poll {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}
