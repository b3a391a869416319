//! When the autopilot's stream steers the gimbal: it is obeyed for what changes, and keeps nobody out for longer.

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
}

impl Flight {
    /// The stream has been −30° from the beginning.
    fn new(settings: Settings) -> Self {
        let (world, places) = with_device(settings);
        let mut flight = Self { world, places, demand: setpoint(-30.0, 0.0, 0) };
        flight.run(3 * SECOND);
        flight
    }

    /// The autopilot goes on with what it demands.
    fn run(&mut self, duration: Duration) {
        let Places { autopilot, gimbal, ground } = self.places;
        let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(self.world.now, 44, -5.0, 10.0));
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

/// RC that moves the camera, and a place that the vehicle looks at while it flies by, go on to be obeyed for as long as they
/// move; each setpoint at once.
#[test]
fn what_moves_keeps_control() {
    let mut flight = Flight::new(presenting());
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    for step in 1..=500 {
        flight.demand(setpoint(-30.0 - f64::from(step) * 0.1, 0.0, 28), PERIOD);
    }
    assert_eq!(flight.holders(), (autopilot(), station()));
    assert_eq!(flight.told().map(|(_, pitch, _)| pitch), Some(-80));
    flight.run(5 * SECOND);
    assert_eq!(flight.holders(), (station(), None));
}

/// What creeps is followed by whom it is obeyed already, but takes no control and keeps nobody out.
#[test]
fn what_creeps_takes_no_control() {
    let mut flight = Flight::new(presenting());
    flight.demand(setpoint(-40.0, 0.0, 0), SECOND);
    let mut pitch = -40.0;
    let creep = |flight: &mut Flight, pitch: &mut f64| {
        for _ in 0..500 {
            *pitch -= 0.004;
            flight.demand(setpoint(*pitch, 0.0, 0), PERIOD);
        }
    };
    creep(&mut flight, &mut pitch);
    assert_eq!(flight.told(), Some((44, -42, 0)));

    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(-70.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    creep(&mut flight, &mut pitch);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -70, 0)), (station(), None)));
}

/// Who takes control back while the autopilot's demand is moving has it: what goes on moving is nothing new. When it has
/// rested, it can be asked for anew.
#[test]
fn a_ground_station_takes_control_back_from_a_moving_demand() {
    let mut flight = Flight::new(presenting());
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    let mut pitch = 0.0;
    let sweep = |flight: &mut Flight, pitch: &mut f64, by: f64| {
        for _ in 0..100 {
            *pitch += by / 100.0;
            flight.demand(setpoint(*pitch, 0.0, 0), PERIOD);
        }
    };
    sweep(&mut flight, &mut pitch, -10.0);
    assert_eq!(flight.holders(), (autopilot(), station()));

    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(-70.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    sweep(&mut flight, &mut pitch, -10.0);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -70, 0)), (station(), None)));
    assert_eq!(flight.stream(), "overruled");
    let refused = &flight.world.snapshot().gimbals[0].rejected;
    assert!(refused["1/1"]["overruled"] > 10, "{refused:?}");

    flight.run(3 * SECOND);
    sweep(&mut flight, &mut pitch, -10.0);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -30, 0)), (autopilot(), station())));
}

/// Likewise who takes control without saying where to look, and who steers a gimbal that nobody holds.
#[test]
fn what_moves_when_somebody_else_is_heard_is_nothing_new() {
    for (command, holder, expected) in
        [(take_control(), station(), -40), (pitchyaw(-70.0, 0.0, NAN, NAN, 44.0), None, -70)]
    {
        let mut flight = Flight::new(presenting());
        let mut pitch = -30.0;
        let sweep = |flight: &mut Flight, pitch: &mut f64| {
            for _ in 0..50 {
                *pitch -= 0.2;
                flight.demand(setpoint(*pitch, 0.0, 0), PERIOD);
            }
        };
        sweep(&mut flight, &mut pitch);
        assert_eq!((flight.stream(), flight.holders()), ("asks".to_owned(), (None, None)));
        assert_eq!(flight.command(&command), Some(ACCEPTED));
        sweep(&mut flight, &mut pitch);

        assert_eq!((flight.stream(), flight.holders()), ("overruled".to_owned(), (holder, None)));
        assert_eq!(flight.told(), Some((44, expected, 0)));
        flight.run(3 * SECOND);
        sweep(&mut flight, &mut pitch);
        assert_eq!(flight.stream(), "asks", "it has rested");
    }
}

