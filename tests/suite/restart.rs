//! "After kill -9 the gimbal is re-acquired in under 2 s without a jump": how long it takes from the start of the core,
//! and what the gimbal is told meanwhile. `daemon::restart` shows the same on the real process.

use std::time::Duration;

use gimbald::bridge::settings::{Settings, SystemId, Transport};
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_INFORMATION_DATA, MavMessage,
};

use crate::support::hub::Watched;
use crate::support::script::{
    ACCEPTED, NAN, TEMPORARILY_REJECTED, command_long, ground_heartbeat, ids, of, request_message,
};
use crate::support::world::{GCS, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);
const SYSTEM: u8 = 7;
const OUR_MANAGER: MavId = MavId::new(SYSTEM, 191);

/// What the gimbal does when the daemon is killed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    /// It was never told anything, and speaks four times a second.
    Nothing,
    /// It speaks ten times a second.
    HoldingAnAngle,
    Turning,
}

struct Flight {
    world: World,
    places: Places,
    device: Watched<Device>,
}

fn settings(stored: Option<u8>) -> Settings {
    let mut settings = Settings { system_id: SystemId::Auto, stored_system_id: stored, ..three_links() };
    settings.links[1].transport = Transport::Serial { baud: 115_200 };
    settings
}

impl Flight {
    /// A daemon that was killed, half a second ago, while the gimbal was busy.
    fn after_a_kill(doing: Doing) -> Self {
        let (mut world, places) = World::empty(settings(None));
        let vehicle = VehicleSettings { system_id: SYSTEM, ..VehicleSettings::default() };
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, vehicle));
        let device = Watched::new(Device::new(Timestamp::ZERO, DeviceSettings::default()));
        world.install(places.gimbal, device.clone());
        world.run_for(8 * SECOND);
        let mut flight = Self { world, places, device };
        match doing {
            Doing::Nothing => {}
            Doing::HoldingAnAngle => {
                assert_eq!(flight.demand(&[-30.0, 20.0, NAN, NAN, 44.0]), Some(ACCEPTED));
                flight.beat_for(4);
            }
            Doing::Turning => {
                assert_eq!(flight.demand(&[NAN, NAN, 0.0, 20.0, 44.0]), Some(ACCEPTED));
                flight.beat_for(2);
            }
        }
        flight.world.kill();
        flight.world.run_for(SECOND / 2);
        flight.world.forget();
        flight
    }

    fn demand(&mut self, params: &[f32; 5]) -> Option<u8> {
        let [pitch, yaw, pitch_rate, yaw_rate, flags] = *params;
        let command = command_long(OUR_MANAGER, 1000, &[pitch, yaw, pitch_rate, yaw_rate, flags, 0.0, 154.0]);
        let answers = self.world.ask(self.places.ground, GCS, &command);
        let acks: Vec<gimbald::wire::dialect::COMMAND_ACK_DATA> = of(&answers);
        acks.first().map(|ack| ack.result)
    }

    fn beat_for(&mut self, seconds: u32) {
        let beat = (SECOND, self.places.ground, GCS, ground_heartbeat());
        self.world.run_with(seconds * SECOND, &[beat]);
    }

    /// Pitch and yaw against the vehicle.
    fn pose_deg(&self) -> (f64, f64) {
        let device = self.device.look();
        let pose = device.plant().pose();
        (pose.pitch.degrees(), pose.yaw.degrees())
    }

    fn is_known(&self) -> bool {
        let gimbals = self.world.snapshot().gimbals;
        gimbals.first().is_some_and(|gimbal| gimbal.state == "alive" && gimbal.model.is_some())
    }
}

/// The way of discovery in the time of the core: the first 285 after the start is answered by a request of 283 in the
/// same moment, and its answer makes the gimbal known. It takes one interval of 285, and the way over the line.
#[test]
fn after_a_kill_the_gimbal_is_known_within_one_interval_of_its_status() {
    for (doing, interval_ms) in [(Doing::Nothing, 250), (Doing::HoldingAnAngle, 100), (Doing::Turning, 100)] {
        let mut flight = Flight::after_a_kill(doing);
        let started = flight.world.now;
        flight.world.start(settings(Some(SYSTEM)));

        while !flight.is_known() {
            flight.world.run_for(Duration::from_millis(1));
            assert!(flight.world.now - started < 2 * SECOND, "{doing:?}");
        }

        let took = flight.world.now - started;
        // A heartbeat and a request of 283 are 60 bytes, or 5.2 ms.
        assert!(took <= Duration::from_millis(interval_ms + 6), "{doing:?}: {took:?}");
        let asked: Vec<COMMAND_LONG_DATA> = flight.world.take_messages(flight.places.gimbal);
        assert_eq!(asked.iter().map(|asked| (asked.command, asked.param1)).collect::<Vec<_>>(), [(512, 283.0)]);
        assert_eq!(flight.world.snapshot().system_id, Some(SYSTEM));
    }
}

