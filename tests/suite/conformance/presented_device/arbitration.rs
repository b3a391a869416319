//! When the autopilot's stream steers the gimbal: it is obeyed for what changes, and keeps nobody out for longer.

mod borrowing;
mod moving;

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::settings::{GimbalSettings, Takeover};
use gimbald::manager::settings::ControlSettings;
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, MavMessage, SYSTEM_TIME_DATA};
use gimbald::wire::ids::CapFlags;

use proptest::prelude::*;

use super::{PERIOD, SECOND, introduce, presenting, setpoint, turning, with_device};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, ardupilot_heartbeat, autopilot_state, command_int, configure,
    device_status, gimbal_heartbeat, global_position, ground_heartbeat, of, pitch_yaw_deg, pitchyaw, take_control,
    usual_capabilities,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, Places, World};

/// The world with the autopilot's stream in it, and everybody's heartbeat.
struct Flight {
    world: World,
    places: Places,
    demand: MavMessage,
    /// Where the gimbal looks, pitch and yaw in degrees.
    looks: (f64, f64),
}

impl Flight {
    /// The stream has been −30° from the beginning.
    fn new(settings: Settings) -> Self {
        let (world, places) = with_device(settings);
        let mut flight = Self { world, places, demand: setpoint(-30.0, 0.0, 0), looks: (-5.0, 10.0) };
        flight.run(3 * SECOND);
        flight
    }

    /// The autopilot goes on with what it demands.
    fn run(&mut self, duration: Duration) {
        let Places { autopilot, gimbal, ground } = self.places;
        let status =
            MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(self.world.now, 44, self.looks.0, self.looks.1));
        let state = MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(autopilot_state(self.world.now, AUTOPILOT, 90.0));
        self.world.run_with(
            duration,
            &[
                (SECOND, autopilot, AUTOPILOT, ardupilot_heartbeat()),
                (SECOND, gimbal, GIMBAL, gimbal_heartbeat()),
                (SECOND, ground, GCS, ground_heartbeat()),
                (SECOND / 20, gimbal, GIMBAL, status),
                (PERIOD, autopilot, AUTOPILOT, state),
                (PERIOD, autopilot, AUTOPILOT, self.demand.clone()),
            ],
        );
    }

    /// The same, and the gimbal goes where it is told; where that was at last.
    fn follow(&mut self, duration: Duration) -> (f64, f64) {
        for _ in 0..duration.as_millis() / 100 {
            self.run(SECOND / 10);
            let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = self.world.take_messages(self.places.gimbal);
            if let Some(told) = told.last() {
                self.looks = pitch_yaw_deg(told.q);
            }
        }
        self.looks
    }

    /// The autopilot demands something else, and goes on with that.
    fn demand(&mut self, demand: MavMessage, duration: Duration) {
        self.demand = demand;
        self.run(duration);
    }

    /// The ground station's command; its result.
    fn command(&mut self, command: &MavMessage) -> Option<u8> {
        self.world.result_of(self.places.ground, GCS, command)
    }

    /// What the gimbal was last told: flags, pitch and yaw in degrees.
    fn told(&mut self) -> Option<(u16, i32, i32)> {
        let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = self.world.take_messages(self.places.gimbal);
        told.last().map(|told| {
            let (pitch, yaw) = pitch_yaw_deg(told.q);
            (told.flags, pitch.round() as i32, yaw.round() as i32)
        })
    }

    fn holders(&self) -> (Option<String>, Option<String>) {
        let gimbal = &self.world.snapshot().gimbals[0];
        (gimbal.primary.clone(), gimbal.lender.clone())
    }

    fn stream(&self) -> String {
        self.world.snapshot().gimbals[0].presented.as_ref().expect("it is presented").stream.clone()
    }

    fn events(&self) -> Vec<(String, u64)> {
        let events = self.world.snapshot().events;
        events.into_iter().rev().map(|event| (event.what, event.count)).collect()
    }
}

