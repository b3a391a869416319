//! The mount commands of gimbal protocol v1 (protocol notes 2.8).

use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, HOME_POSITION_DATA, MavMessage};
use gimbald::wire::ids::CapFlags;

use super::frames::turn_vehicle;
use super::{
    COMPANION, FIELD, SECOND, assert_near, fly, is_nan, look, only_setpoint, run_flying, run_looking, setpoints,
    with_gimbal, with_gimbal_that,
};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, UNSUPPORTED, ack, again, command_int, command_long, configure,
    mount_configure, mount_control, of, pitch_yaw_deg, pitchyaw, quaternion, roll_pitch_yaw_deg, set_attitude,
    take_control, to, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, World, three_links};

/// Protocol checklist 137: "When DO_MOUNT_CONTROL (205) mode 2 with pitch −20 yaw 10 arrives from the primary, it acts as 1000(−20, 10, flags 44)."
/// Client checklist E127: "205 with p7 = 2 and pitch/roll/yaw in p1/p2/p3: moves." Client checklist E128: "205 in mode 2
/// without ACK interest: no harm from the ACK."
#[test]
fn client_items_e127_and_e128_angles_of_a_mount_are_those_of_a_gimbal() {
    for command in [
        control([-20.0, 0.0, 10.0], 2.0),
        control([-20.0, NAN, 10.0], 2.0),
        to(MavId::new(1, 0), control([-20.0, 0.0, 10.0], 2.0)),
        command_int(MANAGER, 205, [-20.0, 0.0, 10.0, NAN], 0, i32::MAX, 2.0),
    ] {
        let mut told = Vec::new();
        for command in [command, pitchyaw(-20.0, 10.0, NAN, NAN, 44.0)] {
            let (mut world, places) = with_gimbal();
            assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
            assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED), "{command:?}");
            let setpoint = only_setpoint(&mut world, places);
            assert!(is_nan(&[setpoint.angular_velocity_x, setpoint.angular_velocity_y, setpoint.angular_velocity_z]));
            told.push((setpoint.q, setpoint.flags));
        }
        assert_eq!(told[0], told[1]);
    }
    // Roll has a parameter of its own.
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &control([-20.0, 8.0, NAN], 2.0)), Some(ACCEPTED));
    assert_near(roll_pitch_yaw_deg(only_setpoint(&mut world, places).q)[0], 8.0, 0.001);
}

/// What each mode does, in both commands.
/// Gimbal statement 42: "205 p7=5 → UNSUPPORTED; p7=9 → DENIED; p7=0/1/3 accepted", 3 where the gimbal has a radio control of
/// its own.
/// Client checklist E126: "204 and 205 addressed to M: handled (compatibility on) or UNSUPPORTED (off); never silence."
#[test]
#[rustfmt::skip]
fn client_item_e126_each_mode_of_a_mount_has_its_answer() {
    for (mode, result,      told,     reason) in [
        (0.0,  ACCEPTED,    Some(1),  None),
        (1.0,  ACCEPTED,    Some(2),  None),
        (3.0,  UNSUPPORTED, None,     Some("mount_mode_rc_targeting_unsupported")),
        (5.0,  UNSUPPORTED, None,     Some("mount_mode_sysid_target_unsupported")),
        (6.0,  TEMPORARILY_REJECTED, None, Some("no_home_position")),
        (7.0,  UNSUPPORTED, None,     Some("mount_mode_wpnext_offset_unsupported")),
        (8.0,  DENIED,      None,     Some("unknown_mount_mode")),
        (9.0,  DENIED,      None,     Some("unknown_mount_mode")),
        (256.0, DENIED,     None,     Some("unknown_mount_mode")),
        (-1.0, DENIED,      None,     Some("unknown_mount_mode")),
        (1.5,  DENIED,      None,     Some("unknown_mount_mode")),
        (NAN,  DENIED,      None,     Some("unknown_mount_mode")),
        (f32::INFINITY, DENIED, None, Some("unknown_mount_mode")),
    ] {
        for command in [again(1, configure_mount(mode, [0.0; 3])), control([-20.0, 0.0, 10.0], mode)] {
            let (mut world, places) = with_gimbal();
            assert_eq!(world.result_of(places.ground, GCS, &command), Some(result), "{command:?}");
            let flags: Vec<u16> = setpoints(&mut world, places).iter().map(|(_, setpoint)| setpoint.flags).collect();
            assert_eq!(flags, told.map(|flag| flag | 44).into_iter().collect::<Vec<_>>());
            let rejected = world.snapshot().gimbals[0].rejected.get("255/190").cloned().unwrap_or_default();
            assert_eq!(rejected.keys().map(String::as_str).collect::<Vec<_>>(), reason.into_iter().collect::<Vec<_>>());
        }
    }
    // A gimbal that cannot retract says so, here as there.
    let mut capabilities = usual_capabilities();
    capabilities.set(CapFlags::HAS_RETRACT, false);
    let (mut world, places) = with_gimbal_that(capabilities, three_links());
    assert_eq!(world.result_of(places.ground, GCS, &control([0.0; 3], 0.0)), Some(DENIED));
}

