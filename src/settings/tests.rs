use proptest::prelude::*;

use super::record::{self, Record, Trial};
use super::*;
use crate::desk::Units;

mod canopen;

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
    settings.buses[0].protocol =
        Protocol::ModbusAscii(Modbus { quarantine_ms: Some(300), ..Modbus::default() });
    let mut edb = Edb::default();
    edb.registers.status = 0x0902;
    settings.axes[1].drive = Drive::Edb(edb);
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

/// What a framed bus and its axes add to that form.
#[test]
fn the_compact_form_of_a_framed_bus() {
    let settings = framed();
    let mut bytes = [0; 256];
    let length = record::emit(&mut bytes, Some(&settings), None).expect("room");
    let expected: &[&[u8]] = &[
        b"pS\x01\0\0\0\0\0\x5B\0",
        &[1, 127, 0, 0, 1, 0x90, 0x3F, 0xB6, 0x42, 16, 0xFA, 0x01, 120, 1],
        b"\x10192.168.1.111/24\0\x06puente",
        // One bus.
        b"\x01\x01b\x02\x03sim\xC0\x84\x3D\x038N1\x01\0\x02\x02\x08\x10\x04\x02",
        // Two axes.
        b"\x02\x01x\x01b\x01\x11\0\0",
        b"\x01y\x01b\x01\x12\x01\x01\0\0\0\x3F\0\0\x80\x3E\0\0\0\0",
    ];
    assert_eq!(bytes[..length].escape_ascii().to_string(), expected.concat().escape_ascii().to_string());
}

/// A framed bus with axes x and y.
fn framed() -> Settings {
    let mut settings = Settings::factory();
    let bus = &mut settings.buses[0];
    bus.name = "b".parse().expect("a name");
    bus.protocol = Protocol::Framed(Framed::default());
    settings.axes.truncate(2);
    for (address, axis) in (17..).zip(&mut settings.axes) {
        (axis.address, axis.bus) = (address, "b".parse().expect("a name"));
        axis.drive = Drive::Pid(Pid::default());
    }
    settings.axes[1].drive = Drive::Pid(Pid { payload: Payload::Binary, gains: Some([0.5, 0.25, 0.0]) });
    settings
}

#[test]
fn a_table_has_the_defaults_of_its_protocol_and_of_its_drive() {
    let text = "{\"bus\":[{\"name\":\"b\",\"protocol\":\"framed\",\"port\":\"sim\"}],\"axis\":[\
        {\"name\":\"x\",\"bus\":\"b\",\"drive\":\"pid\",\"address\":17},\
        {\"name\":\"y\",\"bus\":\"b\",\"drive\":\"pid\",\"address\":18,\"payload\":\"binary\",\"gains\":[0.5,0.25,0]}]}";
    let mut expected = framed();
    expected.net = Net::default();
    assert_eq!(read(text), Ok(expected.clone()));
    assert_eq!(expected.check(), Ok(()));
    // And says no word of others.
    let text = text_of(&expected);
    assert!(!text.contains("units") && !text.contains("rpm") && !text.contains("registers"), "{text}");
    let text = text_of(&Settings::factory());
    assert!(!text.contains("station") && !text.contains("payload"), "{text}");
}

