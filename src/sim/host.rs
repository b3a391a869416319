//! Runs a simulated peer on a real link, in real time.

use std::future::poll_fn;
use std::io;
use std::pin::pin;
use std::task::{Context, Poll};

use crate::daemon::clock::{Clock, DeadlineTimer};
use crate::daemon::shutdown::Shutdown;
use crate::links::inbox::{Event, Inbox, PeerSet};
use crate::links::{Link, Progress};
use crate::sim::peer::Peer;
use crate::timestamp::Timestamp;

/// Why a simulated peer could not start, or not go on.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    #[error("the event loop could not be started")]
    Runtime(#[source] io::Error),
    #[error("the timer failed")]
    Timer(#[source] io::Error),
    #[error("waiting for the end failed")]
    Stop(#[source] io::Error),
}

/// Runs `peer` on the link that `open` makes, until `stop` is ready; everybody on the link speaks with this one peer.
///
/// Both are called and polled inside a runtime of their own, on the calling thread.
pub fn run<P: Peer>(
    peer: P,
    open: impl FnOnce() -> io::Result<Box<dyn Link>>,
    stop: impl Future<Output = io::Result<()>>,
) -> Result<(), HostError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build().map_err(HostError::Runtime)?;
    runtime.block_on(async {
        let link = open().map_err(HostError::Runtime)?;
        let timer = DeadlineTimer::new().map_err(HostError::Timer)?;
        let peers = PeerSet::default();
        let mut host = Host { peer, link, peers, inbox: Inbox::default(), clock: Clock::start(), timer };
        let mut stop = pin!(stop);
        poll_fn(|cx| match stop.as_mut().poll(cx) {
            Poll::Ready(stopped) => Poll::Ready(stopped.map_err(HostError::Stop)),
            Poll::Pending => host.poll(cx).map_err(HostError::Timer),
        })
        .await
    })
}

/// Ready at SIGTERM, SIGINT or SIGHUP.
pub async fn interrupted() -> io::Result<()> {
    let mut shutdown = Shutdown::new()?;
    poll_fn(|cx| if shutdown.poll(Timestamp::ZERO, cx) { Poll::Ready(Ok(())) } else { Poll::Pending }).await
}

struct Host<P> {
    peer: P,
    link: Box<dyn Link>,
    /// Whom the link knows.
    peers: PeerSet,
    inbox: Inbox,
    clock: Clock,
    timer: DeadlineTimer,
}

impl<P: Peer> Host<P> {
    /// Does what there is to do; ready only with an error.
    fn poll(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<()>> {
        let now = self.clock.now();
        self.timer.poll(cx)?;
        self.inbox.clear();
        let progress = self.link.poll(now, cx, &mut self.inbox);
        for index in 0..self.inbox.len() {
            match self.inbox.event(index) {
                Event::Up => tracing::info!("link up"),
                Event::Down { reason } => {
                    tracing::warn!(reason, "link down");
                    self.peers = PeerSet::default();
                }
                Event::PeerAppeared { peer, address } => {
                    tracing::info!(address, "peer appeared");
                    self.peers.insert(peer);
                }
                Event::PeerLeft { peer: left } => {
                    let mut rest = PeerSet::default();
                    self.peers.filter(|peer| *peer != left).for_each(|peer| rest.insert(peer));
                    self.peers = rest;
                }
                Event::Received { bytes, .. } => self.peer.handle_received(now, bytes),
                Event::SendFailed { frames, reason, .. } => tracing::debug!(frames, reason, "not sent"),
            }
            self.send();
        }
        if self.peer.poll_timeout().is_some_and(|at| at <= now) {
            self.peer.handle_timeout(now);
            self.send();
        }
        self.link.flush(now);
        match [self.peer.poll_timeout(), self.link.poll_timeout()].into_iter().flatten().min() {
            _ if progress == Progress::More => cx.waker().wake_by_ref(),
            Some(at) if at <= now => cx.waker().wake_by_ref(),
            Some(at) => self.timer.wake_by(at, &self.clock)?,
            None => {}
        }
        Poll::Pending
    }

    fn send(&mut self) {
        while let Some(bytes) = self.peer.poll_output() {
            self.link.send(self.peers, &bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;
    use std::time::Duration;

    use super::*;
    use crate::endpoint::Endpoint;
    use crate::links;
    use crate::sim::vehicle::{Vehicle, VehicleSettings};
    use crate::wire::DatagramFrames;
    use crate::wire::ids::message;

    #[test]
    fn a_vehicle_speaks_on_a_real_socket_until_it_is_told_to_stop() {
        let ground = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        ground.set_read_timeout(Some(Duration::from_secs(10))).expect("it can be set");
        let endpoint = Endpoint::UdpOut(ground.local_addr().expect("it is bound"));
        let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
        let host = std::thread::spawn(move || {
            let vehicle = Vehicle::new(Timestamp::ZERO, VehicleSettings::default());
            run(vehicle, || Ok(links::link(&endpoint)), async {
                // Whether it was told or the sender is gone, it is over.
                let _ = stopped.await;
                Ok(())
            })
        });

        let mut seen = Vec::new();
        let mut buffer = [0; 300];
        while !(seen.contains(&message::HEARTBEAT) && seen.contains(&message::GLOBAL_POSITION_INT)) {
            let length = ground.recv(&mut buffer).expect("it goes on speaking");
            let frame = DatagramFrames::new(&buffer[..length]).next_frame().expect("a whole frame");
            seen.push(frame.message_id());
        }
        stop.send(()).expect("it still listens");
        host.join().expect("no panic").expect("no error");
    }
}
