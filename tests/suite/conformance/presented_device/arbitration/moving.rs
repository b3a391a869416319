//! A demand that goes on moving: who it keeps out, and who has control when.

use super::*;

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
