//! The Modbus functions that a drive knows: 03, 06 and 10h.

use puente_modbus::request::Request;
use puente_modbus::{Exception, Pdu, Words};

use crate::drive::Drive;

/// Lets `drive` execute a request and returns its reply, an exception where it refuses.
pub(crate) fn answer(drive: &mut Drive, request: &[u8]) -> Pdu {
    execute(drive, request).unwrap_or_else(|exception| {
        let function = request.first().copied().unwrap_or(0);
        Pdu::from_slice(&exception.pdu(function)).unwrap_or_default()
    })
}

fn execute(drive: &mut Drive, request: &[u8]) -> Result<Pdu, Exception> {
    let (Some(0x03 | 0x06 | 0x10), true) = (request.first(), request.len() > 1) else {
        return Err(Exception::IllegalFunction);
    };
    match Request::parse(request)? {
        Request::ReadHoldingRegisters { address, quantity } => read(drive, address, quantity),
        Request::WriteSingleRegister { address, value } => {
            drive.write(address, value)?;
            echo(request)
        }
        Request::WriteMultipleRegisters { address, words } => {
            write(drive, address, words)?;
            // Function, address and quantity.
            echo(request.get(..5).unwrap_or(request))
        }
        _ => Err(Exception::IllegalFunction),
    }
}

fn read(drive: &Drive, address: u16, quantity: u16) -> Result<Pdu, Exception> {
    if quantity > drive.profile().max_read {
        return Err(Exception::IllegalDataValue);
    }
    let mut reply = vec![0x03, (quantity * 2) as u8];
    for at in 0..quantity {
        reply.extend(drive.read(nth(address, at)?)?.to_be_bytes());
    }
    echo(&reply)
}

/// Nothing is written unless all addresses and values are good.
fn write(drive: &mut Drive, address: u16, words: Words<'_>) -> Result<(), Exception> {
    if words.len() > usize::from(drive.profile().max_write) {
        return Err(Exception::IllegalDataValue);
    }
    for (at, value) in (0..).zip(words.iter()) {
        drive.check(nth(address, at)?, value)?;
    }
    for (at, value) in (0..).zip(words.iter()) {
        drive.write(nth(address, at)?, value)?;
    }
    Ok(())
}

fn nth(address: u16, at: u16) -> Result<u16, Exception> {
    address.checked_add(at).ok_or(Exception::IllegalDataAddress)
}

fn echo(bytes: &[u8]) -> Result<Pdu, Exception> {
    Pdu::from_slice(bytes).map_err(|_| Exception::ServerDeviceFailure)
}
