//! What is under `/api/buses/NAME/nodes`.

use puente_canopen::nmt;

use super::super::head::Method;
use crate::front::objects;

/// What the rest of the path names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::front::http) enum Path<'p> {
    /// Nothing more: all nodes.
    All,
    /// `/ID`
    Node(&'p str),
    /// `/ID/COMMAND`
    Command(&'p str, nmt::Command),
    /// `/ID/emergencies`
    Emergencies(&'p str),
    /// `/ID/eds`
    Sheet(&'p str),
    /// `/ID/objects`
    Objects(&'p str),
    /// `/ID/objects/OBJECT`, and `/TYPE` behind it
    Object(&'p str, &'p str, Option<&'p str>),
}

impl<'p> Path<'p> {
    pub fn find(segments: &[&'p str]) -> Option<Self> {
        Some(match *segments {
            [] => Path::All,
            [node] => Path::Node(node),
            [node, "emergencies"] => Path::Emergencies(node),
            [node, "eds"] => Path::Sheet(node),
            [node, "objects"] => Path::Objects(node),
            [node, "objects", object] => Path::Object(node, object, None),
            [node, "objects", object, kind] => Path::Object(node, object, Some(kind)),
            [node, command] => Path::Command(node, objects::command(command)?),
            _ => return None,
        })
    }

    pub const fn methods(&self) -> &'static str {
        match self {
            Path::Command(..) => "POST",
            Path::Sheet(_) => "GET, HEAD, PUT, DELETE",
            Path::Object(..) => "GET, HEAD, PUT",
            Path::All | Path::Node(_) | Path::Emergencies(_) | Path::Objects(_) => "GET, HEAD",
        }
    }

    pub const fn takes(&self, method: Method) -> bool {
        match method {
            Method::Get | Method::Head => !matches!(self, Path::Command(..)),
            Method::Post => matches!(self, Path::Command(..)),
            Method::Put => matches!(self, Path::Sheet(_) | Path::Object(..)),
            Method::Delete => matches!(self, Path::Sheet(_)),
            Method::Other => false,
        }
    }
}
