//! The chip's temperature sensor, as its maker has calibrated it.

/// Temperature in degrees Celsius, from a conversion at the supply of 3.3 V and the two that ST has stored in the chip,
/// made at 30 and at 110 degrees. None where these make no sense, as in a chip where nothing is stored.
pub fn degrees(conversion: u16, [at_30, at_110]: [u16; 2]) -> Option<i16> {
    let slope = i32::from(at_110) - i32::from(at_30);
    let above = i32::from(conversion) - i32::from(at_30);
    let tenths = (above * 800).checked_div(slope)?;
    let degrees = i16::try_from(30 + (tenths + tenths.signum() * 5) / 10).ok()?;
    // What the sensor can tell.
    (slope > 0 && (-50..=150).contains(&degrees)).then_some(degrees)
}
