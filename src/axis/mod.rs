//! The uniform axis: the same commands whatever the drive speaks.
//!
//! [`Axes`] finds an axis by its name, keeps what is known of it, and holds each command to the rules that every drive
//! shares: the lease, no motion without `enable`, no jump on enabling, stop for everyone.

mod canopen;
pub mod cia402;
pub mod edb;
mod error;
mod framed;
pub mod group;
mod link;
pub mod pid;
mod raw;
mod watch;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::{String, Vec};
use puente_drives::edb::Parameter;
use puente_drives::pid::Gains;
use puente_line::Duration;

pub use canopen::{CanRefusal, CanRuling};
pub use error::AxisError;
pub use framed::FrameRuling;
pub use raw::Ruling;

use crate::clock;
use crate::desk::{Class, Desk, Event, Holder, View};
use crate::port::limits::AXES;
use link::Link;

/// One sequence of writes at a time on an axis; a stop does not wait for it.
type Turn = embassy_sync::mutex::Mutex<CriticalSectionRawMutex, ()>;

const NO_GAINS: &str = "only a PID module takes gains; an EDB drive has its own, as parameters: get and set";
const NO_PARAMETERS: &str = "only an EDB drive has parameters; a PID module takes: gains";

/// What the configuration says of an axis.
#[derive(Clone, Debug)]
pub struct AxisSpec {
    /// Name in commands and paths.
    pub name: String<16>,
    /// Index of its bus.
    pub bus: u8,
    /// Name of its bus.
    pub bus_name: String<16>,
    /// Address of the drive on its bus.
    pub address: u8,
    /// What drives it.
    pub drive: DriveSpec,
}

/// What drives an axis.
#[derive(Clone, Copy, Debug)]
pub enum DriveSpec {
    /// An EDB servo drive on a Modbus bus.
    Edb(edb::Spec),
    /// A PID interface module on a framed bus, in the process image of the desk.
    Pid(pid::Spec),
    /// A CiA 402 drive on a CANopen bus, in the process image of the desk.
    Cia402(cia402::Spec),
}

/// Where an axis is to go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// To there.
    pub position: i32,
    /// As fast; none where that is as the drive has it. Only a CiA 402 drive takes one.
    pub velocity: Option<u32>,
}

/// Who gives a command.
#[derive(Clone, Copy, Debug)]
pub struct Commander {
    /// Its place at the gateway, for the fair order of requests.
    pub seat: u8,
    /// As whom it holds leases.
    pub holder: Holder,
}

/// What is known of an axis.
#[derive(Clone, Copy, Debug)]
pub enum Known {
    /// Of an EDB drive.
    Edb(edb::Known),
    /// Of a PID module.
    Pid(View),
    /// Of a CiA 402 drive.
    Cia402(View),
}

/// Values of a drive at one moment.
#[derive(Clone, Copy, Debug)]
pub enum Snapshot {
    /// Of an EDB drive.
    Edb(edb::Snapshot),
    /// Of a PID module.
    Pid(View),
    /// Of a CiA 402 drive.
    Cia402(View),
}

/// One axis.
pub struct Axis {
    /// Its name in commands and paths.
    pub name: String<16>,
    /// Index of its bus.
    pub bus: u8,
    /// Name of its bus.
    pub bus_name: String<16>,
    /// Address of the drive on its bus.
    pub address: u8,
    drive: Drive,
    turn: Turn,
}

enum Drive {
    Edb(edb::Drive),
    Pid(pid::Spec),
    Cia402(cia402::Drive),
}

/// All axes of the gateway.
pub struct Axes {
    /// The desk that carries their requests.
    pub desk: &'static Desk,
    list: Vec<Axis, AXES>,
    group: group::Group,
}

