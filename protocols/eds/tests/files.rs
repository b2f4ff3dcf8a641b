//! Files as they are found, and files that are none.

use proptest::prelude::*;
use puente_eds::{Access, DataType, Entry, Error, LINE, Mistake, NAME, Number, Reader, VALUE};

/// An entry that outlives its reader.
#[derive(Clone, Debug, PartialEq)]
enum Told {
    Name(u16, Option<u8>, String),
    Object(Value),
}

#[derive(Clone, Debug, PartialEq)]
struct Value {
    index: u16,
    subs: (u8, u8),
    name: String,
    kind: u16,
    access: Option<Access>,
    pdo: bool,
    texts: [String; 4],
}

fn told(entry: Entry<'_>) -> Told {
    match entry {
        Entry::Name { index, sub, name } => Told::Name(index, sub, name.to_owned()),
        Entry::Object(object) => Told::Object(Value {
            index: object.index,
            subs: (object.first, object.last),
            name: object.name.to_owned(),
            kind: object.kind.0,
            access: object.access,
            pdo: object.pdo,
            texts: [object.low, object.high, object.default, object.value].map(str::to_owned),
        }),
    }
}

fn read(pieces: &[&[u8]]) -> (Vec<Told>, Result<(), Error>) {
    let mut entries = Vec::new();
    let mut reader = Reader::new();
    let mut take = |entry: Entry<'_>| entries.push(told(entry));
    let mut result = Ok(());
    for piece in pieces {
        result = result.and_then(|()| reader.push(piece, &mut take));
    }
    result = result.and_then(|()| reader.end(&mut take));
    (entries, result)
}

fn objects(text: &[u8]) -> Vec<Told> {
    let (entries, result) = read(&[text]);
    result.expect("a file");
    entries
}

fn value(index: u16, subs: (u8, u8), name: &str, kind: DataType, access: Access) -> Value {
    let texts = Default::default();
    Value { index, subs, name: name.to_owned(), kind: kind.0, access: Some(access), pdo: false, texts }
}

fn mistake(text: &[u8]) -> (u32, Mistake) {
    let error = read(&[text]).1.expect_err("no file");
    (error.line, error.mistake)
}

#[test]
fn a_variable_and_a_record() {
    let text = b"[FileInfo]\r\nFileName=drive.eds\r\n\r\n; objects\r\n[1000]\r\nParameterName=Device type ; of CiA 402\r\n\
        ObjectType=0x7\r\nDataType=0x0007\r\nAccessType=ro\r\nDefaultValue=0x00020192\r\nPDOMapping=0\r\n\
        [1018]\r\nParameterName=Identity object\r\nObjectType=0x9\r\nSubNumber=2\r\n\
        [1018sub0]\r\nParameterName=Highest sub-index\r\nDataType=5\r\nAccessType=const\r\n\
        [1018SUBa]\r\nParameterName=Vendor-ID\r\nObjectType=7\r\nDataType=0x7\r\nAccessType=RO\r\n\
        [1014]\r\nparametername=COB-ID EMCY\r\ndatatype=0x7\r\naccesstype=rw\r\ndefaultvalue=$NODEID+0x80";
    let device = Value {
        texts: [String::new(), String::new(), "0x00020192".to_owned(), String::new()],
        ..value(0x1000, (0, 0), "Device type", DataType::UNSIGNED32, Access::Ro)
    };
    let emergency = Value {
        texts: [String::new(), String::new(), "$NODEID+0x80".to_owned(), String::new()],
        ..value(0x1014, (0, 0), "COB-ID EMCY", DataType::UNSIGNED32, Access::Rw)
    };
    assert_eq!(
        objects(text),
        [
            Told::Object(device),
            Told::Name(0x1018, None, "Identity object".to_owned()),
            Told::Object(value(0x1018, (0, 0), "Highest sub-index", DataType::UNSIGNED8, Access::Const)),
            Told::Object(value(0x1018, (10, 10), "Vendor-ID", DataType::UNSIGNED32, Access::Ro)),
            Told::Object(emergency),
        ]
    );
}

#[test]
fn values_that_are_alike() {
    let text = b"[DummyUsage]\nDummy0001=0\n[1003]\nParameterName=Error field\nObjectType=8\nDataType=7\n\
        AccessType=ro\nCompactSubObj=4\n[1003Name]\nNrOfEntries=1\n2=Last but one\n[1003Value]\n1=5\n";
    assert_eq!(
        objects(text),
        [
            Told::Name(0x1003, None, "Error field".to_owned()),
            Told::Object(value(0x1003, (0, 0), "", DataType::UNSIGNED8, Access::Ro)),
            Told::Object(value(0x1003, (1, 4), "", DataType::UNSIGNED32, Access::Ro)),
            Told::Name(0x1003, Some(2), "Last but one".to_owned()),
        ]
    );
}