/// Gimbal statement 42: "p7=3 accepted", by a gimbal that has a radio control of its own; the next angle takes it back.
#[test]
fn statement_42_radio_control_gets_a_gimbal_that_has_one() {
    let capabilities = usual_capabilities() | CapFlags::HAS_RC_INPUTS;
    for command in [configure_mount(3.0, [0.0; 3]), control([0.0; 3], 3.0), mount_configure(MANAGER, 3)] {
        let (mut world, places) = with_gimbal_that(capabilities, three_links());
        look(&mut world, places, -10.0, 5.0);
        world.forget();
        if matches!(command, MavMessage::COMMAND_LONG(_)) {
            assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED), "{command:?}");
        } else {
            world.send(places.ground, GCS, &command);
        }
        let setpoint = only_setpoint(&mut world, places);
        assert_eq!(setpoint.flags, 44 | 256, "{command:?}");
        assert_eq!(world.snapshot().gimbals[0].setpoint, None, "{command:?}");
        assert_near(pitch_yaw_deg(setpoint.q).0, -10.0, 0.001);
        assert_eq!(world.result_of(places.ground, GCS, &control([-20.0, 0.0, 10.0], 2.0)), Some(ACCEPTED));
        assert_eq!(only_setpoint(&mut world, places).flags, 44);
    }
}

