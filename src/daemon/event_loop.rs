//! The one loop that carries bytes between the links and the core.
//!
//! One future polls everything: no task per link, no queue between tasks, no allocation per frame. At each wake-up
//! every link hands over one bounded batch, what the core answers is collected by the links, and leaves with one
//! system call per link.

use std::io;
use std::sync::Arc;
use std::task::{Context, Poll};

use tokio::sync::{mpsc, watch};

use super::askers::Askers;
use super::channels::ChannelTable;
use super::clock::{Clock, DeadlineTimer};
use super::shutdown::Shutdown;
use super::state_file::StateFile;
use super::system_id_file::SystemIdFile;
use super::systemd::ServiceManager;
use super::turning_file::TurningFile;
use super::window::CoreRequest;
use crate::bridge::snapshot::Snapshot;
use crate::bridge::{Bridge, Input, LinkIndex, Output};
use crate::links::inbox::{Event, Inbox, PeerIndex};
use crate::links::{Link, Progress};
use crate::timestamp::Timestamp;

/// Requests of the window that may wait; whoever asks for more waits.
pub const REQUESTS: usize = 16;

pub struct EventLoop {
    clock: Clock,
    timer: DeadlineTimer,
    core: Bridge,
    ports: Ports,
    inbox: Inbox,
    shutdown: Shutdown,
    service_manager: ServiceManager,
    window: Window,
    started: bool,
}

/// The core's ends of [`super::window::CoreHandle`].
pub struct Window {
    pub requests: mpsc::Receiver<CoreRequest>,
    pub snapshots: watch::Sender<Arc<Snapshot>>,
}

/// Where the core's output goes.
struct Ports {
    links: Vec<Box<dyn Link>>,
    channels: ChannelTable,
    states: Vec<LinkState>,
    kept: Kept,
    askers: Askers,
}

/// What is kept for the next start.
pub struct Kept {
    pub system_id: SystemIdFile,
    pub gimbal_ids: StateFile,
    pub turning: TurningFile,
}

/// What is known of a link, so that only changes are told.
struct LinkState {
    name: String,
    state: State,
    refusal_told: bool,
}

#[derive(PartialEq)]
enum State {
    Unknown,
    Up,
    Down(String),
}

impl EventLoop {
    #[expect(clippy::too_many_arguments, reason = "it is where everything meets")]
    pub fn new(
        core: Bridge,
        links: Vec<Box<dyn Link>>,
        names: Vec<String>,
        clock: Clock,
        timer: DeadlineTimer,
        shutdown: Shutdown,
        service_manager: ServiceManager,
        kept: Kept,
        window: Window,
    ) -> Self {
        let channels = ChannelTable::new(links.len());
        let states =
            names.into_iter().map(|name| LinkState { name, state: State::Unknown, refusal_told: false }).collect();
        let ports = Ports { links, channels, states, kept, askers: Askers::default() };
        let inbox = Inbox::default();
        Self { clock, timer, core, ports, inbox, shutdown, service_manager, window, started: false }
    }

    /// Does what there is to do; ready when the process is to end.
    pub fn poll(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let now = self.clock.now();
        let mut more = false;
        for link in 0..self.ports.links.len() {
            more |= self.poll_link(now, link, cx);
        }
        // What was received is answered before anything that nobody waits for.
        self.flush(now);
        self.timer.poll(cx)?;
        if self.shutdown.poll(now, cx) {
            tracing::info!("stopping");
            self.service_manager.stopping();
            self.input(now, Input::Shutdown);
        }
        if self.core.poll_timeout().is_some_and(|at| now >= at) {
            self.core.handle_timeout(now);
            self.ports.carry_out(&mut self.core);
            self.flush(now);
        }
        self.poll_window(now, cx);
        self.serve_service_manager(now);
        if self.is_finished(now) {
            return Poll::Ready(Ok(()));
        }
        match self.deadline() {
            _ if more => cx.waker().wake_by_ref(),
            Some(at) if at <= now => cx.waker().wake_by_ref(),
            Some(at) => self.timer.wake_by(at, &self.clock)?,
            None => {}
        }
        Poll::Pending
    }

    /// Hands what one link received to the core; whether the link has more.
    fn poll_link(&mut self, now: Timestamp, link: LinkIndex, cx: &mut Context<'_>) -> bool {
        self.inbox.clear();
        let progress = self.ports.links[link].poll(now, cx, &mut self.inbox);
        for index in 0..self.inbox.len() {
            self.ports.hand_over(now, link, self.inbox.event(index), &mut self.core);
        }
        progress == Progress::More
    }

    /// What an input or a timer wants to be sent leaves with the same wake-up.
    fn input(&mut self, now: Timestamp, input: Input<'_>) {
        self.core.handle_input(now, input);
        self.ports.carry_out(&mut self.core);
        self.flush(now);
    }

    fn flush(&mut self, now: Timestamp) {
        for link in &mut self.ports.links {
            link.flush(now);
        }
    }

