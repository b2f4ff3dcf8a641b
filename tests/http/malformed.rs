//! What is no request, or an unusual one.

use std::time::{Duration, Instant};

use super::client::Gateway;

const STATUS: &str = "GET /api/axes/x HTTP/1.1\r\nHost: gw\r\n\r\n";

#[test]
fn what_cannot_be_understood_is_answered_and_closed() {
    let gateway = Gateway::start(16);
    for (request, status, code) in [
        ("GET / HTTP/9.9\r\n\r\n", 400, "bad-request"),
        ("GET /\r\n\r\n", 400, "bad-request"),
        ("GET / HTTP/1.1\r\nno colon here\r\n\r\n", 400, "bad-request"),
        ("POST /\u{7f} HTTP/1.1\r\n\r\n", 400, "bad-request"),
        ("GET / HTTP/1.1\r\nA\0: b\r\n\r\n", 400, "bad-request"),
        ("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", 400, "bad-request"),
        ("POST /api/axes/x/stop HTTP/1.1\r\nContent-Length: -1\r\n\r\n", 400, "bad-request"),
        (
            "POST /api/axes/x/stop HTTP/1.1\r\nContent-Length: 1\r\nContent-Length: 0\r\n\r\n",
            400,
            "bad-request",
        ),
        ("POST /api/axes/x/stop HTTP/1.1\r\nContent-Length: 18446744073709551615\r\n\r\n", 413, "too-large"),
        ("POST /api/axes/x/stop HTTP/1.1\r\nContent-Length: 1000000\r\n\r\n", 413, "too-large"),
        (
            "POST /api/axes/x/stop HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
            411,
            "length-required",
        ),
    ] {
        let mut client = gateway.connect();
        client.send(request);
        let reply = client.reply();
        assert_eq!(reply.error(), (status, code.to_owned()), "{request:?}");
        assert_eq!(reply.field("connection"), Some("close"), "{request:?}");
        assert!(client.closed(), "{request:?}");
    }
    assert_eq!(gateway.axis("x")["online"], true);
}

/// What an intermediary takes for a body must not be carried out as a request.
#[test]
fn no_request_hides_in_the_body_of_another() {
    let gateway = Gateway::start(16);
    let hidden = "POST /api/axes/x/enable HTTP/1.1\r\n\r\n";
    for field in
        ["Content-Length: 0x25", "Content-Length: 0\r\nContent-Length: 37", "Transfer-Encoding: identity"]
    {
        let mut client = gateway.connect();
        client.send(&format!("POST /api/axes/x/disable HTTP/1.1\r\n{field}\r\n\r\n{hidden}"));
        let reply = client.reply();
        assert!(reply.status == 400 || reply.status == 411, "{field}");
        assert!(client.closed(), "{field}");
    }
    let body =
        format!("POST /api/axes/x/disable HTTP/1.1\r\nContent-Length: {}\r\n\r\n{hidden}", hidden.len());
    let mut client = gateway.connect();
    client.send(&format!("{body}{STATUS}"));
    assert_eq!(client.reply().json()["enabled"], false);
    assert_eq!(client.reply().json()["enabled"], false);
}

#[test]
fn a_request_may_come_byte_by_byte() {
    let gateway = Gateway::start(16);
    let mut client = gateway.connect();
    let body = "{\"value\":77}";
    let request = format!(
        "PUT /api/axes/x/parameters/Pn037 HTTP/1.1\r\nHost: gw\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    for byte in request.as_bytes() {
        client.send_bytes(std::slice::from_ref(byte)).expect("sent");
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(client.reply().json()["value"], 77);
}

#[test]
fn requests_may_come_at_once() {
    let gateway = Gateway::start(16);
    let mut client = gateway.connect();
    client.send(&format!(
        "{STATUS}HEAD /api/axes/x HTTP/1.1\r\n\r\n\r\n{STATUS}GET /nothing HTTP/1.1\r\n\r\n{STATUS}"
    ));
    assert_eq!(client.reply().json()["name"], "x");
    let head = client.head();
    assert!(head.status == 200 && head.field("content-length").is_some());
    assert_eq!(client.reply().json()["name"], "x");
    assert_eq!(client.reply().status, 404);
    assert_eq!(client.reply().json()["name"], "x");
}

#[test]
fn the_end_of_a_connection() {
    let gateway = Gateway::start(16);
    for request in
        ["GET /api/axes/x HTTP/1.0\r\n\r\n", "GET /api/axes/x HTTP/1.1\r\nConnection: close\r\n\r\n"]
    {
        let mut client = gateway.connect();
        client.send(request);
        assert_eq!(client.reply().json()["name"], "x");
        assert!(client.closed());
    }
    // A client that has said all it wants still gets its replies.
    let mut client = gateway.connect();
    client.send(&format!("{STATUS}{STATUS}"));
    client.finish();
    assert_eq!(client.reply().status, 200);
    assert_eq!(client.reply().status, 200);
    assert!(client.closed());
    let mut client = gateway.connect();
    client.send("POST /api/axes/x/stop HTTP/1.1\r\nContent-Length: 5\r\n\r\nab");
    client.finish();
    assert_eq!(client.reply().error(), (400, "bad-request".to_owned()));
}

#[test]
fn a_body_waits_for_leave_where_the_client_wants_it() {
    let gateway = Gateway::start(16);
    let mut client = gateway.connect();
    client.send(
        "PUT /api/axes/x/parameters/Pn037 HTTP/1.1\r\nExpect: 100-continue\r\nContent-Length: 12\r\n\r\n",
    );
    assert_eq!(client.head().status, 100);
    client.send("{\"value\":55}");
    assert_eq!(client.reply().json()["value"], 55);
}

#[test]
fn a_flood_of_header_fields_is_cut_off() {
    let gateway = Gateway::start(16);
    for line in ["Cookie: a=b\r\n".to_owned(), format!("Cookie: {}\r\n", "a".repeat(5000))] {
        let mut client = gateway.connect();
        client.send("GET / HTTP/1.1\r\n");
        // The gateway may have closed before all is sent.
        for _ in 0..200 {
            if client.send_bytes(line.as_bytes()).is_err() {
                break;
            }
        }
        assert_eq!(client.reply().error(), (431, "too-large".to_owned()));
        assert!(client.closed());
    }
}

#[test]
fn a_request_that_never_ends_holds_nobody_up() {
    let gateway = Gateway::start(16);
    let mut slow = gateway.connect();
    slow.send("POST /api/axes/x/jog HTTP/1.1\r\nContent-Length: 20\r\n\r\n{\"rpm\"");
    let start = Instant::now();
    assert_eq!(gateway.axis("x")["online"], true);
    let others = start.elapsed();
    // It gets its error once its time is up, long after others were served.
    assert_eq!(slow.reply().error(), (408, "timeout".to_owned()));
    assert!(others * 2 < start.elapsed(), "{others:?}");
    assert!(slow.closed());
}
