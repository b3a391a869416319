//! The state that is made for gimbals, when the line to the autopilot is long or bad: "with true delays".

use std::collections::VecDeque;
use std::time::Duration;

use gimbald::geometry::{Attitude, EarthFrame};
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::sim::faults::{Faults, FaultyPeer};
use gimbald::sim::peer::Peer;
use gimbald::sim::vehicle::{Autopilot, StateForGimbals, Vehicle};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::TIMESYNC_DATA;

use super::{SECOND, assert_near, flight, states, vehicle};
use crate::support::world::{Arrival, MANAGER, World, three_links};

/// On a line that holds each message up for a while, and all of them for some time, what is told was so at the time told
/// less the delay told, and both are right.
#[test]
fn delays_are_those_of_the_measurement() {
    let settings = vehicle(Autopilot::Px4, StateForGimbals::Denied);
    let (mut world, places) = World::empty(three_links());
    let faults: Faults = "jitter=30ms".parse().expect("a fault");
    let peer = FaultyPeer::new(Vehicle::new(Timestamp::ZERO, settings), faults);
    world.install(places.autopilot, Far::new(peer, Duration::from_millis(40)));
    world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));
    world.run_for(20 * SECOND);
    world.forget();

    world.run_for(20 * SECOND);

    let truth = Vehicle::new(Timestamp::ZERO, settings);
    let told = states(&mut world, places.gimbal);
    assert!(told.len() > 400, "{}", told.len());
    for (at, _, state) in told {
        let measured = Timestamp::from_micros(state.time_boot_us - u64::from(state.q_estimated_delay_us));
        let attitude: Attitude<EarthFrame> = Attitude::from_wxyz(state.q).expect("well formed").expect("set");
        let error = attitude.angle_to(Attitude::from_aircraft_angles(truth.motion(measured).attitude)).degrees();
        assert!(error < 0.01, "{error}° off at {at}: {state:?}");
        let moved = Timestamp::from_micros(state.time_boot_us - u64::from(state.v_estimated_delay_us));
        let velocity = truth.motion(moved).velocity_mps;
        assert_near(f64::from(state.vx), velocity[0], 0.005);
        assert_near(f64::from(state.vy), velocity[1], 0.005);
        // The fastest messages are held up by little, but by something.
        assert_near(state.time_boot_us as f64, at.as_micros() as f64, 5_000.0);
        assert!((35_000..=80_000).contains(&state.q_estimated_delay_us), "{state:?}");
    }
}

/// Whatever the line makes of it: what is told is well-formed, its time goes on, and it is not far from the truth.
#[test]
fn what_is_told_is_sound_on_a_bad_line() {
    for seed in 0..5 {
        let settings = vehicle(Autopilot::ArduPilot, StateForGimbals::Ignored);
        let (mut world, places) = World::empty(three_links());
        let faults = "drop=0.2,duplicate=0.1,reorder=0.05,jitter=20ms,corrupt=0.1,nan=0.2,garbage=0.1,ack-loss=0.5";
        let faults = Faults { seed, ..faults.parse().expect("faults") };
        world.install(places.autopilot, FaultyPeer::new(Vehicle::new(Timestamp::ZERO, settings), faults));
        world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));

        world.run_for(30 * SECOND);

        let truth = Vehicle::new(Timestamp::ZERO, settings);
        let told = states(&mut world, places.gimbal);
        assert!(told.len() > 500, "{}", told.len());
        for (at, _, state) in &told {
            let attitude: Attitude<EarthFrame> = Attitude::from_wxyz(state.q).expect("well formed").expect("set");
            let error = attitude.angle_to(Attitude::from_aircraft_angles(truth.motion(*at).attitude)).degrees();
            assert!(error < 3.0, "{error}° off at {at}: {state:?}");
            assert!([state.vx, state.vy, state.vz].iter().all(|speed| !speed.is_infinite()));
            assert!(state.angular_velocity_z.is_finite() && !state.feed_forward_angular_velocity_z.is_infinite());
        }
        for pair in told.windows(2) {
            assert!(pair[1].2.time_boot_us > pair[0].2.time_boot_us);
            assert!(pair[1].0 - pair[0].0 >= Duration::from_millis(20));
        }
    }
}

/// The way from the autopilot is measured there and back, with it alone, and only while its state is told by us.
#[test]
fn the_way_from_the_autopilot_is_measured_while_it_matters() {
    for (behaviour, asked) in [(StateForGimbals::Told, 0..=0), (StateForGimbals::Denied, 7..=10)] {
        let (mut world, places) = flight(three_links(), vehicle(Autopilot::Px4, behaviour));

        world.run_for(25 * SECOND);

        let ours = |arrival: &&Arrival| arrival.source() == MANAGER && arrival.id() == 111;
        let heard = world.take(places.autopilot);
        let requests: Vec<TIMESYNC_DATA> = heard.iter().filter(ours).map(Arrival::decode).collect();
        assert!(asked.contains(&requests.len()), "{behaviour:?}: {}", requests.len());
        for request in requests {
            assert_eq!((request.tc1, request.target_system, request.target_component), (0, 1, 1));
        }
        for elsewhere in [places.gimbal, places.ground] {
            assert_eq!(world.take(elsewhere).iter().filter(ours).count(), 0);
        }
    }
}

/// A peer at the end of a long line, which takes its time in both directions.
struct Far<P> {
    peer: P,
    latency: Duration,
    there: VecDeque<(Timestamp, Vec<u8>)>,
    back: VecDeque<(Timestamp, Vec<u8>)>,
    /// How many at the front of `back` have arrived.
    arrived: usize,
}

impl<P> Far<P> {
    fn new(peer: P, latency: Duration) -> Self {
        Self { peer, latency, there: VecDeque::new(), back: VecDeque::new(), arrived: 0 }
    }
}

impl<P: Peer> Peer for Far<P> {
    fn handle_received(&mut self, now: Timestamp, bytes: &[u8]) {
        self.there.push_back((now + self.latency, bytes.to_vec()));
    }

    fn handle_timeout(&mut self, now: Timestamp) {
        while self.there.front().is_some_and(|(at, _)| *at <= now)
            && let Some((_, bytes)) = self.there.pop_front()
        {
            self.peer.handle_received(now, &bytes);
        }
        if self.peer.poll_timeout().is_some_and(|due| due <= now) {
            self.peer.handle_timeout(now);
        }
        while let Some(bytes) = self.peer.poll_output() {
            self.back.push_back((now + self.latency, bytes));
        }
        self.arrived = self.back.iter().take_while(|(at, _)| *at <= now).count();
    }

    fn poll_output(&mut self) -> Option<Vec<u8>> {
        self.arrived = self.arrived.checked_sub(1)?;
        self.back.pop_front().map(|(_, bytes)| bytes)
    }

    fn poll_timeout(&self) -> Option<Timestamp> {
        let lines = [&self.there, &self.back].into_iter().filter_map(|line| line.front().map(|(at, _)| *at));
        lines.chain(self.peer.poll_timeout()).min()
    }

    fn handle_reboot(&mut self, now: Timestamp) {
        self.peer.handle_reboot(now);
    }
}
