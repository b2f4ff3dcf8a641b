//! What the console tells of an axis and of a bus.

use core::fmt::Write;

use puente_drives::pid::State;
use puente_framed::arbiter;
use puente_line::{Instant, micros, millis};
use puente_servos::Progress;

use super::super::Gateway;
use super::super::lines::Reply;
use super::say;
use crate::axis::edb::{self, Jog};
use crate::axis::{Known, Snapshot, cia402, pid};
use crate::clock;
use crate::desk::{Event, Holder, View};
use crate::settings::{self, Protocol};

/// Values of an axis, who commands it, and how the last commander lost it.
pub(super) fn axis(gateway: &Gateway, id: u8, snapshot: &Snapshot, reply: &mut Reply) {
    let now = clock::now();
    let (lease, event) = (gateway.axes.leased(id), gateway.axes.event(id));
    match snapshot {
        Snapshot::Edb(snapshot) => {
            if let Ok(Known::Edb(known)) = gateway.axes.known(id) {
                edb(now, snapshot, &known, reply);
            }
            lease.inspect(|lease| self::lease(lease, reply));
            event.inspect(|event| self::event(now, event, reply));
        }
        Snapshot::Pid(_) | Snapshot::Cia402(_) => {
            match snapshot {
                Snapshot::Pid(view) => pid(now, view, reply),
                Snapshot::Cia402(view) => cia402(now, view, reply),
                Snapshot::Edb(_) => {}
            }
            match &lease {
                Some(lease) => self::lease(lease, reply),
                None => say(reply, format_args!(" lease=none")),
            }
            match &event {
                Some(event) => self::event(now, event, reply),
                None => say(reply, format_args!(" event=none")),
            }
        }
    }
}

/// The group that is on its way, or the last one: how far it is, and who holds it up.
pub(super) fn group(gateway: &Gateway, reply: &mut Reply) {
    let axes = &gateway.axes;
    let name = |id| axes.get(id).map_or("?", |axis| axis.name.as_str());
    let Some(run) = axes.group() else { return say(reply, format_args!("ok group=none")) };
    say(reply, format_args!("ok group="));
    super::separated(reply, run.axes.iter().map(name));
    match run.failed {
        Some((id, error)) => {
            let stage = run.stage.name();
            say(
                reply,
                format_args!(
                    " stage=failed in={stage} axis={} code={} why=\"{error}\"",
                    name(id),
                    error.code()
                ),
            );
        }
        None => {
            say(reply, format_args!(" stage={}", run.stage.name()));
            if run.goes_on() {
                say(reply, format_args!(" awaits="));
                super::separated(reply, axes.awaited(&run).map(name));
                say(reply, format_args!(" by=\"{}\"", run.by.holder));
            }
        }
    }
}

fn edb(now: Instant, snapshot: &edb::Snapshot, known: &edb::Known, reply: &mut Reply) {
    let edb::Snapshot { at, status, monitor } = snapshot;
    say(reply, format_args!(" status={:04X} flags={status}", status.0));
    match known.enabled {
        Some(enabled) => say(reply, format_args!(" enabled={}", u8::from(enabled))),
        None => say(reply, format_args!(" enabled=?")),
    }
    match known.jog {
        Jog::Still => say(reply, format_args!(" jog_rpm=0")),
        Jog::At(rpm) => say(reply, format_args!(" jog_rpm={rpm}")),
        Jog::Unknown => say(reply, format_args!(" jog_rpm=?")),
    }
    say(
        reply,
        format_args!(
            " speed_rpm={} torque_percent={} position_pulses={} alarm={} age_ms={}",
            monitor.speed_feedback,
            monitor.internal_torque_reference,
            monitor.position,
            monitor.alarm,
            millis(now.since(*at))
        ),
    );
}

fn pid(now: Instant, view: &View, reply: &mut Reply) {
    let (Some((at, report)), Some(set_point)) = (view.module(), pid::set_point(view)) else { return };
    say(reply, format_args!(" state={}", pid::state(report.state)));
    if let State::Fault(cause) = report.state {
        say(reply, format_args!(" fault=\"{cause}\""));
    }
    let permille = pid::permille(&report);
    say(
        reply,
        format_args!(
            " position={} velocity={} set_point={set_point} following_error={} command_percent={}{}.{} age_ms={}",
            report.position,
            report.velocity as i32,
            report.following_error,
            if permille < 0 { "-" } else { "" },
            permille.unsigned_abs() / 10,
            permille.unsigned_abs() % 10,
            millis(now.since(at))
        ),
    );
}

fn cia402(now: Instant, view: &View, reply: &mut Reply) {
    let Some((at, report)) = view.servo() else { return };
    say(reply, format_args!(" node={}", cia402::node(&report.node)));
    if cia402::node(&report.node) == "refused" {
        say(reply, format_args!(" why=\"{}\"", report.node));
    }
    if let Some((status, state)) = report.status.zip(report.state()) {
        say(reply, format_args!(" state={} status={:04X}", cia402::state(state), status.0));
    }
    if let Some(mode) = report.mode {
        say(reply, format_args!(" mode={mode}"));
    }
    if let Some(position) = report.position {
        say(reply, format_args!(" position={position}"));
    }
    if let Some(target) = cia402::target(view) {
        say(reply, format_args!(" set_point={target}"));
    }
    if let Some(velocity) = report.velocity {
        say(reply, format_args!(" velocity={velocity}"));
    }
    say(reply, format_args!(" progress={}", cia402::progress(report.progress)));
    if let Progress::Failed(failure) = report.progress {
        say(reply, format_args!(" failure=\"{failure}\""));
    }
    say(reply, format_args!(" homed={}", u8::from(report.homed)));
    if let Some(fault) = report.fault {
        say(reply, format_args!(" fault={fault:04X}"));
    }
    if let Some(emergency) = report.emergency {
        say(reply, format_args!(" emergency=\"{emergency}\""));
    }
    say(reply, format_args!(" age_ms={}", millis(now.since(at))));
}