impl Axis {
    /// What the configuration says of its drive.
    pub fn drive(&self) -> DriveSpec {
        match &self.drive {
            Drive::Edb(edb) => DriveSpec::Edb(edb.spec),
            Drive::Pid(pid) => DriveSpec::Pid(*pid),
            Drive::Cia402(drive) => DriveSpec::Cia402(drive.spec),
        }
    }

    /// Its drive, where that is an EDB; `lacks` tells what others have not.
    fn edb(&self, lacks: &'static str) -> Result<&edb::Drive, AxisError> {
        match &self.drive {
            Drive::Edb(edb) => Ok(edb),
            Drive::Pid(_) | Drive::Cia402(_) => Err(AxisError::Unsupported(lacks)),
        }
    }

    fn pid(&self, lacks: &'static str) -> Result<pid::Spec, AxisError> {
        match &self.drive {
            Drive::Pid(pid) => Ok(*pid),
            Drive::Edb(_) | Drive::Cia402(_) => Err(AxisError::Unsupported(lacks)),
        }
    }
}

impl From<AxisSpec> for Axis {
    fn from(AxisSpec { name, bus, bus_name, address, drive }: AxisSpec) -> Self {
        let drive = match drive {
            DriveSpec::Edb(spec) => Drive::Edb(edb::Drive::new(spec)),
            DriveSpec::Pid(spec) => Drive::Pid(spec),
            DriveSpec::Cia402(spec) => Drive::Cia402(cia402::Drive::new(spec)),
        };
        Self { name, bus, bus_name, address, drive, turn: Turn::new(()) }
    }
}

impl Axes {
    /// The axes of a configuration; at most [`AXES`] count.
    pub fn new(desk: &'static Desk, specs: impl IntoIterator<Item = AxisSpec>) -> Self {
        Self {
            desk,
            list: specs.into_iter().take(AXES).map(Axis::from).collect(),
            group: group::Group::new(),
        }
    }

    /// All of them, with their numbers.
    pub fn iter(&self) -> impl Iterator<Item = (u8, &Axis)> {
        self.list.iter().enumerate().map(|(index, axis)| (index as u8, axis))
    }

    /// The number of the axis of this name.
    pub fn find(&self, name: &str) -> Result<u8, AxisError> {
        self.iter().find(|(_, axis)| axis.name == name).map(|(id, _)| id).ok_or(AxisError::UnknownAxis)
    }

    /// An axis by its number.
    pub fn get(&self, id: u8) -> Result<&Axis, AxisError> {
        self.list.get(usize::from(id)).ok_or(AxisError::UnknownAxis)
    }

    /// Who holds the axis, and for how long.
    pub fn leased(&self, id: u8) -> Option<(Holder, Duration)> {
        self.desk.leased(clock::now(), id)
    }

    /// How the last commander lost the axis, until cleared.
    pub fn event(&self, id: u8) -> Option<Event> {
        self.desk.event(id)
    }

    /// What is known of an axis.
    pub fn known(&self, id: u8) -> Result<Known, AxisError> {
        Ok(match &self.get(id)?.drive {
            Drive::Edb(edb) => Known::Edb(edb.known()),
            Drive::Pid(_) => Known::Pid(self.desk.view(clock::now(), id)),
            Drive::Cia402(_) => Known::Cia402(self.desk.view(clock::now(), id)),
        })
    }

