//! The status lamps of the gateway on a bus, as text.

use core::fmt::Write as _;

use embassy_futures::select::{Either, select};
use embedded_io_async::{Read, Write};
use heapless::String;
use puente_canopen::manager::Health;
use puente_cia309::leds::{Lamp, Leds};
use puente_line::Duration;

use super::super::inbox::Inbox;
use super::super::{End, idle, send};
use super::Client;
use crate::clock;
use crate::port::CanState;

/// The states behind the lamps are looked at so often.
const LOOK: Duration = Duration::from_millis(200);

impl Client<'_> {
    /// Shows the lamps whenever they change, until the client says something else.
    pub(super) async fn led<R: Read, W: Write>(
        &self,
        inbox: &mut Inbox<'_, R>,
        writer: &mut W,
        bus: u8,
    ) -> Result<(), End> {
        let begun = clock::now();
        let patience = Duration::from_micros(idle(self.gateway).as_micros());
        let mut shown = None;
        while inbox.data().is_empty() && !inbox.ended() {
            let now = clock::now();
            let since = now.since(begun);
            if since >= patience {
                return Err(End::Idle);
            }
            let (red, changes) = self.red(bus).at(since.as_millis() as u32);
            // The manager is operational as long as it is there.
            let leds = Leds { red, green: true };
            if shown != Some(leds) {
                let mut line = String::<64>::new();
                let _ = write!(line, "{leds}");
                send(writer, line.as_bytes()).await?;
                shown = Some(leds);
            }
            let changes = changes.map_or(LOOK, |ms| Duration::from_millis(ms.into()).min(LOOK));
            match select(inbox.fill(), clock::at(Some(now + changes))).await {
                Either::First(filled) => filled?,
                Either::Second(()) => {}
            }
        }
        send(writer, Leds::BLANK.as_bytes()).await
    }

    /// The red lamp (CiA 303-3): off the bus, a node missing, errors on the bus.
    fn red(&self, bus: u8) -> Lamp {
        match self.gateway.desk.can_statistics(clock::now(), bus).map(|statistics| statistics.state) {
            None | Some(CanState::Off | CanState::Down) => Lamp::On,
            _ if self.gateway.desk.nodes(bus).any(|(_, status)| status.health == Health::Lost) => {
                Lamp::Double
            }
            Some(CanState::Warning | CanState::Passive) => Lamp::Single,
            Some(CanState::Active) => Lamp::Off,
        }
    }
}