/// Gimbal statement 41: "204 with p7=2 makes the next 205 yaw an earth yaw; with p7=1 a rate in deg/s; parameter order is
/// roll, pitch, yaw."
/// "DO_MOUNT_CONFIGURE: p5/p6/p7 input mode roll/pitch/yaw: 0 angle body frame, 1 angular rate, 2 angle absolute", each
/// sender for itself.
#[test]
fn the_inputs_of_a_mount_are_what_their_sender_configured() {
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 30.0);
    look(&mut world, places, 0.0, 0.0);
    let absolute_yaw = configure_mount(2.0, [0.0, 0.0, 2.0]);
    assert_eq!(world.result_of(places.ground, GCS, &absolute_yaw), Some(ACCEPTED));
    assert_eq!(setpoints(&mut world, places), [], "to configure moves nothing");

    for (sender, yaw) in [(GCS, 10.0), (COMPANION, 40.0)] {
        assert_eq!(world.result_of(places.ground, sender, &control([-20.0, 0.0, 40.0], 2.0)), Some(ACCEPTED));
        let setpoint = only_setpoint(&mut world, places);
        assert_near(pitch_yaw_deg(setpoint.q).1, yaw, 0.001);
    }

    // "In the order roll, pitch, yaw", by either form: a roll in degrees per second beside a pitch in degrees, and beside angles
    // roll is level.
    for rates in [configure_mount(2.0, [1.0, 0.0, 0.0]), command_int(MANAGER, 204, [2.0, 1.0, 1.0, 1.0], 1, 0, 0.0)] {
        assert_eq!(world.result_of(places.ground, GCS, &rates), Some(ACCEPTED));
        assert_eq!(world.result_of(places.ground, GCS, &control([-20.0, 5.0, 40.0], 2.0)), Some(ACCEPTED));
        let [roll, pitch, yaw] = roll_pitch_yaw_deg(only_setpoint(&mut world, places).q);
        assert_near(pitch, -20.0, 0.001);
        assert_near(yaw, 40.0, 0.001);
        assert_near(roll, 0.0, 0.5);
    }

    // The three of them as rates.
    assert_eq!(world.result_of(places.ground, GCS, &configure_mount(2.0, [1.0; 3])), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &control([-20.0, 5.0, 40.0], 2.0)), Some(ACCEPTED));
    let setpoint = only_setpoint(&mut world, places);
    assert!(is_nan(&setpoint.q));
    let rates = [setpoint.angular_velocity_x, setpoint.angular_velocity_y, setpoint.angular_velocity_z];
    for (rate, expected) in rates.into_iter().zip([5.0_f64, -20.0, 40.0]) {
        assert_near(rate.into(), expected.to_radians(), 1e-6);
    }

    // Pitch and yaw as rates, by either form.
    for rates in [configure_mount(2.0, [0.0, 1.0, 1.0]), command_int(MANAGER, 204, [2.0, 1.0, 1.0, 1.0], 0, 1, 1.0)] {
        assert_eq!(world.result_of(places.ground, GCS, &rates), Some(ACCEPTED));
        assert_eq!(world.result_of(places.ground, GCS, &control([-20.0, NAN, 40.0], 2.0)), Some(ACCEPTED));
        let setpoint = only_setpoint(&mut world, places);
        assert!(is_nan(&setpoint.q));
        assert_near(setpoint.angular_velocity_y.into(), (-20.0_f64).to_radians(), 1e-6);
        assert_near(setpoint.angular_velocity_z.into(), 40.0_f64.to_radians(), 1e-6);
        assert_eq!(setpoint.flags, 44);
        let back = configure_mount(2.0, [0.0, NAN, 7.0]);
        assert_eq!(world.result_of(places.ground, GCS, &back), Some(ACCEPTED));
        assert_eq!(world.result_of(places.ground, GCS, &control([-20.0, NAN, 40.0], 2.0)), Some(ACCEPTED));
        assert_near(pitch_yaw_deg(only_setpoint(&mut world, places).q).1, 40.0, 0.001);
    }
}

/// A rate that is said again and again is a stream, and ends like one.
#[test]
fn a_rate_of_a_mount_that_is_repeated_ends_as_a_stream() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &configure_mount(2.0, [1.0; 3])), Some(ACCEPTED));
    for _ in 0..3 {
        assert_eq!(world.result_of(places.ground, GCS, &control([-5.0, 0.0, 0.0], 2.0)), Some(ACCEPTED));
        run_looking(&mut world, places, SECOND / 2, 0.0, 0.0);
    }
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    let turning = |world: &mut World| {
        let setpoints = setpoints(world, places);
        setpoints.last().is_some_and(|(_, setpoint)| setpoint.angular_velocity_y.abs() > 0.01)
    };
    assert!(turning(&mut world));
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    assert!(!turning(&mut world), "two seconds after the last");
}

