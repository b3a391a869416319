//! Its MAVLink id becomes another while it turns.

use gimbald::gimbals::settings::GimbalSettings;

use super::*;

/// "A device that was restarted under another id is the same one", and so is one that went on turning: whoever comes to the
/// link of a gimbal that may be turning and fell silent is told to stop, whether the configuration names one of them or
/// not. Where the operator goes on, it goes on in the name of the former.
#[test]
fn a_gimbal_that_turns_under_another_id_is_stopped() {
    for kind in KINDS {
        for id in [MavId::new(1, 171), MavId::new(7, 154)] {
            for entry in [None, Some(None), Some(Some(154))] {
                for goes_on in [false, true] {
                    let what = format!("{kind:?} {id}, entry {entry:?}, goes on {goes_on}");
                    let found = GimbalSettings::found("camera".to_owned());
                    let gimbals =
                        entry.map(|component_id| GimbalSettings { component_id, ..found }).into_iter().collect();
                    let mut flight = Flight::turning_with(kind, Settings { gimbals, ..three_links() });
                    flight.cable.rename(id);
                    if goes_on {
                        flight.turn_for(10 * SECOND);
                    } else {
                        flight.run_for(10 * SECOND);
                    }
                    flight.run_for(10 * SECOND);
                    flight.assert_rests(&what);
                }
            }
        }
    }
}

/// D9: "Nothing is sent before the first accepted demand": another gimbal on that link that was there before is none of its
/// successors.
#[test]
fn a_gimbal_that_was_there_before_is_told_nothing() {
    let mut flight = Flight::begin(Kind::GremsyV1);
    let place = flight.world.open(1);
    let (other, _) = Gimbal::install(&mut flight.world, place, Kind::V2Device, 171);
    flight.run_for(8 * SECOND);
    flight.turn_for(3 * SECOND);
    let before = other.yaw_deg();
    flight.cable.cut();
    flight.world.forget();
    flight.run_for(20 * SECOND);
    assert!((other.yaw_deg() - before).abs() < 0.1);
    let gimbals = flight.world.snapshot().gimbals;
    let other = gimbals.iter().find(|gimbal| gimbal.name == "gimbal-171").expect("it was found");
    assert_eq!((other.state.as_str(), &other.setpoint), ("alive", &None));
}
