//! Known faults of gimbals and their firmware: recognised, named, and worked round where that can be done.

use gimbald::gimbals::gremsy::parameters::RcType;
use gimbald::gimbals::operation::{Motors, OperationError};
use gimbald::manager::asked::NotDone;
use gimbald::wire::dialect::{MavMessage, PARAM_REQUEST_LIST_DATA, STATUSTEXT_DATA};
use gimbald::wire::ids::message;

use super::*;
use crate::support::script::{NAN, device_information, gimbal_heartbeat, usual_capabilities};
use crate::support::world::GIMBAL;

/// What the pilot reads.
fn texts(world: &World, places: Places) -> Vec<String> {
    let arrivals = world.arrivals(places.ground).iter().filter(|arrival| arrival.id() == message::STATUSTEXT);
    arrivals.map(|arrival| arrival.decode::<STATUSTEXT_DATA>().text.to_str().expect("text").to_owned()).collect()
}

fn faults(world: &World) -> Vec<String> {
    seen(world).details.faults
}

/// A gimbal without a fault has none to tell of.
#[test]
fn a_gimbal_that_works_has_no_fault() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = switched_on(device(generation), GremsySettings::default());
        run(&mut world, places, 20 * SECOND);
        for (pitch, yaw) in [(-30.0, 45.0), (20.0, -90.0), (-90.0, 0.0), (0.0, 170.0)] {
            demand(&mut world, places, [pitch, yaw, NAN, NAN, 0.0]);
            run(&mut world, places, 12 * SECOND);
            assert_looks(&world, f64::from(pitch), f64::from(yaw));
        }
        assert_eq!((faults(&world), texts(&world, places)), (vec![], vec![]), "{generation:?}");
    }
}

/// Gimbal statement 31: "RC_TYPE ≠ 7 produces exactly one operator warning." The gimbal then acknowledges and does not move,
/// which is named when it shows.
#[test]
fn statement_31_another_radio_type_is_told_once() {
    for generation in [Generation::V1, Generation::V2] {
        let other = DeviceSettings { rc_type: RcType::Other(15), ..device(generation) };
        let (mut world, places) = switched_on(other, GremsySettings::default());
        for _ in 0..4 {
            run(&mut world, places, 15 * SECOND);
            // A ground station reads all parameters: it is no news.
            let list = PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 154 };
            world.send(places.ground, GCS, &MavMessage::PARAM_REQUEST_LIST(list));
        }
        assert_eq!(texts(&world, places), ["camera: RC_TYPE is not SYNC, may not move"], "{generation:?}");
        assert_eq!(faults(&world).len(), 1);
        assert!(faults(&world)[0].contains("RC_TYPE is 15, not sync"), "{:?}", faults(&world));

        demand(&mut world, places, [-30.0, 45.0, NAN, NAN, 0.0]);
        run(&mut world, places, 6 * SECOND);
        assert_eq!(texts(&world, places), ["camera: acknowledges but does not move"], "{generation:?}");
        assert!(faults(&world).iter().any(|fault| fault.contains("does not move. Check")), "{:?}", faults(&world));

        // Set right, both are gone.
        take_control(&mut world);
        let set = Operation::SetRadioType(gimbald::gimbals::operation::RadioType::Sync);
        assert_eq!(operate(&mut world, places, set), Some(Ok(())));
        point(&mut world, -30.0, 45.0);
        run(&mut world, places, 5 * SECOND);
        assert_looks(&world, -30.0, 45.0);
        assert_eq!(faults(&world), Vec::<String>::new());
    }
}

/// Firmware 7.8.0 to 7.8.7 reports a wrong yaw from North: yaw from the nose and the autopilot's heading are used.
#[test]
fn a_wrong_yaw_from_north_is_named_and_worked_round() {
    for (generation, z) in [
        (Generation::V1, 0),
        (Generation::V1, 7),
        (Generation::V2, 0),
        (Generation::V2, 4),
        (Generation::V2, 6),
        (Generation::V2, 7),
    ] {
        let (mut world, places) = switched_on(with_firmware(generation, 7, 8, z), GremsySettings::default());
        run(&mut world, places, 20 * SECOND);
        assert_eq!(texts(&world, places), ["camera: firmware has a wrong earth yaw"], "{generation:?} 7.8.{z}");
        assert!(faults(&world)[0].contains(&format!("firmware 7.8.{z} reports a wrong yaw")), "{:?}", faults(&world));

        // It is looked at North + 20 from the vehicle, which turns: what is told and what is so are the same.
        let heading = world.snapshot().vehicle.heading_deg.expect("a heading");
        let yaw = AxisDemand { angle: Some(Angle::from_degrees(heading + 20.0)), rate: None };
        let pitch = AxisDemand { angle: Some(Angle::from_degrees(-10.0)), rate: None };
        let asked = Asked::Point { roll: AxisDemand::default(), pitch, yaw, yaw_frame: YawFrame::Earth };
        assert_eq!(ask(&mut world, places, &asked), Some(Ok(())));
        let earth = seen(&world).attitude.yaw_earth_deg.expect("a yaw");
        let off = (earth - heading - 20.0).rem_euclid(360.0);
        assert!(!(4.0..=356.0).contains(&off), "{generation:?} 7.8.{z}: {off}");
        // By the encoders, which know nothing of North, it looks there too.
        let now = world.snapshot().vehicle.heading_deg.expect("a heading");
        let pan = seen(&world).details.encoders.expect("encoders").pan_deg;
        let off = (pan + now - heading - 20.0).rem_euclid(360.0);
        assert!(!(5.0..=355.0).contains(&off), "{generation:?} 7.8.{z}: {off} by the encoders");
    }
}

