//! Sockets to requests, replies to sockets. One listener; the first bytes decide the dialect.

mod can;
mod console;
mod dictionary;
mod framed;
mod http;
mod inbox;
mod lines;
mod modbus_ascii;
mod modbus_tcp;
mod objects;
mod sniff;
mod system;

use core::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

use embassy_time::with_timeout;
use embedded_io_async::Write;
use puente_line::Instant;

use crate::axis::{Axes, Commander};
use crate::clock;
use crate::desk::{Desk, Holder};
use crate::port::{Door, Listener, Peer, Socket};
use crate::settings::Settings;
use crate::settings::keeper::Keeper;
use inbox::Inbox;
use sniff::Dialect;

/// A new client must say its first bytes within this time.
const FIRST_BYTES: embassy_time::Duration = embassy_time::Duration::from_secs(10);
/// A client over the limit may stay this long, to stop an axis,
const STOP_VISIT: embassy_time::Duration = embassy_time::Duration::from_secs(2);
/// and must say its first bytes within this time: others may wait behind it for the same.
const STOP_FIRST_BYTES: embassy_time::Duration = embassy_time::Duration::from_secs(1);
/// A client that does not take its replies for so long is dropped.
const SLOW_READER: embassy_time::Duration = embassy_time::Duration::from_secs(5);

/// What every connection works with.
pub struct Gateway {
    /// The settings in force.
    pub settings: &'static Settings,
    /// The desk.
    pub desk: &'static Desk,
    /// The axes.
    pub axes: Axes,
    /// Who changes the settings.
    pub keeper: &'static Keeper,
    /// When the gateway started.
    pub started: Instant,
    dictionaries: dictionary::Dictionaries,
    sheets: http::Sheets,
    clients: AtomicUsize,
    connections: AtomicU32,
    idle_places: AtomicUsize,
}

impl Gateway {
    /// A gateway with these settings, and with the axes that they name. Call it once.
    pub fn new(
        settings: &'static Settings,
        desk: &'static Desk,
        axes: Axes,
        keeper: &'static Keeper,
    ) -> Self {
        Self {
            settings,
            desk,
            axes,
            keeper,
            started: clock::now(),
            dictionaries: dictionary::Dictionaries::new(),
            sheets: http::Sheets::new(),
            clients: AtomicUsize::new(0),
            connections: AtomicU32::new(0),
            idle_places: AtomicUsize::new(0),
        }
    }

    /// Connections open now, and accepted since the start.
    pub fn clients(&self) -> (usize, u32) {
        (self.clients.load(Ordering::Relaxed), self.connections.load(Ordering::Relaxed))
    }

    /// Places that wait for a client now.
    fn idle_places(&self) -> usize {
        self.idle_places.load(Ordering::Relaxed)
    }
}

/// One connection.
#[derive(Clone, Copy, Debug)]
pub struct Guest {
    /// Its place, for the fair order of requests.
    pub seat: u8,
    /// Its running number.
    pub connection: u32,
    /// Its address.
    pub peer: Peer,
    /// All places are taken: this one may only stop axes.
    pub stop_only: bool,
}

impl Guest {
    /// The guest as a commander in its own name.
    pub fn commander(&self) -> Commander {
        Commander { seat: self.seat, holder: Holder::Connection(self.connection) }
    }
}

/// Counts a client as long as it is served, and takes its leases back when it is gone, however that comes about.
struct Visit<'g> {
    gateway: &'g Gateway,
    guest: Guest,
}

impl<'g> Visit<'g> {
    /// Who comes when all places are taken is not counted among the clients: it may only stop axes.
    fn new(gateway: &'g Gateway, seat: u8, peer: Peer) -> Self {
        // Never 0, so that a number names a connection for good.
        let connection = gateway.connections.fetch_add(1, Ordering::Relaxed).wrapping_add(1);
        let limit = usize::from(gateway.settings.net.clients);
        let one_more = |clients| (clients < limit).then_some(clients + 1);
        let counted = gateway.clients.fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_more);
        Self { gateway, guest: Guest { seat, connection, peer, stop_only: counted.is_err() } }
    }
}

impl Drop for Visit<'_> {
    fn drop(&mut self) {
        if !self.guest.stop_only {
            self.gateway.clients.fetch_sub(1, Ordering::Relaxed);
        }
        self.gateway.desk.leave(clock::now(), self.guest.connection);
    }
}

