//! Small clients.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::time::Duration;

use super::{ms, target, until};

/// Longer than anything may take.
const PATIENCE: Duration = Duration::from_secs(20);

pub fn connect(address: SocketAddr) -> TcpStream {
    let stream = target().connect(address).expect("a connection");
    stream.set_nodelay(true).expect("no delay");
    stream.set_read_timeout(Some(PATIENCE)).expect("a timeout");
    stream.set_write_timeout(Some(PATIENCE)).expect("a timeout");
    stream
}

/// Sends everything, closes its side, and gives what comes until the gateway closes too.
pub fn send_and_close(address: SocketAddr, bytes: &[u8]) -> Vec<u8> {
    let mut stream = connect(address);
    stream.write_all(bytes).expect("sent");
    stream.shutdown(Shutdown::Write).expect("closed");
    rest(&mut stream)
}

/// As `send_and_close`, of one who comes again where it is refused: the last places of a board have to be cleared before
/// they are free.
pub fn visit(address: SocketAddr, question: &[u8]) -> Vec<u8> {
    let mut answer = Vec::new();
    until("a visitor is heard", || {
        let mut stream = connect(address);
        let asked = stream.write_all(question).and_then(|()| stream.shutdown(Shutdown::Write));
        answer = asked.map_or(Vec::new(), |()| rest(&mut stream));
        !answer.is_empty()
    });
    answer
}

/// What comes until the gateway closes the connection.
pub fn rest(stream: &mut TcpStream) -> Vec<u8> {
    let mut received = Vec::new();
    match stream.read_to_end(&mut received) {
        Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
            panic!("the gateway keeps the connection open; so far: {}", received.escape_ascii())
        }
        // A reset: what has been read stays.
        _ => received,
    }
}

/// Whether the gateway closes this connection within `time`, having sent nothing more.
pub fn closes_within(stream: &mut TcpStream, time: Duration) -> bool {
    stream.set_read_timeout(Some(time)).expect("a timeout");
    match stream.read(&mut [0]) {
        Ok(count) => count == 0,
        Err(error) => error.kind() == std::io::ErrorKind::ConnectionReset,
    }
}

/// Ends a connection with RST.
pub fn reset(stream: TcpStream) {
    rustix::net::sockopt::set_socket_linger(&stream, Some(Duration::ZERO)).expect("no linger");
}

/// A Modbus/TCP client.
pub struct Modbus {
    pub stream: TcpStream,
    transaction: u16,
}

/// PDU of a reading of holding registers.
pub fn read_pdu(address: u16, quantity: u16) -> Vec<u8> {
    [&[3][..], &address.to_be_bytes(), &quantity.to_be_bytes()].concat()
}

/// PDU of a writing of one register.
pub fn write_pdu(address: u16, value: u16) -> Vec<u8> {
    [&[6][..], &address.to_be_bytes(), &value.to_be_bytes()].concat()
}

/// A Modbus/TCP frame.
pub fn mbap(transaction: u16, unit: u8, pdu: &[u8]) -> Vec<u8> {
    let length = (pdu.len() + 1) as u16;
    [&transaction.to_be_bytes()[..], &[0, 0], &length.to_be_bytes(), &[unit], pdu].concat()
}

impl Modbus {
    #[track_caller]
    pub fn connect(address: SocketAddr) -> Self {
        Self { stream: connect(address), transaction: 0x4700 }
    }

    /// As `connect`; returns when the gateway serves it. A board's idle places are few: of many that come at once it
    /// refuses some.
    #[track_caller]
    pub fn served(address: SocketAddr) -> Self {
        let mut client = Self::connect(address);
        // There is no function 0: the gateway itself refuses it.
        assert_eq!(client.ask(1, &[0, 0]), [0x80, 1]);
        client
    }

    /// Sends a request and tells its transaction number.
    #[track_caller]
    pub fn send(&mut self, unit: u8, pdu: &[u8]) -> u16 {
        self.transaction = self.transaction.wrapping_add(1);
        self.stream.write_all(&mbap(self.transaction, unit, pdu)).expect("sent");
        self.transaction
    }

    /// The next reply: transaction, unit, PDU.
    #[track_caller]
    pub fn receive(&mut self) -> (u16, u8, Vec<u8>) {
        let mut header = [0; 7];
        self.stream.read_exact(&mut header).expect("a reply");
        let [t1, t0, p1, p0, l1, l0, unit] = header;
        assert_eq!([p1, p0], [0, 0], "protocol");
        let mut pdu = vec![0; usize::from(u16::from_be_bytes([l1, l0])) - 1];
        self.stream.read_exact(&mut pdu).expect("a PDU");
        (u16::from_be_bytes([t1, t0]), unit, pdu)
    }

    /// One transaction: the reply PDU.
    #[track_caller]
    pub fn ask(&mut self, unit: u8, pdu: &[u8]) -> Vec<u8> {
        let transaction = self.send(unit, pdu);
        let (number, replier, reply) = self.receive();
        assert_eq!((number, replier), (transaction, unit));
        reply
    }

