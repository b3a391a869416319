//! The same with a whole ArduPilot (simulated, `MNT1_TYPE` 6) and a whole gimbal, over everything that both say.

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::sim::vehicle::{Autopilot, GimbalOutput, Vehicle, VehicleSettings};
use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_SET_ATTITUDE_DATA, MavMessage, STATUSTEXT_DATA};

use super::{SECOND, presenting};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, command_long, ground_heartbeat, of, pitch_yaw_deg, pitchyaw, take_control, to,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Places, World};

/// ArduPilot looks for a gimbal from ten seconds after its start.
const ARDUPILOT: VehicleSettings = VehicleSettings {
    autopilot: Autopilot::ArduPilot,
    system_id: 1,
    state_for_gimbals: gimbald::sim::vehicle::StateForGimbals::Told,
    gimbal_output: GimbalOutput::Device,
    uptime: Duration::from_secs(10),
    unix_time_us: None,
};

/// All parties, with the ground station's heartbeat.
struct Flight {
    world: World,
    places: Places,
}

impl Flight {
    fn new(settings: Settings) -> Self {
        let (mut world, places) = World::empty(settings);
        world.install(places.autopilot, Vehicle::new(world.now, ARDUPILOT));
        world.install(places.gimbal, Device::new(world.now, DeviceSettings::default()));
        Self { world, places }
    }

    fn run(&mut self, duration: Duration) {
        self.world.run_with(duration, &[(SECOND, self.places.ground, GCS, ground_heartbeat())]);
    }

    fn command(&mut self, command: &MavMessage) -> Option<u8> {
        self.world.result_of(self.places.ground, GCS, command)
    }

    /// Has the autopilot do something, as a mission item would.
    fn mission_item(&mut self, command: MavMessage) {
        self.world.send(self.places.ground, GCS, &to(AUTOPILOT, command));
    }

    /// What the gimbal was told since it was asked last, the last: flags, pitch and yaw.
    fn told(&mut self) -> Option<(u16, i32, i32)> {
        let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = self.world.take_messages(self.places.gimbal);
        told.last().map(|told| {
            let (pitch, yaw) = pitch_yaw_deg(told.q);
            (told.flags, pitch.round() as i32, yaw.round() as i32)
        })
    }

    fn looks_at(&self) -> (i32, i32) {
        let attitude = &self.world.snapshot().gimbals[0].attitude;
        let [pitch, yaw] = [attitude.pitch_deg, attitude.yaw_vehicle_deg].map(|angle| angle.expect("it is told"));
        (pitch.round() as i32, yaw.round() as i32)
    }

    fn holders(&self) -> (Option<String>, Option<String>) {
        let gimbal = &self.world.snapshot().gimbals[0];
        (gimbal.primary.clone(), gimbal.lender.clone())
    }

    fn stream(&self) -> String {
        self.world.snapshot().gimbals[0].presented.as_ref().expect("it is presented").stream.clone()
    }
}

/// Who said what of a gimbal.
fn sources(arrivals: &[Arrival], ids: &[u32]) -> Vec<MavId> {
    let mut sources: Vec<MavId> =
        arrivals.iter().filter(|arrival| ids.contains(&arrival.id())).map(Arrival::source).collect();
    sources.sort_unstable();
    sources.dedup();
    sources
}

const STATION: &str = "255/190";

