//! Whatever starts first: autopilot, gimbal, daemon and ground station find each other, and nothing moves before somebody
//! wants it.

use std::time::Duration;

use gimbald::bridge::settings::{Settings, SystemId};
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings, SystemId as DeviceSystem};
use gimbald::sim::peer::Peer;
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, HEARTBEAT_DATA};
use gimbald::wire::ids::mav_state;

use crate::support::ground_station::GroundStation;
use crate::support::hub::{Hub, Watched};
use crate::support::world::{GCS, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);
const STEP: Duration = Duration::from_secs(5);
const SET_ATTITUDE: u32 = 284;
/// Bootstrap or not: without any autopilot our system id is this one.
const FALLBACK: u8 = 1;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Party {
    Autopilot,
    Gimbal,
    Daemon,
    Ground,
}

use Party::{Autopilot, Daemon, Gimbal, Ground};

/// All 24 orders.
fn orders() -> Vec<[Party; 4]> {
    let all = [Autopilot, Gimbal, Daemon, Ground];
    let mut orders = Vec::new();
    for a in all {
        for b in all {
            for c in all {
                for d in all {
                    let order = [a, b, c, d];
                    if all.iter().all(|party| order.contains(party)) {
                        orders.push(order);
                    }
                }
            }
        }
    }
    orders
}

/// A flight, party by party.
struct Flight {
    world: World,
    places: Places,
    /// The vehicle's.
    system: u8,
    stored: Option<u8>,
    device: Option<Watched<Device>>,
    ground: Option<Watched<GroundStation>>,
    daemon_at: Timestamp,
    autopilot_at: Timestamp,
}

impl Flight {
    fn new(system: u8, stored: Option<u8>) -> Self {
        let (mut world, places) = World::empty(settings(stored));
        world.kill();
        world.forget();
        let (daemon_at, autopilot_at) = (Timestamp::ZERO, Timestamp::ZERO);
        Self { world, places, system, stored, device: None, ground: None, daemon_at, autopilot_at }
    }

    fn start(&mut self, party: Party) {
        let now = self.world.now;
        match party {
            Autopilot => {
                self.autopilot_at = now;
                let settings = VehicleSettings { system_id: self.system, ..VehicleSettings::default() };
                self.world.install(self.places.autopilot, Vehicle::new(now, settings));
            }
            Gimbal => {
                let device = Watched::new(Device::new(now, DeviceSettings::default()));
                self.device = Some(device.clone());
                self.world.install(self.places.gimbal, device);
            }
            Daemon => {
                self.daemon_at = now;
                self.world.start(settings(self.stored));
            }
            Ground => {
                let ground = Watched::new(GroundStation::new(now));
                self.ground = Some(ground.clone());
                self.world.install(self.places.ground, ground);
            }
        }
    }

    fn device(&self) -> &Watched<Device> {
        self.device.as_ref().expect("it was started")
    }

    fn ground(&self) -> &Watched<GroundStation> {
        self.ground.as_ref().expect("it was started")
    }

    /// What our managers answered to the station.
    fn answers_of_ours(&self) -> Vec<(u16, u8, MavId)> {
        let answers = self.ground().touch().take_acks().into_iter();
        answers.filter(|(.., source)| source.component == 191).collect()
    }

    fn pitch_deg(&self) -> f64 {
        self.device().look().plant().pose().pitch.degrees()
    }

