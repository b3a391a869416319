//! Mount commands whose numbers cannot be meant as they were sent (gimbal notes 2.3, traps).

use gimbald::bridge::settings::Settings;
use gimbald::manager::settings::ControlSettings;
use gimbald::wire::dialect::STATUSTEXT_DATA;

use super::frames::turn_vehicle;
use super::mount::{configure_mount, control};
use super::{COMPANION, SECOND, assert_near, look, only_setpoint, setpoints, with_gimbal, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, command_long, mount_control, of, pitch_yaw_deg, usual_capabilities,
};
use crate::support::world::{GCS, MANAGER, three_links};

/// "ArduPilot refuses |pitch| > 90, |roll| > 180, |yaw| > 360": a number beyond that comes from a sender of centidegrees.
/// Gimbal statement 38: "205 with p1 = −4500 is DENIED with a warning by default."
#[test]
fn angles_that_look_like_centidegrees_are_denied() {
    let (mut world, places) = with_gimbal();
    for (angles, result) in [
        ([-90.0, 180.0, 360.0], ACCEPTED),
        ([-90.5, 0.0, 0.0], DENIED),
        ([0.0, -181.0, 0.0], DENIED),
        ([0.0, 0.0, 361.0], DENIED),
        ([-2_000.0, 0.0, 1_000.0], DENIED),
        ([-4_500.0, 0.0, 0.0], DENIED),
    ] {
        assert_eq!(world.result_of(places.ground, GCS, &control(angles, 2.0)), Some(result), "{angles:?}");
    }
    let rejected = &world.snapshot().gimbals[0].rejected["255/190"];
    assert_eq!((rejected.len(), rejected["looks_like_centidegrees"]), (1, 5));
    assert_eq!(world.result_of(places.ground, GCS, &control([f32::INFINITY, 0.0, 0.0], 2.0)), Some(DENIED));
    assert_eq!(world.snapshot().gimbals[0].rejected["255/190"]["infinite_number"], 1);
}

/// Only angles have such a range: "p5/p6/p7 … 1 angular rate", and a gimbal may pitch at more than 90 degrees per second.
#[test]
fn a_fast_rate_does_not_look_like_centidegrees() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &configure_mount(2.0, [1.0; 3])), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &control([-120.0, NAN, NAN], 2.0)), Some(ACCEPTED));
    assert_near(only_setpoint(&mut world, places).angular_velocity_y.into(), (-120.0_f64).to_radians(), 1e-6);
    world.send(places.ground, GCS, &mount_control(MANAGER, [12_000, 0, 0]));
    assert_near(only_setpoint(&mut world, places).angular_velocity_y.into(), 120.0_f64.to_radians(), 1e-6);
    assert_eq!(world.snapshot().gimbals[0].rejected, Default::default());
}

/// Both of the first numbers are far beyond angles where they are the coordinates of a place; one alone is an angle that no
/// gimbal has.
#[test]
fn one_number_beyond_all_angles_is_no_place() {
    let (mut world, places) = with_gimbal();
    for (inputs, reason) in [
        ([473_977_420, 0, 0], "angle_out_of_range"),
        ([0, 85_455_940, 0], "angle_out_of_range"),
        ([473_977_420, 85_455_940, 0], "looks_like_a_place"),
    ] {
        let before = world.snapshot().gimbals[0].rejected.get("255/190").and_then(|all| all.get(reason).copied());
        world.send(places.ground, GCS, &mount_control(MANAGER, inputs));
        let after = world.snapshot().gimbals[0].rejected["255/190"][reason];
        assert_eq!(after, before.unwrap_or(0) + 1, "{inputs:?}");
    }
    assert_eq!(setpoints(&mut world, places), []);
}

