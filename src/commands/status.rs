//! Asks a running daemon how it is, and shows the answer to a person.

mod text;

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use axum::body::{Body, to_bytes};
use axum::http::{Request, StatusCode, Uri, header};
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use serde_json::Value;
use tokio::net::TcpStream;
use tokio::time::{sleep, timeout};

use crate::bridge::snapshot::Snapshot;
use crate::cli::StatusArgs;
use crate::exit_code::ExitCode;

const STATUS_PATH: &str = "/api/v1/status";
const DEADLINE: Duration = Duration::from_secs(2);
const REDRAW: Duration = Duration::from_secs(1);
/// A status is a few kilobytes; whatever sends more than this is not gimbald.
const ANSWER_BYTES: usize = 1024 * 1024;

#[derive(Debug, thiserror::Error)]
pub enum StatusError {
    #[error("{0:?} is not an address that can be asked: expected http://HOST:PORT, for example http://127.0.0.1:8080")]
    Url(String),
    #[error(
        "no gimbald answers at {url} ({source}): is it running (systemctl status gimbald), \
         and is [http] listen that address? Otherwise name it with --url"
    )]
    Unreachable { url: String, source: io::Error },
    #[error("{url} did not answer within 2 s: is it gimbald, and can it be reached?")]
    TimedOut { url: String },
    #[error("gimbald at {url} answers {status}: {reason}")]
    Refused { url: String, status: StatusCode, reason: String },
    #[error("what answers at {url} is not a gimbald of this version: {what}")]
    NotGimbald { url: String, what: String },
    #[error("the status cannot be shown")]
    Output(#[source] io::Error),
}

impl StatusError {
    /// As in sysexits: 64 for a wrong argument, 69 for a daemon that is not there.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Url(_) => ExitCode::Usage,
            Self::Unreachable { .. }
            | Self::TimedOut { .. }
            | Self::Refused { .. }
            | Self::NotGimbald { .. }
            | Self::Output(_) => ExitCode::Unavailable,
        }
    }
}

/// Prints the status, and to `errors` why it could not.
pub fn status(arguments: &StatusArgs, errors: &mut impl Write) -> ExitCode {
    match run(arguments) {
        Ok(()) => ExitCode::Ok,
        Err(error) => {
            // The exit code says it too; nobody is left to tell when the reader is gone.
            let _ = writeln!(errors, "gimbald: {error}");
            error.exit_code()
        }
    }
}

/// What the daemon at `url` tells.
pub(super) async fn snapshot(url: &str) -> Result<Snapshot, StatusError> {
    let target = Target::parse(url)?;
    let answer = fetch(&target).await?;
    let not_gimbald =
        |error: serde_json::Error| StatusError::NotGimbald { url: url.to_owned(), what: error.to_string() };
    serde_json::from_slice(&answer).map_err(not_gimbald)
}