/// Locked by somebody else, firmware that tells only a wrong yaw from North is read from its orientation.
#[test]
fn a_locked_gimbal_with_a_wrong_north_is_read_from_the_nose() {
    let (mut world, places) = running_with(with_firmware(Generation::V2, 7, 8, 4), GremsySettings::default());
    take_control(&mut world);
    let lock = Operation::SetYawMode(gimbald::gimbals::operation::YawMode::Lock);
    assert_eq!(operate(&mut world, places, lock), Some(Ok(())));
    let pan = seen(&world).details.encoders.expect("encoders").pan_deg;
    let told = seen(&world).attitude.yaw_vehicle_deg.expect("a yaw");
    let off = (told - pan).rem_euclid(360.0);
    assert!(!(3.0..=357.0).contains(&off), "{told} {pan}");
}

/// "MOUNT_ORIENTATION pitch seen inverted": recognised when it moves, named, and turned round; by the setting from the
/// start.
#[test]
fn an_inverted_pitch_is_recognised_and_turned_round() {
    let inverted = DeviceSettings { has_inverted_pitch: true, ..device(Generation::V1) };
    let (mut world, places) = switched_on(inverted.clone(), GremsySettings::default());
    run(&mut world, places, 20 * SECOND);
    demand(&mut world, places, [-40.0, 0.0, NAN, NAN, 0.0]);
    run(&mut world, places, 8 * SECOND);
    assert_looks(&world, -40.0, 0.0);
    assert_eq!(texts(&world, places), ["camera: reports pitch upside down"]);
    assert_eq!(faults(&world).len(), 1, "{:?}", faults(&world));

    let told = GremsySettings {
        report_sign: Some(gimbald::gimbals::signs::Signs {
            pitch: gimbald::gimbals::signs::Sign::Opposite,
            ..gimbald::gimbals::signs::Signs::NORMAL
        }),
        ..GremsySettings::default()
    };
    let (mut world, places) = switched_on(inverted, told);
    run(&mut world, places, 20 * SECOND);
    demand(&mut world, places, [-40.0, 0.0, NAN, NAN, 0.0]);
    run(&mut world, places, 8 * SECOND);
    assert_looks(&world, -40.0, 0.0);
    assert_eq!((texts(&world, places), faults(&world)), (vec![], vec![]));
}

/// "on some firmware only a reboot re-enables": said when it shows.
#[test]
fn motors_that_stay_off_after_retract_are_named() {
    let latched = DeviceSettings { is_latched_by_retract: true, ..device(Generation::V2) };
    let allowed = GremsySettings { retract_allowed: true, ..GremsySettings::default() };
    let (mut world, places) = switched_on(latched, allowed);
    run(&mut world, places, 20 * SECOND);
    demand(&mut world, places, [0.0, 0.0, NAN, NAN, 1.0]);
    run(&mut world, places, 3 * SECOND);
    demand(&mut world, places, [-10.0, 20.0, NAN, NAN, 0.0]);
    run(&mut world, places, 5 * SECOND);
    assert!(
        texts(&world, places).contains(&"camera: motors stay off, restart it".to_owned()),
        "{:?}",
        texts(&world, places)
    );
}

