//! The ends of one contender's links, and how long what goes in at one takes to come out at another.
#![expect(clippy::disallowed_methods, reason = "time is what is measured here")]

use std::net::{SocketAddr, TcpListener, UdpSocket};
use std::os::fd::AsFd;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings, SystemId};
use gimbald::sim::peer::Peer;
use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::{DatagramFrames, StreamDecoder};
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};

use crate::demand::{self, Demand, Effect, GROUND};
use crate::gimbal_end::GimbalEnd;
use crate::process::Forwarder;

/// An answer that takes longer is lost.
const LOST: Duration = Duration::from_millis(200);
/// How long a contender may take to start.
const START: Duration = Duration::from_secs(20);
/// Between one demand and the next at least.
const LEAST_PAUSE: Duration = Duration::from_micros(1_000);
/// Pauses differ by up to this much, so as not to keep step with anything.
const PAUSE_SPREAD: Duration = Duration::from_micros(1_000);

/// Where a contender takes what is to go where.
#[derive(Clone, Copy)]
pub struct Ports {
    /// What leads to something at the gimbal's end.
    pub to_gimbal: SocketAddr,
    /// What leads to an answer.
    pub to_ground: SocketAddr,
    /// Foreign messages of the ground station.
    pub from_ground: SocketAddr,
    /// All that the autopilot sends.
    pub from_autopilot: SocketAddr,
}

/// The far ends of all links.
pub struct Ends {
    pub ground: UdpSocket,
    pub autopilot: UdpSocket,
    pub gimbal: GimbalEnd,
    pub ports: Ports,
}

impl Ends {
    pub fn new(gimbal: GimbalEnd, ports: Ports) -> Self {
        let socket = || UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let (ground, autopilot) = (socket(), socket());
        ground.set_nonblocking(true).expect("a socket takes it");
        Self { ground, autopilot, gimbal, ports }
    }

    pub fn ground_address(&self) -> SocketAddr {
        self.ground.local_addr().expect("it is bound")
    }

    pub fn autopilot_address(&self) -> SocketAddr {
        self.autopilot.local_addr().expect("it is bound")
    }

    pub fn send_from_ground(&self, to: SocketAddr, bytes: &[u8]) {
        self.ground.send_to(bytes, to).expect("this machine reaches itself");
    }

    /// Waits until there is something at the end of `effect`, or for `until`.
    fn wait(&self, effect: Effect, until: Instant) {
        let end = match effect {
            Effect::Setpoint => self.gimbal.as_fd(),
            Effect::Answer => self.ground.as_fd(),
        };
        let left = until.saturating_duration_since(Instant::now());
        // Whole milliseconds, rounded up: whoever waits looks at the time again.
        let timeout = PollTimeout::try_from(left.as_micros().div_ceil(1_000) as u32).expect("it is short");
        poll(&mut [PollFd::new(end, PollFlags::POLLIN)], timeout).expect("an end can be waited for");
    }
}

/// A forwarder with its ends.
pub struct Contender {
    forwarder: Forwarder,
    ends: Arc<Ends>,
    start: Instant,
    /// The gimbal of the daemon; a relay has none, it gives back what it was given.
    device: Option<Device>,
    decoder: StreamDecoder,
    buffer: Vec<u8>,
    beat_at: Instant,
    sent: u32,
    lost: u32,
}

/// What a demand is to bring about.
struct Expected<'a> {
    frame: &'a [u8],
    pitch: f64,
}

impl Contender {
    pub fn daemon(forwarder: Forwarder, ends: Ends) -> Self {
        let settings = DeviceSettings {
            system_id: SystemId::Fixed(1),
            listens_first: Some(Duration::ZERO),
            ..DeviceSettings::default()
        };
        Self::new(forwarder, ends, Some(Device::new(Timestamp::ZERO, settings)))
    }

    pub fn relay(forwarder: Forwarder, ends: Ends) -> Self {
        Self::new(forwarder, ends, None)
    }

    fn new(forwarder: Forwarder, ends: Ends, device: Option<Device>) -> Self {
        let now = Instant::now();
        Self {
            forwarder,
            ends: Arc::new(ends),
            start: now,
            device,
            decoder: StreamDecoder::new(Patience::Fixed(Duration::from_millis(100))),
            buffer: vec![0; 4096],
            beat_at: now,
            sent: 0,
            lost: 0,
        }
    }

    pub fn ends(&self) -> &Arc<Ends> {
        &self.ends
    }

    /// Demands without an answer.
    pub fn lost(&self) -> u32 {
        self.lost
    }

    /// What its process used up to now.
    pub fn cpu_time(&self) -> Duration {
        self.forwarder.cpu_time()
    }

