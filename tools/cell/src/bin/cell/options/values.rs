//! What may follow an option.

use std::fmt::Display;
use std::str::FromStr;

use puente_cell::Fault;
use puente_framed::arbiter::Policy;
use puente_line::{BadFormat, Format};
use puente_modbus::Mode;
use puente_modules::Form;

use super::Protocol;

pub fn protocol(text: &str) -> Result<Protocol, String> {
    match text {
        "modbus-ascii" => Ok(Protocol::Modbus(Mode::Ascii)),
        "modbus-rtu" => Ok(Protocol::Modbus(Mode::Rtu)),
        "framed" => Ok(Protocol::Framed),
        _ => Err("expected modbus-ascii, modbus-rtu or framed".into()),
    }
}

pub fn policy(text: &str) -> Result<Policy, String> {
    match text {
        "truncated" => Ok(Policy::Truncated),
        "thesis" => Ok(Policy::Thesis),
        _ => Err("expected truncated or thesis".into()),
    }
}

pub fn form(text: &str) -> Result<Form, String> {
    match text {
        "text" => Ok(Form::Text),
        "binary" => Ok(Form::Binary),
        _ => Err("expected text or binary".into()),
    }
}

pub fn format(text: &str) -> Result<Format, String> {
    text.parse().map_err(|error: BadFormat| error.to_string())
}

pub fn in_range<T>(min: T, max: T) -> impl Fn(&str) -> Result<T, String>
where
    T: FromStr + PartialOrd + Display,
{
    move |text| {
        let value = text.parse().ok().filter(|value| *value >= min && *value <= max);
        value.ok_or_else(|| format!("expected {min} to {max}"))
    }
}

/// `1,2,5-8`
pub fn addresses(text: &str) -> Result<Vec<u8>, String> {
    let address = in_range(1, 254);
    let mut list = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        list.extend(address(first)?..=address(last)?);
    }
    if list.is_empty() { Err("the list is empty".into()) } else { Ok(list) }
}

/// `2=silent`
pub fn unit_fault(text: &str) -> Result<(u8, Fault), String> {
    let (unit, fault) = text.split_once('=').ok_or("expected UNIT=FAULT, as in 2=silent")?;
    Ok((in_range(1, 254)(unit)?, fault.parse().map_err(|error| format!("{error}"))?))
}
