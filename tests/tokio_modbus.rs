//! tokio-modbus, an independent client, through both ports of the gateway.
//!
//! Alone: to the simulated drives of a gateway that is started here. Under tests/peers/run.py: to the slaves that the
//! variable `PUENTE_PEERS` names, one a line, as `PORT NAME,ADDRESS,UNIT,SLAVE NAME`; they hold what
//! tests/peers/model.py says.

mod common;

use std::fmt::Debug;
use std::net::SocketAddr;
use std::time::Duration;

use common::Gateway;
use tokio_modbus::client::sync::{Client, Context, Reader, Writer, tcp};
use tokio_modbus::prelude::{ExceptionCode, ReadCode, Request, Response, Slave};

#[test]
fn reads_and_writes_through_both_ports() {
    match std::env::var("PUENTE_PEERS") {
        Ok(peers) => peers.lines().for_each(|peer| Peer::parse(peer).exercise()),
        Err(_) => {
            let gateway = Gateway::factory();
            for address in [gateway.main, gateway.modbus] {
                drive(&mut connect(address, 2));
            }
        }
    }
}

fn connect(address: SocketAddr, unit: u8) -> Context {
    let patience = Some(Duration::from_secs(10));
    tcp::connect_slave_with_timeout(address, Slave(unit), patience).expect("connection")
}

/// A reply of the server, exception or not.
fn reply<T>(result: tokio_modbus::Result<T>) -> Result<T, ExceptionCode> {
    result.expect("a reply")
}

/// What an EDB drive knows: functions 03, 06 and 10h.
fn drive(client: &mut Context) {
    const JOG_SPEED: u16 = 0x0025;
    for speed in [250, 100] {
        reply(client.write_single_register(JOG_SPEED, speed)).expect("written");
        assert_eq!(reply(client.read_holding_registers(JOG_SPEED, 1)), Ok(vec![speed]));
    }
    reply(client.write_multiple_registers(JOG_SPEED, &[300])).expect("written");
    assert_eq!(reply(client.read_holding_registers(JOG_SPEED, 1)), Ok(vec![300]));
    assert_eq!(reply(client.read_holding_registers(0, 20)).expect("read").len(), 20);
    assert_eq!(reply(client.read_coils(0, 1)), Err(ExceptionCode::IllegalFunction));
    assert_eq!(reply(client.read_holding_registers(0x5000, 1)), Err(ExceptionCode::IllegalDataAddress));
    assert_eq!(reply(client.read_holding_registers(0, 21)), Err(ExceptionCode::IllegalDataValue));
}

/// A slave behind one port of a gateway.
struct Peer {
    name: String,
    libmodbus: bool,
    client: Context,
}

impl Peer {
    fn parse(line: &str) -> Self {
        let [port, address, unit, slave] = line.split(',').collect::<Vec<_>>()[..] else {
            panic!("PUENTE_PEERS: {line}");
        };
        let client = connect(address.parse().expect("address"), unit.parse().expect("unit"));
        let name = format!("tokio-modbus > {port} > {slave}");
        Self { name, libmodbus: slave.ends_with("libmodbus"), client }
    }

    fn exercise(mut self) {
        self.bits();
        self.registers();
        self.mask_and_read_write();
        self.exceptions();
        if self.libmodbus { self.server_id() } else { self.identification_and_diagnostics() }
    }

    fn passed(&self, case: &str) {
        println!("passed  {}: {case}", self.name);
    }

    fn same<T: PartialEq + Debug>(&self, received: T, expected: T) {
        assert_eq!(received, expected, "{}", self.name);
    }

    fn bits(&mut self) {
        for on in [true, false, true] {
            reply(self.client.write_single_coil(77, on)).expect("written");
            let coils = reply(self.client.read_coils(77, 1));
            self.same(coils, Ok(vec![on]));
        }
        self.passed("05 write coil, 01 read coils");
        let coils: Vec<bool> = (0..1968).map(|i| i % 5 == 2 || i % 3 == 1).collect();
        reply(self.client.write_multiple_coils(0, &coils)).expect("written");
        let read = reply(self.client.read_coils(0, 1968));
        self.same(read, Ok(coils));
        self.passed("0F write 1968 coils, 01 read coils");
        let inputs = reply(self.client.read_discrete_inputs(0, 2000));
        self.same(inputs, Ok((0..2000_u32).map(|i| i * i % 7 < 3).collect()));
        self.passed("02 read 2000 discrete inputs");
    }

    fn registers(&mut self) {
        for value in [0, 0x8001, 0xFFFF] {
            reply(self.client.write_single_register(12, value)).expect("written");
            let read = reply(self.client.read_holding_registers(12, 1));
            self.same(read, Ok(vec![value]));
        }
        self.passed("06 write register, 03 read holding registers");
        let words: Vec<u16> = (0..123).map(|i: u16| i.wrapping_mul(40_503)).collect();
        reply(self.client.write_multiple_registers(150, &words)).expect("written");
        let read = reply(self.client.read_holding_registers(150, 123));
        self.same(read, Ok(words));
        self.passed("10 write 123 registers, 03 read holding registers");
        let inputs = reply(self.client.read_input_registers(3, 125));
        self.same(inputs, Ok((3..128_u32).map(|i| (i * 1021 + 7) as u16).collect()));
        self.passed("04 read 125 input registers");
    }

    fn mask_and_read_write(&mut self) {
        reply(self.client.write_single_register(5, 0x0012)).expect("written");
        // The example of clause 6.16 of the specification.
        reply(self.client.masked_write_register(5, 0x00F2, 0x0025)).expect("written");
        let read = reply(self.client.read_holding_registers(5, 1));
        self.same(read, Ok(vec![0x0017]));
        self.passed("16 mask write register");
        let words: Vec<u16> = (0..121).map(|i: u16| i.wrapping_mul(7919)).collect();
        let read = reply(self.client.read_write_multiple_registers(30, 121, 30, &words));
        self.same(read, Ok(words));
        self.passed("17 read/write 121 registers");
    }

    fn exceptions(&mut self) {
        const NOWHERE: u16 = 5000;
        let refused = Err(ExceptionCode::IllegalDataAddress);
        let read = reply(self.client.read_holding_registers(NOWHERE, 1));
        self.same(read.map(drop), refused);
        let read = reply(self.client.read_coils(NOWHERE, 1));
        self.same(read.map(drop), refused);
        let written = reply(self.client.write_multiple_registers(NOWHERE, &[1, 2]));
        self.same(written, refused);
        self.passed("exception 02 from the slave");
    }

    /// tokio-modbus takes the second byte of the data for the run indicator, which fits libmodbus alone.
    fn server_id(&mut self) {
        let read = reply(self.client.call(Request::ReportServerId));
        self.same(read, Ok(Response::ReportServerId(180, true, b"LMB3.1.6".to_vec())));
        self.passed("11 report server id");
    }

    fn identification_and_diagnostics(&mut self) {
        let read = reply(self.client.read_device_identification(ReadCode::Basic, 0)).expect("read");
        let objects: Vec<_> = read.device_id_objects.iter().map(|object| object.value_as_str()).collect();
        self.same(objects, vec![Some("puente"), Some("peer"), Some("1.0")]);
        self.passed("2B/0E read device identification");
        let query = [0x00, 0x00, 0xA5, 0x37];
        let read = reply(self.client.call(Request::Custom(0x08, query.as_slice().into())));
        self.same(read, Ok(Response::Custom(0x08, query.to_vec().into())));
        self.passed("08 diagnostics, return query data");
    }
}
