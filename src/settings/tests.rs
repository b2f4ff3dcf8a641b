use proptest::prelude::*;

use super::record::{self, Record, Trial};
use super::*;

fn text_of(settings: &Settings) -> std::string::String {
    serde_json::to_string(settings).expect("text")
}

fn read(text: &str) -> Result<Settings, json::Error> {
    let mut settings = Settings::factory();
    json::read(text.as_bytes(), &mut settings).map(|()| settings)
}

/// In flash this is a document of the first format. Where it has changed, firmware reads what other firmware has written
/// wrongly: raise `record::FORMAT`, and keep a reader for this one.
#[test]
fn the_compact_form_is_that_of_its_number() {
    let mut settings = Settings::factory();
    settings.net.router = Some([192, 168, 1, 1].into());
    settings.buses[0].quarantine_ms = Some(300);
    settings.axes[1].registers.status = 0x0902;
    settings.axes.truncate(2);
    let mut bytes = [0; 256];
    let length = record::emit(&mut bytes, Some(&settings), Some(None)).expect("room");
    record::stamp(&mut bytes, 0x0102_0304);
    let expected: &[&[u8]] = &[
        b"pS\x01\x01\x04\x03\x02\x01\x6D\x00",
        // Version and net.
        &[1, 127, 0, 0, 1, 0x90, 0x3F, 0xB6, 0x42, 16, 0xFA, 0x01, 120, 1],
        b"\x10192.168.1.111/24\x01\xC0\xA8\x01\x01\x06puente",
        // One bus.
        b"\x01\x01a\x01\x03sim\x80\x4B\x038O1\x051-247\xF4\x03\x64\x00\x01\xAC\x02\xB8\x17\x00",
        // Two axes.
        b"\x02\x01x\x01a\x00\x01\xB8\x17\x00\x01y\x01a\x00\x02\xB8\x17\x01",
        &[
            0x82, 0x12, 0x86, 0x10, 0x97, 0x10, 0xF1, 0x0F, 0x25, 0xA2, 0x20, 0xA3, 0x20, 0xA4, 0x20, 0xA5,
            0x20,
        ],
    ];
    assert_eq!(bytes[..length].escape_ascii().to_string(), expected.concat().escape_ascii().to_string());
}

#[test]
fn a_document_that_is_cut_off_too_long_or_does_not_hold_is_not_half_read() {
    let mut bytes = [0; 512];
    let length = record::emit(&mut bytes, Some(&Settings::factory()), None).expect("room");
    let confirmed = |bytes: &[u8]| {
        let mut settings = Settings::factory();
        settings.net.idle_s = 999;
        let before = settings.clone();
        let read = Record::parse(bytes).map(|record| record.confirmed(&mut settings));
        if read != Some(Ok(true)) {
            assert_eq!(settings, before);
        }
        read
    };
    assert_eq!(confirmed(&bytes[..length]), Some(Ok(true)));
    let document = length - 10;
    for cut in 1..document {
        let mut shorter = bytes[..length - cut].to_vec();
        shorter[8..10].copy_from_slice(&((document - cut) as u16).to_le_bytes());
        assert_eq!(confirmed(&shorter), Some(Err(record::Unreadable)), "{cut}");
    }
    let mut longer = bytes[..=length].to_vec();
    longer[8..10].copy_from_slice(&((document + 1) as u16).to_le_bytes());
    assert_eq!(confirmed(&longer), Some(Err(record::Unreadable)));
    // Another format, or another version of the keys.
    for (place, value) in [(0, b'P'), (2, 2), (2, 0), (3, 3)] {
        let mut other = bytes[..length].to_vec();
        other[place] = value;
        assert_eq!(Record::parse(&other), None);
    }
    bytes[10] = 2;
    assert_eq!(confirmed(&bytes[..length]), Some(Err(record::Unreadable)));
}

#[test]
fn a_trial_is_started_and_confirmed_in_its_place() {
    let mut bytes = [0; 512];
    let settings = Settings::factory();
    for (confirmed, tried) in [(None, Some(&settings)), (Some(&settings), None), (None, None)] {
        let length = record::emit(&mut bytes, confirmed, Some(tried)).expect("room");
        assert_eq!(record::confirm(&mut bytes[..length]), None, "it has not been started");
        record::start(&mut bytes[..length]);
        assert_eq!(Record::parse(&bytes[..length]).expect("a record").trial, Trial::Started);
        let length = record::confirm(&mut bytes[..length]).expect("started");
        let mut expected = [0; 512];
        let other = record::emit(&mut expected, tried, None).expect("room");
        assert_eq!(bytes[..length], expected[..other]);
    }
}

#[test]
fn what_is_wrong_with_a_text_is_said() {
    let document = text_of(&Settings::factory());
    for (text, sentence) in [
        (&*document.replace("\"version\":1", "\"version\":7"), ""),
        ("{\"version\":7,\"bus\":3}", "version: 7 is not known, this firmware reads version 1"),
        (
            "{\"other\":[{\"version\":8}],\"version\" : 7}",
            "version: 7 is not known, this firmware reads version 1",
        ),
        ("{\"a\\\"\":1,\"version\":7}", "version: 7 is not known, this firmware reads version 1"),
        ("{}", "a key is missing"),
        ("{\"bus\":[],\"bus\":[]}", "a key is missing, given twice"),
        ("{\"bus\":[]", "this is not JSON"),
        ("{\"bus\":[]}x", "this is not JSON"),
        ("{\"x\":{\"version\":7}}", "a key is missing"),
    ] {
        match read(text) {
            Ok(settings) => assert_eq!((settings.version, sentence), (7, ""), "{text}"),
            Err(error) => {
                let said = error.to_string();
                assert!(!sentence.is_empty() && said.starts_with(sentence), "{text}: {said}");
            }
        }
    }
    // Escapes, as some programs write them.
    let escaped = document.replace("\"sim\"", "\"\\/dev\\/tty\\u0041\"");
    assert_eq!(read(&escaped).expect("a document").buses[0].port, "/dev/ttyA");
}

