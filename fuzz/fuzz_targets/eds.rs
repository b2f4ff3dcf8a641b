//! Whatever file is sent, it is read or refused; where it is cut makes no difference, and what is told of it has bounds.
#![no_main]

use puente_eds::{Entry, Error, NAME, Number, Reader, VALUE};

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let Some((piece, file)) = data.split_first() else { return };
    let whole = read(file, file.len().max(1));
    assert_eq!(whole, read(file, usize::from(*piece).max(1)));
});

/// What is told, as text.
fn read(file: &[u8], piece: usize) -> (Vec<String>, Result<(), Error>) {
    let mut told = Vec::new();
    let mut reader = Reader::new();
    let mut take = |entry: Entry<'_>| {
        if let Entry::Object(object) = entry {
            assert!(object.first <= object.last && object.name.len() <= NAME);
            for text in [object.low, object.high, object.default, object.value] {
                assert!(text.len() <= VALUE);
                let _ = Number::parse(text, object.kind, 5);
            }
        }
        told.push(format!("{entry:?}"));
    };
    let mut result = Ok(());
    for piece in file.chunks(piece) {
        result = result.and_then(|()| reader.push(piece, &mut take));
    }
    result = result.and_then(|()| reader.end(&mut take));
    (told, result)
}
