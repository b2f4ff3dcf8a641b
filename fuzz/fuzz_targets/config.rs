//! A settings document as a client puts it. Nothing panics, and one that holds is the same after it was in flash, and
//! after it was read again.
#![no_main]

use puente::settings::record::{self, Record};
use puente::settings::{Settings, json};

libfuzzer_sys::fuzz_target!(|text: &[u8]| {
    let mut settings = Settings::factory();
    if json::read(text, &mut settings).is_err() || settings.check().is_err() {
        return;
    }
    let mut bytes = [0; 16_384];
    let length = record::emit(&mut bytes, Some(&settings), Some(Some(&settings))).expect("room");
    let record = Record::parse(&bytes[..length]).expect("a record");
    let mut found = Settings::factory();
    assert_eq!(record.confirmed(&mut found), Ok(true));
    assert_eq!(found, settings);

    let mut text = [0; 32_768];
    let length = serde_json_core::to_slice(&settings, &mut text).expect("room");
    let mut again = Settings::factory();
    assert_eq!(json::read(&text[..length], &mut again), Ok(()));
    assert_eq!(again, settings);
});