/// A client's nesting must not become the stack's.
#[test]
fn nesting_is_refused_at_its_first_step() {
    for opening in
        ["[", "{\"bus\":[", "{\"bus\":[{\"name\":[", "{\"x\":[", "{\"axis\":[{\"registers\":{\"x\":["]
    {
        let text = opening.to_string() + &"[".repeat(100_000);
        assert!(read(&text).is_err(), "{opening}");
    }
}

prop_compose! {
    fn any_bus()(
        name in "[a-z]{1,16}",
        port in "/[ -~]{1,63}",
        baud in 300..=1_000_000_u32,
        format in "8[NEO][12]",
        units in proptest::collection::vec(1..=247_u8, 1..20),
        times in proptest::array::uniform4(60..=10_000_u32),
        quarantine_ms in proptest::option::of(0..=60_000_u32),
        rtu: bool,
        echo in 0..3_u8,
    ) -> Bus {
        let mut all = Units::default();
        units.into_iter().for_each(|unit| all.insert(unit));
        Bus {
            name: name.parse().expect("a name"),
            protocol: if rtu { Protocol::ModbusRtu } else { Protocol::ModbusAscii },
            port: port.parse().expect("a port"),
            baud,
            format: format.parse().expect("a format"),
            units: all,
            reply_timeout_ms: times[0],
            turnaround_ms: times[1],
            rest_ms: times[2],
            quarantine_ms,
            queue_timeout_ms: times[3],
            echo: [Echo::Off, Echo::Strip, Echo::Verify][usize::from(echo)],
        }
    }
}

prop_compose! {
    fn any_settings()(
        bus in any_bus(),
        axes in proptest::collection::vec((1..=247_u8, 1..=32_767_u16, proptest::option::of(0..0x800_u16)), 0..AXES),
        router: bool,
        dhcp: bool,
        hostname in "[a-z0-9]{1,32}",
    ) -> Settings {
        let mut settings = Settings::factory();
        (settings.net.dhcp, settings.net.hostname) = (dhcp, hostname.parse().expect("a name"));
        settings.net.router = router.then_some([192, 168, 1, 1].into());
        settings.axes.clear();
        let mut taken = vec![];
        for (number, (address, max_rpm, status)) in axes.into_iter().enumerate() {
            if taken.contains(&address) {
                continue;
            }
            taken.push(address);
            let mut axis = Settings::factory().axes[0].clone();
            axis.name = format!("axis-{number}").parse().expect("a name");
            axis.bus = bus.name.clone();
            (axis.address, axis.max_rpm) = (address, max_rpm);
            axis.registers.status = status.unwrap_or(axis.registers.status);
            settings.axes.push(axis).expect("room");
        }
        settings.buses[0] = bus;
        settings
    }
}

proptest! {
    #[test]
    fn every_form_gives_the_same_document_back(settings in any_settings()) {
        prop_assert_eq!(settings.check(), Ok(()));
        prop_assert_eq!(read(&text_of(&settings)), Ok(settings.clone()));
        let toml = toml::to_string(&settings).expect("TOML");
        prop_assert_eq!(toml::from_str::<Settings>(&toml).expect("a document"), settings.clone());
        let mut bytes = [0; keeper::DOCUMENT];
        let length = record::emit(&mut bytes, Some(&settings), Some(Some(&settings))).expect("room");
        let record = Record::parse(&bytes[..length]).expect("a record");
        for tried in [false, true] {
            let mut found = Settings::factory();
            let read = if tried { record.tried(&mut found) } else { record.confirmed(&mut found) };
            prop_assert_eq!(read, Ok(true));
            prop_assert_eq!(&found, &settings);
        }
    }

    #[test]
    fn any_text_is_read_without_panic(text in "[\\[\\]{}\":,a-z0-9\\\\. u-]{0,200}") {
        let _ = read(&text).map(|settings| settings.check());
    }

    /// Parts of a document, in any order and number.
    #[test]
    fn any_parts_are_read_without_panic(parts in proptest::collection::vec((0..2000_usize, 0..60_usize), 0..8)) {
        let document = text_of(&Settings::factory());
        let text: std::string::String =
            parts.iter().map(|(from, length)| document.get(*from..from + length).unwrap_or("{\"bus\":[")).collect();
        let _ = read(&text);
    }

    #[test]
    fn any_record_is_read_without_panic(
        bytes in proptest::collection::vec(any::<u8>(), 0..200),
        place in 0..200_usize,
        value: u8,
    ) {
        let mut record = b"pS\x01\x01\0\0\0\0\x40\0".to_vec();
        record.extend(bytes);
        let mut factory = [0; 512];
        let length = record::emit(&mut factory, Some(&Settings::factory()), Some(None)).expect("room");
        factory[place % length] = value;
        for bytes in [&record, &factory[..length]] {
            if let Some(record) = Record::parse(bytes) {
                let mut settings = Settings::factory();
                let _ = (record.confirmed(&mut settings), record.tried(&mut settings));
                prop_assert_eq!(settings.check(), Ok(()));
            }
        }
    }
}