/// What creeps is followed by whom it is obeyed already, also where everybody may steer; not by who looks at a place, and not
/// by who was told something else.
#[test]
fn what_creeps_ends_neither_a_place_nor_what_another_asked_for() {
    let creep = |flight: &mut Flight, pitch: &mut f64| {
        for _ in 0..100 {
            *pitch -= 0.005;
            flight.demand(setpoint(*pitch, 0.0, 0), PERIOD);
        }
    };
    let mut flight = Flight::new(presenting());
    let mut pitch = -40.0;
    flight.demand(setpoint(pitch, 0.0, 0), 4 * SECOND);
    assert_eq!(flight.command(&pitchyaw(-70.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    creep(&mut flight, &mut pitch);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -70, 0)), (None, None)));

    let mut flight = Flight::new(presenting());
    let mut pitch = -40.0;
    flight.demand(setpoint(pitch, 0.0, 0), 4 * SECOND);
    assert_eq!(name_place(&mut flight, 47.0 + 100.0 / 111_180.0), [ACCEPTED]);
    creep(&mut flight, &mut pitch);
    assert!(flight.world.snapshot().gimbals[0].roi.is_some(), "the place is looked at");
    // A setpoint that asks for something ends it, and the same place is something new after that.
    flight.demand(setpoint(-10.0, 0.0, 0), SECOND);
    assert_eq!((flight.told(), flight.world.snapshot().gimbals[0].roi.clone()), (Some((44, -10, 0)), None));
    assert_eq!(name_place(&mut flight, 47.0 + 100.0 / 111_180.0), [ACCEPTED]);
    assert!(flight.world.snapshot().gimbals[0].roi.is_some());
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
    flight.demand(turning(2.0, 0.0), 9 * SECOND);
    assert_eq!(flight.world.snapshot().gimbals[0].setpoint.as_ref().map(|it| it.mode.clone()), Some("angle".into()));
    let before = flight.told();
    flight.run(SECOND);
    assert_ne!(flight.told(), before, "it turns");
    flight.run(3 * SECOND);
    let after = flight.told();
    flight.run(30 * SECOND);
    assert_eq!(flight.told(), after, "it has stopped");
}

/// A control that is exclusive the autopilot cannot borrow either: it is refused once for each demand.
#[test]
fn an_exclusive_holder_is_left_alone() {
    let gimbal = GimbalSettings { takeover: Takeover::Exclusive, ..GimbalSettings::found("camera".to_owned()) };
    let mut flight = Flight::new(Settings { gimbals: vec![gimbal], ..presenting() });
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    for pitch in [-45.0, -60.0] {
        flight.demand(setpoint(pitch, 0.0, 0), 10 * SECOND);
    }
    assert_eq!((flight.told(), flight.holders()), (None, (station(), None)));
    assert_eq!(flight.world.snapshot().gimbals[0].rejected["1/1"]["exclusively_held"], 2);
    // What was denied is denied until something else is asked for, also when the gimbal is free by then.
    flight.demand(setpoint(-75.0, 0.0, 0), SECOND);
    assert_eq!(flight.command(&configure([-3.0, -3.0], [-1.0, -1.0])), Some(ACCEPTED));
    flight.run(2 * SECOND);
    assert_eq!((flight.told(), flight.holders()), (None, (None, None)));
    flight.demand(setpoint(-50.0, 0.0, 0), SECOND);
    assert_eq!(flight.told(), Some((44, -50, 0)));
}

/// With `unclaimed = "closed"` nobody steers without control: for a demand it is taken, and given up afterwards.
#[test]
fn where_control_is_needed_it_is_taken_for_the_demand() {
    let control = ControlSettings { open_when_unclaimed: false, ..ControlSettings::default() };
    let mut flight = Flight::new(Settings { control, ..presenting() });
    flight.demand(setpoint(-45.0, 0.0, 0), SECOND);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -45, 0)), (autopilot(), None)));
    flight.run(5 * SECOND);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -45, 0)), (None, None)));
}

/// What is demanded while the gimbal is not there is done when it comes, unless that is so long ago that it is no demand any
/// more.
#[test]
fn a_demand_waits_for_the_gimbal_only_for_a_while() {
    for (away, expected) in [(2, Some((44, -45, 0))), (20, None)] {
        let (mut world, places) = World::empty(presenting());
        let stream = |world: &mut World, pitch: f64, secs: u32| {
            let beat = (SECOND, places.autopilot, AUTOPILOT, ardupilot_heartbeat());
            world.run_with(secs * SECOND, &[beat, (PERIOD, places.autopilot, AUTOPILOT, setpoint(pitch, 0.0, 0))]);
        };
        stream(&mut world, -30.0, 2);
        stream(&mut world, -45.0, away);
        introduce(&mut world, places, usual_capabilities());
        world.forget();
        stream(&mut world, -45.0, 1);
        let mut flight = Flight { world, places, demand: gimbal_heartbeat() };
        assert_eq!(flight.told(), expected, "after {away} s");
        assert_eq!(flight.world.snapshot().gimbals[0].rejected["1/1"]["no_gimbal_yet"], 1);
    }
}