    /// Reads registers; the exception code where there is one.
    #[track_caller]
    pub fn read(&mut self, unit: u8, address: u16, quantity: u16) -> Result<Vec<u16>, u8> {
        let reply = self.ask(unit, &read_pdu(address, quantity));
        match *reply.as_slice() {
            [0x83, code] => Err(code),
            [3, count, ref words @ ..] if words.len() == usize::from(count) => {
                Ok(words.chunks(2).map(|word| u16::from_be_bytes([word[0], word[1]])).collect())
            }
            _ => panic!("no reply to a reading: {reply:02X?}"),
        }
    }

    /// Writes a register; the exception code where there is one.
    #[track_caller]
    pub fn write(&mut self, unit: u8, address: u16, value: u16) -> Result<(), u8> {
        let request = write_pdu(address, value);
        let reply = self.ask(unit, &request);
        match *reply.as_slice() {
            [0x86, code] => Err(code),
            _ if reply == request => Ok(()),
            _ => panic!("no reply to a writing: {reply:02X?}"),
        }
    }
}

/// A client of the line dialects.
pub struct Lines {
    stream: BufReader<TcpStream>,
}

impl Lines {
    #[track_caller]
    pub fn connect(address: SocketAddr) -> Self {
        Self::over(connect(address))
    }

    /// Over a connection from which nothing is to be read yet.
    pub fn over(stream: TcpStream) -> Self {
        Self { stream: BufReader::new(stream) }
    }

    #[track_caller]
    pub fn send(&mut self, text: &str) {
        self.stream.get_mut().write_all(format!("{text}\r\n").as_bytes()).expect("sent");
    }

    /// Sends this and no line end.
    #[track_caller]
    pub fn put(&mut self, text: &str) {
        self.stream.get_mut().write_all(text.as_bytes()).expect("sent");
    }

    /// The next line, without its end.
    #[track_caller]
    pub fn line(&mut self) -> String {
        let mut line = String::new();
        self.stream.read_line(&mut line).expect("a line");
        assert!(line.ends_with("\r\n"), "not a whole line: {line:?}");
        line.trim_end().to_owned()
    }

    /// What comes to the next carriage return, without it.
    #[track_caller]
    pub fn until_return(&mut self) -> String {
        let mut text = Vec::new();
        self.stream.read_until(b'\r', &mut text).expect("a text");
        assert_eq!(text.pop(), Some(b'\r'));
        String::from_utf8(text).expect("text")
    }

    #[track_caller]
    pub fn ask(&mut self, text: &str) -> String {
        self.send(text);
        self.line()
    }

    /// As `ask`, of an answer that has line feeds in it.
    #[track_caller]
    pub fn ask_long(&mut self, text: &str) -> String {
        self.send(text);
        self.long()
    }

    /// Waits until something of an answer has come.
    #[track_caller]
    pub fn begins(&mut self) {
        assert!(!self.stream.fill_buf().expect("something").is_empty(), "ended");
    }

    /// What comes to the next line end, with the line feeds that are in it.
    #[track_caller]
    pub fn long(&mut self) -> String {
        let mut answer = String::new();
        while !answer.ends_with("\r\n") {
            assert_ne!(self.stream.read_line(&mut answer).expect("a line"), 0, "ended: {answer:?}");
        }
        answer.trim_end().to_owned()
    }

    /// As `ask`; the answer must begin with `ok`.
    #[track_caller]
    pub fn ok(&mut self, text: &str) -> String {
        let reply = self.ask(text);
        assert!(reply.starts_with("ok"), "{text}: {reply}");
        reply
    }

    /// As `ask`; the answer must be this error.
    #[track_caller]
    pub fn error(&mut self, text: &str, code: &str) -> String {
        let reply = self.ask(text);
        assert!(reply.starts_with(&format!("error {code} ")), "{text}: {reply}");
        reply
    }

    pub fn stream(self) -> TcpStream {
        self.stream.into_inner()
    }
}

/// A value of a reply line, as in `ok key=value`.
pub fn value<'a>(reply: &'a str, key: &str) -> Option<&'a str> {
    reply.split(' ').find_map(|word| word.strip_prefix(key)?.strip_prefix('='))
}

/// As [`value`], a number that must be there.
pub fn figure(reply: &str, key: &str) -> u64 {
    value(reply, key).and_then(|text| text.parse().ok()).unwrap_or_else(|| panic!("no {key} in {reply}"))
}

/// Polls one register of a unit, at an easy pace, until it is told to end, and ten times at least. All readings must be
/// right.
pub struct Poller {
    running: std::sync::Arc<std::sync::atomic::AtomicBool>,
    thread: Option<std::thread::JoinHandle<u32>>,
}

impl Poller {
    pub fn start(address: SocketAddr, unit: u8, register: u16, expected: u16) -> Self {
        let running = std::sync::Arc::new(std::sync::atomic::AtomicBool::new(true));
        let goes_on = running.clone();
        let thread = std::thread::spawn(move || {
            let mut client = Modbus::connect(address);
            let mut count = 0;
            while count < 10 || goes_on.load(std::sync::atomic::Ordering::Relaxed) {
                assert_eq!(client.read(unit, register, 1), Ok(vec![expected]), "reading {count}");
                count += 1;
                std::thread::sleep(ms(5));
            }
            count
        });
        Self { running, thread: Some(thread) }
    }

    /// How many readings it made; fails where one of them did.
    pub fn end(mut self) -> u32 {
        self.running.store(false, std::sync::atomic::Ordering::Relaxed);
        self.thread.take().expect("a thread").join().expect("every reading is right")
    }
}