#[test]
fn what_real_files_have() {
    // A domain without a type; nothing behind a key; limits; a mark of UTF-8 before all; what a device is configured to.
    let text = "\u{FEFF}[1f50]\nParameterName=Programme=data;all\nObjectType=2\nDataType=\nAccessType=\n\
        LowLimit=-5\nHighLimit=0x7F\nParameterValue=3\nPDOMapping=1\nVendorKey=?\n";
    let Told::Object(object) = &objects(text.as_bytes())[0] else { panic!("no object") };
    assert_eq!((object.name.as_str(), object.kind), ("Programme=data;all", DataType::DOMAIN.0));
    assert_eq!((object.access, object.pdo), (None, true));
    assert_eq!(object.texts, ["-5", "0x7F", "", "3"]);
    // Latin-1; sections of which nobody needs anything, with lines that are none.
    let latin = b"[Comments]\nLines=1\nno line at all\n[1001Denotation]\n1=x\n[2000]\nParameterName=Temperatur [\xB0C]\n";
    let Told::Object(object) = &objects(latin)[0] else { panic!("no object") };
    assert_eq!(object.name, "Temperatur [°C]");
    // What is longer than is kept is cut, between letters.
    let long = format!("[2000]\nParameterName=x{}\nDefaultValue={}\n", "é".repeat(NAME), "9".repeat(100));
    let Told::Object(object) = &objects(long.as_bytes())[0] else { panic!("no object") };
    assert_eq!(object.name, format!("x{}", "é".repeat((NAME - 1) / 2)));
    assert_eq!(object.texts[2].len(), VALUE);
    // A comment of any length.
    let comment = format!(";{}\n[2000]\nDataType=7\n", "é".repeat(1000));
    assert_eq!(objects(comment.as_bytes()).len(), 1);
}

#[test]
fn what_is_wrong_has_its_line() {
    for (text, expected) in [
        (&b"PK\x03\x04"[..], (1, Mistake::NoSection)),
        (b"\n;\nkey=value\n[1000]\n", (3, Mistake::NoSection)),
        (b"", (1, Mistake::NoObject)),
        (b"[FileInfo]\nx=1\n", (3, Mistake::NoObject)),
        (b"[FileInfo]\r\n[1000\r\n", (2, Mistake::Header)),
        (b"[1000]\r\n\r\nParameterName\r\n", (3, Mistake::Line)),
        (b"[1000]\nDataType=word\n", (2, Mistake::Number)),
        (b"[1000]\nDataType=0x10000\n", (2, Mistake::Number)),
        (b"[1000]\nDataType=-1\n", (2, Mistake::Number)),
        (b"[1000]\nSubNumber=256\n", (2, Mistake::Number)),
        (b"[1000]\nAccessType=some", (2, Mistake::Access)),
    ] {
        assert_eq!(mistake(text), expected, "{}", text.escape_ascii());
    }
    assert_eq!(mistake(format!("[1000]\nDefaultValue={}", "é".repeat(LINE)).as_bytes()), (2, Mistake::Long));
    assert_eq!(mistake(format!("[{}", "x".repeat(LINE)).as_bytes()), (1, Mistake::Long));
    let shown = Error { line: 7, mistake: Mistake::Number }.to_string();
    assert_eq!(shown, "line 7: no number of the size that is needed");
}

#[test]
fn numbers() {
    let number = |text, kind| Number::parse(text, kind, 5).map(|number| number.to_string());
    for (text, kind, expected) in [
        ("0x20192", DataType::UNSIGNED32, Some("131474")),
        ("100", DataType::UNSIGNED8, Some("100")),
        ("010", DataType::UNSIGNED8, Some("10")),
        ("$NODEID", DataType::UNSIGNED8, Some("5")),
        ("$NODEID+0x180", DataType::UNSIGNED32, Some("389")),
        ("0x40000180 + $nodeid", DataType::UNSIGNED32, Some("1073742213")),
        ("-128", DataType::INTEGER8, Some("-128")),
        ("-0", DataType::INTEGER8, Some("0")),
        ("0x80", DataType::INTEGER8, Some("-128")),
        ("0xFFFF", DataType::INTEGER16, Some("-1")),
        ("0x7FFF", DataType::INTEGER16, Some("32767")),
        ("0x8000000000000000", DataType::INTEGER64, Some("-9223372036854775808")),
        ("18446744073709551615", DataType::UNSIGNED64, Some("18446744073709551615")),
        ("0x800000", DataType::INTEGER24, Some("-8388608")),
        ("128", DataType::INTEGER8, None),
        ("-129", DataType::INTEGER8, None),
        ("-1", DataType::UNSIGNED8, None),
        ("256", DataType::UNSIGNED8, None),
        ("", DataType::UNSIGNED8, None),
        ("1.5", DataType::REAL32, None),
        ("text", DataType::VISIBLE_STRING, None),
        ("0x+1", DataType::UNSIGNED8, None),
        ("$NODEID+-1", DataType::INTEGER8, None),
        ("1+", DataType::UNSIGNED8, None),
        ("18446744073709551615+1", DataType::UNSIGNED64, None),
    ] {
        assert_eq!(number(text, kind).as_deref(), expected, "{text} {kind:?}");
    }
}