    /// Serves what the window asks for, but not more at once than can wait: links come first.
    fn poll_window(&mut self, now: Timestamp, cx: &mut Context<'_>) {
        for _ in 0..REQUESTS {
            match self.window.requests.poll_recv(cx) {
                Poll::Ready(Some(CoreRequest::Refresh)) => {
                    self.window.snapshots.send_replace(Arc::new(self.core.snapshot(now)));
                }
                // Who has given up is told that it was not done: so it is not.
                Poll::Ready(Some(CoreRequest::Ask { answer, .. })) if answer.is_closed() => {}
                Poll::Ready(Some(CoreRequest::Ask { gimbal, asked, answer })) => {
                    let id = self.ports.askers.wait(answer);
                    self.input(now, Input::Asked { id, gimbal: &gimbal, asked: &asked });
                }
                // Without a window nobody asks.
                Poll::Ready(None) | Poll::Pending => return,
            }
        }
        // There may be more.
        cx.waker().wake_by_ref();
    }

    fn serve_service_manager(&mut self, now: Timestamp) {
        if !self.started {
            self.started = true;
            self.service_manager.ready();
        }
        let up = self.ports.states.iter().filter(|link| link.state == State::Up).count();
        self.service_manager.links_up(up, self.ports.states.len());
        self.service_manager.feed_watchdog(now);
    }

    fn is_finished(&self, now: Timestamp) -> bool {
        self.shutdown.leave_at().is_some_and(|at| {
            now >= at || self.core.is_finished() && !self.ports.links.iter().any(|link| link.has_unsent())
        })
    }

    fn deadline(&self) -> Option<Timestamp> {
        let links = self.ports.links.iter().filter_map(|link| link.poll_timeout());
        let others = [self.core.poll_timeout(), self.service_manager.poll_timeout(), self.shutdown.leave_at()];
        links.chain(others.into_iter().flatten()).min()
    }
}

impl Ports {
    /// Does everything that the core wants done.
    fn carry_out(&mut self, core: &mut Bridge) {
        while let Some(output) = core.poll_output() {
            match output {
                Output::Transmit { channels, bytes } => {
                    for (link, peers) in self.channels.by_link(channels) {
                        self.links[link].send(peers, bytes);
                    }
                }
                Output::StoreSystemId(id) => self.kept.system_id.store(id),
                Output::StoreGimbalIds(lines) => self.kept.gimbal_ids.store(lines.to_owned()),
                Output::StoreTurning(names) => self.kept.turning.store(names),
                Output::Answered { id, answer } => self.askers.answer(id, answer.clone()),
            }
        }
    }

    fn input(&mut self, now: Timestamp, input: Input<'_>, core: &mut Bridge) {
        core.handle_input(now, input);
        self.carry_out(core);
    }

    fn hand_over(&mut self, now: Timestamp, link: LinkIndex, event: Event<'_>, core: &mut Bridge) {
        match event {
            Event::Received { peer, bytes } => {
                if let Some(channel) = self.channels.channel(link, peer) {
                    self.input(now, Input::Received { channel, bytes }, core);
                }
            }
            Event::SendFailed { peer, frames, reason } => {
                if let Some(channel) = self.channels.channel(link, peer) {
                    self.input(now, Input::SendFailed { channel, frames, reason }, core);
                }
            }
            Event::PeerAppeared { peer, address } => self.peer_appeared(now, link, peer, address, core),
            Event::PeerLeft { peer } => {
                if let Some(channel) = self.channels.close(link, peer) {
                    tracing::info!(link = self.states[link].name, %channel, "peer left");
                    self.input(now, Input::ChannelClosed { channel }, core);
                }
            }
            Event::Up => {
                self.states[link].state = State::Up;
                tracing::info!(link = self.states[link].name, "link up");
                self.input(now, Input::LinkUp { link }, core);
            }
            Event::Down { reason } => {
                for channel in self.channels.close_all(link) {
                    self.input(now, Input::ChannelClosed { channel }, core);
                }
                if !matches!(&self.states[link].state, State::Down(known) if known == reason) {
                    self.states[link].state = State::Down(reason.to_owned());
                    tracing::warn!(link = self.states[link].name, reason, "link down");
                    self.input(now, Input::LinkDown { link, reason }, core);
                }
            }
        }
    }

    fn peer_appeared(&mut self, now: Timestamp, link: LinkIndex, peer: PeerIndex, address: &str, core: &mut Bridge) {
        match self.channels.open(link, peer) {
            Some(channel) => {
                tracing::info!(link = self.states[link].name, address, %channel, "peer appeared");
                self.input(now, Input::ChannelOpened { channel, link, address }, core);
            }
            None => {
                if !std::mem::replace(&mut self.states[link].refusal_told, true) {
                    tracing::warn!(link = self.states[link].name, address, "too many peers, newcomers are ignored");
                }
                self.links[link].refuse(peer);
            }
        }
    }
}

#[cfg(test)]
mod tests;
