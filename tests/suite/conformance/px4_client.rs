//! PX4 as the client of our manager (`MNT_MODE_OUT` = 3): a whole vehicle (simulated) and a whole gimbal, over everything
//! that both say (peers notes 2.2, client notes C5).

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::manager::settings::ControlSettings;
use gimbald::sim::vehicle::{ClientVersion, GimbalOutput, Vehicle, VehicleSettings};
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage, STATUSTEXT_DATA,
};

use crate::support::script::{
    ACCEPTED, DENIED, NAN, ack, again, command_long, configure, ground_heartbeat, of, pitchyaw, take_control, to,
};
use crate::support::world::{AUTOPILOT, GCS, MANAGER, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);
const STATION: &str = "255/190";
const PX4: &str = "1/1";

fn vehicle(version: ClientVersion) -> VehicleSettings {
    VehicleSettings { gimbal_output: GimbalOutput::Manager(version), ..VehicleSettings::default() }
}

/// All parties, with the ground station's heartbeat.
struct Flight {
    world: World,
    places: Places,
}

impl Flight {
    /// Everybody is there and known.
    fn new(settings: Settings, version: ClientVersion) -> Self {
        let (world, places) = World::empty(settings);
        let mut flight = Self { world, places };
        flight.start_px4(version);
        flight.start_gimbal();
        flight.run(4 * SECOND);
        flight
    }

    fn start_px4(&mut self, version: ClientVersion) {
        self.world.install(self.places.autopilot, Vehicle::new(self.world.now, vehicle(version)));
    }

    fn start_gimbal(&mut self) {
        self.world.install(self.places.gimbal, Device::new(self.world.now, DeviceSettings::default()));
    }

    fn run(&mut self, duration: Duration) {
        self.world.run_with(duration, &[(SECOND, self.places.ground, GCS, ground_heartbeat())]);
    }

    fn command(&mut self, command: &MavMessage) -> Option<u8> {
        self.world.result_of(self.places.ground, GCS, command)
    }

    /// Has PX4 look somewhere, as a mission item would: `DO_MOUNT_CONTROL`, yaw from the nose.
    fn mission_item(&mut self, pitch: f32, yaw: f32) {
        let item = command_long(AUTOPILOT, 205, &[pitch, 0.0, yaw, 0.0, 0.0, 0.0, 2.0]);
        self.world.send(self.places.ground, GCS, &item);
    }

    /// The mission goes on without the gimbal.
    fn mission_ends(&mut self) {
        self.world.send(self.places.ground, GCS, &command_long(AUTOPILOT, 197, &[0.0]));
    }

    fn looks_at(&self) -> (i32, i32) {
        let attitude = &self.world.snapshot().gimbals[0].attitude;
        let [pitch, yaw] = [attitude.pitch_deg, attitude.yaw_vehicle_deg].map(|angle| angle.expect("it is told"));
        (pitch.round() as i32, yaw.round() as i32)
    }

    fn primary(&self) -> Option<String> {
        self.world.snapshot().gimbals[0].primary.clone()
    }

    /// The events of control, oldest first.
    fn changes(&self) -> Vec<String> {
        let events = self.world.snapshot().events.into_iter().rev();
        events.filter(|event| event.place.as_deref() == Some("primary")).map(|event| event.what).collect()
    }
}

fn merged() -> Flight {
    Flight::new(three_links(), ClientVersion::Merged)
}

/// "Finds the manager purely by a streamed 281 and requests nothing, so 281 must flow unasked"; "latches the first (sysid,
/// compid, device id) it sees and never re-latches: our ids must be stable": whoever is lost or starts again.
#[test]
fn the_status_comes_unasked_and_under_the_same_ids() {
    let mut flight = merged();
    flight.world.forget();
    flight.run(2 * SECOND);
    let ids = |flight: &mut Flight| {
        let arrivals = flight.world.take(flight.places.autopilot);
        let told = arrivals.iter().filter(|arrival| arrival.id() == 281);
        told.map(|arrival| (arrival.source(), arrival.decode::<GIMBAL_MANAGER_STATUS_DATA>().gimbal_device_id))
            .collect::<Vec<_>>()
    };
    assert_eq!(ids(&mut flight), [(MANAGER, 154); 10]);

    flight.world.remove(flight.places.gimbal);
    flight.run(15 * SECOND);
    flight.start_gimbal();
    flight.run(5 * SECOND);
    flight.world.kill();
    flight.run(SECOND);
    flight.world.start(three_links());
    flight.run(5 * SECOND);
    flight.world.reboot(flight.places.gimbal);
    flight.world.reboot(flight.places.autopilot);
    flight.run(5 * SECOND);
    let ids = ids(&mut flight);
    assert!(ids.len() > 150 && ids.iter().all(|id| *id == (MANAGER, 154)), "{ids:?}");
}

