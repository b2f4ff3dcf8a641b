//! The last values of the axes.

use embedded_io_async::Write;
use puente_drives::edb::Monitor;
use puente_drives::pid::State;
use puente_line::Instant;
use puente_modules::Report;
use puente_servos as servos;

use super::super::super::{End, Gateway};
use super::super::reply::Reply;
use super::super::view;
use super::{Seconds, family};
use crate::axis::{Known, cia402, pid};
use crate::clock;

type Gauge = (&'static str, &'static str, fn(&Known) -> Option<i64>);

/// The last values of an axis.
const AXIS: [Gauge; 12] = [
    ("puente_axis_speed_rpm", "Speed feedback.", |known| Some(monitor(known)?.speed_feedback.into())),
    ("puente_axis_torque_percent", "Internal torque reference, of rated torque.", |known| {
        Some(monitor(known)?.internal_torque_reference.into())
    }),
    ("puente_axis_position_pulses", "Present position.", |known| Some(monitor(known)?.position.into())),
    ("puente_axis_alarm", "Number of the present alarm, 0 for none.", |known| {
        Some(monitor(known)?.alarm.into())
    }),
    ("puente_axis_jog_rpm", "Commanded jog.", |known| match known {
        Known::Edb(known) => view::jog_rpm(known.jog).map(i64::from),
        Known::Pid(_) | Known::Cia402(_) => None,
    }),
    ("puente_axis_position_counts", "Present position.", |known| Some(report(known)?.position.into())),
    ("puente_axis_following_error_counts", "Reference less position.", |known| {
        Some(report(known)?.following_error.into())
    }),
    ("puente_axis_velocity_counts", "Velocity, a second.", |known| Some(report(known)?.velocity as i64)),
    ("puente_axis_position_units", "Present position, in the drive's position units.", |known| {
        Some(servo(known)?.position?.into())
    }),
    ("puente_axis_velocity_units", "Present velocity, in the drive's velocity units.", |known| {
        Some(servo(known)?.velocity?.into())
    }),
    ("puente_axis_fault", "1 while the module or the drive is in a fault.", |known| {
        let fault = match known {
            Known::Cia402(_) => cia402::faulted(servo(known)?.state()?),
            _ => matches!(report(known)?.state, State::Fault(_)),
        };
        Some(fault.into())
    }),
    (
        "puente_axis_enabled",
        "1 where the servo is enabled, through the gateway or by its own word.",
        |known| {
            match known {
                Known::Edb(known) => known.enabled,
                Known::Pid(_) => report(known).map(|report| pid::enabled(report.state)),
                Known::Cia402(_) => servo(known).and_then(|report| report.state()).map(cia402::powered),
            }
            .map(i64::from)
        },
    ),
];

fn monitor(known: &Known) -> Option<Monitor> {
    match known {
        Known::Edb(known) => known.snapshot.map(|snapshot| snapshot.monitor),
        Known::Pid(_) | Known::Cia402(_) => None,
    }
}

fn report(known: &Known) -> Option<Report> {
    match known {
        Known::Pid(view) => view.module().map(|(_, report)| report),
        Known::Edb(_) | Known::Cia402(_) => None,
    }
}

fn servo(known: &Known) -> Option<servos::Report> {
    match known {
        Known::Cia402(view) => view.servo().map(|(_, report)| report),
        Known::Edb(_) | Known::Pid(_) => None,
    }
}

/// When the last values came.
fn read_at(known: &Known) -> Option<Instant> {
    match known {
        Known::Edb(known) => known.snapshot.map(|snapshot| snapshot.at),
        Known::Pid(view) | Known::Cia402(view) => view.input.map(|input| input.at),
    }
}

/// Sends what is known of the axes.
pub(super) async fn send<W: Write>(gateway: &Gateway, reply: &mut Reply<'_, W>) -> Result<(), End> {
    for (name, help, value) in AXIS {
        family(reply, name, "gauge", help).await?;
        for (id, axis) in gateway.axes.iter() {
            if let Some(value) = gateway.axes.known(id).ok().and_then(|known| value(&known)) {
                reply.put(format_args!("{name}{{axis=\"{}\"}} {value}\n", axis.name)).await?;
            }
        }
    }
    family(reply, "puente_axis_age_seconds", "gauge", "Age of the values of the drive.").await?;
    for (id, axis) in gateway.axes.iter() {
        if let Some(at) = gateway.axes.known(id).ok().and_then(|known| read_at(&known)) {
            let age = Seconds::of(clock::now().since(at));
            reply.put(format_args!("puente_axis_age_seconds{{axis=\"{}\"}} {age}\n", axis.name)).await?;
        }
    }
    family(reply, "puente_axis_leased", "gauge", "1 while a client commands the axis.").await?;
    for (id, axis) in gateway.axes.iter() {
        let leased = u8::from(gateway.axes.leased(id).is_some());
        reply.put(format_args!("puente_axis_leased{{axis=\"{}\"}} {leased}\n", axis.name)).await?;
    }
    Ok(())
}
