//! Asks a running daemon how it is, and shows the answer to a person.

mod details;
pub(super) mod text;

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use serde_json::Value;
use tokio::time::sleep;

use super::client::{ClientError, Target, printable};
use super::daemon_address;
use crate::bridge::snapshot::Snapshot;
use crate::cli::StatusArgs;
use crate::exit_code::ExitCode;

/// Below `/api/v1`.
const STATUS_PATH: &str = "/status";
const REDRAW: Duration = Duration::from_secs(1);

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

/// What the daemon at `target` tells.
pub(super) async fn snapshot(target: &Target) -> Result<Snapshot, ClientError> {
    let answer = fetch(target).await?;
    serde_json::from_slice(&answer).map_err(|error| target.not_gimbald(error))
}

/// Prints the status once, or until Ctrl-C; while watching, a daemon that does not answer is shown and asked again.
fn run(options: &StatusArgs) -> Result<(), ClientError> {
    let target = daemon_address::target(&options.daemon)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build();
    let runtime = runtime.map_err(ClientError::Output)?;
    let result = runtime.block_on(async {
        if options.watch {
            tokio::select! {
                stopped = tokio::signal::ctrl_c() => stopped.map_err(ClientError::Output),
                result = watch(&target, options.json) => result,
            }
        } else {
            let text = report(&fetch(&target).await?, &target, options.json)?;
            io::stdout().write_all(text.as_bytes()).map_err(ClientError::Output)
        }
    });
    // A name that is still being resolved must not keep the command from ending.
    runtime.shutdown_background();
    match result {
        // `gimbald status | head` has seen enough.
        Err(ClientError::Output(error)) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

async fn watch(target: &Target, json: bool) -> Result<(), ClientError> {
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
        shown.and_then(|()| stdout.flush()).map_err(ClientError::Output)?;
        drop(stdout);
        sleep(REDRAW).await;
    }
}

async fn fetch(target: &Target) -> Result<Vec<u8>, ClientError> {
    target.get(STATUS_PATH).await
}

/// `text` in the place of what the terminal shows, line by line, so that nothing flickers.
fn redrawn(text: &str) -> String {
    format!("\x1b[H{}\x1b[J", text.replace('\n', "\x1b[K\n"))
}

fn report(answer: &[u8], target: &Target, json: bool) -> Result<String, ClientError> {
    let value: Value = serde_json::from_slice(answer).map_err(|error| target.not_gimbald(error))?;
    if json {
        return Ok(format!("{}\n", String::from_utf8_lossy(answer)));
    }
    let snapshot: Snapshot = serde_json::from_value(printable(value)).map_err(|error| target.not_gimbald(error))?;
    Ok(text::report(&snapshot))
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::net::{SocketAddr, TcpListener};
    use std::thread::JoinHandle;
    use std::time::Instant;

    use super::super::client::READING;
    use super::*;
    use crate::cli::DaemonArgs;
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
            assert_eq!((target.host.as_str(), target.port, target.path(STATUS_PATH).as_str()), (host, port, path), "{url}");
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
        for remedy in ["systemctl status gimbald", "--url", "--config"] {
            assert!(text.contains(remedy), "{text}");
        }
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
            assert!(matches!(error, ClientError::NotGimbald { .. }), "{answer:?}: {error:?}");
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
        assert!(matches!(error, ClientError::TimedOut { .. }), "{error:?}");
        assert!((READING..READING * 5).contains(&start.elapsed()));
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
        let daemon = DaemonArgs { url: Some(format!("http://{address}")), config: None };
        StatusArgs { daemon, watch: false, json: false }
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
