//! What the gateway tells of itself.

use core::fmt;

use serde::{Serialize, Serializer};

use super::Gateway;
use crate::clock;
use crate::port;
use crate::port::record::{History, Incident};

/// The gateway, as docs/http.md describes it. What is not known is absent.
pub(super) struct System<'g>(pub &'g Gateway);

#[derive(Serialize)]
struct Facts {
    version: &'static str,
    commit: &'static str,
    board: &'static str,
    uptime_ms: u64,
    reset: Option<&'static str>,
    resets: Option<u32>,
    stack: Option<Stack>,
    free: Free,
    temperature_c: Option<i16>,
    last_panic: Option<Ended>,
    last_watchdog: Option<Ended>,
}

#[derive(Serialize)]
struct Stack {
    size: usize,
    used: usize,
}

/// Buffers that nobody uses now.
#[derive(Serialize)]
struct Free {
    requests: usize,
    replies: usize,
    places: usize,
}

/// How the gateway once ended.
#[derive(Serialize)]
struct Ended {
    cause: &'static str,
    text: heapless::String<{ port::record::TEXT }>,
    uptime_ms: u64,
}

impl From<Incident> for Ended {
    fn from(Incident { cause, uptime_ms, text }: Incident) -> Self {
        Self { cause: cause.name(), text, uptime_ms }
    }
}

impl System<'_> {
    fn facts(&self) -> Facts {
        let Self(gateway) = self;
        let (used, all) = gateway.desk.tickets();
        let (mut reset, mut last_panic, mut last_watchdog) = (None, None, None);
        if let Some(History { cause, resets, crash, watchdog }) = port::history() {
            reset = Some((cause.name(), resets));
            (last_panic, last_watchdog) = (crash.map(Ended::from), watchdog.map(Ended::from));
        }
        Facts {
            version: env!("CARGO_PKG_VERSION"),
            commit: env!("PUENTE_COMMIT"),
            board: port::NAME,
            uptime_ms: clock::now().as_micros() / 1000,
            reset: reset.map(|(cause, _)| cause),
            resets: reset.map(|(_, resets)| resets),
            stack: port::stack().map(|port::Stack { size, used }| Stack { size, used }),
            free: Free {
                requests: all - used,
                replies: gateway.sheets.free(),
                places: gateway.idle_places(),
            },
            temperature_c: port::temperature(),
            last_panic,
            last_watchdog,
        }
    }
}

impl Serialize for System<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.facts().serialize(serializer)
    }
}

/// In the manner of the console.
impl fmt::Display for System<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let facts = self.facts();
        write!(f, "version={} commit={} board={}", facts.version, facts.commit, facts.board)?;
        write!(f, " uptime_ms={}", facts.uptime_ms)?;
        if let (Some(reset), Some(resets)) = (facts.reset, facts.resets) {
            write!(f, " reset={reset} resets={resets}")?;
        }
        if let Some(Stack { size, used }) = facts.stack {
            write!(f, " stack={size} stack_used={used}")?;
        }
        let Free { requests, replies, places } = facts.free;
        write!(f, " free_requests={requests} free_replies={replies} free_places={places}")?;
        if let Some(celsius) = facts.temperature_c {
            write!(f, " temperature_c={celsius}")?;
        }
        for (key, ended) in [("last_panic", facts.last_panic), ("last_watchdog", facts.last_watchdog)] {
            if let Some(Ended { text, uptime_ms, .. }) = ended {
                write!(f, " {key}_uptime_ms={uptime_ms} {key}=\"{text}\"")?;
            }
        }
        Ok(())
    }
}