/// "motors off ≤ 200 ms / on takes 3.0 s" (gimbals 5.3), and the status comes once a second: until then it is no news that they
/// do not run yet; that they are off, or do not come on, is.
#[test]
fn motors_that_are_being_switched_on_are_no_fault() {
    use gimbald::gimbals::operation::Motors;
    let off = || vec!["camera: motors are off".to_owned()];
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        assert_eq!(operate(&mut world, places, Operation::Motors(Motors::Off)), Some(Ok(())));
        world.forget();
        let on = Asked::Operation(Operation::Motors(Motors::On));
        world.ask_by_name("camera", &on);
        run(&mut world, places, Duration::from_millis(100));
        point(&mut world, -20.0, 30.0);
        run(&mut world, places, 8 * SECOND);
        assert_eq!((texts(&world, places), faults(&world)), (vec![], vec![]), "{generation:?}");
        assert_looks(&world, -20.0, 30.0);

        take_control(&mut world);
        assert_eq!(operate(&mut world, places, Operation::Motors(Motors::Off)), Some(Ok(())));
        world.forget();
        point(&mut world, -20.0, 10.0);
        run(&mut world, places, SECOND);
        assert_eq!(texts(&world, places), off(), "{generation:?}");
        assert_eq!(faults(&world), ["it was told to move while its motors are off. Switch them on"]);
    }
}

/// "RETRACT in v2 cuts motors": the next angle switches them on, and that takes as long.
#[test]
fn motors_that_return_after_a_retract_are_no_fault() {
    for generation in [Generation::V1, Generation::V2] {
        let allowed = GremsySettings { retract_allowed: true, ..GremsySettings::default() };
        let (mut world, places) = running_with(device(generation), allowed);
        demand(&mut world, places, [0.0, 0.0, NAN, NAN, 1.0]);
        run(&mut world, places, 3 * SECOND);
        demand(&mut world, places, [-10.0, 20.0, NAN, NAN, 0.0]);
        run(&mut world, places, 8 * SECOND);
        assert_eq!((texts(&world, places), faults(&world)), (vec![], vec![]), "{generation:?}");
        assert_looks(&world, -10.0, 20.0);
    }
}

/// Its status comes and its answers do not: the wire towards it, or the baud rate.
#[test]
fn a_gimbal_that_does_not_answer_is_named() {
    use gimbald::wire::dialect::MOUNT_ORIENTATION_DATA;
    let (mut world, places) = running(Generation::V1);
    world.remove(places.gimbal);
    let mut time_boot_ms = 100_000;
    demand(&mut world, places, [-10.0, 0.0, NAN, NAN, 0.0]);
    for _ in 0..80 {
        let orientation = MOUNT_ORIENTATION_DATA { time_boot_ms, roll: 0.0, pitch: 0.0, yaw: 0.0, yaw_absolute: 0.0 };
        time_boot_ms += 100;
        world.send(places.gimbal, crate::support::world::GIMBAL, &MavMessage::MOUNT_ORIENTATION(orientation));
        run(&mut world, places, Duration::from_millis(100));
    }
    // FOLLOW was never acknowledged, so no angle was sent.
    assert_eq!(texts(&world, places), ["camera: does not answer commands"]);
    let named =
        "its status arrives and its answers do not. Check the wire towards the gimbal and the baud rate (115200)";
    assert_eq!(faults(&world), [named]);
    let (commands, _) = orders(&mut world, places);
    assert!(commands.iter().all(|command| command.command == command::USER_2), "{commands:?}");
}

/// One that is switched off just after it was told something is not there, which is no fault of its wires.
#[test]
fn a_gimbal_that_is_gone_is_lost_and_nothing_else() {
    let (mut world, places) = running(Generation::V1);
    demand(&mut world, places, [-30.0, 60.0, NAN, NAN, 0.0]);
    run(&mut world, places, SECOND);
    world.remove(places.gimbal);
    world.forget();
    run(&mut world, places, 10 * SECOND);
    assert_eq!(texts(&world, places), ["camera: gimbal lost"]);
    assert_eq!(faults(&world), [""; 0]);
}

/// "details.faults: Faults of this gimbal or its firmware, and what to do about them": a family that does not fit is the
/// first thing that whoever configures a gimbal gets wrong.
#[test]
fn a_family_that_does_not_fit_is_named() {
    let gimbal = |family| GimbalSettings { family, ..GimbalSettings::found("camera".to_owned()) };
    let world_of = |family| World::empty(Settings { gimbals: vec![gimbal(family)], ..three_links() });
    for family in [Family::MavlinkV2, Family::MavlinkV1] {
        for generation in [Generation::V1, Generation::V2] {
            let (mut world, places) = world_of(family);
            world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
            world.install(places.gimbal, Device::new(Timestamp::ZERO, device(generation)));
            run(&mut world, places, 15 * SECOND);
            let expected = format!(
                "this gimbal says that it is a Gremsy, but its family is {}. Set family = \"gremsy\", or leave the key out",
                family.name()
            );
            assert_eq!(faults(&world), [expected], "{generation:?}");
        }
    }

    let (mut world, places) = world_of(Family::Gremsy);
    for _ in 0..20 {
        world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
        run(&mut world, places, SECOND);
    }
    assert!(faults(&world).iter().any(|fault| fault.contains("Is family right?")), "{:?}", faults(&world));
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    let other = "made it, but its family is gremsy. Is family right? Leave the key out to have it found out";
    assert!(faults(&world).iter().any(|fault| fault.contains(other)), "{:?}", faults(&world));
}

