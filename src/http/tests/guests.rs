//! Whoever only costs us makes room for others: bounds of connections and of patience.

use super::*;

/// "At most 32 connections": for whoever comes later goes the oldest that asks for nothing.
#[test]
fn connections_that_ask_for_nothing_make_room() {
    let limits = Limits { connections: 2, header: FOREVER, lifetime: FOREVER, ..Limits::default() };
    let window = Window::open(Some(Snapshot::default()), limits);
    let mut first = window.connect();
    first.write_all(b"GET /healthz HT").expect("the kernel takes it");
    let mut second = window.connect();
    let mut third = window.connect();

    third.write_all(HEALTHZ).expect("the kernel takes the request");

    assert_eq!(Answer::read(third).body, "ok");
    first.set_read_timeout(Some(PATIENCE)).expect("a time-out");
    assert_eq!(first.read(&mut [0]).expect("the connection is closed"), 0);
    second.write_all(HEALTHZ).expect("the kernel takes the request");
    assert_eq!(Answer::read(second).body, "ok", "there was room for two");
}

/// Whoever has asked gets the answer, and whoever comes waits for that; who asks by a body has asked when it is whole.
#[test]
fn connections_that_are_answered_are_not_cut() {
    let token: Token = "0123456789abcdef".parse().expect("a token");
    let limits = Limits { connections: 1, ..Limits::default() };
    // It hangs, so that the answer takes a second or two.
    let window = Window::controlled(None, Some(token), Ok(()), limits);
    let order = b"POST /api/v1/gimbals/camera/stop HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\
        Authorization: Bearer 0123456789abcdef\r\nContent-Type: application/json\r\nContent-Length: 2\r\n\r\n{}";
    for (request, error) in
        [(HEALTHZ, "the core did not answer within 1 s"), (&order[..], "the core did not answer in time")]
    {
        let mut first = window.connect();
        first.write_all(request).expect("the kernel takes the request");
        let mut second = window.connect();
        second
            .write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
            .expect("the kernel takes it");

        assert_eq!(Answer::read(first).json(), json!({"error": error}));
        assert_eq!(Answer::read(second).status, 200);
    }
}

/// Who asks on and on without reading, or sends a body by halves, keeps nobody out.
#[test]
fn connections_that_only_keep_us_busy_make_room() {
    let token: Token = "0123456789abcdef0123456789abcdef".parse().expect("a token");
    let limits = Limits { connections: 2, header: FOREVER, body: FOREVER, lifetime: FOREVER, ..Limits::default() };
    // Each answer takes the interval between two snapshots, so these would be there for minutes.
    let on_and_on = b"GET /api/v1/status HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(5000);
    let half = b"POST /api/v1/gimbals/camera/turn HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n\
        Authorization: Bearer 0123456789abcdef0123456789abcdef\r\nContent-Length: 14\r\n\r\n{\"y";
    for busy in [&on_and_on[..], half] {
        let window = Window::controlled(Some(Snapshot::default()), Some(token.clone()), Ok(()), limits);
        let mut guests: Vec<_> = (0..10).map(|_| window.connect()).collect();
        for guest in &mut guests {
            guest.set_nonblocking(true).expect("a flag");
            // As much as the kernel takes; it may be cut already.
            let _ = guest.write(busy);
        }

        assert_eq!(window.get("/healthz").body, "ok");
    }
}

/// A client that sends its headers by the byte, or nothing at all, loses its place.
#[test]
fn slow_headers_are_cut() {
    let header = Duration::from_millis(200);
    let window = Window::open(Some(Snapshot::default()), Limits { header, lifetime: FOREVER, ..Limits::default() });
    for beginning in ["", "GET /healthz HT", "GET /healthz HTTP/1.1\r\nHost: localhost\r\n"] {
        let start = now();
        let mut client = window.connect();
        client.write_all(beginning.as_bytes()).expect("the kernel takes it");
        let mut answer = String::new();
        client.read_to_string(&mut answer).expect("the connection is closed");
        assert!(!answer.contains("200 OK"), "{beginning:?} got {answer:?}");
        assert!(start.elapsed() >= header, "{beginning:?} was cut after {:?}", start.elapsed());
    }
    let mut idle = window.connect();
    idle.write_all(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n").expect("the kernel takes it");
    assert_eq!(Answer::read(idle).body, "ok", "answered, then closed although the client would stay");
}

/// Answers that nobody reads do not hold a place for ever.
#[test]
fn clients_that_do_not_read_are_cut() {
    let short = Duration::from_millis(200);
    let limits = Limits { lifetime: short, farewell: short, ..Limits::default() };
    let window = Window::open(Some(Snapshot::default()), limits);
    let mut client = window.connect();
    client.set_write_timeout(Some(PATIENCE)).expect("a time-out");
    let request = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n".repeat(100);
    let error = loop {
        if let Err(error) = client.write_all(&request) {
            break error;
        }
    };
    assert!(matches!(error.kind(), ErrorKind::ConnectionReset | ErrorKind::BrokenPipe), "{error}");
}

#[test]
fn headers_without_end_are_refused() {
    let window = Window::of(Snapshot::default());
    let mut client = window.connect();
    let padding = format!("GET /healthz HTTP/1.1\r\nHost: localhost\r\nX-Padding: {}\r\n\r\n", "a".repeat(64 * 1024));
    client.write_all(padding.as_bytes()).expect("the kernel takes it");
    let mut status_line = [0; 12];
    client.read_exact(&mut status_line).expect("an answer");
    assert_eq!(&status_line, b"HTTP/1.1 431");
}
