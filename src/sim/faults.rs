//! What may go wrong between a simulated peer and the line.
//!
//! [`Faults`] says what goes wrong and when, [`FaultyPeer`] does it to what any peer sends; the same seed gives the
//! same faults.

mod grammar;
mod injector;
mod rewrite;

use std::time::Duration;

pub use grammar::{FaultError, WORDS};
pub use injector::FaultyPeer;

use crate::timestamp::Timestamp;

/// Which faults to inject. Probabilities are per frame sent, from 0 to 1; none by default.
///
/// Written as words separated by commas, each `NAME=VALUE`, `NAME=VALUE@TIME` or `NAME@TIME`; TIME counts from the
/// start of the process, and durations are a number with `ms`, `s`, `min` or `h`.
///
/// | Word | What happens |
/// |---|---|
/// | `drop=P` | the frame is lost |
/// | `deaf=P` | what the peer should have received is lost |
/// | `duplicate=P` | the frame comes twice |
/// | `reorder=P` | the frame is held for up to 100 ms, so that later ones overtake it |
/// | `delay=D` | every frame comes later by D |
/// | `jitter=D` | every frame comes later by up to D; their order stays |
/// | `corrupt=P` | one bit is inverted |
/// | `truncate=P` | the end of the frame is missing |
/// | `garbage=P` | 1 to 32 random bytes come before the frame |
/// | `split=P` | the frame comes in two pieces, 2 ms apart |
/// | `merge=P` | the frame waits for the next one, up to 100 ms, and comes with it |
/// | `ack-loss=P` | a `COMMAND_ACK` is lost |
/// | `ack-delay=D` | every `COMMAND_ACK` comes later by D; other frames overtake it |
/// | `ack-target=P` | a `COMMAND_ACK` addresses somebody else |
/// | `sequence-gap=P` | 1 to 10 sequence numbers are left out before the frame |
/// | `nan=P` | one float of the frame is NaN |
/// | `slow-parameters=D` | every `PARAM_VALUE` comes later by D, as from a slow flash memory |
/// | `foreign=P` | a heartbeat of another vehicle, 99/1, comes before the frame |
/// | `twin=P` | a second device under the same ids says its own attitude before the frame |
/// | `silence=D@T` | nothing is sent for D |
/// | `power-cut=D@T` | off for D, then a start as after a power-on |
/// | `baud-mismatch=D@T` | for D every byte sent is a random one |
/// | `reboot@T` | a start as after a power-on |
/// | `clock-jump=D@T` | `time_boot_ms` jumps by D, backwards when D begins with `-` |
#[derive(Clone, Debug, PartialEq)]
pub struct Faults {
    /// Decides the course of chance; it is not part of the text.
    pub seed: u64,
    pub drop: f64,
    pub deaf: f64,
    pub duplicate: f64,
    pub reorder: f64,
    pub delay: Duration,
    pub jitter: Duration,
    pub corrupt: f64,
    pub truncate: f64,
    pub garbage: f64,
    pub split: f64,
    pub merge: f64,
    pub ack_loss: f64,
    pub ack_delay: Duration,
    pub ack_target: f64,
    pub sequence_gap: f64,
    pub nan: f64,
    pub slow_parameters: Duration,
    pub foreign: f64,
    pub twin: f64,
    pub silences: Vec<Window>,
    pub power_cuts: Vec<Window>,
    pub baud_mismatches: Vec<Window>,
    pub reboots: Vec<Timestamp>,
    pub clock_jumps: Vec<ClockJump>,
}

/// A stretch of time; its end does not belong to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    pub from: Timestamp,
    pub until: Timestamp,
}

impl Window {
    fn contains(self, now: Timestamp) -> bool {
        self.from <= now && now < self.until
    }
}

/// A change of the peer's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ClockJump {
    pub at: Timestamp,
    pub by_ms: i64,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            seed: 1,
            drop: 0.0,
            deaf: 0.0,
            duplicate: 0.0,
            reorder: 0.0,
            delay: Duration::ZERO,
            jitter: Duration::ZERO,
            corrupt: 0.0,
            truncate: 0.0,
            garbage: 0.0,
            split: 0.0,
            merge: 0.0,
            ack_loss: 0.0,
            ack_delay: Duration::ZERO,
            ack_target: 0.0,
            sequence_gap: 0.0,
            nan: 0.0,
            slow_parameters: Duration::ZERO,
            foreign: 0.0,
            twin: 0.0,
            silences: Vec::new(),
            power_cuts: Vec::new(),
            baud_mismatches: Vec::new(),
            reboots: Vec::new(),
            clock_jumps: Vec::new(),
        }
    }
}
