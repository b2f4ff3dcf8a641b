//! Pseudo terminals and serial devices.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read};
use std::os::fd::AsFd;
use std::os::unix::fs::{OpenOptionsExt, symlink};

use puente_line::{Parity, Settings};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};

use super::{Received, received};

/// A pseudo terminal with a symbolic link to its far side.
pub(super) struct Pty {
    /// The cell's side.
    pub master: File,
    pub link: String,
    /// Kept open, so that the cell reads no error while nobody else has the far side open.
    _far: File,
}

/// What begins a packet: data follow, or the far side has dropped what it had written (`TIOCPKT_FLUSHWRITE`).
const DATA: u8 = 0;
const DROPPED: u8 = 2;

impl Pty {
    /// Makes a pseudo terminal in raw mode. A symbolic link that `link` already is gets replaced.
    pub fn open(link: &str) -> io::Result<Self> {
        // Not inherited by a program that is started later, which would keep it open.
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?;
        let path = name.to_string_lossy();
        let far = open_terminal(&path)?;
        set_raw(&far, None)?;
        fcntl_setfl(&master, fcntl_getfl(&master)? | OFlags::NONBLOCK)?;
        packets(&master)?;
        match fs::symlink_metadata(link) {
            Ok(found) if found.is_symlink() => fs::remove_file(link)?,
            Ok(_) => return Err(io::Error::new(ErrorKind::AlreadyExists, "a file of this name exists")),
            Err(_) => {}
        }
        symlink(path.as_ref(), link)?;
        Ok(Self { master: master.into(), link: link.to_owned(), _far: far })
    }

    /// What has come.
    pub fn receive(&mut self, buffer: &mut Vec<u8>) -> io::Result<Received> {
        let mut packet = [0; 4_096];
        let count = match received(self.master.read(&mut packet), "pseudo terminal")? {
            0 => return Ok(Received::Nothing),
            count => count,
        };
        match packet.get(..count) {
            Some([DATA, bytes @ ..]) => buffer.extend_from_slice(bytes),
            Some([change, ..]) if change & DROPPED != 0 => return Ok(Received::Discard),
            _ => {}
        }
        Ok(Received::Bytes)
    }
}

/// From now on each reading of a pseudo terminal's near side begins with a byte that says what it is.
fn packets(master: impl AsFd) -> io::Result<()> {
    const TIOCPKT: rustix::ioctl::Opcode = 0x5420;
    // SAFETY: TIOCPKT reads an int, which this is.
    #[allow(unsafe_code, reason = "rustix has no function for it")]
    unsafe {
        rustix::ioctl::ioctl(master, rustix::ioctl::Setter::<TIOCPKT, i32>::new(1))?;
    }
    Ok(())
}

/// Opens a serial device in raw mode at the line's baud rate and format.
pub(super) fn open_device(path: &str, line: Settings) -> io::Result<File> {
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