/// "If the commanded pose differs by > 10° from the report for > 3 s with rate < 1 °/s" (gimbals 1.10): one that is on its
/// way moves, whatever its yaw is told from. Locked, it tells yaw from North, and from the nose before.
#[test]
fn a_gimbal_on_its_way_to_a_yaw_from_north_has_no_fault() {
    for generation in [Generation::V1, Generation::V2] {
        for turn in [160.0, -120.0] {
            let (mut world, places) = running(generation);
            take_control(&mut world);
            assert_eq!(operate(&mut world, places, Operation::SetCombinedAttitude(true)), Some(Ok(())));
            let vehicle = world.snapshot().vehicle.heading_deg.expect("a heading");
            let asked = Asked::Point {
                roll: AxisDemand::default(),
                pitch: AxisDemand::default(),
                yaw: AxisDemand { angle: Some(Angle::from_degrees(vehicle + turn)), rate: None },
                yaw_frame: YawFrame::Earth,
            };
            assert_eq!(ask(&mut world, places, &asked), Some(Ok(())));
            run(&mut world, places, 4 * SECOND);
            assert_eq!((faults(&world), texts(&world, places)), (vec![], vec![]), "{generation:?} {turn}");
        }
    }
}

/// "On some firmware only a reboot re-enables": also where it was "motors off" that cut them, which is RETRACT in v2. Whoever
/// switches them on is told so, and nothing that contradicts it.
#[test]
fn motors_that_stay_off_are_named_whoever_switched_them_off() {
    let latched = DeviceSettings { is_latched_by_retract: true, ..device(Generation::V2) };
    let (mut world, places) = running_with(latched, GremsySettings::default());
    take_control(&mut world);
    assert_eq!(operate(&mut world, places, Operation::Motors(Motors::Off)), Some(Ok(())));
    let text = "its motors stay off; this firmware needs a restart for that";
    let expected = Err(NotDone::Operation(OperationError::NoEffect(text.to_owned())));
    assert_eq!(operate(&mut world, places, Operation::Motors(Motors::On)), Some(expected));
    let fault = "its motors were switched off and do not come back: this firmware needs a restart. Restart the gimbal, and \
                 neither switch its motors off nor set retract_allowed";
    assert_eq!(faults(&world), [fault]);
    point(&mut world, -30.0, 20.0);
    run(&mut world, places, 5 * SECOND);
    assert_eq!(faults(&world), [fault]);
    assert_eq!(texts(&world, places), ["camera: motors stay off, restart it"]);
}

/// `gremsy_generation` is "for when it is found out wrong": where it is wrong itself, it is named.
#[test]
fn a_generation_that_is_set_wrong_is_named() {
    let wrong = GremsySettings { generation: Some(V2), ..GremsySettings::default() };
    let (mut world, places) = switched_on(device(Generation::V1), wrong);
    run(&mut world, places, 30 * SECOND);
    assert_eq!(
        faults(&world),
        ["it sends no GIMBAL_DEVICE_ATTITUDE_STATUS, as a v2 gimbal does, so it is not known where it looks. Leave \
             gremsy_generation out to have it found out"]
    );
    assert_eq!(texts(&world, places), ["camera: sends no attitude (gremsy_generation)"]);
    let wrong = GremsySettings { generation: Some(V1), ..GremsySettings::default() };
    let (mut world, places) = switched_on(device(Generation::V2), wrong);
    run(&mut world, places, 20 * SECOND);
    demand(&mut world, places, [-30.0, 45.0, NAN, NAN, 0.0]);
    run(&mut world, places, 6 * SECOND);
    assert_eq!(
        faults(&world),
        ["it refuses to change between lock and follow, as a v2 gimbal does that gremsy_generation calls v1. Leave \
             gremsy_generation out to have it found out; if it is right, check that the radio type is sync, or restart the gimbal"]
    );
    assert_eq!(texts(&world, places), ["camera: is no v1 gimbal (gremsy_generation)"]);
    for (generation, is) in [(V1, Generation::V1), (V2, Generation::V2)] {
        let right = GremsySettings { generation: Some(generation), ..GremsySettings::default() };
        let (mut world, places) = switched_on(device(is), right);
        run(&mut world, places, 30 * SECOND);
        demand(&mut world, places, [-30.0, 45.0, NAN, NAN, 0.0]);
        run(&mut world, places, 6 * SECOND);
        assert_eq!((faults(&world), texts(&world, places)), (vec![], vec![]));
    }
}
