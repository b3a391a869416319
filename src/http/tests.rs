//! The window as its clients see it, over real sockets.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::{mpsc, oneshot, watch};

mod asking;
mod describing;
mod guests;
mod opening;
mod reading;

use super::server::{Limits, attend, run};
use super::{canned, spawn};
use crate::bridge::snapshot::Snapshot;
use crate::config::settings::HttpSettings;
use crate::daemon::window::{CoreHandle, CoreRequest};
use crate::manager::asked::{Answer as Outcome, Asked};
use crate::token::Token;

const LOOPBACK: &str = "127.0.0.1:0";
const HEALTHZ: &[u8] = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
/// Longer than any test takes.
const FOREVER: Duration = Duration::from_secs(600);
/// How long a test waits for what must happen.
const PATIENCE: Duration = Duration::from_secs(20);

#[expect(clippy::disallowed_methods, reason = "time-outs of real sockets show in real time only")]
fn now() -> Instant {
    Instant::now()
}

fn core() -> (CoreHandle, mpsc::Receiver<CoreRequest>, watch::Sender<Arc<Snapshot>>) {
    let (requests, received) = mpsc::channel(4);
    let (published, snapshots) = watch::channel(Arc::default());
    (CoreHandle { requests, snapshots }, received, published)
}

/// A window on a port of its own, and the core behind it.
struct Window {
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
    /// What the core was asked to do.
    asked: std::sync::mpsc::Receiver<(String, Asked)>,
}

impl Window {
    fn of(snapshot: Snapshot) -> Self {
        Self::open(Some(snapshot), Limits::default())
    }

    /// Without a snapshot the core hangs.
    fn open(snapshot: Option<Snapshot>, limits: Limits) -> Self {
        Self::controlled(snapshot, None, Ok(()), limits)
    }

    /// With a core that answers so whatever it is asked.
    fn controlled(snapshot: Option<Snapshot>, token: Option<Token>, outcome: Outcome, limits: Limits) -> Self {
        let (told, address) = std::sync::mpsc::channel();
        let (tell, asked) = std::sync::mpsc::channel();
        let (stop, stopped) = oneshot::channel();
        let thread = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
            runtime.block_on(async {
                let listener = TcpListener::bind(LOOPBACK).await.expect("a port");
                let address = listener.local_addr().expect("its address");
                told.send(address).expect("the test waits");
                let (core, mut requests, published) = core();
                let answer = async {
                    while let (Some(snapshot), Some(request)) = (&snapshot, requests.recv().await) {
                        match request {
                            CoreRequest::Refresh => drop(published.send_replace(Arc::new(snapshot.clone()))),
                            CoreRequest::Ask { gimbal, asked, answer } => {
                                // A test may not care, and an asker may have gone.
                                let _ = tell.send((gimbal, asked));
                                let _ = answer.send(outcome.clone());
                            }
                        }
                    }
                    std::future::pending::<()>().await;
                };
                tokio::select! {
                    () = attend(listener, address, core, token, limits) => {}
                    () = answer => {}
                    _ = stopped => {}
                }
            });
        });
        let address = address.recv_timeout(PATIENCE).expect("the window opens");
        Self { address, stop: Some(stop), thread: Some(thread), asked }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).expect("the window listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        stream
    }

    fn get(&self, path: &str) -> Answer {
        self.ask(&format!("GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address))
    }

    fn ask(&self, request: &str) -> Answer {
        let mut stream = self.connect();
        stream.write_all(request.as_bytes()).expect("the window takes the request");
        Answer::read(stream)
    }
}

impl Drop for Window {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
            && !std::thread::panicking()
        {
            panic!("the window's thread panicked");
        }
    }
}

struct Answer {
    status: u16,
    head: String,
    body: String,
}

impl Answer {
    fn read(mut stream: TcpStream) -> Self {
        let mut text = String::new();
        stream.read_to_string(&mut text).expect("a whole answer");
        let (head, body) = text.split_once("\r\n\r\n").expect("headers, then a body");
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).expect("a status");
        Self { status, head: head.to_owned(), body: body.to_owned() }
    }

    fn header(&self, name: &str) -> Option<&str> {
        let mut lines = self.head.lines().filter_map(|line| line.split_once(": "));
        lines.find(|(key, _)| key.eq_ignore_ascii_case(name)).map(|(_, value)| value)
    }

    fn json(&self) -> Value {
        assert_eq!(self.header("content-type"), Some("application/json"));
        serde_json::from_str(&self.body).expect("strict JSON")
    }
}

#[derive(Clone, Default)]
struct Journal(Arc<Mutex<Vec<u8>>>);

impl Journal {
    fn text(&self) -> String {
        String::from_utf8(self.0.lock().expect("not poisoned").clone()).expect("text")
    }
}

impl Write for Journal {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().expect("not poisoned").write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