fn lease((holder, left): &(Holder, puente_line::Duration), reply: &mut Reply) {
    say(reply, format_args!(" lease=\"{holder}\" lease_ms={}", millis(*left)));
}

fn event(now: Instant, event: &Event, reply: &mut Reply) {
    say(reply, format_args!(" event={} event_age_ms={}", event.cause.name(), millis(now.since(event.at))));
}

/// Settings of a bus, and what was counted on it.
pub(super) fn bus(gateway: &Gateway, bus: u8, reply: &mut Reply) {
    let Some(settings) = gateway.settings.buses.get(usize::from(bus)) else { return };
    let settings::Bus { name, protocol, port, .. } = settings;
    say(reply, format_args!("ok bus={name} protocol={} port={port}", protocol.name()));
    if let Some(line) = settings.line() {
        say(reply, format_args!(" baud={} format={}", line.baud, line.format));
    }
    match protocol {
        Protocol::ModbusRtu(_) | Protocol::ModbusAscii(_) => modbus(gateway, bus, reply),
        Protocol::Framed(framed) => self::framed(gateway, bus, framed, reply),
        Protocol::Canopen(canopen) => self::canopen(gateway, bus, canopen, reply),
    }
}

/// What becomes of frames for a framed line, in a word.
const fn line_state(down: bool, failure: Option<arbiter::Failure>) -> &'static str {
    match failure {
        _ if down => "down",
        None => "up",
        Some(arbiter::Failure::Collisions { .. }) => "collisions",
        Some(arbiter::Failure::LineHeld) => "held",
        Some(arbiter::Failure::NoEcho) => "no-echo",
    }
}

fn framed(gateway: &Gateway, bus: u8, framed: &settings::Framed, reply: &mut Reply) {
    let Some(counted) = gateway.desk.cycles(bus) else { return };
    let line = &counted.line;
    say(
        reply,
        format_args!(
            " station={} line={} cycle_ms={} cycle_us={} longest_us={} cycles={} given_up={} overruns={} missed={}",
            framed.station,
            line_state(gateway.desk.line_down(bus), counted.failure),
            framed.cycle_ms,
            micros(counted.last_cycle),
            micros(counted.longest_cycle),
            counted.cycles,
            counted.failed,
            counted.overruns,
            counted.missed,
        ),
    );
    say(
        reply,
        format_args!(
            " frames={} attempts={} collisions={} deferrals={} losses={} backoff_us={}",
            line.frames,
            line.attempts,
            line.collisions,
            line.deferrals,
            line.losses,
            micros(line.backoff),
        ),
    );
    if gateway.desk.framed_bus() == Some(bus) {
        let packets = gateway.desk.mail_statistics();
        say(
            reply,
            format_args!(
                " packets_sent={} packets_refused={} packets_heard={} packets_lost={}",
                packets.sent, packets.undelivered, packets.heard, packets.lost,
            ),
        );
    }
}

fn canopen(gateway: &Gateway, bus: u8, canopen: &settings::Canopen, reply: &mut Reply) {
    let settings::Canopen { bitrate, node, net, sync_us, .. } = canopen;
    say(reply, format_args!(" bitrate={bitrate} node={node} net={net} sync_us={sync_us}"));
    let Some(counted) = gateway.desk.can_statistics(clock::now(), bus) else { return };
    let (port, manager) = (&counted.port, &counted.manager);
    say(
        reply,
        format_args!(
            " state={} load_permille={} tx_errors={} rx_errors={} bus_offs={} received={} sent={} not_received={} not_sent={}",
            counted.state.name(),
            counted.load_permille,
            port.tx_errors,
            port.rx_errors,
            port.bus_offs,
            counted.received,
            counted.sent,
            port.lost,
            counted.undelivered,
        ),
    );
    say(
        reply,
        format_args!(
            " nodes={} booted={} emergencies={} sync_missed={} sdo={} sdo_aborted={} sdo_timeouts={} waiting={} lost={}",
            gateway.desk.nodes(bus).count(),
            manager.booted,
            manager.emergencies,
            manager.sync_missed,
            manager.sdo.transfers,
            manager.sdo.aborted,
            manager.sdo.timeouts,
            counted.waiting,
            counted.lost,
        ),
    );
}

fn modbus(gateway: &Gateway, bus: u8, reply: &mut Reply) {
    let Some(counted) = gateway.desk.statistics(bus) else { return };
    let mean = counted.latency_sum_us / u64::from(counted.confirmed.max(1));
    let _ = write!(
        reply,
        " requests={} confirmed={} exceptions={} no_reply={} \
         not_sent={} late={} bad_check={} garbage={} echoes={} waiting={} resting={} mean_us={mean}",
        counted.submitted,
        counted.confirmed,
        counted.exceptions,
        counted.no_reply,
        counted.expired + counted.rested + counted.stopped + counted.line_down + counted.queue_full,
        counted.line.late,
        counted.line.check_errors,
        counted.line.garbage_bytes,
        counted.line.echoes,
        counted.waiting,
        counted.resting,
    );
}
