//! `MOUNT_CONFIGURE` (156) and `MOUNT_CONTROL` (157), which older programs send instead of commands.

use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, MavMessage};

use super::frames::turn_vehicle;
use super::mount::configure_mount;
use super::{COMPANION, FIELD, SECOND, assert_near, fly, only_setpoint, run_looking, setpoints, with_gimbal};
use crate::support::script::{ACCEPTED, mount_configure, mount_control, of, pitch_yaw_deg, roll_pitch_yaw_deg};
use crate::support::world::{AUTOPILOT, GCS, MANAGER, Places, World};

/// The messages of v1, addressed to us or to everybody: what the commands do, without an answer.
/// Gimbal statement 39: "MOUNT_CONTROL message −4500/0/3000 gives −45/0/30 (golden frame)."
#[test]
fn statement_39_the_messages_of_a_mount_do_what_its_commands_do() {
    const GOLDEN: [u8; 26] = [
        0xFD, 0x0E, 0x00, 0x00, 0x1A, 0xFF, 0xBE, 0x9D, 0x00, 0x00, 0x6C, 0xEE, 0xFF, 0xFF, 0x00, 0x00, 0x00, 0x00,
        0xB8, 0x0B, 0x00, 0x00, 0x01, 0xBF, 0xCE, 0x12,
    ];
    let (mut world, places) = with_gimbal();
    world.send_bytes(places.ground, &GOLDEN);
    let setpoint = only_setpoint(&mut world, places);
    assert_angles(setpoint.q, [0.0, -45.0, 30.0]);
    assert_eq!(setpoint.flags, 44);

    turn_vehicle(&mut world, places, 0.0);
    for target in [MANAGER, MavId::new(1, 0), MavId::new(0, 0)] {
        assert_eq!(acks(&mut world, places, GCS, &mount_control(target, [-2_000, 800, 1_000])), 0);
        assert_angles(only_setpoint(&mut world, places).q, [8.0, -20.0, 10.0]);
        // What the autopilot says to every mount is how it drives one.
        let told = usize::from(target == MANAGER);
        world.forget();
        world.send(places.autopilot, AUTOPILOT, &mount_control(target, [-1_000, 0, 0]));
        world.send(places.autopilot, AUTOPILOT, &mount_configure(target, 1));
        assert_eq!(setpoints(&mut world, places).len(), 2 * told, "{target}");
    }
    for (mode, flags) in [(0, 1 | 44), (1, 2 | 44)] {
        world.forget();
        assert_eq!(acks(&mut world, places, GCS, &mount_configure(MANAGER, mode)), 0);
        assert_eq!(only_setpoint(&mut world, places).flags, flags);
    }
}

/// `MOUNT_CONTROL` names no mode: it is the one that its sender configured, by message or by command. "GPS mode: a lat degE7,
/// b lon degE7, c alt cm", above home.
#[test]
fn a_place_for_a_mount_comes_by_message_too() {
    for configure in [mount_configure(MANAGER, 4), configure_mount(4.0, [0.0; 3])] {
        let (mut world, places) = with_gimbal();
        fly(&mut world, places, FIELD, 0.0);
        world.send(places.ground, GCS, &configure);
        world.forget();
        world.send(places.ground, GCS, &mount_control(MANAGER, [474_000_000, 85_500_000, 5_000]));
        let roi = world.snapshot().gimbals[0].roi.clone().expect("a place");
        assert_near(roi.latitude_deg, 47.4, 1e-9);
        assert_near(roi.longitude_deg, 8.55, 1e-9);
        assert_near(roi.altitude_amsl_m, 450.0, 1e-3);
        // Of another sender they are angles.
        world.send(places.ground, COMPANION, &mount_control(MANAGER, [474_000_000, 85_500_000, 5_000]));
        assert_eq!(world.snapshot().gimbals[0].rejected["1/192"]["looks_like_a_place"], 1);
        assert!(world.snapshot().gimbals[0].roi.is_some());
        world.send(places.ground, GCS, &mount_configure(MANAGER, 2));
        world.forget();
        world.send(places.ground, GCS, &mount_control(MANAGER, [-2_000, 0, 0]));
        assert_near(pitch_yaw_deg(only_setpoint(&mut world, places).q).0, -20.0, 0.001);
        assert_eq!(world.snapshot().gimbals[0].roi, None);
    }
}

/// Rates by message, as their sender configured them, end as a stream does.
#[test]
fn a_rate_by_message_ends_as_a_stream() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &configure_mount(2.0, [1.0; 3])), Some(ACCEPTED));
    world.forget();
    world.send(places.ground, GCS, &mount_control(MANAGER, [-500, 0, 0]));
    run_looking(&mut world, places, SECOND * 3 / 2, 0.0, 0.0);
    let told = setpoints(&mut world, places);
    assert_near(told.last().map_or(0.0, |(_, told)| told.angular_velocity_y.into()), (-5.0_f64).to_radians(), 1e-6);
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    let told = setpoints(&mut world, places);
    assert!(told.last().is_some_and(|(_, told)| told.angular_velocity_y == 0.0 || told.angular_velocity_y.is_nan()));
}

fn assert_angles(q: [f32; 4], roll_pitch_yaw: [f64; 3]) {
    for (told, expected) in roll_pitch_yaw_deg(q).into_iter().zip(roll_pitch_yaw) {
        assert_near(told, expected, 0.001);
    }
}

fn acks(world: &mut World, places: Places, sender: MavId, message: &MavMessage) -> usize {
    of::<COMMAND_ACK_DATA>(&world.ask(places.ground, sender, message)).len()
}
