//! Serial devices.

use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;

use puente_line::{Parity, Settings};
use rustix::termios::{self, ControlModes, OptionalActions, SpecialCodeIndex};

/// Opens a serial device or pseudo-terminal: raw, with this baud rate and format, for this process alone.
pub(super) fn open(path: &str, settings: Settings) -> io::Result<File> {
    let nonblocking = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
    let file =
        OpenOptions::new().read(true).write(true).custom_flags(nonblocking.bits() as i32).open(path)?;
    let mut modes = termios::tcgetattr(&file)?;
    modes.make_raw();
    modes.control_modes -= ControlModes::CSIZE
        | ControlModes::PARENB
        | ControlModes::PARODD
        | ControlModes::CSTOPB
        | ControlModes::CRTSCTS;
    modes.control_modes |= ControlModes::CREAD | ControlModes::CLOCAL | control_modes(settings);
    modes.special_codes[SpecialCodeIndex::VMIN] = 1;
    modes.special_codes[SpecialCodeIndex::VTIME] = 0;
    modes.set_speed(settings.baud)?;
    termios::tcsetattr(&file, OptionalActions::Now, &modes)?;
    // A device may ignore what it cannot do without an error. Pseudo-terminals have no parity, and need none.
    let applied = termios::tcgetattr(&file)?;
    let wanted = control_modes(settings);
    if !applied.control_modes.contains(wanted) && !path.starts_with("/dev/pts/") {
        log::warn!("{path}: the device does not take the format {}", settings.format);
    }
    // Not every device knows this; it only keeps others from mixing in.
    let _ = termios::ioctl_tiocexcl(&file);
    termios::tcflush(&file, termios::QueueSelector::IOFlush)?;
    Ok(file)
}

/// Drops what has been written and not been sent.
pub(super) fn discard(file: &impl AsFd) {
    // Where a device cannot do it, it sends what nobody wants any more, which no one on the line can tell from noise.
    let _ = termios::tcflush(file, termios::QueueSelector::OFlush);
}

fn control_modes(settings: Settings) -> ControlModes {
    let mut modes = if settings.format.data_bits == 7 { ControlModes::CS7 } else { ControlModes::CS8 };
    match settings.format.parity {
        Parity::None => {}
        Parity::Even => modes |= ControlModes::PARENB,
        Parity::Odd => modes |= ControlModes::PARENB | ControlModes::PARODD,
    }
    if settings.format.stop_bits == 2 {
        modes |= ControlModes::CSTOPB;
    }
    modes
}