/// Mode 6 of both commands and of the message: the place that `HOME_POSITION` names. While it was not told, the autopilot is
/// asked for it.
#[test]
fn a_mount_that_is_to_look_home_looks_at_the_home_position() {
    for command in [configure_mount(6.0, [0.0; 3]), control([0.0; 3], 6.0), mount_configure(MANAGER, 6)] {
        let (mut world, places) = with_gimbal();
        fly(&mut world, places, FIELD, 0.0);
        world.forget();
        world.send(places.ground, GCS, &command);
        let asked: Vec<COMMAND_LONG_DATA> = world.take_messages(places.autopilot);
        let asked: Vec<(u16, f32)> = asked.iter().map(|asked| (asked.command, asked.param1)).collect();
        assert_eq!(asked, [(512, 242.0)], "{command:?}");
        assert_eq!(world.snapshot().gimbals[0].rejected["255/190"]["no_home_position"], 1);

        world.send(places.autopilot, AUTOPILOT, &home_position([473_977_420, 85_455_940, 400_000]));
        world.forget();
        world.send(places.ground, GCS, &command);
        let roi = world.snapshot().gimbals[0].roi.clone().expect("home");
        assert_near(roi.latitude_deg, 47.397_742, 1e-7);
        assert_near(roi.longitude_deg, 8.545_594, 1e-7);
        assert_near(roi.altitude_amsl_m, 400.0, 1e-3);
        // Straight above it, that is straight down.
        assert_near(pitch_yaw_deg(only_setpoint(&mut world, places).q).0, -85.94, 0.1);
    }
    // Nobody has it while the autopilot says that it has none.
    let (mut world, places) = with_gimbal();
    fly(&mut world, places, FIELD, 0.0);
    world.send(places.autopilot, AUTOPILOT, &home_position([0, 0, 0]));
    assert_eq!(world.result_of(places.ground, GCS, &control([0.0; 3], 6.0)), Some(TEMPORARILY_REJECTED));
}

/// `DO_MOUNT_CONTROL_QUAT` (220): "treat as 282 with flags ROLL|PITCH lock + vehicle yaw".
#[test]
fn a_quaternion_of_a_mount_is_one_of_a_gimbal() {
    let q = quaternion(-30.0, 40.0);
    let mut told = Vec::new();
    for message in [command_long(MANAGER, 220, &q), set_attitude(q, [NAN; 3], 44)] {
        let (mut world, places) = with_gimbal();
        world.send(places.ground, GCS, &message);
        let setpoint = only_setpoint(&mut world, places);
        told.push((setpoint.q, setpoint.flags));
    }
    assert_eq!(told[0], told[1]);
    assert_eq!(told[0].1, 44);
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &command_long(MANAGER, 220, &q)), Some(ACCEPTED));
    for broken in [[NAN; 4], [2.0, 0.0, 0.0, 0.0], [0.0; 4], [1.0, NAN, 0.0, 0.0]] {
        let command = command_long(MANAGER, 220, &broken);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(DENIED), "{broken:?}");
    }
    assert_eq!(world.snapshot().gimbals[0].rejected["255/190"]["malformed_quaternion"], 4);
}

/// Gimbal statement 40: "205 mode 4 with p5=47.1234567 and with p5=471234567 give the same latitude."
/// "205 p7 = 4: p4 altitude m above home, p5/p6 in degrees, or in degE7 when either is beyond 360."
/// Client checklist E127: "With p7 = 4, p5/p6 as 474000000.0: degE7 recognised."
#[test]
fn client_item_e127_a_place_for_a_mount_comes_in_either_unit() {
    for (command, tolerance) in [
        (place(50.0, 47.4, 8.55), 1e-5),
        (command_long(MANAGER, 205, &[0.0, 0.0, 0.0, 50.0, 47.4, 8.55, 4.0]), 1e-5),
        (place(50.0, 474_000_000.0, 85_500_000.0), 1e-5),
        (command_int(MANAGER, 205, [NAN, NAN, NAN, 50.0], 474_000_000, 85_500_000, 4.0), 1e-9),
    ] {
        let (mut world, places) = with_gimbal();
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(TEMPORARILY_REJECTED), "no position yet");
        fly(&mut world, places, FIELD, 0.0);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED), "{command:?}");
        let roi = world.snapshot().gimbals[0].roi.clone().expect("a place");
        assert_near(roi.latitude_deg, 47.4, tolerance);
        assert_near(roi.longitude_deg, 8.55, tolerance);
        // Home is 400 m above the sea.
        assert_near(roi.altitude_amsl_m, 450.0, 1e-6);
        assert_eq!(world.result_of(places.ground, GCS, &place(0.0, 0.0, 0.0)), Some(ACCEPTED));
        assert_eq!(world.snapshot().gimbals[0].roi, None);
    }
    // "Always both alike": near Greenwich the longitude alone could be in either unit.
    let (mut world, places) = with_gimbal();
    fly(&mut world, places, FIELD, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &place(50.0, 474_000_000.0, -320.0)), Some(ACCEPTED));
    let roi = world.snapshot().gimbals[0].roi.clone().expect("a place");
    assert_near(roi.latitude_deg, 47.4, 1e-5);
    assert_near(roi.longitude_deg, -0.000_032, 1e-9);

    let (mut world, places) = with_gimbal();
    let mode = configure_mount(4.0, [0.0; 3]);
    assert_eq!(world.result_of(places.ground, GCS, &mode), Some(TEMPORARILY_REJECTED));
    fly(&mut world, places, FIELD, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &mode), Some(ACCEPTED), "the place is yet to come");
    let nan_as_integer = 0x7ff8_0000;
    for command in [
        place(50.0, 91.0, 8.5),
        place(50.0, 474_000_000.0, 8_500_000_000.0),
        place(NAN, 47.4, 8.5),
        place(50.0, NAN, 8.5),
        place(50.0, f32::INFINITY, 8.5),
        command_int(MANAGER, 205, [NAN, NAN, NAN, 50.0], i32::MAX, 85_500_000, 4.0),
        command_int(MANAGER, 205, [NAN, NAN, NAN, 50.0], nan_as_integer, nan_as_integer, 4.0),
    ] {
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(DENIED), "{command:?}");
    }
    assert_eq!(world.snapshot().gimbals[0].roi, None);
}

