//! Modbus requests that clients send straight to a drive: the rules of the axis hold for them too.

use puente_drives::edb::{self, Effect};
use puente_modbus::Exception;
use puente_modbus::request::Request;

use super::{Axes, Commander, Drive};
use crate::clock;
use crate::desk::{Class, Permit};

/// How a raw request is to be handled.
#[derive(Clone, Copy, Debug)]
pub struct Ruling {
    /// Its place in the queue.
    pub class: Class,
    /// Where it starts motion: to be told to [`Axes::raw_ended`].
    pub motion: Option<Permit>,
}

impl Axes {
    /// Judges a raw request to `unit` of `bus`; 0 is a broadcast. Refused with exception 06 where another client holds
    /// the lease, and with 01 where it would move all axes at once, which no lease covers.
    pub fn judge(
        &self,
        by: Commander,
        bus: u8,
        unit: u8,
        request: &Request<'_>,
    ) -> Result<Ruling, Exception> {
        let mut ruling = Ruling { class: Class::Free, motion: None };
        for (id, drive) in self.addressed(bus, unit) {
            let now = clock::now();
            let busy = |_| Exception::ServerDeviceBusy;
            let effect = edb::effect(&drive.spec.registers, request);
            match effect {
                Effect::Read => {}
                Effect::Stop => {
                    self.desk.revoke_permits(now, id, by.holder);
                    ruling.class = Class::Stop;
                }
                Effect::Motion if unit == 0 => return Err(Exception::IllegalFunction),
                Effect::Motion => {
                    let permit = self.desk.lease(now, id, by.holder, None).map_err(busy)?;
                    ruling = Ruling { class: Class::Motion(permit), motion: Some(permit) };
                }
                Effect::Write => {
                    let permit = self.desk.permit(now, id, by.holder).map_err(busy)?;
                    ruling.class = Class::Guarded(permit);
                }
            }
            if effect != Effect::Read {
                drive.forget();
            }
        }
        Ok(ruling)
    }

    /// A raw request that starts motion has been sent, with or without a reply.
    pub fn raw_ended(&self, ruling: &Ruling, sent: bool) {
        match ruling.motion {
            Some(permit) if sent => {
                self.desk.moving(clock::now(), permit);
            }
            Some(permit) => self.desk.unlease(permit),
            None => {}
        }
    }

    fn addressed(&self, bus: u8, unit: u8) -> impl Iterator<Item = (u8, &super::edb::Drive)> {
        self.iter().filter_map(move |(id, axis)| match &axis.drive {
            Drive::Edb(edb) if axis.bus == bus && (unit == 0 || axis.address == unit) => Some((id, edb)),
            _ => None,
        })
    }
}