/// The autopilot, 100 m above the sea's 400 m at 47° N, 8° E, has the device look at a place there; the answers.
fn name_place(flight: &mut Flight, latitude: f64) -> Vec<u8> {
    let position = global_position(Timestamp::ZERO, [47.0, 8.0, 500.0], 100.0);
    let roi = command_int(GIMBAL, 195, [0.0; 4], (latitude * 1e7) as i32, 80_000_000, 400.0);
    flight.world.send(flight.places.autopilot, AUTOPILOT, &position);
    let answers = flight.world.ask(flight.places.autopilot, AUTOPILOT, &crate::support::script::in_frame(0, roi));
    of::<COMMAND_ACK_DATA>(&answers).iter().map(|ack| ack.result).collect()
}

fn station() -> Option<String> {
    Some(GCS.to_string())
}

fn autopilot() -> Option<String> {
    Some(AUTOPILOT.to_string())
}

/// "Its first value after start/reconnect moves nothing (nothing moves that nobody asked)", and "a constant 50 Hz stream
/// neither takes control nor keeps anyone out".
#[test]
fn a_constant_stream_moves_nothing() {
    let mut flight = Flight::new(presenting());
    flight.run(60 * SECOND);
    assert_eq!(flight.told(), None);
    assert_eq!(flight.holders(), (None, None));
    assert_eq!(flight.stream(), "steady");

    // After a silence it may stand elsewhere.
    let mut quiet = Flight { demand: gimbal_heartbeat(), ..flight };
    quiet.run(2 * SECOND);
    assert_eq!(quiet.stream(), "silent");
    quiet.demand(setpoint(40.0, 20.0, 0), 2 * SECOND);
    assert_eq!((quiet.told(), quiet.stream()), (None, "steady".to_owned()));
}