#[test]
fn keys_and_drives_of_another_protocol_are_told() {
    let framed = text_of(&framed());
    let modbus = text_of(&Settings::factory());
    for (text, good, bad, sentence) in [
        (
            &framed,
            "\"slot\":8",
            "\"slot\":8,\"units\":\"1\"",
            "[[bus]] \"b\" units: this protocol has no such key",
        ),
        (
            &framed,
            "\"slot\":8",
            "\"slot\":8,\"rest_ms\":0",
            "[[bus]] \"b\" rest_ms: this protocol has no such key",
        ),
        (
            &modbus,
            "\"rest_ms\":0",
            "\"rest_ms\":0,\"cycle_ms\":2",
            "[[bus]] \"a\" cycle_ms: this protocol has no such key",
        ),
        (
            &framed,
            "\"payload\":\"text\"",
            "\"max_rpm\":1",
            "[[axis]] \"x\" max_rpm: this drive has no such key",
        ),
        (
            &modbus,
            "\"address\":2",
            "\"address\":2,\"gains\":[1,1,1]",
            "[[axis]] \"y\" gains: this drive has no such key",
        ),
        (
            &framed,
            "\"drive\":\"pid\",\"address\":17,\"payload\":\"text\",\"gains\":null",
            "\"drive\":\"edb\",\"address\":17",
            "[[axis]] \"x\" drive: \"pid\" is what",
        ),
        (
            &modbus,
            "\"drive\":\"edb\",\"address\":1,\"max_rpm\":3000,\"registers\":null",
            "\"drive\":\"pid\",\"address\":1",
            "[[axis]] \"x\" drive: \"edb\" is what",
        ),
        (&framed, "\"station\":1", "\"station\":17", "[[axis]] \"x\" address: it must differ"),
        (&framed, "\"station\":1", "\"station\":255", "[[bus]] \"b\" station: 1 to 254"),
        (&framed, "\"address\":17", "\"address\":255", "[[axis]] \"x\" address: 1 to 254"),
        (&framed, "\"address\":17", "\"address\":18", "[[axis]] \"y\" address: axis \"x\" has this drive"),
        (&framed, "\"cycle_ms\":2", "\"cycle_ms\":0", "[[bus]] \"b\" cycle_ms: 1 to 1000"),
        (&framed, "\"ipg\":2", "\"ipg\":0", "[[bus]] \"b\" ipg: 1 to 1000"),
        (&framed, "\"slot\":8", "\"slot\":1001", "[[bus]] \"b\" slot: 1 to 1000"),
        (&framed, "\"attempts\":16", "\"attempts\":17", "[[bus]] \"b\" attempts: 1 to 16"),
        (&framed, "\"window\":4", "\"window\":9", "[[bus]] \"b\" window: 1 to 8"),
        (&framed, "\"verify\"", "\"strip\"", "[[bus]] \"b\" echo: \"verify\" or \"off\""),
        (&framed, "8N1", "7E1", "[[bus]] \"b\" format: a framed bus needs 8 data bits"),
        (&framed, "[0.5,", "[-0.5,", "[[axis]] \"y\" gains: three numbers"),
        (&framed, "0.25,", "1000001,", "[[axis]] \"y\" gains: three numbers"),
    ] {
        assert!(text.contains(good), "{good} is not in {text}");
        let problem = read(&text.replacen(good, bad, 1)).expect("a document").check().expect_err(bad);
        assert!(problem.to_string().starts_with(sentence), "{bad}: {problem}");
    }
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
        let modbus = Modbus {
            line: puente_line::Settings { baud, format: format.parse().expect("a format") },
            units: all,
            reply_timeout_ms: times[0],
            turnaround_ms: times[1],
            rest_ms: times[2],
            quarantine_ms,
            queue_timeout_ms: times[3],
            echo: [Echo::Off, Echo::Strip, Echo::Verify][usize::from(echo)],
        };
        Bus {
            name: name.parse().expect("a name"),
            port: port.parse().expect("a port"),
            protocol: if rtu { Protocol::ModbusRtu(modbus) } else { Protocol::ModbusAscii(modbus) },
            stray: None,
        }
    }
}

prop_compose! {
    fn any_framed()(
        station in 200..=254_u8,
        thesis: bool,
        cycle_ms in 1..=1000_u16,
        ipg in 1..=1000_u16,
        slot in 1..=1000_u16,
        attempts in 1..=16_u8,
        window in 1..=8_u8,
        off: bool,
    ) -> Framed {
        let policy = if thesis { Policy::Thesis } else { Policy::Truncated };
        let echo = if off { Echo::Off } else { Echo::Verify };
        Framed { line: Framed::default().line, station, policy, cycle_ms, ipg, slot, attempts, window, echo }
    }
}

prop_compose! {
    fn any_settings()(
        mut bus in any_bus(),
        framed in proptest::option::of(any_framed()),
        axes in proptest::collection::vec((1..=199_u8, 1..=32_767_u16, proptest::option::of(0..0x800_u16)), 0..AXES),
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
            axis.address = address;
            let mut edb = Edb { max_rpm, ..Edb::default() };
            edb.registers.status = status.unwrap_or(edb.registers.status);
            let gains = status.map(|number| [f32::from(number) / 7.0, 1e6 / f32::from(max_rpm), 1e-20]);
            let payload = if max_rpm % 2 == 0 { Payload::Text } else { Payload::Binary };
            axis.drive = match &framed {
                Some(_) => Drive::Pid(Pid { payload, gains }),
                None => Drive::Edb(edb),
            };
            settings.axes.push(axis).expect("room");
        }
        if let Some(mut framed) = framed {
            let line = bus.line().expect("a line");
            framed.line = line;
            bus.protocol = Protocol::Framed(framed);
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
