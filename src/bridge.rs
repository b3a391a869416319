//! Gives bytes their meaning: frames, routes, gimbals; the core of the daemon as one plain value.
//!
//! **One input, then [`Bridge::poll_output`] until it is `None`, then the next input.** Time never goes backwards and
//! only comes in as `now`.

mod identity;
mod outbox;
pub mod pacing;
pub mod settings;
pub mod snapshot;

pub use crate::channel::{ChannelId, ChannelSet};

/// Position of a link in [`settings::Settings::links`].
pub type LinkIndex = usize;

/// What happened outside.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// Port open, socket bound, or TCP connected.
    LinkUp {
        link: LinkIndex,
    },
    LinkDown {
        link: LinkIndex,
        reason: &'a str,
    },
    /// A peer was heard or may be spoken to; `address` is shown to people.
    ChannelOpened {
        channel: ChannelId,
        link: LinkIndex,
        address: &'a str,
    },
    ChannelClosed {
        channel: ChannelId,
    },
    /// One read: a whole datagram, or a piece of a stream.
    Received {
        channel: ChannelId,
        bytes: &'a [u8],
    },
    /// Bytes given out before could not be sent.
    SendFailed {
        channel: ChannelId,
        frames: u32,
        reason: &'static str,
    },
    /// The process is to end: stop what moves, say goodbye.
    Shutdown,
}

/// What is to be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output<'a> {
    /// Send one whole frame to each of `channels`.
    Transmit { channels: ChannelSet, bytes: &'a [u8] },
    /// Keep the adopted system id for the next start.
    StoreSystemId(u8),
}
