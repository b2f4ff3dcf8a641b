//! Alarm numbers.

/// What alarm `number` says, in the drive's display shown as `A.nn`; `None` for 0 (no alarm) and undefined numbers.
///
/// HAL's list, whose texts mention Pn036 and so descend from the EDB's generation; medium for EDB.
pub const fn alarm_name(number: u16) -> Option<&'static str> {
    Some(match number {
        1 => "parameter checksum",
        2 => "A/D channel",
        3 => "overspeed",
        4 => "overload",
        5 => "position error counter overflow",
        6 => "position error beyond Pn036",
        7 => "electronic gear or pulse frequency unreasonable",
        8 => "current sensing channel 1",
        9 => "current sensing channel 2",
        10 => "encoder PA, PB or PC broken",
        11 => "encoder PU, PV or PW broken",
        12 => "power module over-current",
        13 => "over-voltage",
        14 => "under-voltage",
        15 => "bleeder resistor damaged",
        16 => "regeneration error",
        20 => "open power phase",
        21 => "momentary power loss",
        30 => "illegal encoder UVW, all 0 or all 1",
        31 => "wrong encoder UVW sequence",
        32 => "encoder C pulse at a wrong place",
        33 => "no encoder C pulse in a turn",
        41 | 43 | 44 => "reserved",
        42 => "drive and motor do not match",
        45 => "multi-turn information",
        46 => "multi-turn overflow",
        47 => "battery below 2.5 V",
        48 => "battery below 3.1 V",
        50 => "encoder communication timeout",
        51 => "absolute encoder above 100 r/min while unpowered",
        52 => "absolute encoder state",
        53 => "encoder count",
        54 => "encoder control field, parity or stop bit",
        55 => "encoder data verification",
        56 => "encoder status field, stop bit",
        57 => "no encoder EEPROM data",
        58 => "encoder data format",
        59 => "no communication module",
        60 => "cannot connect to the communication module",
        61 => "no cyclic data from the communication module",
        62 => "communication module misses the drive's reply",
        63 => "communication module not connected to the bus",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::alarm_name;

    #[test]
    fn defined_numbers_have_names_and_no_others() {
        let defined = (1..=16).chain(20..=21).chain(30..=33).chain(41..=48).chain(50..=63);
        assert!(defined.clone().all(|number| alarm_name(number).is_some()));
        assert_eq!((0..=u16::MAX).filter(|&number| alarm_name(number).is_some()).count(), defined.count());
        assert_eq!(alarm_name(3), Some("overspeed"));
        assert_eq!(alarm_name(14), Some("under-voltage"));
        assert_eq!(alarm_name(63), Some("communication module not connected to the bus"));
    }
}