    /// What the station shows, and that it can take control and turn the camera; before that nobody moved it.
    fn assert_the_gimbal_can_be_used(&mut self, order: &str) {
        let wanted = (self.system, 191, 154);
        assert_eq!(self.ground().look().gimbals(), [wanted], "{order}: what the station shows");
        assert_eq!(self.device().look().id(), MavId::new(self.system, 154), "{order}: the gimbal's system id");
        let heard = self.world.arrivals(self.places.gimbal);
        assert!(heard.iter().all(|arrival| arrival.id() != SET_ATTITUDE), "{order}: told without a demand");
        assert!(self.pitch_deg().abs() < 0.5, "{order}: moved to {} without a demand", self.pitch_deg());
        self.assert_no_foreign_id(order);

        self.ground().touch().take_acks();
        self.ground().touch().acquire(wanted);
        self.ground().touch().tilt(wanted, -30.0);
        self.world.run_for(3 * SECOND);

        let manager = MavId::new(self.system, 191);
        assert_eq!(self.answers_of_ours(), [(1001, 0, manager), (1000, 0, manager)], "{order}");
        assert!((self.pitch_deg() + 30.0).abs() < 0.5, "{order}: it looks to {}", self.pitch_deg());
        let ground = self.ground().look();
        let gimbal = ground.gimbal(self.system, 191, 154).expect("it is shown");
        let status = gimbal.status.as_ref().expect("it is complete");
        assert_eq!((status.primary_control_sysid, status.primary_control_compid), (GCS.system, GCS.component));
    }

    /// "no frame of ours with a wrong system id": but for the fallback id, in state BOOT, from ten seconds without an
    /// autopilot to three seconds with one (protocol checklist 14, 15).
    fn assert_no_foreign_id(&self, order: &str) {
        for place in [self.places.autopilot, self.places.gimbal, self.places.ground] {
            let ours = self.world.arrivals(place).iter().filter(|arrival| arrival.source().component == 191);
            for arrival in ours.filter(|arrival| arrival.source().system != self.system) {
                assert_eq!(arrival.source().system, FALLBACK, "{order}");
                let is_patient = arrival.at >= self.daemon_at + 10 * SECOND;
                let is_alone = arrival.at < self.autopilot_at.max(self.daemon_at) + 4 * SECOND;
                assert!(is_patient && is_alone, "{order}: {} at {}", arrival.source(), arrival.at);
                let is_beat = arrival.id() == 0;
                assert!(!is_beat || arrival.decode::<HEARTBEAT_DATA>().system_status == mav_state::BOOT, "{order}");
            }
        }
    }
}

fn settings(stored: Option<u8>) -> Settings {
    Settings { system_id: SystemId::Auto, stored_system_id: stored, ..three_links() }
}

/// All 24 orders, five seconds apart.
fn start_in_every_order(system: u8, stored: Option<u8>, apart: Duration) {
    for order in orders() {
        let mut flight = Flight::new(system, stored);
        for party in order {
            flight.start(party);
            flight.world.run_for(apart);
        }
        flight.world.run_for(2 * STEP);
        flight.assert_the_gimbal_can_be_used(&format!("{order:?}"));
    }
}

#[test]
fn in_every_order_the_gimbal_can_be_used() {
    start_in_every_order(1, None, STEP);
}

/// The fallback id is that of most vehicles; on this one it is wrong.
#[test]
fn in_every_order_the_gimbal_of_another_system_can_be_used() {
    start_in_every_order(7, None, STEP);
}

#[test]
fn when_all_start_at_once_the_gimbal_can_be_used() {
    start_in_every_order(7, None, Duration::ZERO);
}

/// D19: the id of the last flight is used at once, so none of our frames has another.
#[test]
fn with_a_stored_id_no_frame_has_another() {
    for order in
        [[Daemon, Ground, Gimbal, Autopilot], [Gimbal, Daemon, Autopilot, Ground], [Ground, Autopilot, Gimbal, Daemon]]
    {
        let mut flight = Flight::new(7, Some(7));
        for party in order {
            flight.start(party);
            flight.world.run_for(STEP);
        }
        flight.world.run_for(STEP);
        for place in [flight.places.autopilot, flight.places.gimbal, flight.places.ground] {
            let heard = flight.world.arrivals(place);
            let ours: Vec<_> = heard.iter().filter(|arrival| arrival.source().component == 191).collect();
            assert!(ours.iter().all(|arrival| arrival.source().system == 7) && !ours.is_empty());
            assert!(ours[0].at < flight.daemon_at + SECOND, "at once");
        }
        flight.assert_the_gimbal_can_be_used(&format!("{order:?}"));
    }
}

