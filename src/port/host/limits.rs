//! Sizes of the host port.

/// Clients that can be served at once.
pub const CLIENTS: usize = 64;
/// The same in words, for messages.
pub const CLIENTS_ALLOWED: &str = "1 to 64 is allowed";
/// Places for clients: some more than clients, for those that come to stop an axis.
pub const SLOTS: usize = CLIENTS + 4;
/// Requests of one client that may be under way at once.
pub const PIPELINE: usize = 16;
/// Requests under way at once, of all clients.
pub const TICKETS: usize = 256;
/// Buses.
pub const BUSES: usize = 8;
/// Modbus buses.
pub const MODBUS: usize = 8;
/// Framed buses.
pub const FRAMED: usize = 8;
/// CANopen buses.
pub const CANOPEN: usize = 8;
/// Nodes of a CANopen bus that are booted and watched.
pub const MEMBERS: usize = 127;
/// Those of them that are drives.
pub const DRIVES: usize = AXES;
/// Nodes of a CANopen bus with which there is an SDO transfer at once.
pub const CHANNELS: usize = 127;
/// SDO transfers of clients under way at once, on all CANopen buses.
pub const TRANSFERS: usize = 64;
/// Bytes that an SDO transfer writes at most, and that are kept of one that reads, for a client that is slow.
pub const SDO_DATA: usize = 1024;
/// Frames and events of a CANopen bus that are kept for clients; a power of two.
pub const CAN_HEARD: usize = 256;
/// Nodes of which the settings say something, of all CANopen buses.
pub const NODES: usize = 64;
/// Values that the settings have written to a node.
pub const WRITES: usize = 16;
/// Longest frame on a framed bus, in bytes.
pub const FRAME: usize = puente_framed::frame::MAX_FRAME;
/// Modules of a framed bus that tell events at once.
pub const PEERS: usize = AXES;
/// Frames outstanding to one station of a framed bus.
pub const WINDOW: usize = puente_framed::window::MAX_WINDOW;
/// Axes.
pub const AXES: usize = 32;
/// Bytes that a client may send ahead: the longest head of an HTTP request.
pub const INBOX: usize = 8192;
/// HTTP replies that can be written at once.
pub const SHEETS: usize = 32;
/// Bytes of recent log lines that are kept.
pub const JOURNAL: usize = 65_536;
/// Longest line of the log, in bytes.
pub const JOURNAL_LINE: usize = 400;
/// Bytes of frames heard on a framed bus that are kept for clients.
pub const HEARD: usize = 16_384;
/// Bytes of what is kept of nodes' data sheets: some hundred objects take 10 KB.
pub const DICTIONARY: usize = 262_144;
/// Nodes of which a data sheet is kept.
pub const DICTIONARIES: usize = 64;