/// D9: "Nothing is sent before the first accepted demand": the camera stays where the former life left it, and obeys in the
/// moment of the first demand.
#[test]
fn after_a_kill_nothing_moves_before_the_first_demand() {
    for doing in [Doing::Nothing, Doing::HoldingAnAngle, Doing::Turning] {
        let mut flight = Flight::after_a_kill(doing);
        flight.world.start(settings(Some(SYSTEM)));
        if doing == Doing::Turning {
            // A rate that nobody renews ends by itself, in this device after a second.
            flight.world.run_for(SECOND);
        }
        let before = flight.pose_deg();
        flight.beat_for(5);

        let told = flight.world.take(flight.places.gimbal);
        assert!(!ids(&told).contains(&284), "{doing:?}");
        assert_same(flight.pose_deg(), before, 0.01);
        assert_eq!(flight.world.snapshot().gimbals[0].setpoint, None);
        assert_eq!(flight.world.snapshot().gimbals[0].primary, None, "nobody holds it: {doing:?}");

        // What it is told first starts where it is: one axis moves, the other doesn't.
        assert_eq!(flight.demand(&[-10.0, NAN, NAN, NAN, 44.0]), Some(ACCEPTED));
        // As soon as the frame in progress has left the line.
        flight.world.run_for(Duration::from_millis(8));
        let setpoints: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = flight.world.take_messages(flight.places.gimbal);
        assert_eq!(setpoints.len(), 1, "at once: {doing:?}");
        flight.beat_for(4);
        assert_same(flight.pose_deg(), (-10.0, before.1), 0.3);
    }
}

/// Client checklist E10: "512/p1=280 to component 0 in the first second after daemon start is answered within 1 s", and
/// protocol checklist 42: what could not be told yet is told when it can.
#[test]
fn e10_a_client_that_asks_in_the_first_moment_is_answered() {
    let mut flight = Flight::after_a_kill(Doing::Nothing);
    flight.world.start(settings(Some(SYSTEM)));
    let asked = request_message(MavId::new(SYSTEM, 0), 280);
    let answers = flight.world.ask(flight.places.ground, GCS, &asked);
    let acks: Vec<gimbald::wire::dialect::COMMAND_ACK_DATA> = of(&answers);
    assert_eq!(acks.iter().map(|ack| ack.result).collect::<Vec<_>>(), [TEMPORARILY_REJECTED]);

    flight.world.run_for(SECOND / 2);

    let told: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = flight.world.take_messages(flight.places.ground);
    // Once more when the vehicle's position is known, which lets it aim at places.
    assert!(!told.is_empty() && told.iter().all(|told| told.gimbal_device_id == 154));
    // A second time it is answered at once.
    let answers = flight.world.ask(flight.places.ground, GCS, &asked);
    assert!(answers.iter().any(|arrival| arrival.id() == 280));
}

/// A gimbal that says nothing but its heartbeat is found with it.
#[test]
fn after_a_kill_a_heartbeat_alone_is_enough() {
    let (mut world, places) = World::empty(settings(Some(SYSTEM)));
    let started = world.now;
    world.run_for(SECOND / 2);
    world.forget();
    let beat = crate::support::script::gimbal_heartbeat();

    world.send(places.gimbal, MavId::new(SYSTEM, 154), &beat);
    world.run_for(Duration::from_millis(6));

    let asked: Vec<MavMessage> =
        world.take_messages::<COMMAND_LONG_DATA>(places.gimbal).into_iter().map(MavMessage::COMMAND_LONG).collect();
    assert_eq!(asked.len(), 1);
    assert!(world.now - started < 2 * SECOND);
}

fn assert_same(found: (f64, f64), wanted: (f64, f64), within: f64) {
    let is_same = (found.0 - wanted.0).abs() <= within && (found.1 - wanted.1).abs() <= within;
    assert!(is_same, "{found:?} instead of {wanted:?}");
}

/// "A gimbal that keeps turning after its operator is gone is our worst bug", also when it is us who are gone: the names
/// of those that turn are kept outside, and the next life stops them before anything else, and keeps them where they
/// come to rest.
#[test]
fn a_gimbal_that_was_left_turning_is_stopped_by_the_next_life() {
    let mut flight = Flight::after_a_kill(Doing::Turning);
    assert_eq!(flight.world.stored_turning, ["gimbal-154\t7/154"]);
    let left_turning = flight.world.stored_turning.clone();

    flight.world.start(Settings { left_turning, ..settings(Some(SYSTEM)) });
    while !flight.is_known() {
        flight.world.run_for(Duration::from_millis(1));
    }
    flight.world.run_for(Duration::from_millis(8));

    let setpoints: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = flight.world.take_messages(flight.places.gimbal);
    let rates: Vec<_> = setpoints.iter().map(|told| [told.angular_velocity_y, told.angular_velocity_z]).collect();
    assert_eq!(rates, [[0.0, 0.0]], "as soon as it is known");
    assert!(setpoints[0].q.iter().all(|q| q.is_nan()), "and to go nowhere");
    assert_eq!(flight.world.stored_turning, ["gimbal-154\t7/154"]);
    let before = flight.pose_deg();
    flight.beat_for(5);
    assert_eq!(flight.world.stored_turning, Vec::<String>::new());
    assert_same(flight.pose_deg(), before, 0.3);
    assert_eq!(flight.world.snapshot().gimbals[0].primary, None, "nobody holds it");
}

