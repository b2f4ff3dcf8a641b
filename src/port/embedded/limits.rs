//! Sizes of the boards. `cargo xtask size` says what they cost.

/// Clients that can be served at once.
pub const CLIENTS: usize = 16;
/// The same in words, for messages.
pub const CLIENTS_ALLOWED: &str = "1 to 16 is allowed";
/// Places for clients, on both TCP ports together: some more than clients, for those that come to stop an axis, and
/// because a place that a client has just left needs a moment before it listens again.
pub const SLOTS: usize = CLIENTS + 2;
/// Requests of one client that may be under way at once.
pub const PIPELINE: usize = 4;
/// Requests under way at once, of all clients.
pub const TICKETS: usize = 24;
/// Buses: the lines a and b, and CAN 1 and 2.
pub const BUSES: usize = 4;
/// Modbus buses: the lines a and b.
pub const MODBUS: usize = 2;
/// Framed buses: each takes more memory than a Modbus bus.
pub const FRAMED: usize = 1;
/// CANopen buses: CAN 1 and 2.
pub const CANOPEN: usize = 2;
/// Nodes of a CANopen bus that are booted and watched.
pub const MEMBERS: usize = 8;
/// Those of them that are drives.
pub const DRIVES: usize = 4;
/// Nodes of a CANopen bus with which there is an SDO transfer at once; the others wait.
pub const CHANNELS: usize = 2;
/// SDO transfers of clients under way at once, on all CANopen buses.
pub const TRANSFERS: usize = 6;
/// Bytes that an SDO transfer writes at most, and that are kept of one that reads, for a client that is slow.
pub const SDO_DATA: usize = 256;
/// Frames and events of a CANopen bus that are kept for clients; a power of two.
pub const CAN_HEARD: usize = 32;
/// Nodes of which the settings say something, of all CANopen buses.
pub const NODES: usize = 6;
/// Values that the settings have written to a node.
pub const WRITES: usize = 8;
/// Longest frame on a framed bus, in bytes.
pub const FRAME: usize = puente_framed::frame::MAX_FRAME;
/// Modules of a framed bus that tell events at once; the others wait. What matters of events is in the reports, too.
pub const PEERS: usize = 2;
/// Frames outstanding to one station of a framed bus.
pub const WINDOW: usize = 1;
/// Axes.
pub const AXES: usize = 8;
/// Bytes that a client may send ahead: the longest head of an HTTP request.
pub const INBOX: usize = 1024;
/// HTTP replies that can be written at once.
pub const SHEETS: usize = 3;
/// Bytes of recent log lines that are kept.
pub const JOURNAL: usize = 3072;
/// Longest line of the log, in bytes.
pub const JOURNAL_LINE: usize = 160;
/// Bytes of frames heard on a framed bus that are kept for clients: the longest has room.
pub const HEARD: usize = 1540;
/// Bytes of what is kept of nodes' data sheets: some fifty objects.
pub const DICTIONARY: usize = 2048;
/// Nodes of which a data sheet is kept.
pub const DICTIONARIES: usize = 4;