/// Prints the status once, or until Ctrl-C; while watching, a daemon that does not answer is shown and asked again.
fn run(options: &StatusArgs) -> Result<(), StatusError> {
    let target = Target::parse(&options.url)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build();
    let runtime = runtime.map_err(StatusError::Output)?;
    let result = runtime.block_on(async {
        if options.watch {
            tokio::select! {
                stopped = tokio::signal::ctrl_c() => stopped.map_err(StatusError::Output),
                result = watch(&target, options.json) => result,
            }
        } else {
            let text = report(&fetch(&target).await?, &target, options.json)?;
            io::stdout().write_all(text.as_bytes()).map_err(StatusError::Output)
        }
    });
    // A name that is still being resolved must not keep the command from ending.
    runtime.shutdown_background();
    match result {
        // `gimbald status | head` has seen enough.
        Err(StatusError::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

async fn watch(target: &Target, json: bool) -> Result<(), StatusError> {
    let screen = !json && io::stdout().is_terminal();
    loop {
        let text = match fetch(target).await {
            Ok(answer) => report(&answer, target, json),
            Err(error) => Err(error),
        };
        let mut stdout = io::stdout().lock();
        let shown = match text {
            Ok(text) if screen => write!(stdout, "{}", redrawn(&text)),
            Ok(text) if json => stdout.write_all(text.as_bytes()),
            Ok(text) => writeln!(stdout, "{text}"),
            Err(error) if screen => write!(stdout, "{}", redrawn(&format!("{error}\n"))),
            Err(error) => writeln!(io::stderr(), "{error}"),
        };
        shown.and_then(|()| stdout.flush()).map_err(StatusError::Output)?;
        drop(stdout);
        sleep(REDRAW).await;
    }
}

/// `text` in the place of what the terminal shows, line by line, so that nothing flickers.
fn redrawn(text: &str) -> String {
    format!("\x1b[H{}\x1b[J", text.replace('\n', "\x1b[K\n"))
}

fn report(answer: &[u8], target: &Target, json: bool) -> Result<String, StatusError> {
    let not_gimbald =
        |error: serde_json::Error| StatusError::NotGimbald { url: target.url.clone(), what: error.to_string() };
    let value: Value = serde_json::from_slice(answer).map_err(not_gimbald)?;
    if json {
        return Ok(format!("{}\n", String::from_utf8_lossy(answer)));
    }
    let snapshot: Snapshot = serde_json::from_value(printable(value)).map_err(not_gimbald)?;
    Ok(text::report(&snapshot))
}

/// Names come from devices: nothing in them may move the cursor or turn the writing round.
pub(super) fn printable_text(text: &str) -> String {
    text.replace(commands_the_terminal, "\u{fffd}")
}

/// The same for every text in a value.
fn printable(value: Value) -> Value {
    match value {
        Value::String(text) => Value::String(printable_text(&text)),
        Value::Array(items) => Value::Array(items.into_iter().map(printable).collect()),
        Value::Object(entries) => {
            entries.into_iter().map(|(key, value)| (printable_text(&key), printable(value))).collect()
        }
        Value::Null | Value::Bool(_) | Value::Number(_) => value,
    }
}

fn commands_the_terminal(char: char) -> bool {
    char.is_control() || matches!(char, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Whom to ask for what.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Target {
    url: String,
    host: String,
    port: u16,
    authority: String,
    path: String,
}

impl Target {
    fn parse(url: &str) -> Result<Self, StatusError> {
        let wrong = || StatusError::Url(url.to_owned());
        let uri: Uri = url.parse().map_err(|_| wrong())?;
        let authority = uri.authority().ok_or_else(wrong)?;
        if uri.scheme_str() != Some("http") || uri.query().is_some() || authority.host().is_empty() {
            return Err(wrong());
        }
        let port = match authority.as_str().strip_prefix(authority.host()) {
            Some("") => 80,
            Some(port) => {
                let port = port.strip_prefix(':').and_then(|port| port.parse().ok()); // no number, or none that fits
                port.filter(|port| *port != 0).ok_or_else(wrong)?
            }
            None => return Err(wrong()), // a user name stands before the host
        };
        let base = uri.path().trim_end_matches('/');
        let base = base.strip_suffix(STATUS_PATH).unwrap_or(base);
        Ok(Self {
            url: url.to_owned(),
            host: authority.host().trim_start_matches('[').trim_end_matches(']').to_owned(),
            port,
            authority: authority.to_string(),
            path: format!("{base}{STATUS_PATH}"),
        })
    }
}

async fn fetch(target: &Target) -> Result<Vec<u8>, StatusError> {
    match timeout(DEADLINE, ask(target)).await {
        Ok(result) => result,
        Err(_) => Err(StatusError::TimedOut { url: target.url.clone() }),
    }
}

async fn ask(target: &Target) -> Result<Vec<u8>, StatusError> {
    let url = || target.url.clone();
    let not_gimbald = |what: String| StatusError::NotGimbald { url: url(), what };
    let request = Request::get(&target.path).header(header::HOST, &target.authority).body(Body::empty());
    let request = request.map_err(|_| StatusError::Url(url()))?;
    let stream = TcpStream::connect((target.host.as_str(), target.port)).await;
    let stream = stream.map_err(|source| StatusError::Unreachable { url: url(), source })?;
    let (mut sender, connection) =
        http1::handshake(TokioIo::new(stream)).await.map_err(|error| not_gimbald(error.to_string()))?;
    let conversation = async move {
        let answer = sender.send_request(request).await.map_err(|error| not_gimbald(error.to_string()))?;
        let status = answer.status();
        let body = to_bytes(Body::new(answer.into_body()), ANSWER_BYTES).await;
        Ok((status, body.map_err(|error| not_gimbald(error.to_string()))?))
    };
    // What breaks the connection breaks the conversation too, which tells it.
    let (answer, _) = tokio::join!(conversation, connection);
    let (status, body) = answer?;
    if status == StatusCode::OK {
        return Ok(body.to_vec());
    }
    match serde_json::from_slice::<Value>(&body).map(printable) {
        Ok(Value::Object(refusal)) => match refusal.get("error") {
            Some(Value::String(reason)) => Err(StatusError::Refused { url: url(), status, reason: reason.clone() }),
            Some(_) | None => Err(StatusError::NotGimbald { url: url(), what: status.to_string() }),
        },
        Ok(_) | Err(_) => Err(StatusError::NotGimbald { url: url(), what: status.to_string() }),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::net::{SocketAddr, TcpListener};
    use std::thread::JoinHandle;
    use std::time::Instant;

    use super::*;
    use crate::http::canned;

    #[test]
    #[rustfmt::skip]
    fn only_http_addresses_are_asked() {
        for (url,                                  host,          port, path) in [
            ("http://127.0.0.1:8080",              "127.0.0.1",   8080, "/api/v1/status"),
            ("http://127.0.0.1:8080/",             "127.0.0.1",   8080, "/api/v1/status"),
            ("http://drone.local",                 "drone.local", 80,   "/api/v1/status"),
            ("http://[::1]:8080/api/v1/status",    "::1",         8080, "/api/v1/status"),
            ("http://ground:80/drone7/",           "ground",      80,   "/drone7/api/v1/status"),
        ] {
            let target = Target::parse(url).expect(url);
            assert_eq!((target.host.as_str(), target.port, target.path.as_str()), (host, port, path), "{url}");
        }
        for url in [
            "", "127.0.0.1:8080", "drone.local", "/api/v1/status", "https://127.0.0.1:8080", "file:///etc/passwd",
            "http://", "http://:8080", "http://user:secret@drone", "http://drone:0", "http://drone:99999", "http://a b",
            "http://drone/?x=1",
        ] {
            let error = Target::parse(url).expect_err(url);
            assert_eq!((error.exit_code(), error.to_string()), (ExitCode::Usage, format!(
                "{url:?} is not an address that can be asked: expected http://HOST:PORT, for example http://127.0.0.1:8080"
            )));
        }
    }

    /// "No daemon: message with remedy and exit code 69."
    #[test]
    fn a_daemon_that_is_not_there_is_unavailable() {
        let free = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = free.local_addr().expect("its address");
        drop(free);
        let error = run(&options(address)).expect_err("nobody listens");
        let text = error.to_string();
        assert_eq!(error.exit_code(), ExitCode::Unavailable);
        assert!(text.starts_with(&format!("no gimbald answers at http://{address} (")), "{text}");
        assert!(text.contains("systemctl status gimbald") && text.contains("--url"), "{text}");
    }

    #[test]
    fn a_core_that_hangs_is_told() {
        let body = r#"{"error":"the core did not answer within 500 ms"}"#;
        let answer = format!("HTTP/1.1 503 Service Unavailable\r\nContent-Length: {}\r\n\r\n{body}", body.len());
        let (address, server) = server(answer);
        let error = run(&options(address)).expect_err("refused");
        let expected = format!(
            "gimbald at http://{address} answers 503 Service Unavailable: the core did not answer within 500 ms"
        );
        assert_eq!((error.exit_code(), error.to_string()), (ExitCode::Unavailable, expected));
        assert!(server.join().expect("no panic").starts_with("GET /api/v1/status HTTP/1.1\r\nhost: 127.0.0.1:"));
    }

    #[test]
    fn other_servers_are_not_taken_for_gimbald() {
        for answer in [
            "HTTP/1.1 200 OK\r\nContent-Length: 5\r\n\r\nhello",
            "HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\n{}",
            "HTTP/1.1 404 Not Found\r\nContent-Length: 2\r\n\r\n{}",
            "HTTP/1.1 200 OK\r\nContent-Length: 500\r\n\r\n{",
            "SSH-2.0-OpenSSH_9.2\r\n",
            "",
        ] {
            let (address, server) = server(answer.to_owned());
            let error = run(&options(address)).expect_err(answer);
            assert!(matches!(error, StatusError::NotGimbald { .. }), "{answer:?}: {error:?}");
            assert_eq!(error.exit_code(), ExitCode::Unavailable);
            server.join().expect("no panic");
        }
    }

    #[test]
    #[expect(clippy::disallowed_methods, reason = "the time-out of a real socket shows in real time only")]
    fn a_server_that_stays_silent_is_given_up() {
        let silent = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = silent.local_addr().expect("its address");
        let start = Instant::now();
        let error = run(&options(address)).expect_err("silence");
        assert!(matches!(error, StatusError::TimedOut { .. }), "{error:?}");
        assert!((DEADLINE..DEADLINE * 5).contains(&start.elapsed()));
    }

    #[test]
    fn json_is_what_the_daemon_gave() {
        let target = Target::parse("http://127.0.0.1:8080").expect("our own address");
        let given = br#"{"version":"9","later":{"key":null}}"#;
        let printed = report(given, &target, true).expect("JSON is passed on, of whatever version");
        assert_eq!(printed.as_bytes(), [&given[..], b"\n"].concat());
    }

    /// Vendor names are hostile input.
    #[test]
    fn names_do_not_command_the_terminal() {
        let mut snapshot = canned::snapshot();
        snapshot.gimbals[0].vendor = Some("\x1b[2J\u{9b}31mAc\nme\u{202e}".into());
        let answer = serde_json::to_vec(&snapshot).expect("JSON");
        let target = Target::parse("http://127.0.0.1:8080").expect("our own address");
        let text = report(&answer, &target, false).expect("a snapshot");
        assert!(text.contains("\u{fffd}[2J\u{fffd}31mAc\u{fffd}me\u{fffd} Pixy"), "{text}");
        assert!(!text.contains(|char: char| char.is_control() && char != '\n'));
    }

    fn options(address: SocketAddr) -> StatusArgs {
        StatusArgs { url: format!("http://{address}"), watch: false, json: false }
    }

    /// Gives one client `answer`; ends with what it asked.
    fn server(answer: String) -> (SocketAddr, JoinHandle<String>) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("its address");
        let serve = move || {
            let (mut client, _) = listener.accept().expect("a client");
            client.set_read_timeout(Some(Duration::from_secs(20))).expect("a time-out");
            let (mut asked, mut byte) = (Vec::new(), [0]);
            while !asked.ends_with(b"\r\n\r\n") && client.read(&mut byte).expect("a request") == 1 {
                asked.push(byte[0]);
            }
            client.write_all(answer.as_bytes()).expect("the client listens");
            String::from_utf8(asked).expect("text")
        };
        (address, std::thread::spawn(serve))
    }
}