/// Serves one place, one client after the other, for ever.
pub async fn serve(gateway: &'static Gateway, seat: u8, listener: &mut impl Listener) -> ! {
    loop {
        gateway.idle_places.fetch_add(1, Ordering::Relaxed);
        let mut socket = listener.accept().await;
        gateway.idle_places.fetch_sub(1, Ordering::Relaxed);
        let visit = Visit::new(gateway, seat, socket.peer());
        let guest = visit.guest;
        log::info!("client {}: {} connected", guest.connection, guest.peer);
        let attended = attend(gateway, guest, &mut socket);
        let end = if guest.stop_only {
            with_timeout(STOP_VISIT, attended).await.unwrap_or(End::Idle)
        } else {
            attended.await
        };
        drop(visit);
        log::info!("client {}: {}", guest.connection, end.text());
        match end {
            End::Closed | End::Idle | End::Refused => socket.close().await,
            End::Broken | End::Slow => socket.abort(),
            End::Restart => {
                socket.close().await;
                gateway.keeper.answered();
            }
        }
    }
}

/// How a visit ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    /// The client closed, and has all its replies.
    Closed,
    /// The connection broke.
    Broken,
    /// The client said nothing for too long.
    Idle,
    /// The client did not take its replies.
    Slow,
    /// What it said cannot be understood, nor where it ends.
    Refused,
    /// The gateway is about to start anew, and the client knows.
    Restart,
}

impl End {
    const fn text(self) -> &'static str {
        match self {
            End::Closed => "closed",
            End::Broken => "connection broken",
            End::Idle => "let go, idle",
            End::Slow => "dropped, takes no replies",
            End::Refused => "refused, not understood",
            End::Restart => "has changed the settings",
        }
    }
}

async fn attend<S: Socket>(gateway: &'static Gateway, guest: Guest, socket: &mut S) -> End {
    let door = socket.door();
    let first_bytes = if guest.stop_only { STOP_FIRST_BYTES } else { FIRST_BYTES };
    let (reader, mut writer) = socket.split();
    let mut inbox = Inbox::new(reader, gateway.desk, guest.connection);
    let dialect = match door {
        Door::Modbus => Ok(Dialect::ModbusTcp),
        Door::Slcan => return can::slcan::serve(gateway, guest, &mut inbox, &mut writer).await,
        Door::Socketcand => return can::socketcand::serve(gateway, guest, &mut inbox, &mut writer).await,
        Door::Main => match with_timeout(first_bytes, listen(&mut inbox)).await {
            Ok(dialect) => dialect,
            Err(_) => Err(End::Idle),
        },
    };
    match dialect {
        Ok(Dialect::ModbusTcp) => modbus_tcp::serve(gateway, guest, &mut inbox, &mut writer).await,
        Ok(Dialect::Framed) => framed::serve(gateway, guest, &mut inbox, &mut writer).await,
        Ok(Dialect::Lines) => lines::serve(gateway, guest, &mut inbox, &mut writer).await,
        Ok(Dialect::Http) => http::serve(gateway, guest, &mut inbox, &mut writer).await,
        Ok(Dialect::Unknown) => {
            let text = b"error unknown-dialect expected HTTP, Modbus/TCP, a Modbus ASCII frame, a frame of the framed bus or a command; try 'help'\r\n";
            match send(&mut writer, text).await {
                Ok(()) => End::Refused,
                Err(end) => end,
            }
        }
        Err(end) => end,
    }
}

/// Reads until the first bytes tell the dialect.
async fn listen<R: embedded_io_async::Read>(inbox: &mut Inbox<'_, R>) -> Result<Dialect, End> {
    loop {
        if let Some(dialect) = sniff::sniff(inbox.data()) {
            return Ok(dialect);
        }
        inbox.fill().await?;
        if inbox.ended() {
            // What is there is all there will be.
            return sniff::sniff_whole(inbox.data()).ok_or(End::Closed);
        }
    }
}

/// Hands all of it to the network, where the client takes it; does not wait until the client has acknowledged it.
async fn send<W: Write>(writer: &mut W, bytes: &[u8]) -> Result<(), End> {
    match with_timeout(SLOW_READER, writer.write_all(bytes)).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) => Err(End::Broken),
        Err(_) => Err(End::Slow),
    }
}

/// How long a client may say nothing.
fn idle(gateway: &Gateway) -> embassy_time::Duration {
    embassy_time::Duration::from_secs(u64::from(gateway.settings.net.idle_s))
}
