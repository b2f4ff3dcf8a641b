//! ESTUN EDB servo drives over Modbus RTU or ASCII.
//!
//! Sources, by the confidence they give:
//! - *thesis*: the tables and frames of a working EDB cell: link parameters (table 4.3), the status word (tables 4.5
//!   and 4.6), the JOG speed Pn037 (figure 4.13). High for EDB.
//! - *ProNet*: manuals of the same vendor's ProNet, ProNet Plus and ETS drives, which share the chapter's structure.
//!   High for ProNet, medium for EDB: the table of the EDB manual V2.02 was not available.
//! - *HAL*: a public LinuxCNC driver for ProNet, which quotes manual V1.04. Medium for ProNet, low for EDB.
//!
//! Where only ProNet or HAL speak, the item is called *assumed* for EDB. [`Registers`] carries the addresses that the
//! gateway uses, so that a configuration can correct them for a given drive.
//!
//! A drive answers at most 20 words to one read (function 03h) and takes at most 12 words of data in one write.

mod alarm;
mod effect;
mod monitor;
mod parameter;
pub mod register;
mod status;

pub use alarm::alarm_name;
pub use effect::{Effect, effect};
pub use monitor::{Monitor, position, position_words};
pub use parameter::{BadParameter, Info, Parameter};
pub use register::Registers;
pub use status::Status;

/// Most words that one read (function 03h) may ask for. ProNet; assumed for EDB.
pub const MAX_READ: u16 = 20;

/// Most words of data that one write (function 10h) may carry. Thesis table 4.4 prints "n < 12", ProNet "n <= 12";
/// assumed 12.
pub const MAX_WRITE: u16 = 12;