/// D5: "one gate for v2 messages, v2 commands, v1 commands, ROI".
/// Gimbal statement 43: "A v1 client is" refused "while another v2 client owns control": DENIED (D4), and the pilot told.
#[test]
fn mount_commands_pass_the_gate() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    let commands = [
        configure_mount(0.0, [0.0; 3]),
        configure_mount(2.0, [0.0; 3]),
        control([-20.0, 0.0, 10.0], 2.0),
        place(50.0, 47.4, 8.5),
        control([0.0; 3], 6.0),
        command_long(MANAGER, 220, &[1.0, 0.0, 0.0, 0.0]),
    ];
    for command in &commands {
        assert_eq!(world.result_of(places.autopilot, COMPANION, command), Some(DENIED), "{command:?}");
    }
    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].rejected["1/192"]["not_in_control"], commands.len() as u64);
    world.forget();
    for message in [mount_configure(MANAGER, 0), mount_configure(MANAGER, 2), mount_control(MANAGER, [-2_000, 0, 0])] {
        world.send(places.autopilot, COMPANION, &message);
    }
    assert_eq!(setpoints(&mut world, places), []);
    assert_eq!(world.snapshot().gimbals[0].rejected["1/192"]["not_in_control"], commands.len() as u64 + 3);
}

/// Protocol checklist 66: "Secondary's absolute set-points only if primary silent > 2 s." A place is one, however a mount is
/// told it.
#[test]
fn a_place_for_a_mount_by_the_secondary_waits_for_the_primary_to_be_silent() {
    let (mut world, places) = with_gimbal();
    let both = configure([255.0, 190.0], [1.0, 192.0]);
    assert_eq!(world.result_of(places.ground, GCS, &both), Some(ACCEPTED));
    fly(&mut world, places, FIELD, 0.0);
    world.send(places.autopilot, AUTOPILOT, &home_position([473_977_420, 85_455_940, 400_000]));
    let commands =
        [place(50.0, 47.4, 8.55), place(0.0, 0.0, 0.0), control([0.0; 3], 6.0), configure_mount(6.0, [0.0; 3])];
    let messages = [mount_control(MANAGER, [474_000_000, 85_500_000, 5_000]), mount_configure(MANAGER, 6)];
    assert_eq!(world.result_of(places.autopilot, COMPANION, &configure_mount(4.0, [0.0; 3])), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &place(10.0, 47.5, 8.5)), Some(ACCEPTED));
    let roi = world.snapshot().gimbals[0].roi.clone().expect("the primary's place");
    for command in &commands {
        assert_eq!(world.result_of(places.autopilot, COMPANION, command), Some(DENIED), "{command:?}");
    }
    for message in &messages {
        world.send(places.autopilot, COMPANION, message);
    }
    let gimbal = world.snapshot().gimbals[0].clone();
    assert_eq!(gimbal.rejected["1/192"]["primary_is_active"], (commands.len() + messages.len()) as u64);
    assert_eq!(gimbal.roi, Some(roi));

    run_flying(&mut world, places, SECOND * 21 / 10, FIELD, 0.0);
    for command in &commands {
        assert_eq!(world.result_of(places.autopilot, COMPANION, command), Some(ACCEPTED), "{command:?}");
    }
}