/// Objects, as the file of them is to be read.
fn any_value() -> impl Strategy<Value = Value> {
    let name = "[A-Za-z][A-Za-z0-9 ()=:]{0,28}[A-Za-z0-9]";
    let text = proptest::option::of("0x[0-9A-F]{1,8}");
    let access = proptest::option::of(proptest::sample::select(&Access::ALL[..]));
    (
        any::<u16>(),
        1..=254_u8,
        name,
        1..0x1C_u16,
        access,
        any::<bool>(),
        [text.clone(), text.clone(), text.clone(), text],
    )
        .prop_map(|(index, sub, name, kind, access, pdo, texts)| Value {
            index,
            subs: (sub, sub),
            name,
            kind,
            access,
            pdo,
            texts: texts.map(Option::unwrap_or_default),
        })
}

fn write(value: &Value) -> String {
    let Value { index, subs: (sub, _), name, kind, pdo, texts, .. } = value;
    let access = value.access.map_or("", Access::name);
    let [low, high, default, set] = texts;
    format!(
        "[{index:04x}sub{sub:X}]\r\nParameterName={name}\r\nObjectType=7\r\nDataType={kind}\r\nAccessType={access}\r\n\
         PDOMapping={}\r\nLowLimit={low}\r\nHighLimit={high}\r\nDefaultValue={default}\r\nParameterValue={set}\r\n",
        u8::from(*pdo)
    )
}

proptest! {
    /// What is written is read, however the file is cut.
    #[test]
    fn written_and_read(values in proptest::collection::vec(any_value(), 1..8), piece in 1_usize..300) {
        let text: String = values.iter().map(write).collect();
        let pieces: Vec<&[u8]> = text.as_bytes().chunks(piece).collect();
        let (entries, result) = read(&pieces);
        prop_assert_eq!(result, Ok(()));
        prop_assert_eq!(entries, values.into_iter().map(Told::Object).collect::<Vec<_>>());
    }

    /// Whatever comes is read or refused, and where it is cut makes no difference.
    #[test]
    fn any_bytes(lines in proptest::collection::vec(any_line(), 0..12), piece in 1_usize..40) {
        let text = lines.concat();
        let pieces: Vec<&[u8]> = text.chunks(piece).collect();
        prop_assert_eq!(read(&pieces), read(&[&text]));
    }

    /// A number is one that its type has.
    #[test]
    fn a_number_fits_its_type(text in "(-?(0x)?[0-9A-F]{1,17}|[$]NODEID)([+](0x)?[0-9A-F]{1,8})?", kind in 0..0x1D_u16, node in 1..=127_u8) {
        let kind = DataType(kind);
        if let Some(number) = Number::parse(&text, kind, node) {
            let bits = 8 * u32::from(kind.size().expect("a size"));
            let magnitude = u128::from(number.magnitude);
            let most = if kind.signed() { 1_u128 << (bits - 1) } else { 1 << bits };
            prop_assert!(magnitude < most || number.negative && magnitude == most);
            prop_assert!(!number.negative || kind.signed() && magnitude > 0);
        }
    }
}

fn any_line() -> impl Strategy<Value = Vec<u8>> {
    let known = proptest::sample::select(
        &[
            "[1000]\n",
            "[1018sub1]\r\n",
            "[1003Name]\n",
            "[x",
            "DataType=0x7\n",
            "ObjectType=9\n",
            "1=one\n",
            "CompactSubObj=0xFF\n",
            "LowLimit=",
            "ParameterName=name ; why\n",
            "AccessType=rw\n",
            ";",
        ][..],
    );
    prop_oneof![
        4 => known.prop_map(|line| line.as_bytes().to_vec()),
        1 => proptest::collection::vec(any::<u8>(), 0..400),
    ]
}
