//! Pseudo terminals and serial devices.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::fd::AsFd;
use std::os::unix::fs::{OpenOptionsExt, symlink};

use puente_line::{Parity, Settings};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};

/// A pseudo terminal with a symbolic link to its far side.
pub struct Pty {
    /// The cell's side.
    pub master: File,
    /// Kept open, so that the cell reads no error while nobody else has the far side open.
    _far: File,
}

impl Pty {
    /// Makes a pseudo terminal in raw mode. A symbolic link that `link` already is gets replaced.
    pub fn open(link: &str) -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?;
        let path = name.to_string_lossy();
        let far = open_terminal(&path)?;
        set_raw(&far, None)?;
        fcntl_setfl(&master, fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        match fs::symlink_metadata(link) {
            Ok(found) if found.is_symlink() => fs::remove_file(link)?,
            Ok(_) => return Err(io::Error::new(ErrorKind::AlreadyExists, "a file of this name exists")),
            Err(_) => {}
        }
        symlink(path.as_ref(), link)?;
        Ok(Self { master: master.into(), _far: far })
    }
}

/// Opens a serial device in raw mode at the line's baud rate and format.
pub fn open_device(path: &str, line: Settings) -> io::Result<File> {
    let device = open_terminal(path)?;
    set_raw(&device, Some(line))?;
    Ok(device)
}

fn open_terminal(path: &str) -> io::Result<File> {
    let flags = OFlags::NOCTTY | OFlags::NONBLOCK;
    OpenOptions::new().read(true).write(true).custom_flags(flags.bits() as i32).open(path)
}

fn set_raw(terminal: impl AsFd, line: Option<Settings>) -> io::Result<()> {
    let mut termios = tcgetattr(&terminal)?;
    termios.make_raw();
    if let Some(line) = line {
        let modes = &mut termios.control_modes;
        modes.remove(ControlModes::CSIZE | ControlModes::CRTSCTS);
        modes.insert(if line.format.data_bits == 7 { ControlModes::CS7 } else { ControlModes::CS8 });
        modes.set(ControlModes::PARENB, line.format.parity != Parity::None);
        modes.set(ControlModes::PARODD, line.format.parity == Parity::Odd);
        modes.set(ControlModes::CSTOPB, line.format.stop_bits == 2);
        modes.insert(ControlModes::CLOCAL | ControlModes::CREAD);
        termios.set_speed(line.baud)?;
    }
    Ok(tcsetattr(&terminal, OptionalActions::Now, &termios)?)
}