/// Gimbal statement 38: "205 with p1 = −4500 is … interpreted as −45° with accept_centidegrees." Who was found out once means
/// hundredths by small numbers too: half a degree does not become fifty.
#[test]
fn statement_38_centidegrees_are_taken_where_they_are_accepted() {
    let control_settings = ControlSettings { accept_centidegrees: true, ..ControlSettings::default() };
    let settings = Settings { control: control_settings, ..three_links() };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), settings);
    for (sender, angles, expected) in [
        (GCS, [-45.0, 0.0, 30.0], (-45.0, 30.0)),
        (GCS, [-4_500.0, 0.0, 3_000.0], (-45.0, 30.0)),
        (GCS, [-50.0, 0.0, 80.0], (-0.5, 0.8)),
        (COMPANION, [-50.0, 0.0, 80.0], (-50.0, 80.0)),
    ] {
        assert_eq!(world.result_of(places.ground, sender, &control(angles, 2.0)), Some(ACCEPTED), "{angles:?}");
        let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
        assert_near(pitch, expected.0, 0.001);
        assert_near(yaw, expected.1, 0.001);
    }
    assert_eq!(world.result_of(places.ground, GCS, &control([-9_100.0, 0.0, 0.0], 2.0)), Some(DENIED));
    let snapshot = world.snapshot();
    let doubts: Vec<_> = snapshot.events.iter().filter(|event| event.what == "doubtful").collect();
    assert_eq!(doubts.len(), 1, "{doubts:?}");
    assert_eq!(doubts[0].text, "255/190 is taken to send hundredths of a degree (accept_centidegrees)");
}

/// "Trap recognition": what was refused for how it looks is said on the pilot's screen, of each sender and each kind once in ten
/// seconds.
/// Gimbal statement 38: "DENIED with a warning", which names the setting.
#[test]
fn statement_38_the_pilot_is_told_what_looks_like_centidegrees() {
    let (mut world, places) = with_gimbal();
    world.forget();
    for _ in 0..5 {
        world.send(places.ground, GCS, &control([-4_500.0, 0.0, 0.0], 2.0));
    }
    world.send(places.ground, GCS, &mount_control(MANAGER, [473_977_420, 85_455_940, 1_000]));
    world.run_for(SECOND);
    world.send(
        places.ground,
        COMPANION,
        &command_long(MANAGER, 205, &[473_977_420.0, 85_455_940.0, 1_000.0, 0.0, 0.0, 0.0, 4.0]),
    );
    world.run_for(SECOND);
    let heard = world.take(places.ground);
    let texts: Vec<String> = of::<STATUSTEXT_DATA>(&heard).iter().map(text_of).collect();
    let expected = [
        "gimbal-154: 255/190: refused, accept_centidegrees?",
        "gimbal-154: 255/190: refused, place without mode 4",
        "gimbal-154: 1/192: refused, place in params 1-3",
    ];
    assert_eq!(texts, expected);
    let rejected = world.snapshot().gimbals[0].rejected.clone();
    assert_eq!(rejected["255/190"]["looks_like_centidegrees"], 5);
    assert_eq!(rejected["255/190"]["looks_like_a_place"], 1);
    assert_eq!(rejected["1/192"]["place_in_the_first_parameters"], 1);
    assert_eq!(setpoints(&mut world, places), []);
}

/// Traps of frames: a yaw from the nose beyond 180° is done, since some count it so, and named, since headings look so.
#[test]
fn a_yaw_that_looks_like_a_heading_is_named() {
    let (mut world, places) = with_gimbal();
    for yaw in [270.0, 271.0, -90.0, 180.0] {
        assert_eq!(world.result_of(places.ground, GCS, &control([-20.0, 0.0, yaw], 2.0)), Some(ACCEPTED));
    }
    let events = world.snapshot().events;
    let doubts: Vec<_> = events.iter().filter(|event| event.what == "doubtful").collect();
    assert_eq!((doubts.len(), doubts[0].count), (1, 2));
    assert_eq!(doubts[0].reason.as_deref(), Some("yaw_like_a_heading"));
    assert_eq!(world.result_of(places.ground, GCS, &configure_mount(2.0, [0.0, 0.0, 2.0])), Some(ACCEPTED));
    turn_vehicle(&mut world, places, 0.0);
    look(&mut world, places, 0.0, 0.0);
    assert_eq!(world.result_of(places.ground, GCS, &control([-20.0, 0.0, 300.0], 2.0)), Some(ACCEPTED));
    let events = world.snapshot().events;
    assert_eq!(events.iter().filter(|event| event.what == "doubtful").map(|event| event.count).sum::<u64>(), 2);
}

fn text_of(message: &STATUSTEXT_DATA) -> String {
    message.text.to_str().unwrap_or_default().to_owned()
}