    fn link<'a>(&'a self, axis: &Axis, by: Commander) -> Link<'a> {
        Link { desk: self.desk, seat: by.seat, bus: axis.bus, unit: axis.address }
    }

    fn module(&self, axis: u8, bus: u8, spec: pid::Spec) -> pid::Module<'_> {
        pid::Module { desk: self.desk, axis, bus, spec }
    }

    /// Values of the drive. Those that are read are not older than `max_age`; those that come by themselves are as old as
    /// they are.
    pub async fn status(&self, id: u8, by: Commander, max_age: Duration) -> Result<Snapshot, AxisError> {
        let axis = self.get(id)?;
        match &axis.drive {
            Drive::Edb(edb) => edb.status(&self.link(axis, by), max_age).await.map(Snapshot::Edb),
            Drive::Pid(spec) => self.module(id, axis.bus, *spec).status().await.map(Snapshot::Pid),
            Drive::Cia402(drive) => self.servo(id, axis.bus, drive).status().map(Snapshot::Cia402),
        }
    }

    /// Enables the servo at standstill, so that nothing moves.
    pub async fn enable(&self, id: u8, by: Commander) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let permit = self.desk.permit(clock::now(), id, by.holder)?;
        let _turn = axis.turn.lock().await;
        match &axis.drive {
            Drive::Edb(edb) => edb.enable(&self.link(axis, by), permit).await?,
            Drive::Pid(spec) => self.module(id, axis.bus, *spec).enable(permit).await?,
            Drive::Cia402(drive) => self.servo(id, axis.bus, drive).enable(permit).await?,
        }
        // A motion of this commander's own has ended with it.
        self.desk.release(permit);
        Ok(())
    }

    /// Disables the servo. Allowed to everyone, at any time; the axis coasts if it was moving.
    pub async fn disable(&self, id: u8, by: Commander) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let duty = self.desk.revoke(clock::now(), id, by.holder);
        match &axis.drive {
            Drive::Edb(edb) => edb.disable(&self.link(axis, by)).await?,
            Drive::Pid(spec) => self.module(id, axis.bus, *spec).off(None).await?,
            Drive::Cia402(drive) => self.servo(id, axis.bus, drive).off().await?,
        }
        duty.done();
        Ok(())
    }

    /// Stops the axis by the drive's own means; it stays enabled. Allowed to everyone, at any time. Where that ended a
    /// lease and the drive does not confirm it, the gateway goes on trying.
    pub async fn stop(&self, id: u8, by: Commander) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let duty = self.desk.revoke(clock::now(), id, by.holder);
        match &axis.drive {
            Drive::Edb(edb) => edb.stop(&self.link(axis, by)).await?,
            Drive::Pid(spec) => self.module(id, axis.bus, *spec).stop().await?,
            Drive::Cia402(drive) => self.servo(id, axis.bus, drive).stop().await?,
        }
        duty.done();
        Ok(())
    }

    /// Turns the axis at `rpm` r/min, negative for reverse, while its commander shows life; 0 stops it. Takes the
    /// lease for `hold`, or for the configured time.
    pub async fn jog(
        &self,
        id: u8,
        by: Commander,
        rpm: i32,
        hold: Option<Duration>,
    ) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let edb =
            axis.edb("only an EDB drive turns at r/min; a PID module: move, a CiA 402 drive: velocity")?;
        let speed = edb.speed(rpm)?;
        if speed == 0 {
            return self.stop(id, by).await;
        }
        let permit = self.desk.lease(clock::now(), id, by.holder, hold)?;
        let _turn = axis.turn.lock().await;
        edb.jog(&self.link(axis, by), permit, speed).await
    }

    /// Sends the axis to a position: a module, in encoder counts, stays under the lease while its commander shows life; a
    /// CiA 402 drive, in its position units, needs nobody any more when it has arrived. Takes the lease as
    /// [`jog`](Self::jog) does; to `renew` is to have it already, so that a motion which has ended does not begin again by
    /// what comes late.
    pub async fn move_to(
        &self,
        id: u8,
        by: Commander,
        course: Course,
        hold: Option<Duration>,
        renew: bool,
    ) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let Course { position, velocity } = course;
        match &axis.drive {
            Drive::Edb(_) => return Err(AxisError::Unsupported("an EDB drive turns at a speed: jog")),
            Drive::Pid(_) if velocity.is_some() => {
                return Err(AxisError::Unsupported("a PID module takes a position alone"));
            }
            Drive::Pid(_) => pid::in_range(position)?,
            Drive::Cia402(_) if renew => {}
            Drive::Cia402(drive) => self.servo(id, axis.bus, drive).reached()?,
        }
        let now = clock::now();
        let permit = match renew {
            true => match self.desk.prolong(now, id, by.holder, hold)? {
                Some(permit) => permit,
                None => return self.arrived(id),
            },
            false => self.desk.lease(now, id, by.holder, hold)?,
        };
        let _turn = axis.turn.lock().await;
        match &axis.drive {
            Drive::Pid(spec) => self.module(id, axis.bus, *spec).follow(permit, position).await,
            Drive::Cia402(drive) => self.servo(id, axis.bus, drive).position(permit, course, renew).await,
            Drive::Edb(_) => Ok(()),
        }
    }

    /// The gains of the axis' loop.
    pub fn gains(&self, id: u8) -> Result<Gains, AxisError> {
        self.get(id)?.pid(NO_GAINS)?;
        Ok(self.desk.view(clock::now(), id).gains)
    }

    /// New gains for the axis' loop, at once.
    pub fn set_gains(&self, id: u8, by: Commander, gains: Gains) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let spec = axis.pid(NO_GAINS)?;
        let permit = self.desk.permit(clock::now(), id, by.holder)?;
        self.module(id, axis.bus, spec).set_gains(permit, gains)
    }

    /// Whether the motor of any axis turns, by its drive's own word. A drive that does not answer has no part in it:
    /// what this gateway has set in motion is under a lease, or is being stopped.
    pub async fn turning(&self, by: Commander) -> bool {
        for (id, _) in self.iter() {
            let turns = match self.status(id, by, Duration::ZERO).await {
                Ok(Snapshot::Edb(snapshot)) => edb::turns(&snapshot),
                Ok(Snapshot::Pid(view)) => pid::turns(&view),
                Ok(Snapshot::Cia402(view)) => cia402::turns(&view),
                Err(_) => false,
            };
            if turns {
                return true;
            }
        }
        false
    }

    /// Reads a parameter.
    pub async fn parameter(&self, id: u8, by: Commander, parameter: Parameter) -> Result<u16, AxisError> {
        let axis = self.get(id)?;
        axis.edb(NO_PARAMETERS)?;
        self.link(axis, by).read(parameter.address(), Class::Free).await
    }

    /// Writes a parameter: one request, sent once.
    pub async fn set_parameter(
        &self,
        id: u8,
        by: Commander,
        parameter: Parameter,
        value: u16,
    ) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let edb = axis.edb(NO_PARAMETERS)?;
        let permit = self.desk.permit(clock::now(), id, by.holder)?;
        if parameter.address() == edb.spec.registers.jog_speed {
            // A running jog changes its speed with it.
            edb.forget();
        }
        self.link(axis, by).write(parameter.address(), value, Class::Guarded(permit)).await
    }

    /// The number of the present alarm, 0 for none.
    pub async fn alarm(&self, id: u8, by: Commander) -> Result<u16, AxisError> {
        let axis = self.get(id)?;
        let edb = axis.edb("only an EDB drive numbers its alarms; the status of others tells faults")?;
        self.link(axis, by).read(edb.spec.registers.alarm, Class::Free).await
    }

    /// Clears the alarm, or acknowledges the fault, and forgets the latched event. The servo is switched off first, so
    /// that the axis stays at rest until it is enabled again.
    pub async fn clear(&self, id: u8, by: Commander) -> Result<(), AxisError> {
        let axis = self.get(id)?;
        let permit = self.desk.permit(clock::now(), id, by.holder)?;
        let _turn = axis.turn.lock().await;
        match &axis.drive {
            Drive::Edb(edb) => edb.clear(&self.link(axis, by), permit).await?,
            Drive::Pid(spec) => self.module(id, axis.bus, *spec).off(Some(permit)).await?,
            Drive::Cia402(drive) => self.servo(id, axis.bus, drive).clear(permit).await?,
        }
        self.desk.release(permit);
        self.desk.clear_event(id);
        Ok(())
    }
}
