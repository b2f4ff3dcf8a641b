//! The page, as files in the program.

/// A file.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Asset {
    pub name: &'static str,
    pub content_type: &'static str,
    pub content: &'static [u8],
}

pub(super) static INDEX: Asset =
    Asset { name: "", content_type: "text/html; charset=utf-8", content: include_bytes!("page/index.html") };
static STYLE: Asset = Asset {
    name: "panel.css",
    content_type: "text/css; charset=utf-8",
    content: include_bytes!("page/panel.css"),
};
static PID: Asset = Asset {
    name: "pid.js",
    content_type: "text/javascript; charset=utf-8",
    content: include_bytes!("page/pid.js"),
};
static NODES: Asset = Asset {
    name: "nodes.js",
    content_type: "text/javascript; charset=utf-8",
    content: include_bytes!("page/nodes.js"),
};
static CIA402: Asset = Asset {
    name: "cia402.js",
    content_type: "text/javascript; charset=utf-8",
    content: include_bytes!("page/cia402.js"),
};
static SCRIPT: Asset = Asset {
    name: "panel.js",
    content_type: "text/javascript; charset=utf-8",
    content: include_bytes!("page/panel.js"),
};

static FILES: [&Asset; 6] = [&INDEX, &STYLE, &PID, &CIA402, &NODES, &SCRIPT];

/// Scripts, styles and requests of the page's own origin only, and no frame around it that could lend its buttons to
/// another page.
pub(super) const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; \
connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// The file of this name; the empty name is the page itself.
pub(super) fn asset(name: &str) -> Option<&'static Asset> {
    FILES.into_iter().find(|asset| asset.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_is_small_and_refers_to_its_own_files_only() {
        assert!(FILES.iter().map(|file| file.content.len()).sum::<usize>() < 48_000);
        let index = core::str::from_utf8(INDEX.content).expect("UTF-8");
        for part in index.split(" src=\"").skip(1).chain(index.split("rel=\"stylesheet\" href=\"").skip(1)) {
            let name = part.split('"').next().expect("a name");
            assert!(asset(name).is_some(), "{name}");
        }
        // The policy forbids them.
        assert!(!index.contains("<style") && !index.contains(" style=") && !index.contains(" onclick="));
    }
}