/// "With a simulated ArduPilot stream at 50 Hz, a ground station that takes control keeps it; a new ArduPilot demand (mission
/// item) borrows and gives back." From the start on the ground sees one manager and one gimbal, and there is nothing to
/// complain of.
#[test]
fn a_ground_station_keeps_control_and_a_mission_item_borrows_it() {
    let mut flight = Flight::new(presenting());
    flight.run(8 * SECOND);
    let texts: Vec<STATUSTEXT_DATA> = of(flight.world.arrivals(flight.places.ground));
    let found = texts.iter().filter_map(|text| text.text.to_str().ok()).find(|text| text.starts_with("Mount:"));
    assert_eq!(found, Some("Mount: gimbald Simulated v2 fw:1.0.0"));
    assert_eq!((flight.told(), flight.stream()), (None, "steady".to_owned()), "it stands at −30°, and nobody asked");

    // It is asked for everything that it would say as a manager.
    for id in [280.0, 281.0, 285.0] {
        let every_tenth = command_long(AUTOPILOT, 511, &[id, 100_000.0]);
        assert_eq!(flight.command_to_autopilot(&every_tenth), Some(ACCEPTED));
    }
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(-60.0, 10.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    flight.world.forget();
    flight.run(30 * SECOND);
    assert_eq!((flight.looks_at(), flight.holders()), ((-60, 10), (Some(STATION.into()), None)));

    flight.mission_item(pitchyaw(-20.0, -15.0, NAN, NAN, 0.0));
    flight.run(3 * SECOND);
    assert_eq!((flight.looks_at(), flight.holders()), ((-20, -15), (Some("1/1".into()), Some(STATION.into()))));
    assert_eq!(flight.command(&pitchyaw(-60.0, 10.0, NAN, NAN, 44.0)), Some(DENIED));
    flight.run(3 * SECOND);
    assert_eq!((flight.looks_at(), flight.holders()), ((-20, -15), (Some(STATION.into()), None)));
    flight.run(30 * SECOND);
    assert_eq!(flight.command(&pitchyaw(-60.0, 10.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    flight.run(30 * SECOND);
    assert_eq!((flight.looks_at(), flight.holders()), ((-60, 10), (Some(STATION.into()), None)));

    let ground = flight.world.take(flight.places.ground);
    assert_eq!(sources(&ground, &[280, 281]), [MANAGER]);
    assert_eq!(sources(&ground, &[283, 285]), [GIMBAL]);
    let snapshot = flight.world.snapshot();
    assert_eq!(snapshot.conflicts, [""; 0]);
    let dropped = &snapshot.links[0].dropped;
    assert!(dropped["autopilots_gimbal"] > 2_000 && dropped["presented_instead"] > 500, "{dropped:?}");
    // All of 286 went on to the gimbal.
    let to_gimbal = flight.world.take(flight.places.gimbal);
    assert_eq!(sources(&to_gimbal, &[286]), [AUTOPILOT]);
    assert_eq!(sources(&to_gimbal, &[284]), [MANAGER]);
}

impl Flight {
    fn command_to_autopilot(&mut self, command: &MavMessage) -> Option<u8> {
        let answers = self.world.ask(self.places.ground, GCS, command);
        let acks: Vec<gimbald::wire::dialect::COMMAND_ACK_DATA> = of(&answers);
        acks.first().map(|ack| ack.result)
    }
}

/// The vehicle's own place of interest: ArduPilot turns it into angles that move all the time, and has control for so long;
/// when it ends, the default is a new demand, and control goes back. A station may take control back in between, and keeps
/// it.
#[test]
fn the_vehicles_place_of_interest_is_looked_at_for_as_long_as_it_moves() {
    let mut flight = Flight::new(presenting());
    flight.run(8 * SECOND);
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    let home = gimbald::sim::vehicle::HOME;
    let roi =
        command_long(AUTOPILOT, 195, &[0.0, NAN, NAN, NAN, home.latitude_deg as f32, home.longitude_deg as f32, 0.0]);
    flight.mission_item(roi);
    flight.run(20 * SECOND);
    assert_eq!((flight.holders().0, flight.stream()), (Some("1/1".into()), "asks".into()));
    // 50 m up and 40 m away, to the right of the nose.
    let (pitch, yaw) = flight.looks_at();
    assert!((-54..=-48).contains(&pitch) && (86..=94).contains(&yaw), "{pitch} {yaw}");

    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    flight.run(20 * SECOND);
    assert_eq!((flight.looks_at(), flight.holders()), ((-10, 0), (Some(STATION.into()), None)));
    assert_eq!(flight.stream(), "overruled");

    flight.mission_item(command_long(AUTOPILOT, 197, &[0.0]));
    flight.run(2 * SECOND);
    assert_eq!((flight.looks_at(), flight.holders().0), ((-30, 0), Some("1/1".into())));
    flight.run(4 * SECOND);
    assert_eq!((flight.looks_at(), flight.holders()), ((-30, 0), (Some(STATION.into()), None)));
}

/// "Nothing moves that nobody asked": not when the daemon, the gimbal or the autopilot starts again while the autopilot
/// holds on to its last demand; and each is found again.
#[test]
fn whoever_starts_again_nothing_moves() {
    for restarts in ["daemon", "gimbal", "autopilot"] {
        let mut flight = Flight::new(presenting());
        flight.run(8 * SECOND);
        flight.mission_item(pitchyaw(-50.0, 20.0, NAN, NAN, 0.0));
        flight.run(10 * SECOND);
        assert_eq!(flight.looks_at(), (-50, 20));
        assert_eq!(flight.command(&pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
        flight.run(5 * SECOND);
        assert_eq!(flight.looks_at(), (-10, 0));
        match restarts {
            "daemon" => {
                flight.world.kill();
                flight.run(SECOND);
                flight.world.start(presenting());
            }
            "gimbal" => flight.world.reboot(flight.places.gimbal),
            _ => flight.world.reboot(flight.places.autopilot),
        }
        flight.world.forget();
        flight.run(20 * SECOND);
        let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = flight.world.take_messages(flight.places.gimbal);
        let moved = told.iter().any(|told| pitch_yaw_deg(told.q).0.round() as i32 != -10);
        assert!(!moved, "{restarts}: {:?}", told.last());
        assert_eq!(flight.stream(), "steady", "{restarts}");

        flight.mission_item(pitchyaw(-40.0, 5.0, NAN, NAN, 0.0));
        flight.run(3 * SECOND);
        assert_eq!(flight.looks_at(), (-40, 5), "{restarts}");
        assert_eq!(flight.world.snapshot().conflicts, [""; 0], "{restarts}");
    }
}

/// The gimbal may come later than the autopilot: that asks until it is answered.
#[test]
fn a_gimbal_that_comes_later_is_found() {
    let (mut world, places) = World::empty(presenting());
    world.install(places.autopilot, Vehicle::new(world.now, ARDUPILOT));
    let mut flight = Flight { world, places };
    flight.run(30 * SECOND);
    let now = flight.world.now;
    flight.world.install(places.gimbal, Device::new(now, DeviceSettings::default()));
    flight.run(5 * SECOND);
    assert_eq!(flight.stream(), "steady");
    flight.mission_item(pitchyaw(-40.0, 5.0, NAN, NAN, 0.0));
    flight.run(3 * SECOND);
    assert_eq!(flight.looks_at(), (-40, 5));
}

/// Gimbal statement 48: "command 1000 with only pitch finite is reported FAILED by the ArduPilot emulation", as the real one
/// does, and moves nothing; our manager takes it, and what it tells the gimbal has both angles.
#[test]
fn statement_48_ardupilot_needs_both_angles_and_we_supply_them() {
    const FAILED: u8 = 4;
    let mut flight = Flight::new(presenting());
    flight.run(8 * SECOND);
    flight.mission_item(pitchyaw(-50.0, 20.0, NAN, NAN, 0.0));
    flight.run(3 * SECOND);
    let pitch_only = pitchyaw(-20.0, NAN, NAN, NAN, 44.0);
    assert_eq!(flight.command_to_autopilot(&to(AUTOPILOT, pitch_only.clone())), Some(FAILED));
    flight.run(3 * SECOND);
    assert_eq!(flight.looks_at(), (-50, 20));

    assert_eq!(flight.command(&pitch_only), Some(ACCEPTED));
    assert_eq!(flight.told(), Some((44, -20, 20)));
}

/// `snoop_autopilot` would have a request obeyed twice: by the autopilot, through the device that we present to it, and by us
/// who overheard it. It is the autopilot that was asked, and its demand that passes the gate.
#[test]
fn what_the_autopilot_is_asked_is_not_overheard_as_well() {
    let mut settings = presenting();
    settings.control.snoop_autopilot = true;
    let mut flight = Flight::new(settings);
    flight.run(8 * SECOND);
    let named = command_long(AUTOPILOT, 1000, &[-50.0, 20.0, NAN, NAN, 44.0, 0.0, 154.0]);
    for item in [named, command_long(AUTOPILOT, 205, &[-40.0, 0.0, 10.0, 0.0, 0.0, 0.0, 2.0])] {
        flight.world.forget();
        flight.mission_item(item);
        let at_once: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = flight.world.take_messages(flight.places.gimbal);
        assert_eq!(at_once, [], "the autopilot has not asked for it yet");
        flight.run(8 * SECOND);
        let setpoint = flight.world.snapshot().gimbals[0].setpoint.clone().expect("it is steered");
        assert_eq!(setpoint.source.as_deref(), Some("1/1"));
    }
    assert_eq!(flight.looks_at(), (-40, 10));
    let sources: Vec<_> = flight.world.snapshot().gimbals[0].rejected.keys().cloned().collect();
    assert_eq!(sources, [""; 0]);
}

/// A gimbal of gimbal protocol v1, which has our device id 1 and its manager's component for a voice, is the same v2 device to
/// ArduPilot; that voice is not heard there, because ArduPilot does not look whose attitude it is.
#[test]
fn a_gimbal_without_v2_is_presented_alike() {
    use gimbald::gimbals::mavlink_v1::sim as v1;
    use gimbald::gimbals::settings::{Family, GimbalSettings};

    let gimbal = GimbalSettings { family: Family::MavlinkV1, ..GimbalSettings::found("camera".to_owned()) };
    let (mut world, places) = World::empty(Settings { gimbals: vec![gimbal], ..presenting() });
    world.install(places.autopilot, Vehicle::new(world.now, ARDUPILOT));
    world.install(places.gimbal, v1::Device::new(world.now, v1::DeviceSettings::default()));
    let mut flight = Flight { world, places };
    flight.run(8 * SECOND);
    assert_eq!(flight.world.snapshot().gimbals[0].device_id, Some(1));
    assert_eq!(flight.stream(), "steady");
    flight.world.forget();
    flight.mission_item(pitchyaw(-40.0, 15.0, NAN, NAN, 0.0));
    flight.run(5 * SECOND);
    assert_eq!(flight.looks_at(), (-40, 15));

    let to_autopilot = flight.world.take(flight.places.autopilot);
    assert_eq!(sources(&to_autopilot, &[283, 285]), [GIMBAL]);
    let told: Vec<gimbald::wire::dialect::GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = of(&to_autopilot);
    let (pitch, yaw) = pitch_yaw_deg(told.last().expect("ten a second").q);
    assert_eq!((told[0].gimbal_device_id, pitch.round() as i32, yaw.round() as i32), (0, -40, 15));
    assert_eq!(sources(&flight.world.take(flight.places.ground), &[283, 285]), [MANAGER]);
}