    pub fn wait_until_it_answers(&mut self) {
        let started = Instant::now();
        while started.elapsed() < START {
            self.serve_for(Duration::from_millis(100));
            let effects = [Effect::Setpoint, Effect::Answer];
            if effects.iter().all(|effect| self.demand(Demand::Command, *effect).is_some()) {
                self.lost = 0;
                return;
            }
        }
        panic!("a contender does not answer within {} s", START.as_secs());
    }

    /// How long `count` demands took, one after the other; those without an effect are left out.
    pub fn turn_around(&mut self, demand: Demand, effect: Effect, count: usize) -> Vec<Duration> {
        let one = |_| {
            let spread = PAUSE_SPREAD.mul_f64(f64::from(self.sent * 7_919 % 1_000) / 1_000.0);
            self.serve_for(LEAST_PAUSE + spread);
            self.demand(demand, effect)
        };
        (0..count).filter_map(one).collect()
    }

    /// How long one demand took.
    fn demand(&mut self, demand: Demand, effect: Effect) -> Option<Duration> {
        self.sent += 1;
        let pitch = -40.0 + f64::from(self.sent % 600) * 0.1;
        let frame = demand.frame(self.sent as u8, pitch);
        let expected = Expected { frame: &frame, pitch };
        let port = match effect {
            Effect::Setpoint => self.ends.ports.to_gimbal,
            Effect::Answer => self.ends.ports.to_ground,
        };
        let sent = Instant::now();
        self.ends.send_from_ground(port, &frame);
        while sent.elapsed() < LOST {
            self.ends.wait(effect, sent + LOST);
            let at = match effect {
                Effect::Setpoint => self.read_gimbal(Some(&expected)),
                Effect::Answer => self.read_ground(&expected),
            };
            if let Some(at) = at {
                return Some(at - sent);
            }
        }
        self.lost += 1;
        None
    }

    /// Keeps the gimbal and the ground station alive.
    pub fn serve_for(&mut self, time: Duration) {
        let until = Instant::now() + time;
        loop {
            self.speak();
            if Instant::now() >= until {
                return;
            }
            self.ends.wait(Effect::Setpoint, until);
            self.read_gimbal(None);
            while self.ends.ground.recv(&mut self.buffer).is_ok() {}
        }
    }

    fn speak(&mut self) {
        let now = Instant::now();
        if now >= self.beat_at {
            self.beat_at = now + Duration::from_secs(1);
            self.ends.send_from_ground(self.ends.ports.from_ground, &demand::heartbeat(GROUND, 0, 6, 8));
        }
        let since_start = Timestamp::ZERO + (now - self.start);
        if let Some(device) = &mut self.device {
            device.handle_timeout(since_start);
            while let Some(bytes) = device.poll_output() {
                self.ends.gimbal.write(&bytes);
            }
        }
    }

    /// Takes one read from the gimbal's end; when it came, if it holds what is expected.
    fn read_gimbal(&mut self, expected: Option<&Expected<'_>>) -> Option<Instant> {
        let length = self.ends.gimbal.read(&mut self.buffer)?;
        let read_at = Instant::now();
        let bytes = &self.buffer[..length];
        let since_start = Timestamp::ZERO + (read_at - self.start);
        let is_daemon = self.device.is_some();
        let mut found = false;
        self.decoder.push(since_start, bytes);
        while let Some(frame) = self.decoder.next_frame() {
            found |= expected.is_some_and(|expected| {
                if is_daemon { demand::is_setpoint(&frame, expected.pitch) } else { frame.bytes() == expected.frame }
            });
        }
        if let Some(device) = &mut self.device {
            device.handle_received(since_start, bytes);
        }
        found.then_some(read_at)
    }

    /// The same at the ground station's end.
    fn read_ground(&mut self, expected: &Expected<'_>) -> Option<Instant> {
        let length = self.ends.ground.recv(&mut self.buffer).ok()?;
        let read_at = Instant::now();
        let bytes = &self.buffer[..length];
        let is_daemon = self.device.is_some();
        let found = if is_daemon {
            DatagramFrames::new(bytes).next_frame().is_some_and(|frame| demand::is_acceptance(&frame))
        } else {
            bytes == expected.frame
        };
        found.then_some(read_at)
    }
}

/// Ports that nobody has at the moment.
pub fn free_ports<const N: usize>() -> [SocketAddr; N] {
    let sockets: [UdpSocket; N] = std::array::from_fn(|_| UdpSocket::bind("127.0.0.1:0").expect("a free port"));
    sockets.map(|socket| socket.local_addr().expect("it is bound"))
}

pub fn free_tcp() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("it is bound")
}
