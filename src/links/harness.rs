//! Runs one link of a test against the real kernel, without the rest of the daemon.

use std::future::{Future, poll_fn};
use std::io::{Read, Write};
use std::pin::pin;
use std::task::Poll;
use std::time::Duration;

use super::inbox::{Event, Inbox, PEERS, PeerIndex, PeerSet, READS};
use super::{Link, Progress};
use crate::timestamp::Timestamp;

/// No wait of a test is longer; one that gets so far fails.
pub const PATIENCE: Duration = Duration::from_secs(10);
/// How often a test looks at what the kernel does not announce.
const LOOK_AGAIN: Duration = Duration::from_millis(1);

/// What an [`Event`] said.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Seen {
    Up,
    Down(String),
    Appeared(PeerIndex, String),
    Left(PeerIndex),
    Received(PeerIndex, Vec<u8>),
    SendFailed(PeerIndex, u32, &'static str),
}

/// A link, the time that it is told, and what it said and was not looked at yet.
pub struct Rig<L> {
    runtime: tokio::runtime::Runtime,
    pub link: L,
    inbox: Inbox,
    pub now: Timestamp,
    seen: std::collections::VecDeque<Seen>,
}

impl<L: Link> Rig<L> {
    pub fn new(link: L) -> Self {
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime can be made");
        let now = Timestamp::from_secs(100);
        Self { runtime, link, inbox: Inbox::default(), now, seen: Default::default() }
    }

    /// Time passes for the link, not for the test.
    pub fn pass(&mut self, duration: Duration) {
        self.now += duration;
    }

    pub fn send(&mut self, peers: impl Into<PeerSet>, frame: &[u8]) {
        self.link.send(peers.into(), frame);
        // Some sockets ask the runtime whether they may send.
        let (link, now) = (&mut self.link, self.now);
        self.runtime.block_on(async { link.flush(now) });
    }

    /// Polls until something happened, and says what; fails the test when nothing does.
    #[track_caller]
    pub fn next(&mut self) -> Seen {
        self.next_within(PATIENCE).expect("the link says something in time")
    }

    /// Polls for as long as the kernel has something for the link, and asserts that there is nothing.
    #[track_caller]
    pub fn expect_silence(&mut self) {
        assert_eq!(self.next_within(Duration::from_millis(20)), None);
    }

    /// What the link says without waiting for anything.
    pub fn poll_once(&mut self) -> Option<Seen> {
        self.next_within(Duration::ZERO)
    }

    fn next_within(&mut self, patience: Duration) -> Option<Seen> {
        let Self { runtime, link, inbox, now, seen } = self;
        runtime.block_on(async {
            let mut patience = pin!(tokio::time::sleep(patience));
            poll_fn(|cx| {
                while seen.is_empty() {
                    inbox.clear();
                    let progress = link.poll(*now, cx, inbox);
                    assert!(inbox.len() <= READS + 2 * PEERS + 2, "a batch is bounded");
                    seen.extend((0..inbox.len()).map(|index| Seen::of(inbox.event(index))));
                    if progress == Progress::Idle && seen.is_empty() {
                        return patience.as_mut().poll(cx).map(|()| None);
                    }
                }
                Poll::Ready(seen.pop_front())
            })
            .await
        })
    }

    /// Polls until `peer` sent `length` bytes, which come in pieces.
    #[track_caller]
    pub fn receive(&mut self, peer: PeerIndex, length: usize) -> Vec<u8> {
        let mut all = Vec::new();
        while all.len() < length {
            match self.next() {
                Seen::Received(from, bytes) if from == peer => all.extend(bytes),
                other => panic!("expected bytes of peer {peer}, not {other:?}"),
            }
        }
        all
    }

    /// Polls the link until `done`, which looks at what the link does not announce.
    #[track_caller]
    pub fn until<T>(&mut self, mut done: impl FnMut(&mut Self) -> Option<T>) -> T {
        for _ in 0..PATIENCE.as_millis() / LOOK_AGAIN.as_millis() {
            if let Some(result) = done(self) {
                return result;
            }
            if let Some(seen) = self.next_within(LOOK_AGAIN) {
                self.seen.push_back(seen);
            }
        }
        panic!("it did not happen in time");
    }
}

impl Seen {
    fn of(event: Event<'_>) -> Self {
        match event {
            Event::Up => Self::Up,
            Event::Down { reason } => Self::Down(reason.to_owned()),
            Event::PeerAppeared { peer, address } => Self::Appeared(peer, address.to_owned()),
            Event::PeerLeft { peer } => Self::Left(peer),
            Event::Received { peer, bytes } => Self::Received(peer, bytes.to_vec()),
            Event::SendFailed { peer, frames, reason } => Self::SendFailed(peer, frames, reason),
        }
    }
}

/// Bytes that look random and are the same in every run.
pub fn noise(length: usize) -> Vec<u8> {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    std::iter::repeat_with(|| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state as u8
    })
    .take(length)
    .collect()
}

/// Writes all of `bytes` on a thread of its own, and hands `writer` back.
pub fn write_aside<W: Write + Send + 'static>(mut writer: W, bytes: Vec<u8>) -> std::thread::JoinHandle<W> {
    std::thread::spawn(move || {
        writer.write_all(&bytes).expect("the link reads");
        writer
    })
}

/// Reads what is there without waiting.
pub fn read_available(reader: &mut impl Read, into: &mut Vec<u8>) {
    let mut buffer = [0; 4096];
    loop {
        match reader.read(&mut buffer) {
            Ok(0) => return,
            Ok(length) => into.extend_from_slice(&buffer[..length]),
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => return,
            Err(error) => panic!("the other end cannot read: {error}"),
        }
    }
}
