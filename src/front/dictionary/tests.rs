use puente_canopen::NodeId;
use puente_eds::Access;

use super::*;
use crate::port::limits::{DICTIONARIES, DICTIONARY};

const FILE: &str = "[1000]\nParameterName=Device type\nDataType=7\nAccessType=ro\nDefaultValue=0x20192\n\
[1018]\nParameterName=Identity\nObjectType=9\n[1018sub1]\nParameterName=Vendor-ID\nDataType=7\nAccessType=ro\n\
[1003]\nParameterName=Errors\nObjectType=8\nDataType=7\nAccessType=ro\nCompactSubObj=8\n[1003Name]\n3=The third\n";

fn dictionaries() -> Dictionaries {
    Dictionaries::with(Box::leak(Box::new(Store::new())), Box::leak(Box::default()))
}

fn whose(node: u8) -> Whose {
    Whose { bus: 0, node: NodeId::new(node).expect("a node") }
}

fn upload(all: &Dictionaries, node: u8, file: &str) -> Held {
    let mut upload = all.begin(whose(node)).expect("nobody else");
    for piece in file.as_bytes().chunks(11) {
        upload.push(piece).expect("a file");
    }
    upload.end().expect("a file").expect("it is kept")
}

/// Names and type of an object.
fn look(all: &Dictionaries, node: u8, index: u16, sub: u8) -> Option<(String, String, &'static str)> {
    let text = |text: Option<&str>| text.unwrap_or("-").to_owned();
    all.look(whose(node), Address::new(index, sub), |found| {
        (text(found.group), text(found.name), found.kind().0)
    })
}

#[test]
fn objects_have_names_and_types() {
    let all = dictionaries();
    let held = upload(&all, 5, FILE);
    assert_eq!((held.objects, held.left_out), (4, 0));
    let shown = |group: &str, name: &str, kind| Some((group.to_owned(), name.to_owned(), kind));
    assert_eq!(look(&all, 5, 0x1000, 0), shown("-", "Device type", "u32"));
    assert_eq!(look(&all, 5, 0x1018, 1), shown("Identity", "Vendor-ID", "u32"));
    assert_eq!(look(&all, 5, 0x1003, 0), shown("Errors", "-", "u8"));
    assert_eq!(look(&all, 5, 0x1003, 3), shown("Errors", "The third", "u32"));
    assert_eq!(look(&all, 5, 0x1003, 8), shown("Errors", "-", "u32"));
    for (index, sub) in [(0x1000, 1), (0x1003, 9), (0x1018, 0), (0x2000, 0)] {
        assert_eq!(look(&all, 5, index, sub), None);
    }
    assert_eq!(look(&all, 6, 0x1000, 0), None, "of another node");
    let first = all
        .nth(whose(5), 0, |found| (found.object.index, found.object.access, found.object.default.to_owned()));
    assert_eq!(first, Some((0x1000, Some(Access::Ro), "0x20192".to_owned())));
    assert!(all.nth(whose(5), 4, |_| ()).is_none());
}

#[test]
fn a_file_replaces_the_one_before_and_one_comes_at_a_time() {
    let all = dictionaries();
    upload(&all, 1, "[1000]\nParameterName=One\nDataType=7\n");
    upload(&all, 2, FILE);
    upload(&all, 3, "[1000]\nParameterName=Three\nDataType=5\n");
    let mut coming = all.begin(whose(2)).expect("nobody else");
    assert!(all.begin(whose(4)).is_none(), "one at a time");
    coming.push(b"[2000]\nParameterName=New\nDataType=3\n").expect("a file");
    assert_eq!(look(&all, 2, 0x1000, 0), None, "what there was is gone, what comes is not known yet");
    all.forget(whose(1));
    let held = coming.end().expect("a file").expect("it is kept");
    assert_eq!(held.objects, 1);
    assert_eq!(look(&all, 1, 0x1000, 0), None);
    assert_eq!(look(&all, 2, 0x2000, 0).expect("an object").1, "New");
    assert_eq!(look(&all, 3, 0x1000, 0).expect("an object").1, "Three");
}

#[test]
fn nothing_is_kept_of_what_is_no_file_or_does_not_end() {
    let all = dictionaries();
    upload(&all, 1, FILE);
    let mut upload_2 = all.begin(whose(2)).expect("nobody else");
    let error = upload_2.push(b"[1000]\nDataType=7\n[1001]\nDataType=?\n").expect_err("no file");
    assert_eq!(error.line, 4);
    drop(upload_2);
    let mut upload_3 = all.begin(whose(3)).expect("the reader is back");
    upload_3.push(FILE.as_bytes()).expect("a file");
    drop(upload_3);
    for node in [2, 3] {
        assert!(all.held(whose(node)).is_none());
    }
    upload(&all, 4, "[1000]\nParameterName=Four\nDataType=7\n");
    assert_eq!(look(&all, 4, 0x1000, 0).expect("an object").1, "Four");
    assert_eq!(look(&all, 1, 0x1018, 1).expect("an object").1, "Vendor-ID");
}

#[test]
fn what_does_not_fit_is_counted() {
    let all = dictionaries();
    let file: String = (0..=u16::MAX)
        .map(|index| format!("[{index:04X}]\nParameterName=A name of thirty-two characters..\nDataType=7\n"))
        .collect();
    let held = upload(&all, 1, &file);
    assert_eq!(held.objects + held.left_out, 0x1_0000);
    assert!(held.left_out > 0 && held.objects as usize > DICTIONARY / 60);
    let last = held.objects as u16 - 1;
    assert!(look(&all, 1, last, 0).is_some() && look(&all, 1, last + 1, 0).is_none());
    all.forget(whose(1));
    // And so are those of more nodes than there is room for.
    for node in 1..=DICTIONARIES as u8 {
        assert_eq!(upload(&all, node, FILE).objects, 4);
    }
    if DICTIONARIES < 127 {
        let held = upload(&all, 127, FILE);
        assert_eq!((held.objects, held.left_out), (0, 4));
        assert_eq!(look(&all, 127, 0x1000, 0), None);
    }
    assert!(look(&all, 1, 0x1000, 0).is_some());
}