/// "Also CAN_POINT_LOCATION_GLOBAL only if we carry out ROI sent to it": the place is looked at, with the altitude in the
/// frame that the command names; it borrows like any demand, and naming it again is nothing new.
#[test]
fn a_place_named_to_the_device_is_looked_at() {
    let mut flight = Flight::new(presenting());
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    let position = global_position(Timestamp::ZERO, [47.0, 8.0, 500.0], 100.0);
    let roi = |latitude: f64| {
        let command = command_int(GIMBAL, 195, [0.0; 4], (latitude * 1e7) as i32, 80_000_000, 400.0);
        crate::support::script::in_frame(0, command)
    };
    let ask = |flight: &mut Flight, command: &MavMessage| {
        flight.world.send(flight.places.autopilot, AUTOPILOT, &position);
        let acks: Vec<COMMAND_ACK_DATA> = of(&flight.world.ask(flight.places.autopilot, AUTOPILOT, command));
        acks.iter().map(|ack| ack.result).collect::<Vec<_>>()
    };
    // 100 m below, and as far to the North: the nose points East.
    let north = roi(47.0 + 100.0 / 111_180.0);
    assert_eq!(ask(&mut flight, &north), [ACCEPTED]);
    flight.run(SECOND);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -45, -90)), (autopilot(), station())));
    assert_eq!(ask(&mut flight, &north), [ACCEPTED]);
    flight.run(5 * SECOND);
    assert_eq!(flight.holders(), (station(), None));
    assert_eq!(flight.command(&pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    assert_eq!(ask(&mut flight, &north), [DENIED], "it is nothing new");
    flight.run(SECOND);
    assert_eq!((flight.told(), flight.holders()), (Some((44, -10, 0)), (station(), None)));
    assert_eq!(ask(&mut flight, &roi(46.999)), [ACCEPTED]);
    assert_eq!(flight.holders(), (autopilot(), station()));
    // Nobody else names places to the device.
    let from_station = flight.world.ask(flight.places.autopilot, GCS, &north);
    assert_eq!(of::<COMMAND_ACK_DATA>(&from_station)[0].result, 3);
}

/// Nor is it borrowed for a setpoint that cannot be carried out, such as a retraction of a gimbal that knows none.
#[test]
fn a_demand_that_cannot_be_done_borrows_nothing() {
    let mut flight = Flight::new(presenting());
    let capabilities = usual_capabilities().difference(CapFlags::HAS_RETRACT);
    introduce(&mut flight.world, flight.places, capabilities);
    assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
    assert_eq!(flight.command(&pitchyaw(NAN, NAN, 0.0, 5.0, 44.0)), Some(ACCEPTED));

    flight.demand(setpoint(-30.0, 0.0, 1), 2 * SECOND);

    let gimbal = flight.world.snapshot().gimbals[0].clone();
    assert_eq!(flight.holders(), (station(), None));
    assert_eq!(gimbal.rejected["1/1"]["cannot_retract"], 1);
    let setpoint = gimbal.setpoint.expect("it turns");
    assert_eq!((setpoint.mode.as_str(), setpoint.source), ("rate", station()));
}

/// Control is not borrowed for a place that cannot be looked at: whoever has it keeps it, and goes on turning.
#[test]
fn a_place_that_cannot_be_looked_at_borrows_nothing() {
    const UNSUPPORTED_MAV_FRAME: u8 = 9;
    let roi = |frame| crate::support::script::in_frame(frame, command_int(GIMBAL, 195, [0.0; 4], 1, 80_000_000, 400.0));
    // Nobody has told where the vehicle is, and the second frame is none that counts from the ground or from the sea.
    for (frame, expected) in [(0, TEMPORARILY_REJECTED), (8, UNSUPPORTED_MAV_FRAME)] {
        let mut flight = Flight::new(presenting());
        assert_eq!(flight.command(&take_control()), Some(ACCEPTED));
        assert_eq!(flight.command(&pitchyaw(NAN, NAN, 0.0, 5.0, 44.0)), Some(ACCEPTED));
        let acks: Vec<COMMAND_ACK_DATA> = of(&flight.world.ask(flight.places.autopilot, AUTOPILOT, &roi(frame)));
        assert_eq!(acks.iter().map(|ack| ack.result).collect::<Vec<_>>(), [expected]);
        assert_eq!(flight.holders(), (station(), None));
        flight.run(SECOND);
        let setpoint = flight.world.snapshot().gimbals[0].setpoint.clone().expect("it turns");
        assert_eq!((setpoint.mode.as_str(), setpoint.source), ("rate", station()));
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
    let mut flight = Flight { world, places, demand: nothing };
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
