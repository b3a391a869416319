//! Its MAVLink id becomes another while it turns.

use gimbald::geometry::GimbalAngles;
use gimbald::gimbals::mavlink_v1::sim as mavlink_v1;
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::wire::dialect::COMMAND_LONG_DATA;

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

/// "To a plain v1 gimbal its own are angles": one that comes to the link of a Gremsy which fell silent while it turned is told
/// none of a Gremsy's zeros, which would take it to its middle.
#[test]
fn a_v1_gimbal_that_comes_after_a_gremsy_is_not_moved() {
    let mut flight = Flight::turning(Kind::GremsyV1);
    flight.cable.cut();
    flight.run_for(2 * SECOND);
    let place = flight.world.open(1);
    let pose = GimbalAngles { roll: Angle::ZERO, pitch: Angle::from_degrees(-12.0), yaw: Angle::from_degrees(33.0) };
    let plant = PlantSettings { noise: Angle::ZERO, initial: pose, ..PlantSettings::default() };
    let settings = mavlink_v1::DeviceSettings { component_id: 171, plant, ..mavlink_v1::DeviceSettings::default() };
    let device = Watched::new(mavlink_v1::Device::new(flight.world.now, settings));
    flight.world.install(place, device.clone());
    flight.world.forget();
    flight.run_for(20 * SECOND);
    let looks = device.look().plant().pose();
    assert_eq!([looks.roll, looks.pitch, looks.yaw], [pose.roll, pose.pitch, pose.yaw]);
    let arrivals = flight.world.take(place);
    let ours: Vec<_> = arrivals.iter().filter(|arrival| (191..=194).contains(&arrival.source().component)).collect();
    let commands = ours.iter().filter_map(|arrival| arrival.frame().decode::<COMMAND_LONG_DATA>());
    let told: Vec<u16> = commands.map(|told| told.command).collect();
    assert!(!told.is_empty() && told.iter().all(|command| matches!(command, 511 | 512)), "{told:?}");
    let steers = |id: u32| matches!(id, 157 | 284);
    assert!(!ours.iter().any(|arrival| steers(arrival.id())), "no setpoint either");
    let gimbals = flight.world.snapshot().gimbals;
    assert_eq!(
        gimbals.iter().find(|gimbal| gimbal.name == "gimbal-171").map(|gimbal| gimbal.family.as_str()),
        Some("mavlink_v1")
    );
}

/// A plain v1 gimbal has no rotation of its own that could have been left: it is not the v2 device that fell silent while it
/// turned, whether that is known at once or found out; one that tells nothing of where it looks would be taken to its middle.
#[test]
fn a_v1_gimbal_that_comes_after_a_v2_device_is_told_nothing() {
    let entry = GimbalSettings {
        component_id: Some(171),
        family: Family::MavlinkV1,
        ..GimbalSettings::found("gimbal-171".to_owned())
    };
    for gimbals in [vec![], vec![entry]] {
        let mut flight = Flight::turning_with(Kind::V2Device, Settings { gimbals, ..three_links() });
        flight.cable.cut();
        // It is there, and steerable, when the other one is given up.
        flight.run_for(2 * SECOND);
        let place = flight.world.open(1);
        let settings = mavlink_v1::DeviceSettings { component_id: 171, ..mavlink_v1::DeviceSettings::default() };
        let device = mavlink_v1::Device::new(flight.world.now, settings);
        flight.world.install(place, device);
        flight.world.forget();
        flight.run_for(40 * SECOND);
        let told: Vec<COMMAND_LONG_DATA> = flight.world.take_messages(place);
        assert!(told.iter().all(|told| ![204, 205].contains(&told.command)), "{told:?}");
        let gimbals = flight.world.snapshot().gimbals;
        let other = gimbals.iter().find(|gimbal| gimbal.name == "gimbal-171").expect("it is there");
        assert_eq!((other.family.as_str(), other.state.as_str(), &other.setpoint), ("mavlink_v1", "alive", &None));
    }
}

/// "A stop counts when the gimbal has stopped": what is known of its rotation is not forgotten when it takes the system id of the
/// vehicle, which is no other gimbal.
#[test]
fn one_that_takes_the_id_of_the_vehicle_is_told_to_stop_on() {
    for kind in [Kind::GremsyV1, Kind::GremsyV2] {
        let mut flight = Flight::begin(kind);
        flight.cable.rename(MavId::new(7, 154));
        flight.run_for(25 * SECOND);
        assert_eq!(flight.world.snapshot().gimbals[0].device.as_deref(), Some("7/154"), "{kind:?}");
        flight.turn_for(3 * SECOND);
        flight.cable.cut_towards_gimbal();
        flight.run_for(6 * SECOND);
        let before = flight.gimbal.yaw_deg();
        flight.cable.rename(GIMBAL);
        flight.run_for(9 * SECOND);
        assert!((flight.gimbal.yaw_deg() - before).abs() > 10.0, "{kind:?} turns");
        assert_eq!(flight.world.snapshot().gimbals[0].device.as_deref(), Some("1/154"), "{kind:?}");
        assert_eq!(flight.world.stored_turning.len(), 1, "{kind:?}: {:?}", flight.world.stored_turning);
        flight.cable.mend();
        flight.run_for(25 * SECOND);
        flight.assert_rests(&format!("{kind:?}"));
        assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{kind:?}");
    }
}