/// "While nobody holds the gimbal it steers directly", without taking control: others may steer it too. "Frames: ArduPilot
/// sets no YAW_IN bits (28 = lock = earth)".
#[test]
fn while_nobody_holds_the_gimbal_it_steers() {
    let mut flight = Flight::new(presenting());
    flight.demand(setpoint(-40.0, 15.0, 0), SECOND);
    assert_eq!(flight.told(), Some((44, -40, 15)));
    // From North: the gimbal takes yaw from the nose, which points East.
    flight.demand(setpoint(-10.0, 100.0, 28), SECOND);
    assert_eq!(flight.told(), Some((44, -10, 10)));
    assert_eq!((flight.holders(), flight.stream()), ((None, None), "asks".to_owned()));
    flight.run(6 * SECOND);
    assert_eq!(flight.stream(), "steady");

    assert_eq!(flight.command(&pitchyaw(-70.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    flight.run(10 * SECOND);
    assert_eq!(flight.told(), Some((44, -70, 0)), "the stream goes on as it was");
}

/// "With a simulated ArduPilot stream at 50 Hz, a ground station that takes control keeps it; a new ArduPilot demand
/// (mission item) borrows and gives back."
#[test]
fn a_new_demand_borrows_and_gives_back() {
    let mut flight = Flight::new(presenting());
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(-70.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    flight.run(60 * SECOND);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -70, 0)), (station(), None)));

    // A mission item.
    flight.demand(setpoint(-45.0, 30.0, 0), SECOND);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -45, 30)), (autopilot(), station())));
    assert_eq!(flight.command(&pitchyaw(-70.0, 0.0, NAN, NAN, 44.0)), Some(DENIED));
    flight.run(SECOND * 39 / 10);
    assert_eq!(flight.holders(), (autopilot(), station()));
    // "The former holder restored after the demand is steady": five seconds; the camera stays.
    flight.run(SECOND / 5);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -45, 30)), (station(), None)));
    flight.run(60 * SECOND);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -45, 30)), (station(), None)));
    assert_eq!(flight.command(&pitchyaw(-70.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    assert_eq!(flight.told(), Some((44, -70, 0)));

    let control: Vec<_> = flight.events().into_iter().filter(|(what, _)| what != "gimbal_found").collect();
    let expected = [("taken", 1), ("borrowed", 1), ("refused", 1), ("restored", 1)];
    assert_eq!(control, expected.map(|(what, count)| (what.to_owned(), count)));
}

/// What the autopilot claimed itself, as PX4 does, is no loan of its stream, and not given back for it.
#[test]
fn what_the_autopilot_claims_itself_it_keeps() {
    let mut flight = Flight::new(presenting());
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    flight.demand(setpoint(-45.0, 30.0, 0), SECOND);
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    flight.world.send(flight.places.autopilot, AUTOPILOT, &take_control());
    flight.run(20 * SECOND);
    assert_eq!(flight.holders(), (autopilot(), station()));
}

/// "What the autopilot had in hand goes back when it starts again": it knows nothing of what it asked for, so the place that
/// it names again is something new.
#[test]
fn after_a_restart_of_the_autopilot_a_place_is_asked_for_anew() {
    let mut flight = Flight::new(presenting());
    let restart = |flight: &mut Flight, millis: u32| {
        let time = SYSTEM_TIME_DATA { time_unix_usec: 0, time_boot_ms: millis };
        flight.world.send(flight.places.autopilot, AUTOPILOT, &MavMessage::SYSTEM_TIME(time));
    };
    restart(&mut flight, 3_600_000);
    assert_eq!(name_place(&mut flight, 47.001), [ACCEPTED]);
    flight.run(SECOND);
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    assert_eq!(name_place(&mut flight, 47.001), [DENIED], "it is nothing new");
    restart(&mut flight, 1_000);
    flight.run(SECOND / 5);
    assert_eq!(name_place(&mut flight, 47.001), [ACCEPTED]);
    assert_eq!(flight.holders(), (autopilot(), station()));
}

/// "NaN q with rates = rates": they go on while the stream does, "if ArduPilot's stream stops, its rates stop", and so they
/// do when control goes back.
#[test]
fn rates_end_with_the_stream() {
    let rates = |flight: &mut Flight| {
        let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = flight.world.take_messages(flight.places.gimbal);
        let told = told.last().expect("it is told something").clone();
        [told.angular_velocity_y, told.angular_velocity_z].map(|rate| rate.to_degrees().round() as i32)
    };
    for stops in ["stream", "command", "control"] {
        let mut flight = Flight::new(presenting());
        if stops == "control" {
            assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
        }
        let turning = |pitch, yaw| match turning(pitch, yaw) {
            MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(message) => {
                // Not locked: this gimbal turns from the nose.
                MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(GIMBAL_DEVICE_SET_ATTITUDE_DATA { flags: 12, ..message })
            }
            other => other,
        };
        flight.demand(turning(5.0, -5.0), 4 * SECOND);
        assert_eq!(rates(&mut flight), [5, -5], "{stops}: they last while the stream does");
        match stops {
            "stream" => flight.demand(gimbal_heartbeat(), 3 * SECOND),
            "command" => flight.demand(turning(0.0, 0.0), SECOND / 2),
            _ => flight.run(2 * SECOND),
        }
        assert_eq!(rates(&mut flight), [0, 0], "{stops}");
        assert_eq!(flight.holders().0, if stops == "control" { station() } else { None });
    }
}

/// ArduPilot repeats a rate for ever, whoever set it may be gone: unchanged it lasts as long as one set by command.
#[test]
fn a_rate_that_nobody_changes_ends() {
    let control = ControlSettings { command_rate_timeout: 10 * SECOND, ..ControlSettings::default() };
    let mut flight = Flight::new(Settings { control, ..presenting() });
    flight.demand = turning(2.0, 0.0);
    let before = flight.follow(9 * SECOND);
    assert_eq!(flight.world.snapshot().gimbals[0].setpoint.as_ref().map(|it| it.mode.clone()), Some("angle".into()));
    assert_ne!(flight.follow(SECOND), before, "it turns");
    let after = flight.follow(3 * SECOND);
    assert_eq!(flight.follow(30 * SECOND), after, "it has stopped");
}

/// "Unchanged" is a rate also when it is not exactly the same each time: what creeps asks for nothing new.
#[test]
fn a_rate_that_only_jitters_ends_as_one_that_nobody_changes() {
    for by in [0.02, 0.2] {
        let mut flight = Flight::new(presenting());
        let jitter = |flight: &mut Flight, seconds: usize| {
            for tenth in 0..seconds * 10 {
                flight.demand = turning(if tenth % 2 == 0 { 2.0 + by } else { 2.0 - by }, 0.0);
                flight.follow(SECOND / 10);
            }
            flight.looks
        };
        let before = jitter(&mut flight, 9);
        assert_ne!(jitter(&mut flight, 1), before, "{by}: it turns");
        let after = jitter(&mut flight, 3);
        assert_eq!(jitter(&mut flight, 30), after, "{by}: it has stopped");
        assert_eq!(flight.stream(), "steady");

        // And what is asked for next is done.
        flight.demand(setpoint(-45.0, 30.0, 0), SECOND);
        assert_eq!(flight.told(), Some((44, -45, 30)));
    }
}

/// PX4 with `MNT_MODE_OUT` 2 drives a device as well, and in its own way: 283 is asked of everybody, 284 comes to no component
/// in particular, with frame bits, with NaN before it has any input, and with the identity beside a rate.
#[test]
fn px4_drives_the_device_alike() {
    let (world, places) = with_device(presenting());
    let to_everybody = |message: MavMessage, flags: u16, q: Option<[f32; 4]>| match message {
        MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(message) => {
            MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(GIMBAL_DEVICE_SET_ATTITUDE_DATA {
                q: q.unwrap_or(message.q),
                flags,
                target_component: 0,
                ..message
            })
        }
        other => other,
    };
    let nothing = to_everybody(setpoint(0.0, 0.0, 0), 44, Some([NAN; 4]));
    let mut flight = Flight { world, places, demand: nothing, looks: (-5.0, 10.0) };
    flight.run(5 * SECOND);
    assert_eq!(flight.told(), None);

    flight.demand(to_everybody(setpoint(-30.0, 15.0, 0), 32, None), SECOND);
    assert_eq!(flight.told(), Some((44, -30, 15)));
    // The nose points East.
    flight.demand(to_everybody(setpoint(-10.0, 100.0, 0), 80, None), SECOND);
    assert_eq!(flight.told(), Some((44, -10, 10)));
    let turns = to_everybody(turning(2.0, 0.0), 32, Some([1.0, 0.0, 0.0, 0.0]));
    flight.demand(turns, 2 * SECOND);
    let told: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = flight.world.take_messages(flight.places.gimbal);
    let told = told.last().expect("it turns");
    assert!((told.angular_velocity_y.to_degrees() - 2.0).abs() < 0.01 && told.q[0].is_nan(), "{told:?}");
    assert_eq!(flight.world.snapshot().conflicts, [""; 0]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever the autopilot demands and a station does, in any order: five seconds after its last demand the autopilot has no
    /// control, and the stream that goes on takes none; and while a station has control and the demand rests, it keeps it.
    #[test]
    fn a_stream_that_rests_has_no_control(steps in prop::collection::vec(step(), 1..12)) {
        let mut flight = Flight::new(presenting());
        for step in steps {
            match step {
                Step::Demand(pitch, flags, millis) => {
                    flight.demand(setpoint(f64::from(pitch), 0.0, flags), Duration::from_millis(millis));
                }
                Step::Turn(rate, millis) => flight.demand(turning(f64::from(rate), 0.0), Duration::from_millis(millis)),
                Step::Take => { flight.command(&take_control()); }
                Step::Release => { flight.command(&configure([-3.0, -3.0], [-1.0, -1.0])); }
                Step::Steer(pitch) => { flight.command(&pitchyaw(f32::from(pitch), 0.0, NAN, NAN, 44.0)); }
            }
        }
        flight.run(6 * SECOND);
        prop_assert_ne!(flight.holders().0, autopilot());
        prop_assert_eq!(flight.holders().1, None);
        let holder = flight.holders().0;
        flight.run(20 * SECOND);
        prop_assert_eq!(flight.holders().0, holder);
        let rotates = flight.world.snapshot().gimbals[0].setpoint.as_ref().is_some_and(|setpoint| setpoint.mode == "rate");
        prop_assert!(!rotates);
    }
}

/// Something that the autopilot, or the station, does.
#[derive(Clone, Debug)]
enum Step {
    /// Pitch in degrees, flags, and for how many milliseconds.
    Demand(i8, u16, u64),
    Turn(i8, u64),
    Take,
    Release,
    Steer(i8),
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        (-80_i8..20, prop_oneof![Just(0), Just(28)], 20_u64..4_000).prop_map(|(p, f, t)| Step::Demand(p, f, t)),
        (-5_i8..=5, 20_u64..4_000).prop_map(|(rate, t)| Step::Turn(rate, t)),
        Just(Step::Take),
        Just(Step::Release),
        (-80_i8..20).prop_map(Step::Steer),
    ]
}
