//! Its cable is away while the rotation ends.

use gimbald::bridge::settings::SystemId;

use super::*;
use crate::support::script::px4_heartbeat;

/// How the rotation ends that nobody wants any more.
#[derive(Clone, Copy, Debug)]
enum End {
    /// Whoever asked for it does not repeat it.
    NotRepeated,
    /// An accepted stop.
    Stop,
    /// Another direction.
    Angle,
    /// Its operator lets go of it.
    Released,
}

const ENDS: [End; 4] = [End::NotRepeated, End::Stop, End::Angle, End::Released];

impl Flight {
    fn end_rotation(&mut self, end: End) {
        let (ground, manager) = (self.places.ground, MANAGER);
        let command = match end {
            End::NotRepeated => return,
            End::Stop => {
                assert_eq!(self.rate_command(0.0), Some(ACCEPTED));
                return;
            }
            End::Angle => command_long(manager, 1000, &[-10.0, 0.0, NAN, NAN, 44.0, 0.0, 0.0]),
            End::Released => command_long(manager, 1001, &[-3.0, -3.0, -3.0, -3.0, 0.0, 0.0, 0.0]),
        };
        self.world.send(ground, GCS, &command);
    }
}

/// "A setpoint is forgotten when the gimbal is lost, but for a rotation, which is stopped at once and again when it is
/// heard: it may have gone on turning." What was said to stop it while it was away went into the void, also where it was
/// accepted and said for a second.
#[test]
fn what_ended_while_the_gimbal_was_away_is_stopped_when_it_is_back() {
    for kind in KINDS {
        for end in ENDS {
            for away in [2, 8] {
                let what = format!("{kind:?} {end:?}, {away} s");
                let mut flight = Flight::turning(kind);
                flight.cable.cut();
                flight.turn_for(SECOND / 2);
                flight.end_rotation(end);
                flight.run_for(away * SECOND);
                assert_eq!(flight.world.stored_turning.len(), 1, "{what}: nothing has heard that it is to stop");

                flight.cable.mend();
                flight.run_for(3 * SECOND);
                flight.assert_rests(&what);
                flight.run_for(3 * SECOND);
                assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{what}");
            }
        }
    }
}

/// The same where the port itself was gone.
#[test]
fn what_ended_while_the_gimbal_was_unplugged_is_stopped_when_it_is_back() {
    for kind in KINDS {
        for end in ENDS {
            let what = format!("{kind:?} {end:?}");
            let mut flight = Flight::turning(kind);
            flight.world.unplug(flight.places.gimbal);
            flight.turn_for(SECOND / 2);
            flight.end_rotation(if matches!(end, End::Stop) { End::NotRepeated } else { end });
            flight.run_for(8 * SECOND);
            assert_eq!(flight.world.stored_turning.len(), 1, "{what}");

            flight.world.plug_in(flight.places.gimbal);
            flight.run_for(3 * SECOND);
            flight.assert_rests(&what);
        }
    }
}

/// A second in which it was heard is enough: then it is not told again when it comes back.
#[test]
fn what_was_heard_to_stop_is_left_alone_when_it_is_back() {
    for kind in KINDS {
        let mut flight = Flight::turning(kind);
        flight.end_rotation(End::Stop);
        flight.run_for(2 * SECOND);
        assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{kind:?}");
        flight.cable.cut();
        flight.run_for(8 * SECOND);
        flight.world.forget();
        flight.cable.mend();
        flight.run_for(8 * SECOND);
        let setpoint = flight.world.snapshot().gimbals[0].setpoint.clone();
        assert_eq!(setpoint, None, "{kind:?}: nobody has asked for anything");
    }
}

/// A gimbal that listens to its system alone is stopped under that id, also where the autopilot has another one by the time
/// that it is back.
#[test]
fn it_is_stopped_under_the_system_that_told_it_to_turn() {
    for kind in KINDS {
        let mut flight = Flight::turning_with(kind, Settings { system_id: SystemId::Auto, ..three_links() });
        flight.cable.cut();
        flight.world.remove(flight.places.autopilot);
        let changed = (SECOND, flight.places.autopilot, MavId::new(2, 1), px4_heartbeat());
        let ground = (SECOND, flight.places.ground, GCS, ground_heartbeat());
        let beats = [changed, ground];
        flight.world.run_with(9 * SECOND, &beats);
        assert_eq!(flight.world.snapshot().system_id, Some(1), "{kind:?}");
        flight.cable.mend();
        flight.world.run_with(20 * SECOND, &beats);
        assert_eq!(flight.world.snapshot().system_id, Some(2), "{kind:?}");
        flight.assert_rests(&format!("{kind:?}"));
    }
}

/// A gimbal whose clock jumps back has started again, and stands, or has not: "a rotation is over when the gimbal was told
/// something else for a second in which it was heard", also where that was said and not heard just before.
#[test]
fn what_did_not_hear_its_stop_is_stopped_when_its_clock_has_jumped() {
    for kind in KINDS {
        for end in [End::Stop, End::Released] {
            let what = format!("{kind:?} {end:?}");
            let mut flight = Flight::turning(kind);
            flight.cable.cut_towards_gimbal();
            flight.end_rotation(end);
            flight.run_for(SECOND / 20);
            flight.cable.set_clock_back(1_500);
            flight.run_for(SECOND / 4);
            flight.cable.mend();
            flight.run_for(3 * SECOND);
            flight.assert_rests(&what);
            flight.run_for(5 * SECOND);
            assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{what}");
        }
    }
}

/// "Its own word that it turns weighs more than that the line is up in one direction": what it is told may not arrive, and while
/// it tells that it turns on, it does. Then the line is out both ways, or the daemon is killed.
#[test]
fn what_tells_that_it_turns_on_is_stopped_when_it_can_hear() {
    for kind in KINDS {
        for end in ENDS {
            for is_killed in [false, true] {
                let what = format!("{kind:?} {end:?}, killed {is_killed}");
                let mut flight = Flight::turning(kind);
                flight.cable.cut_towards_gimbal();
                flight.end_rotation(end);
                flight.run_for(4 * SECOND);
                assert_eq!(flight.world.stored_turning.len(), 1, "{what}: it tells that it turns");
                if is_killed {
                    flight.world.kill();
                    flight.run_for(SECOND / 2);
                    let left_turning = flight.world.stored_turning.clone();
                    flight.world.start(Settings { left_turning, ..three_links() });
                } else {
                    flight.cable.cut();
                }
                flight.run_for(4 * SECOND);
                flight.cable.mend();
                flight.run_for(5 * SECOND);
                flight.assert_rests(&what);
                flight.run_for(10 * SECOND);
                assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{what}");
            }
        }
    }
}
