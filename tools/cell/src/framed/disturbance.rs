//! What goes wrong on a framed line, and how it is written.

use std::fmt;
use std::str::FromStr;
use std::time::Duration;

/// The words of [`Disturbance`]'s text form.
pub const WORDS: &str = "\
noise PROBABILITY                 each bit that a station hears is wrong so often, as in 1e-5
load SHARE                        what the rivals want to send together, as a part of what the line can carry, 0 to 4
babble MILLISECONDS               a station talks without listening
ADDRESS encoder sound|lost|frozen what the module sees of its encoder
ADDRESS amplifier sound|fault     the amplifier's fault line
ADDRESS torque NEWTON_METRES      a load against the positive direction
ADDRESS power-cycle               the module is switched off and on; an encoder that counts begins at 0
ADDRESS mute on|off               nobody hears the station
ADDRESS deaf on|off               the station hears nobody, not even itself
";

/// Something that goes wrong, or is mended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Disturbance {
    /// Each bit that a station hears is wrong with this probability.
    Noise(f64),
    /// What the rivals offer together, in bits per bit of the line.
    Load(f64),
    /// A station talks for so long without listening.
    Babble(Duration),
    /// At the station of this address.
    Station(u8, Trouble),
}

/// What may be wrong with a station.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trouble {
    /// What a module sees of its encoder.
    Encoder(Encoder),
    /// The amplifier's fault line.
    Amplifier(bool),
    /// A load against the positive direction, N·m.
    Torque(f64),
    /// The module is switched off and on again; an encoder that counts begins at 0.
    PowerCycle,
    /// Nobody hears it.
    Mute(bool),
    /// It hears nobody, not even itself.
    Deaf(bool),
}

/// An encoder, or the cable to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoder {
    /// As it should be.
    Sound,
    /// No signal.
    Lost,
    /// Always what it says now.
    Frozen,
}

/// A text that is no [`Disturbance`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadDisturbance(String);

impl fmt::Display for BadDisturbance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "'{}' is no disturbance", self.0)
    }
}

impl std::error::Error for BadDisturbance {}

impl FromStr for Disturbance {
    type Err = BadDisturbance;

    /// As in [`WORDS`].
    fn from_str(text: &str) -> Result<Self, BadDisturbance> {
        let words: Vec<&str> = text.split_whitespace().collect();
        parse(&words).ok_or_else(|| BadDisturbance(text.trim().to_owned()))
    }
}

fn parse(words: &[&str]) -> Option<Disturbance> {
    Some(match *words {
        ["noise", probability] => Disturbance::Noise(number(probability, 0.0, 0.1)?),
        ["load", share] => Disturbance::Load(number(share, 0.0, 4.0)?),
        ["babble", time] => Disturbance::Babble(Duration::from_millis(time.parse().ok()?)),
        [address, ref trouble @ ..] => {
            let address = address.parse().ok().filter(|address| (1..=254).contains(address))?;
            Disturbance::Station(address, trouble_of(trouble)?)
        }
        [] => return None,
    })
}

fn trouble_of(words: &[&str]) -> Option<Trouble> {
    Some(match *words {
        ["encoder", "sound"] => Trouble::Encoder(Encoder::Sound),
        ["encoder", "lost"] => Trouble::Encoder(Encoder::Lost),
        ["encoder", "frozen"] => Trouble::Encoder(Encoder::Frozen),
        ["amplifier", "sound"] => Trouble::Amplifier(false),
        ["amplifier", "fault"] => Trouble::Amplifier(true),
        ["torque", torque] => Trouble::Torque(number(torque, -100.0, 100.0)?),
        ["power-cycle"] => Trouble::PowerCycle,
        ["mute", switch] => Trouble::Mute(on(switch)?),
        ["deaf", switch] => Trouble::Deaf(on(switch)?),
        _ => return None,
    })
}

fn on(word: &str) -> Option<bool> {
    match word {
        "on" => Some(true),
        "off" => Some(false),
        _ => None,
    }
}

fn number(text: &str, least: f64, most: f64) -> Option<f64> {
    text.parse().ok().filter(|number| (least..=most).contains(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_word_is_understood() {
        let at = Disturbance::Station;
        for (text, expected) in [
            ("noise 1e-5", Disturbance::Noise(1e-5)),
            (" load  0.5 ", Disturbance::Load(0.5)),
            ("babble 50", Disturbance::Babble(Duration::from_millis(50))),
            ("17 encoder sound", at(17, Trouble::Encoder(Encoder::Sound))),
            ("17 encoder lost", at(17, Trouble::Encoder(Encoder::Lost))),
            ("17 encoder frozen", at(17, Trouble::Encoder(Encoder::Frozen))),
            ("18 amplifier fault", at(18, Trouble::Amplifier(true))),
            ("18 amplifier sound", at(18, Trouble::Amplifier(false))),
            ("18 torque -0.1", at(18, Trouble::Torque(-0.1))),
            ("254 power-cycle", at(254, Trouble::PowerCycle)),
            ("201 mute on", at(201, Trouble::Mute(true))),
            ("201 deaf off", at(201, Trouble::Deaf(false))),
        ] {
            assert_eq!(text.parse(), Ok(expected), "{text}");
        }
    }

    #[test]
    fn everything_else_is_refused() {
        for text in [
            "",
            "noise",
            "noise x",
            "noise 0.2",
            "noise -1",
            "noise nan",
            "load 5",
            "babble -1",
            "0 mute on",
            "255 mute on",
            "17",
            "17 mute",
            "17 mute yes",
            "17 encoder",
            "17 encoder broken",
            "17 power-cycle now",
            "17 torque inf",
        ] {
            let error = text.parse::<Disturbance>().expect_err(text);
            assert_eq!(error.to_string(), format!("'{text}' is no disturbance"));
        }
    }
}