/// "Sends CONFIGURE with its own ids once when onboard intent starts, and -3/-3 when the intent ends." Nobody else holds the
/// gimbal, and nobody does afterwards.
#[test]
fn a_mission_steers_and_gives_up_control() {
    let mut flight = merged();
    flight.mission_item(-40.0, 25.0);
    flight.run(3 * SECOND);
    assert_eq!((flight.looks_at(), flight.primary().as_deref()), ((-40, 25), Some(PX4)));
    flight.mission_ends();
    flight.run(3 * SECOND);
    assert_eq!((flight.looks_at(), flight.primary()), ((-40, 25), None), "it stays where it is");
    assert_eq!(flight.changes(), ["taken", "released"]);
}

/// "Mission intent while a ground station holds control": it is borrowed and restored (D6), and the station is refused
/// meanwhile.
#[test]
fn a_mission_borrows_control_and_gives_it_back() {
    let mut flight = merged();
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    flight.mission_item(-40.0, 25.0);
    flight.run(3 * SECOND);
    let gimbal = &flight.world.snapshot().gimbals[0];
    assert_eq!((gimbal.primary.as_deref(), gimbal.lender.as_deref()), (Some(PX4), Some(STATION)));
    assert_eq!(flight.looks_at(), (-40, 25));
    assert_eq!(flight.command(&pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(DENIED));

    flight.mission_ends();
    flight.run(3 * SECOND);
    assert_eq!((flight.looks_at(), flight.primary().as_deref()), ((-40, 25), Some(STATION)));
    assert_eq!(flight.command(&pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    assert_eq!(flight.changes(), ["taken", "borrowed", "restored"]);
}

/// "Streams 287 every cycle while it has intent and relies on us to ignore it when it does not hold control. Ignoring must be
/// silent and cheap": for a minute, nothing is answered, nobody is told, the list of events does not fill up, the gimbal stays
/// with who holds it; each is counted. "It re-asks only when STATUS says nobody is in control, every 2 s."
#[test]
fn what_it_streams_without_control_is_ignored_in_silence() {
    let mut flight = merged();
    flight.mission_item(-40.0, 25.0);
    flight.run(2 * SECOND);
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(-10.0, 5.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    flight.world.forget();
    let events = flight.world.snapshot().events.len();
    flight.run(60 * SECOND);

    let snapshot = flight.world.snapshot();
    assert_eq!((flight.looks_at(), flight.primary().as_deref()), ((-10, 5), Some(STATION)));
    let refused = snapshot.gimbals[0].rejected[PX4]["not_in_control"];
    assert!(refused.abs_diff(3_000) <= 2, "{refused}");
    assert_eq!(snapshot.events.len(), events + 1, "one event with a count");
    assert_eq!(snapshot.events[0].count, refused);
    let to_px4 = flight.world.take(flight.places.autopilot);
    let answers: Vec<_> = to_px4.iter().filter(|arrival| matches!(arrival.id(), 77 | 253)).collect();
    assert_eq!(answers, [] as [&crate::support::world::Arrival; 0]);
    let texts: Vec<STATUSTEXT_DATA> = of(&flight.world.take(flight.places.ground));
    assert_eq!(texts, []);

    // When the station is done, control is asked for again.
    assert_eq!(flight.command(&configure([-3.0, -3.0], [-1.0, -1.0])), Some(ACCEPTED));
    flight.run(SECOND * 5 / 2);
    assert_eq!(flight.primary().as_deref(), Some(PX4));
    flight.run(3 * SECOND);
    assert_eq!(flight.looks_at(), (-40, 25));
}

/// "Uses PITCH_LOCK, and YAW_LOCK|YAW_IN_EARTH_FRAME for absolute yaw; sets no frame bit for vehicle-frame yaw. It does the
/// geo-pointing itself, so no ROI command arrives at the manager."
#[test]
fn yaw_is_from_the_nose_or_from_north_as_it_means_it() {
    let mut flight = merged();
    let flags = |flight: &mut Flight| {
        flight.world.forget();
        flight.run(SECOND / 2);
        let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = flight.world.take_messages(flight.places.gimbal);
        told.last().expect("it is streamed").flags & (16 | 32 | 64)
    };
    // From the nose it turns with the vehicle, which circles.
    flight.mission_item(-40.0, 25.0);
    flight.run(3 * SECOND);
    assert_eq!(flags(&mut flight), 32);
    flight.run(10 * SECOND);
    assert_eq!(flight.looks_at(), (-40, 25));

    flight.world.send(flight.places.ground, GCS, &to(AUTOPILOT, pitchyaw(-20.0, 60.0, NAN, NAN, 16.0)));
    flight.run(3 * SECOND);
    assert_eq!(flags(&mut flight), 16 | 64);
    for _ in 0..5 {
        flight.run(2 * SECOND);
        let yaw = flight.world.snapshot().gimbals[0].attitude.yaw_earth_deg.expect("it is told");
        assert!((yaw - 60.0).abs() < 1.5, "{yaw}");
    }

    // The centre of the circle: 40 m to the right of the nose and 50 m below.
    let home = gimbald::sim::vehicle::HOME;
    let place = [0.0, NAN, NAN, NAN, home.latitude_deg as f32, home.longitude_deg as f32, home.altitude_m as f32];
    flight.world.send(flight.places.ground, GCS, &command_long(AUTOPILOT, 195, &place));
    flight.run(5 * SECOND);
    let (pitch, yaw) = flight.looks_at();
    assert!((-54..=-48).contains(&pitch) && (86..=94).contains(&yaw), "{pitch} {yaw}");
    assert_eq!(flight.world.snapshot().gimbals[0].roi, None);
}

/// "Retried by its command sender": each repeat of a CONFIGURE whose answer was lost is answered alike, and is one change of
/// control.
#[test]
fn a_claim_that_is_repeated_is_one_claim() {
    for (claim, what) in [([1.0, 1.0, -1.0, -1.0], "borrowed"), ([-3.0, -3.0, -1.0, -1.0], "restored")] {
        let (mut world, places) = World::with_one_gimbal(three_links());
        world.send(places.ground, GCS, &take_control());
        let own = configure([1.0, 1.0], [-1.0, -1.0]);
        if what == "restored" {
            world.send(places.autopilot, AUTOPILOT, &own);
        }
        let before = world.snapshot().events.len();
        let [p1, p2, p3, p4] = claim;
        let params = [p1, p2, p3, p4, 0.0, 0.0, 154.0];
        for confirmation in 0..4 {
            let claim = again(confirmation, command_long(MANAGER, 1001, &params));
            let answers: Vec<COMMAND_ACK_DATA> = of(&world.ask(places.autopilot, AUTOPILOT, &claim));
            let ours: Vec<_> = answers.into_iter().filter(|answer| answer.command == 1001).collect();
            assert_eq!(ours, [ack(AUTOPILOT, 1001, ACCEPTED)], "{confirmation}");
            world.run_for(SECOND / 2);
        }
        let events = world.snapshot().events;
        assert_eq!((events.len(), events[0].what.as_str()), (before + 1, what));
    }
}

/// "Two earlier stored versions release with −2 (which by the definition means 'the sender takes it')." With
/// `px4_release_quirk` that is a release; without it PX4 keeps what it has until somebody else takes it.
#[test]
fn minus_two_of_an_earlier_version_releases_where_that_is_configured() {
    for (quirk, expected) in [(true, Some(STATION)), (false, Some(PX4))] {
        for version in [ClientVersion::Yielding, ClientVersion::Insisting] {
            let control = ControlSettings { px4_release_quirk: quirk, ..ControlSettings::default() };
            let mut flight = Flight::new(Settings { control, ..three_links() }, version);
            assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
            flight.mission_item(-40.0, 25.0);
            flight.run(3 * SECOND);
            assert_eq!((flight.looks_at(), flight.primary().as_deref()), ((-40, 25), Some(PX4)), "{version:?}");
            flight.mission_ends();
            flight.run(5 * SECOND);
            assert_eq!(flight.primary().as_deref(), expected, "{version:?}, {quirk}");
            assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
            flight.run(5 * SECOND);
            assert_eq!(flight.primary().as_deref(), Some(STATION));
        }
    }
}

/// "The first one takes control back again and again from whoever took it: a tug-of-war a manager should survive with bounded
/// logging": against a station that insists as well, whoever has it then keeps it for ten seconds, and what is told is bounded.
#[test]
fn a_tug_of_war_is_survived() {
    let mut flight = Flight::new(three_links(), ClientVersion::Insisting);
    flight.mission_item(-40.0, 25.0);
    flight.run(2 * SECOND);
    flight.world.forget();
    let mut denied = 0;
    for _ in 0..240 {
        denied += u32::from(flight.command(&take_control()) == Some(DENIED));
        flight.run(SECOND / 4);
    }
    assert!(denied > 20, "{denied}");
    let snapshot = flight.world.snapshot();
    assert!(snapshot.events.iter().any(|event| event.what == "acquire_war"));
    assert!(snapshot.events.len() <= 64);
    let texts: Vec<STATUSTEXT_DATA> = flight.world.take_messages(flight.places.ground);
    // One kind of text at most once in ten seconds: taken, refused, given back, of two parties, and the war.
    assert!(texts.len() <= 6 * 7, "{} in a minute", texts.len());
}

/// "Boot order": in whichever order autopilot, gimbal and daemon start, a mission steers the gimbal.
#[test]
fn in_every_order_of_starting_a_mission_steers() {
    const ORDERS: [[&str; 3]; 6] = [
        ["px4", "gimbal", "daemon"],
        ["px4", "daemon", "gimbal"],
        ["gimbal", "px4", "daemon"],
        ["gimbal", "daemon", "px4"],
        ["daemon", "px4", "gimbal"],
        ["daemon", "gimbal", "px4"],
    ];
    for order in ORDERS {
        let (mut world, places) = World::empty(three_links());
        world.kill();
        let mut flight = Flight { world, places };
        for party in order {
            match party {
                "px4" => flight.start_px4(ClientVersion::Merged),
                "gimbal" => flight.start_gimbal(),
                _ => flight.world.start(three_links()),
            }
            flight.run(15 * SECOND);
        }
        flight.mission_item(-40.0, 25.0);
        flight.run(3 * SECOND);
        assert_eq!((flight.looks_at(), flight.primary().as_deref()), ((-40, 25), Some(PX4)), "{order:?}");
    }
}

/// "Restart of either side": a daemon that starts again is asked for control again within 2 s of its first status; a PX4 that
/// starts again knows nothing of its intent, so what it had goes back to who had it before.
#[test]
fn either_side_may_start_again() {
    let mut flight = merged();
    flight.mission_item(-40.0, 25.0);
    flight.run(3 * SECOND);
    flight.world.kill();
    flight.run(SECOND);
    flight.world.start(three_links());
    flight.run(4 * SECOND);
    assert_eq!((flight.looks_at(), flight.primary().as_deref()), ((-40, 25), Some(PX4)));

    for held in [true, false] {
        let mut flight = merged();
        if held {
            assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
        }
        flight.mission_item(-40.0, 25.0);
        flight.run(3 * SECOND);
        assert_eq!(flight.primary().as_deref(), Some(PX4));
        flight.world.reboot(flight.places.autopilot);
        flight.run(3 * SECOND);
        assert_eq!(flight.primary().as_deref(), held.then_some(STATION));
        let changes = flight.changes();
        let expected: &[&str] =
            if held { &["taken", "borrowed", "holder_restarted", "restored"] } else { &["taken", "holder_restarted"] };
        assert_eq!(changes, expected);
        flight.mission_item(-20.0, 0.0);
        flight.run(3 * SECOND);
        assert_eq!((flight.looks_at(), flight.primary().as_deref()), ((-20, 0), Some(PX4)));
    }
}

/// A gimbal that is lost while PX4 holds it moves again when it is back and PX4 still demands it: 287 comes all the time.
#[test]
fn a_gimbal_that_comes_back_is_where_the_mission_wants_it() {
    let mut flight = merged();
    flight.mission_item(-40.0, 25.0);
    flight.run(3 * SECOND);
    flight.world.remove(flight.places.gimbal);
    flight.run(10 * SECOND);
    flight.start_gimbal();
    flight.run(5 * SECOND);
    assert_eq!((flight.looks_at(), flight.primary().as_deref()), ((-40, 25), Some(PX4)));
}
