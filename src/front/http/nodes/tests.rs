use super::*;

#[test]
fn nodes_have_ids() {
    assert_eq!(id("0"), Ok(None));
    assert_eq!(id("127"), Ok(NodeId::new(127)));
    for text in ["", "128", "-1", "x", "0x5"] {
        assert_eq!(id(text), Err(Problem::UnknownNode), "{text}");
    }
}

/// What is longest fits a sheet.
#[test]
fn objects_fit() {
    let dictionaries = crate::front::dictionary::Dictionaries::new();
    let whose = Whose { bus: 0, node: NodeId::new(127).expect("a node") };
    let (name, text) = ("\"".repeat(puente_eds::NAME), "\"".repeat(puente_eds::VALUE));
    let file = format!(
        "[1A00]\nParameterName={name}\nObjectType=9\n[1A00subFF]\nParameterName={name}\nDataType=0x1B\nAccessType=const\n\
         LowLimit={text}\nHighLimit={text}\nDefaultValue={text}\n"
    );
    let mut upload = dictionaries.begin(whose).expect("nobody else");
    upload.push(file.as_bytes()).expect("a file");
    upload.end().expect("a file");
    let address = Address::new(0x1A00, 0xFF);
    let known = dictionaries.look(whose, address, |found| view::Known::new(&found));
    let bytes = [b'"'; OBJECT];
    for kind in ["hex", "vs", "d"] {
        let kind = named(kind).expect("a type");
        let object = view::Object::new(whose.node, address, known.as_ref(), kind, Some(&bytes));
        let mut room = [0; super::super::reply::BODY];
        serde_json_core::to_slice(&object, &mut room).expect("it fits");
    }
}
