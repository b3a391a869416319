//! What a demand needs to borrow control, and what borrows nothing.

use super::*;

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
        let mut flight = Flight { world, places, demand: gimbal_heartbeat(), looks: (-5.0, 10.0) };
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
