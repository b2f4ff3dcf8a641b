//! Runs puente's firmware on QEMU's mps2-an500: its first RS-485 line ends at a TCP port, its network is reached through
//! forwarded ports of this machine. docs/boards.md says what the emulated board does not model.
#![deny(missing_docs)]

mod monitor;

use std::io::{BufRead, BufReader, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use monitor::Monitor;

/// The program, which is also the name of its Debian package.
pub const QEMU: &str = "qemu-system-arm";

/// How long the firmware may take until it answers, on a slow and busy machine.
const START: Duration = Duration::from_secs(60);
/// After this time a firmware is asked all the same that tells no address.
const SILENCE: Duration = Duration::from_secs(3);
/// How often other ports are tried where somebody else was faster.
const ATTEMPTS: usize = 5;

/// How the firmware's log says that it has an address.
pub const ADDRESSED: &str = "INFO ] network: ";

/// Where the firmware looks whether the user button is held at start: 1 where it is.
pub const BUTTON: u32 = 0x203F_F000;
/// Where the firmware of a PID interface module looks whether its amplifier has a fault: 1 where it has one;
pub const AMPLIFIER_FAULT: u32 = 0x203F_F004;
/// and at the switch for its address, 0 to 15.
pub const SWITCH: u32 = 0x203F_F008;
/// The baud rate of its bus, and the gap and the slot in characters, where they are not 0.
pub const BUS: [u32; 3] = [0x203F_F00C, 0x203F_F010, 0x203F_F014];

/// The board of the gateway: Cortex-M7 and Ethernet.
pub const GATEWAY: &str = "mps2-an500";
/// The board of a PID interface module: Cortex-M4.
pub const AXIS_MODULE: &str = "mps2-an386";

/// What is connected to the board.
#[derive(Clone)]
pub struct Setup {
    /// The board, [`GATEWAY`] or [`AXIS_MODULE`].
    pub machine: &'static str,
    /// The firmware, an ELF file.
    pub image: PathBuf,
    /// Where raw bytes of RS-485 a and b are taken and given.
    pub lines: [Option<SocketAddr>; 2],
    /// Where an SLCAN adapter is for CAN 1 and 2.
    pub cans: [Option<SocketAddr>; 2],
    /// The ports of this machine that lead to the firmware's ports 80 and 502; 0 for any free one.
    pub ports: [u16; 2],
    /// Who else is on the Ethernet: a listener that QEMU connects to. Each frame comes and goes without its FCS, after
    /// its length as 4 bytes, the most significant first.
    pub ethernet: Option<SocketAddr>,
    /// QEMU's own network is there, with its DHCP server and the forwarded ports. Without it nobody but `ethernet` can
    /// tell when the firmware answers.
    pub user_network: bool,
    /// Words of the board's memory at every start: [`BUTTON`] and those that follow it.
    pub words: Vec<(u32, u32)>,
    /// A plugin of QEMU with its options, as QEMU takes it.
    pub plugin: Option<String>,
}

impl Setup {
    /// `image` with a device on RS-485 a, on free ports.
    pub fn new(image: impl Into<PathBuf>, line: SocketAddr) -> Self {
        Self {
            machine: GATEWAY,
            image: image.into(),
            lines: [Some(line), None],
            cans: [None, None],
            ports: [0, 0],
            ethernet: None,
            user_network: true,
            words: Vec::new(),
            plugin: None,
        }
    }
}

/// A running board. It ends with this value, and with the thread that started it.
pub struct Emulator {
    child: Child,
    /// The firmware has told its address.
    addressed: Arc<AtomicBool>,
    monitor: Monitor,
    /// Where this machine reaches the firmware's port of every dialect.
    pub main: SocketAddr,
    /// Where it reaches the firmware's port of Modbus/TCP alone.
    pub modbus: SocketAddr,
    /// Where it reaches the echo of a firmware that is built for tests.
    pub echo: SocketAddr,
}

impl Emulator {
    /// Starts the board, and returns when the firmware answers, where it can. `log` is called with each line of the
    /// firmware's log, from another thread.
    ///
    /// The error is a sentence.
    pub fn start(setup: &Setup, log: impl Fn(&str) + Send + Sync + 'static) -> Result<Self, String> {
        let log = Arc::new(log);
        let mut attempt = 1;
        loop {
            let ports = free(setup.ports)?;
            let mut board = launch(setup, ports, log.clone())?;
            if !setup.user_network {
                return Ok(board);
            }
            match board.answers() {
                Ok(()) => return Ok(board),
                // A port that was free is not any more.
                Err(Silent::Ended(_)) if setup.ports.contains(&0) && attempt < ATTEMPTS => attempt += 1,
                Err(Silent::Ended(status)) => return Err(format!("{QEMU} ended with {status}")),
                Err(Silent::Late) => return Err(format!("the firmware did not answer within {START:?}")),
            }
        }
    }

    /// Gives QEMU a command of its monitor, such as `set_link lan9118.0 off`, and returns what it says.
    ///
    /// The error is a sentence.
    pub fn monitor(&mut self, command: &str) -> Result<String, String> {
        self.monitor.ask(command).map_err(|error| format!("{QEMU}, {command}: {error}"))
    }

    /// The process that QEMU is.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether QEMU has ended by itself.
    pub fn ended(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    /// Waits until QEMU ends.
    pub fn wait(&mut self) -> std::io::Result<ExitStatus> {
        self.child.wait()
    }

    /// QEMU takes connections before the firmware does: only an answer tells that it is there. What QEMU could not pass
    /// on to it is repeated after seconds only, so that nothing is asked before the firmware has told its address.
    fn answers(&mut self) -> Result<(), Silent> {
        let start = Instant::now();
        while start.elapsed() < START {
            if let Some(status) = self.ended() {
                return Err(Silent::Ended(status));
            }
            if (self.addressed.load(Ordering::Relaxed) || start.elapsed() > SILENCE) && answers(self.main) {
                return Ok(());
            }
            thread::sleep(Duration::from_millis(5));
        }
        Err(Silent::Late)
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Why there is no answer.
enum Silent {
    Ended(ExitStatus),
    Late,
}

/// Ends a program together with the thread that starts it, however that comes to its end.
pub fn tie(command: &mut Command) -> &mut Command {
    let tie = || {
        rustix::process::set_parent_process_death_signal(Some(rustix::process::Signal::TERM))?;
        Ok(())
    };
    // SAFETY: between fork and exec there is one system call, and nothing that allocates or locks.
    unsafe { command.pre_exec(tie) }
}

/// The ports of this machine, chosen by the system where they are 0, and one more.
fn free([main, modbus]: [u16; 2]) -> Result<[SocketAddr; 3], String> {
    // Held together, lest the second be the first again.
    let bind = |port| {
        TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(|error| format!("port {port}: {error}"))
    };
    let held = [bind(main)?, bind(modbus)?, bind(0)?];
    let address = |held: &TcpListener| held.local_addr().map_err(|error| error.to_string());
    Ok([address(&held[0])?, address(&held[1])?, address(&held[2])?])
}

fn launch(
    setup: &Setup,
    [main, modbus, echo]: [SocketAddr; 3],
    log: Arc<impl Fn(&str) + Send + Sync + 'static>,
) -> Result<Emulator, String> {
    let mut qemu = Command::new(QEMU);
    qemu.args(["-machine", setup.machine, "-display", "none", "-monitor", "none", "-qmp", "stdio"]);
    let mut hosts = Vec::new();
    if setup.user_network {
        let ports = [(main, 80), (modbus, 502), (echo, 7)];
        let forwarded = ports.map(|(here, there)| format!(",hostfwd=tcp:{here}-:{there}")).concat();
        hosts.push(("user", format!("user,id=user,restrict=on{forwarded}")));
    }
    if let Some(peer) = setup.ethernet {
        hosts.push(("peer", format!("socket,id=peer,connect={peer}")));
    }
    for (name, host) in hosts {
        let port = format!("hubport,id=hub-{name},hubid=0,netdev={name}");
        qemu.arg("-netdev").arg(host).arg("-netdev").arg(port);
    }
    qemu.args(["-netdev", "hubport,id=hub,hubid=0", "-net", "nic,model=lan9118,netdev=hub"]);
    // UART0 is of no use here.
    qemu.args(["-serial", "null"]);
    for (name, line) in ["a", "b", "can1", "can2"].iter().zip(setup.lines.into_iter().chain(setup.cans)) {
        let Some(line) = line else {
            qemu.args(["-serial", "null"]);
            continue;
        };
        // Without nodelay a small exchange takes 44 ms instead of 1 ms.
        let device = format!("socket,id={name},host={},port={},nodelay=on", line.ip(), line.port());
        qemu.arg("-chardev").arg(device).arg("-serial").arg(format!("chardev:{name}"));
    }
    for (address, word) in &setup.words {
        qemu.arg("-device").arg(format!("loader,addr={address:#x},data={word},data-len=4"));
    }
    if let Some(plugin) = &setup.plugin {
        qemu.arg("-plugin").arg(plugin);
    }
    qemu.args(["-semihosting-config", "enable=on,target=native"]).arg("-kernel").arg(&setup.image);
    qemu.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = tie(&mut qemu).spawn().map_err(|error| format!("{QEMU}: {error}"))?;
    let addressed = Arc::new(AtomicBool::new(false));
    if let Some(stderr) = child.stderr.take() {
        let addressed = addressed.clone();
        thread::spawn(move || {
            for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                addressed.fetch_or(line.contains(ADDRESSED), Ordering::Relaxed);
                log(&line);
            }
        });
    }
    let monitor = Monitor::new(child.stdin.take(), child.stdout.take());
    Ok(Emulator { child, addressed, monitor, main, modbus, echo })
}

/// Whether a console command is answered.
fn answers(main: SocketAddr) -> bool {
    let ask = || {
        let mut stream = TcpStream::connect(main)?;
        stream.set_read_timeout(Some(Duration::from_millis(500)))?;
        stream.write_all(b"feed\r\n")?;
        stream.shutdown(Shutdown::Write)?;
        let mut reply = Vec::new();
        // To the end: nobody is to find a client that is about to go.
        stream.read_to_end(&mut reply)?;
        if reply.starts_with(b"ok") { Ok(()) } else { Err(std::io::Error::from(ErrorKind::InvalidData)) }
    };
    ask().is_ok()
}