/// A gimbal that is switched on a minute and a half after everybody else, when the station has long given up asking.
#[test]
fn a_gimbal_that_comes_late_is_shown() {
    let mut flight = Flight::new(7, None);
    for party in [Autopilot, Daemon, Ground] {
        flight.start(party);
    }
    flight.world.run_for(90 * SECOND);
    assert_eq!(flight.ground().look().gimbals(), []);
    flight.world.forget();

    flight.start(Gimbal);
    flight.world.run_for(STEP);

    flight.assert_the_gimbal_can_be_used("90 s late");
}

/// A gimbal that is switched on among other vehicles takes the system id of its own, and nothing of theirs is taken for
/// ours: neither while our autopilot is not there and one of them has the fallback id, nor later.
#[test]
fn other_vehicles_on_the_ground_link_change_nothing() {
    for (order, other) in [
        ([Daemon, Ground, Gimbal, Autopilot], FALLBACK),
        ([Daemon, Gimbal, Ground, Autopilot], 9),
        ([Autopilot, Daemon, Ground, Gimbal], FALLBACK),
        ([Gimbal, Autopilot, Ground, Daemon], 9),
    ] {
        let mut flight = Flight::new(7, None);
        let elsewhere = flight.world.open(2);
        let vehicle = Vehicle::new(Timestamp::ZERO, VehicleSettings { system_id: other, ..VehicleSettings::default() });
        let fixed = DeviceSettings { system_id: DeviceSystem::Fixed(other), ..DeviceSettings::default() };
        let device = Device::new(Timestamp::ZERO, fixed);
        flight.world.install(elsewhere, Hub::new(vec![Box::new(vehicle), Box::new(device)]));
        for party in order {
            flight.start(party);
            flight.world.run_for(STEP);
            if party == Daemon {
                flight.world.run_for(2 * STEP);
                let snapshot = flight.world.snapshot();
                assert!(snapshot.vehicle.system_id.is_none_or(|system| system == 7), "{order:?}");
                let strangers = snapshot.gimbals.iter().filter(|gimbal| gimbal.state != "searching");
                assert!(flight.device.is_some() || strangers.count() == 0, "{order:?}");
            }
        }
        flight.world.run_for(4 * STEP);
        flight.assert_the_gimbal_can_be_used(&format!("{order:?} among {other}"));
        let snapshot = flight.world.snapshot();
        assert_eq!((snapshot.vehicle.system_id, snapshot.gimbals.len()), (Some(7), 1), "{order:?} among {other}");
        assert!(
            flight.world.arrivals(elsewhere).iter().all(|arrival| arrival.id() != SET_ATTITUDE),
            "{order:?}: another vehicle's gimbal was told something"
        );
    }
}

/// "An autopilot that changes its id (reboot with a new parameter) → re-latch, re-announce", also while the station is in
/// control; the gimbal that stays on the former id is driven, and named.
#[test]
fn an_autopilot_that_comes_back_under_another_id_is_followed() {
    let mut flight = Flight::new(1, None);
    for party in [Autopilot, Gimbal, Daemon, Ground] {
        flight.start(party);
    }
    flight.world.run_for(2 * STEP);
    flight.assert_the_gimbal_can_be_used("before");
    flight.world.forget();

    flight.system = 7;
    flight.start(Autopilot);
    flight.world.run_for(5 * STEP);
    assert_eq!(flight.world.snapshot().system_id, Some(1), "the station is in control");
    flight.world.run_for(2 * STEP);

    let snapshot = flight.world.snapshot();
    assert_eq!((snapshot.system_id, snapshot.gimbals[0].device.as_deref()), (Some(7), Some("1/154")));
    assert_eq!(flight.world.stored_system_ids, [1, 7]);
    let conflicts = &snapshot.conflicts;
    assert!(
        conflicts.len() == 1 && conflicts[0].contains("1/154 is not on the vehicle's system id 7"),
        "{conflicts:?}"
    );
    flight.ground().touch().tilt((7, 191, 154), -10.0);
    flight.world.forget();
    flight.world.run_for(SECOND);
    // This one does not listen to another system; others do.
    let told = flight.world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(flight.places.gimbal);
    assert!(told.len() >= 15 && told.iter().all(|told| (told.target_system, told.target_component) == (1, 154)));

    // Once it is restarted it follows.
    let now = flight.world.now;
    flight.device().touch().handle_reboot(now);
    flight.world.forget();
    flight.world.run_for(2 * STEP);
    assert_eq!(flight.device().look().id(), MavId::new(7, 154));
    assert_eq!(
        flight.ground().look().gimbals(),
        [(1, 191, 154), (7, 191, 154)],
        "the former vehicle is not forgotten there"
    );
    // Until it spoke it may have heard the rest of what was said to the former one.
    let told = flight.world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(flight.places.gimbal);
    assert!(told.iter().all(|told| told.target_system == 1), "nothing is said to the new one");
    flight.ground().touch().tilt((7, 191, 154), -20.0);
    flight.world.run_for(3 * SECOND);
    assert!((flight.pitch_deg() + 20.0).abs() < 0.5);
}