/// D9: what did not turn is told nothing at the next start; who asked for a rotation that ended is not remembered either.
#[test]
fn who_turns_is_kept_from_the_first_rate_to_the_last_zero() {
    let mut flight = Flight::after_a_kill(Doing::HoldingAnAngle);
    assert_eq!(flight.world.stored_turning, Vec::<String>::new());
    flight.world.start(settings(Some(SYSTEM)));
    flight.beat_for(3);
    assert_eq!(flight.demand(&[NAN, NAN, 0.0, 20.0, 44.0]), Some(ACCEPTED));
    assert_eq!(flight.world.stored_turning, ["gimbal-154\t7/154"]);
    assert_eq!(flight.demand(&[NAN, NAN, 0.0, 0.0, 44.0]), Some(ACCEPTED));
    assert_eq!(flight.world.stored_turning, ["gimbal-154\t7/154"], "the first zero may be lost");
    flight.beat_for(2);
    assert_eq!(flight.world.stored_turning, Vec::<String>::new());
}

/// A stop takes no knowledge: a gimbal that was left turning is told so at the first sign of it, again and again while it
/// says no more, and once more when it is known.
#[test]
fn a_gimbal_that_is_never_known_is_stopped_all_the_same() {
    let settings = Settings { left_turning: vec!["gimbal-154".to_owned()], ..settings(Some(SYSTEM)) };
    let (mut world, places) = World::empty(settings);
    let device = MavId::new(SYSTEM, 154);
    world.run_for(SECOND);
    assert_eq!(world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal), [], "nobody is there");
    let beats = (SECOND, places.gimbal, device, crate::support::script::gimbal_heartbeat());

    world.send(places.gimbal, device, &crate::support::script::gimbal_heartbeat());
    world.run_for(Duration::from_millis(20));
    let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert_eq!(rates(&told), [[0.0, 0.0]], "at the first sign");
    world.run_with(5 * SECOND, std::slice::from_ref(&beats));
    let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert!(told.len() >= 9 && rates(&told).iter().all(|rates| *rates == [0.0, 0.0]), "{told:?}");

    let known = crate::support::script::device_information(world.now, crate::support::script::usual_capabilities());
    world.send(places.gimbal, device, &MavMessage::GIMBAL_DEVICE_INFORMATION(known));
    world.run_with(3 * SECOND, &[beats]);
    let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert!(rates(&told).iter().all(|rates| *rates == [0.0, 0.0]), "{told:?}");
    assert_eq!(world.stored_turning, Vec::<String>::new());
}

/// Nor is it refused to whoever asks for it, by a command or by the gimbal's name; nothing else is told to a gimbal that is
/// not known.
#[test]
fn a_gimbal_that_is_not_known_can_be_told_to_stop() {
    let (mut world, places) = World::empty(settings(Some(SYSTEM)));
    world.run_with(
        3 * SECOND,
        &[(SECOND, places.gimbal, MavId::new(SYSTEM, 154), crate::support::script::gimbal_heartbeat())],
    );
    world.forget();
    let ask = |world: &mut World, rate: f32| {
        let command = command_long(OUR_MANAGER, 1000, &[NAN, NAN, 0.0, rate, 44.0, 0.0, 0.0]);
        let answers = world.ask(places.ground, GCS, &command);
        let acks: Vec<gimbald::wire::dialect::COMMAND_ACK_DATA> = of(&answers);
        world.run_for(Duration::from_millis(20));
        let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
        (acks[0].result, rates(&told))
    };
    assert_eq!(ask(&mut world, 5.0), (TEMPORARILY_REJECTED, vec![]));
    assert_eq!(ask(&mut world, 0.0), (ACCEPTED, vec![[0.0, 0.0]]));
    assert_eq!(ask(&mut world, 5.0), (TEMPORARILY_REJECTED, vec![]));

    let stop = gimbald::bridge::Input::Asked {
        id: gimbald::gimbals::operation::OperationId(1),
        gimbal: "gimbal-154",
        asked: &gimbald::manager::asked::Asked::Stop,
    };
    world.input(stop);
    world.run_for(Duration::from_millis(20));
    assert_eq!(world.answers.last().map(|(_, answer)| answer.clone()), Some(Ok(())));
    let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert_eq!(rates(&told), [[0.0, 0.0]]);
}

fn rates(setpoints: &[GIMBAL_DEVICE_SET_ATTITUDE_DATA]) -> Vec<[f32; 2]> {
    setpoints.iter().map(|told| [told.angular_velocity_y, told.angular_velocity_z]).collect()
}
