//! A simulated PX4 as the client of an external manager, against what was read in its source (`MNT_MODE_OUT` 3).

use super::*;

const MANAGER: MavId = MavId::new(1, 191);

fn started(version: ClientVersion) -> Flight {
    let gimbal_output = GimbalOutput::Manager(version);
    Flight::with(VehicleSettings { gimbal_output, ..VehicleSettings::default() })
}

/// 281 with that component of the vehicle in control.
fn status(gimbal_device_id: u8, primary: u8) -> GIMBAL_MANAGER_STATUS_DATA {
    GIMBAL_MANAGER_STATUS_DATA {
        time_boot_ms: 1,
        flags: 44,
        gimbal_device_id,
        primary_control_sysid: u8::from(primary != 0),
        primary_control_compid: primary,
        secondary_control_sysid: 0,
        secondary_control_compid: 0,
    }
}

/// A mission item: pitch and yaw in degrees, yaw from the nose.
fn mission_item() -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA { param7: 2.0, ..long(205, [-30.0, 0.0, 20.0]) }
}

/// The claims that it sent, with their confirmations.
fn claims(flight: &Flight) -> Vec<([f32; 4], u8)> {
    let commands = flight.all::<COMMAND_LONG_DATA>();
    let claims = commands.iter().filter(|(_, command)| command.command == 1001).map(|(_, command)| {
        assert_eq!((command.target_system, command.target_component, command.param7), (1, 191, 154.0));
        ([command.param1, command.param2, command.param3, command.param4], command.confirmation)
    });
    claims.collect()
}

fn answered(flight: &mut Flight) {
    let ack = COMMAND_ACK_DATA {
        command: 1001,
        result: 0,
        progress: 0,
        result_param2: 0,
        target_system: 1,
        target_component: 1,
    };
    flight.hear(MANAGER, &ack);
}

const CLAIM: [f32; 4] = [1.0, 1.0, -1.0, -1.0];

/// "Finds the manager purely by a streamed 281 and requests nothing"; "latches the first (sysid, compid, device id) it sees
/// and never re-latches"; acts only for intent born on board.
#[test]
fn it_finds_its_manager_by_281() {
    let mut flight = started(ClientVersion::Merged);
    flight.hear(MavId::new(2, 191), &status(154, 0));
    flight.ask(&mission_item());
    flight.run_for(1000);
    assert_eq!((claims(&flight), flight.count(287)), (vec![], 0), "another vehicle's");

    flight.hear(MANAGER, &status(154, 0));
    flight.hear(MavId::new(1, 195), &status(171, 0));
    flight.sent.clear();
    flight.run_for(1000);
    assert_eq!(claims(&flight), [(CLAIM, 1), (CLAIM, 2)]);
    let demands = flight.all::<GIMBAL_MANAGER_SET_PITCHYAW_DATA>();
    assert_eq!(demands.len(), 50);
    let expected = GIMBAL_MANAGER_SET_PITCHYAW_DATA {
        flags: 8,
        pitch: -30.0_f32.to_radians(),
        yaw: 20.0_f32.to_radians(),
        pitch_rate: f32::NAN,
        yaw_rate: f32::NAN,
        target_system: 1,
        target_component: 191,
        gimbal_device_id: 154,
    };
    let nan = |demand: &GIMBAL_MANAGER_SET_PITCHYAW_DATA| (demand.pitch_rate.is_nan(), demand.yaw_rate.is_nan());
    for (_, demand) in demands {
        assert_eq!(nan(&demand), (true, true));
        let demand = GIMBAL_MANAGER_SET_PITCHYAW_DATA { pitch_rate: 0.0, yaw_rate: 0.0, ..demand };
        assert_eq!(demand, GIMBAL_MANAGER_SET_PITCHYAW_DATA { pitch_rate: 0.0, yaw_rate: 0.0, ..expected.clone() });
    }
}

/// "YAW_LOCK|YAW_IN_EARTH_FRAME for absolute yaw; it does the geo-pointing itself."
#[test]
fn it_points_at_places_itself() {
    let mut flight = started(ClientVersion::Merged);
    flight.hear(MANAGER, &status(154, 0));
    let place = HOME.moved(400.0, 0.0, 0.0);
    flight.ask(&COMMAND_LONG_DATA {
        param5: place.latitude_deg as f32,
        param6: place.longitude_deg as f32,
        param7: place.altitude_m as f32,
        ..long(195, [0.0; 3])
    });
    flight.run_for(100);
    let (_, demand) = flight.all::<GIMBAL_MANAGER_SET_PITCHYAW_DATA>().pop().expect("one a cycle");
    assert_eq!(demand.flags, 8 | 16 | 64);
    // 360 m to the North and 50 m below.
    assert!((demand.pitch.to_degrees() + 7.9).abs() < 0.2 && demand.yaw.to_degrees().abs() < 0.5, "{demand:?}");
}

/// "One CONFIGURE with its own ids once when onboard intent starts (its command sender repeats without ACK), -3/-3 when the
/// intent ends. It re-asks only when STATUS says nobody is in control, every 2 s." "Two earlier stored versions differ: both
/// release with −2, one streams only after 281 has shown itself as primary and yields to others, the first one takes control
/// back again and again from whoever took it."
#[test]
#[rustfmt::skip]
fn each_version_claims_and_releases_in_its_way() {
    for (version, while_nobodys, while_anothers, demands, release) in [
        (ClientVersion::Merged,    3, 0, 300, [-3.0, -3.0, -1.0, -1.0]),
        (ClientVersion::Yielding,  3, 0, 0,   [-2.0, -2.0, -1.0, -1.0]),
        (ClientVersion::Insisting, 2, 2, 300, [-2.0, -2.0, -1.0, -1.0]),
    ] {
        let mut flight = started(version);
        flight.hear(MANAGER, &status(154, 0));
        flight.hear(GCS, &mission_item());
        for (primary, expected) in [(0, while_nobodys), (50, while_anothers)] {
            for _ in 0..300 {
                flight.hear(MANAGER, &status(154, primary));
                answered(&mut flight);
                flight.run_for(18);
            }
            assert_eq!(claims(&flight), vec![(CLAIM, 0); expected], "{version:?} with {primary} in control");
            assert!(flight.count(287).abs_diff(demands) <= 5, "{version:?}: {}", flight.count(287));
            flight.sent.clear();
        }
        flight.hear(MANAGER, &status(154, 1));
        flight.sent.clear();
        flight.run_for(1000);
        assert_eq!((claims(&flight), flight.count(287)), (vec![], 50));

        flight.hear(GCS, &long(197, [0.0; 3]));
        assert_eq!(claims(&flight), [(release, 0)], "{version:?}");
        answered(&mut flight);
        flight.sent.clear();
        flight.run_for(3000);
        assert_eq!((claims(&flight), flight.count(287)), (vec![], 0));
    }
}