/// Client checklist E133: "Client address changes its port (restart): the new one gets streams at once, the old one is
/// dropped after its time." Its control, which is held by its ids, goes on; it is no second station.
#[test]
fn e133_a_station_that_comes_back_on_another_port_goes_on() {
    let mut flight = Flight::new(7, None);
    for party in [Autopilot, Gimbal, Daemon, Ground] {
        flight.start(party);
    }
    flight.world.run_for(2 * STEP);
    flight.assert_the_gimbal_can_be_used("before");
    flight.world.remove(flight.places.ground);
    flight.world.run_for(SECOND);
    flight.world.forget();

    let before = flight.places.ground;
    flight.places.ground = flight.world.open(2);
    flight.start(Ground);
    flight.world.run_for(2 * STEP);

    let streamed = flight.world.arrivals(flight.places.ground).iter().filter(|arrival| arrival.id() == 281);
    assert!(streamed.count() >= 50, "5 Hz from the first moment");
    assert_eq!(flight.world.snapshot().gimbals[0].primary.as_deref(), Some("255/190"));
    assert_eq!(flight.world.snapshot().conflicts, [""; 0]);
    flight.world.forget();
    flight.ground().touch().tilt((7, 191, 154), -10.0);
    flight.world.run_for(3 * SECOND);
    assert_eq!(flight.answers_of_ours().last(), Some(&(1000, 0, MavId::new(7, 191))));
    assert!((flight.pitch_deg() + 10.0).abs() < 0.5);
    assert!(flight.world.arrivals(before).iter().all(|arrival| arrival.id() != 77), "no answers to where it was");
}

/// A gimbal that is restarted while it is told an angle again and again turns there once it is back, and is not told
/// anything of its former life in between.
#[test]
fn a_gimbal_that_is_restarted_mid_stream_is_taken_up_again() {
    let mut flight = Flight::new(7, None);
    for party in [Autopilot, Gimbal, Daemon, Ground] {
        flight.start(party);
    }
    flight.world.run_for(2 * STEP);
    flight.assert_the_gimbal_can_be_used("before");
    let stream = |flight: &mut Flight, times: u32| {
        for _ in 0..times {
            flight.ground().touch().tilt((7, 191, 154), -40.0);
            flight.world.run_for(SECOND / 5);
        }
    };
    stream(&mut flight, 10);
    assert!((flight.pitch_deg() + 40.0).abs() < 0.5);

    let now = flight.world.now;
    flight.device().touch().handle_reboot(now);
    flight.world.forget();
    stream(&mut flight, 25);

    let snapshot = flight.world.snapshot();
    assert_eq!((snapshot.gimbals.len(), snapshot.gimbals[0].device.as_deref()), (1, Some("7/154")));
    assert!((flight.pitch_deg() + 40.0).abs() < 0.5, "{}", flight.pitch_deg());
    let asked = flight
        .world
        .arrivals(flight.places.gimbal)
        .iter()
        .filter(|arrival| arrival.id() == 76 && arrival.decode::<COMMAND_LONG_DATA>().command == 512);
    assert!(asked.count() >= 1, "who it is is asked anew");
}