/// To everybody they are for us too; what the autopilot says to every mount is how it drives one, and what is said to the
/// device is kept from it (D10). Neither moves anything, nor does what a gimbal says to mounts.
/// Gimbal statement 44: "205 not addressed to the daemon never moves the gimbal (PX4 broadcast loop)."
#[test]
fn mount_commands_for_others_move_nothing() {
    let (mut world, places) = with_gimbal();
    turn_vehicle(&mut world, places, 0.0);
    let command = control([-20.0, 0.0, 10.0], 2.0);
    for target in [MavId::new(1, 0), MavId::new(0, 0)] {
        let answers = world.ask(places.ground, GCS, &to(target, command.clone()));
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(GCS, 205, ACCEPTED)]);
        assert_eq!(setpoints(&mut world, places).len(), 1, "{target}");
        assert_eq!(world.ask(places.autopilot, AUTOPILOT, &to(target, command.clone())), [], "{target}");
        assert_eq!(setpoints(&mut world, places), []);
    }
    for target in [MANAGER, MavId::new(1, 0), MavId::new(0, 0)] {
        world.send(places.gimbal, GIMBAL, &to(target, command.clone()));
        world.send(places.gimbal, GIMBAL, &mount_control(target, [-2_000, 0, 1_000]));
        assert_eq!(setpoints(&mut world, places), [], "{target} from the gimbal");
    }
    for target in [GIMBAL, AUTOPILOT, MavId::new(2, 191), MavId::new(1, 190)] {
        world.send(places.ground, GCS, &mount_control(target, [-2_000, 0, 1_000]));
        world.send(places.ground, GCS, &mount_configure(target, 1));
        assert_eq!(setpoints(&mut world, places), [], "{target}");
        assert_eq!(told(&mut world, places.ground, &to(target, command.clone())), Vec::<u8>::new(), "{target}");
        assert_eq!(setpoints(&mut world, places), [], "{target}");
    }
}

fn home_position([latitude, longitude, altitude]: [i32; 3]) -> MavMessage {
    MavMessage::HOME_POSITION(HOME_POSITION_DATA {
        latitude,
        longitude,
        altitude,
        x: 0.0,
        y: 0.0,
        z: 0.0,
        q: [1.0, 0.0, 0.0, 0.0],
        approach_x: 0.0,
        approach_y: 0.0,
        approach_z: 0.0,
        time_usec: 0,
    })
}

fn told(world: &mut World, from: crate::support::world::Place, command: &MavMessage) -> Vec<u8> {
    of::<COMMAND_ACK_DATA>(&world.ask(from, GCS, command)).into_iter().map(|ack| ack.result).collect()
}

/// `DO_MOUNT_CONTROL` with pitch, roll and yaw.
pub(super) fn control([pitch, roll, yaw]: [f32; 3], mode: f32) -> MavMessage {
    command_long(MANAGER, 205, &[pitch, roll, yaw, NAN, NAN, NAN, mode])
}

/// `DO_MOUNT_CONTROL` with a place.
pub(super) fn place(altitude: f32, latitude: f32, longitude: f32) -> MavMessage {
    command_long(MANAGER, 205, &[NAN, NAN, NAN, altitude, latitude, longitude, 4.0])
}

/// `DO_MOUNT_CONFIGURE` with the inputs of roll, pitch and yaw.
pub(super) fn configure_mount(mode: f32, [roll, pitch, yaw]: [f32; 3]) -> MavMessage {
    command_long(MANAGER, 204, &[mode, 1.0, 1.0, 1.0, roll, pitch, yaw])
}
