//! Where it is told to look, in either generation.

use gimbald::geometry::AngularRate;
use gimbald::geometry::GimbalAngles;
use gimbald::gimbals::gremsy::packet;
use gimbald::gimbals::mavlink_v2;
use gimbald::gimbals::setpoint::{RadioControl, Setpoint, Stabilised, Turning};
use gimbald::wire::FrameBuffer;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_MANAGER_STATUS_DATA, MOUNT_ORIENTATION_DATA,
    MavMessage,
};
use gimbald::wire::ids::{CommandResult, GimbalFlags};

use super::*;
use crate::support::script::{
    ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, UNSUPPORTED, quaternion, set_attitude, set_pitchyaw,
};
use crate::support::world::GIMBAL;

fn bytes(text: &str) -> Vec<u8> {
    text.split(' ').map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal")).collect()
}

/// Gimbal statement 5: "COMMAND_LONG 205 for pitch −30 yaw 45 with seq 1 from 1/191 equals the golden frame of §0.4 byte
/// for byte." It is what the core sends for that demand.
#[test]
fn statement_5_the_golden_frame_of_an_angle() {
    let golden = bytes(
        "FD 20 00 00 01 01 BF 4C 00 00 00 00 F0 C1 00 00 00 00 00 00 34 42 00 00 00 00 00 00 00 00 00 00 80 3F 00 00 00 40 CD 00 01 9A 65 4E",
    );
    let (mut world, places) = running(Generation::V1);
    demand(&mut world, places, [-30.0, 45.0, NAN, NAN, 0.0]);
    run(&mut world, places, SECOND);
    let sent = told(&mut world, places, command::DO_MOUNT_CONTROL).remove(0);
    let frame = FrameBuffer::default().encode_any(MANAGER, 1, &MavMessage::COMMAND_LONG(sent)).bytes().to_vec();
    assert_eq!(frame, golden);
}

/// Gimbal statement 25: "v2 rate command golden frame matches; q bytes are quiet NaN 00 00 C0 7F."
#[test]
fn statement_25_the_golden_frame_of_a_rate() {
    // The frame of the notes: pitch +10, yaw −20 degrees per second, flags 0x2C.
    let expected = bytes(
        "FD 20 00 00 08 01 BF 1C 01 00 00 00 C0 7F 00 00 C0 7F 00 00 C0 7F 00 00 C0 7F 00 00 00 00 C2 B8 32 3E C2 B8 B2 BE 2C 00 01 9A F3 4E",
    );
    let (mut world, places) = running(Generation::V2);
    demand(&mut world, places, [NAN, NAN, 10.0, -20.0, 12.0]);
    run(&mut world, places, Duration::from_millis(200));
    let (_, setpoints) = orders(&mut world, places);
    let message = MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(setpoints[0].clone());
    let frame = FrameBuffer::default().encode_any(MANAGER, 8, &message).bytes().to_vec();
    assert_eq!(frame, expected);
}

/// A demand to turn by the vehicle's nose, and the one that stops it.
#[test]
fn a_rate_turns_it_and_zero_stops_it() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        demand(&mut world, places, [NAN, NAN, 0.0, 10.0, 0.0]);
        run(&mut world, places, 2 * SECOND);
        let (_, turned) = looks(&world);
        assert!((turned - 20.0).abs() < 4.0, "{generation:?} {turned}");
        demand(&mut world, places, [NAN, NAN, 0.0, 0.0, 0.0]);
        run(&mut world, places, 2 * SECOND);
        let (_, stopped) = looks(&world);
        run(&mut world, places, 3 * SECOND);
        let (_, later) = looks(&world);
        assert!(
            (later - stopped).abs() < 0.5 && (stopped - turned).abs() < 5.0,
            "{generation:?} {turned} {stopped} {later}"
        );
    }
}

/// "A gimbal that turns after its operator is gone is our worst bug": the sender falls silent, the link to it goes, the
/// process ends, or it is told otherwise; it stops in each case.
#[test]
fn it_stops_when_its_operator_is_gone() {
    for generation in [Generation::V1, Generation::V2] {
        let is_stopped = |world: &mut World| {
            let before = looks(world).1;
            world.run_for(2 * SECOND);
            (looks(world).1 - before).abs() < 0.5
        };
        // A stream that ends.
        let (mut world, places) = running(generation);
        world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.0, 0.2, 0));
        world.run_for(4 * SECOND);
        assert!(is_stopped(&mut world), "{generation:?}: the stream has ended");

        // The end of the daemon, while it turns: its last words are zeros.
        let (mut world, places) = running(generation);
        demand(&mut world, places, [NAN, NAN, 0.0, 10.0, 0.0]);
        run(&mut world, places, SECOND);
        world.forget();
        world.input(Input::Shutdown);
        let (commands, setpoints) = orders(&mut world, places);
        let last_is_zero = match generation {
            Generation::V1 => commands
                .last()
                .is_some_and(|last| (last.param1, last.param2, last.param3, last.param6) == (0.0, 0.0, 0.0, 2.0)),
            Generation::V2 => setpoints.last().is_some_and(|last| last.angular_velocity_z == 0.0),
        };
        assert!(last_is_zero, "{generation:?} {commands:?} {setpoints:?}");

        // Its line is unplugged while it turns, and plugged in again.
        let (mut world, places) = running(generation);
        demand(&mut world, places, [NAN, NAN, 0.0, 10.0, 0.0]);
        run(&mut world, places, SECOND);
        world.unplug(places.gimbal);
        run(&mut world, places, SECOND);
        world.plug_in(places.gimbal);
        run(&mut world, places, 12 * SECOND);
        assert!(is_stopped(&mut world), "{generation:?}: it was unplugged");
    }
}

/// At the end the zero is repeated as long as the process has time, in either generation, also to one that acknowledges
/// nothing; and that it may turn is kept for the next start.
#[test]
fn at_the_end_it_is_told_to_stop_again_and_again() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        demand(&mut world, places, [NAN, NAN, 0.0, 10.0, 0.0]);
        run(&mut world, places, SECOND);
        world.remove(places.gimbal);
        world.forget();

        world.input(Input::Shutdown);
        world.run_for(SECOND / 2);

        assert!(world.bridge.is_finished());
        let (commands, setpoints) = orders(&mut world, places);
        assert_eq!(world.stored_turning, ["camera\t1/154\tgremsy"], "{generation:?}");
        let zeros = match generation {
            Generation::V1 => {
                assert!(commands.iter().all(|told| *told == packet::turn_at(GIMBAL, [AngularRate::ZERO; 3])));
                commands.len()
            }
            Generation::V2 => {
                assert!(setpoints.iter().all(|told| (told.angular_velocity_y, told.angular_velocity_z) == (0.0, 0.0)));
                setpoints.len()
            }
        };
        assert!((5..=12).contains(&zeros), "{generation:?}: {zeros}");
    }
}

/// An operation in the middle of a rotation takes the place of the demand. The word to stop may be lost: that it may turn is
/// kept until it has been told for a while.
#[test]
fn what_an_operation_interrupts_counts_as_turning_for_a_while() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        let rate = AngularRate::from_degrees_per_second;
        let (roll, pitch, yaw, yaw_frame) = (None, rate(0.0), rate(10.0), YawFrame::Vehicle);
        let asks = [
            Asked::Turn { roll, pitch, yaw, yaw_frame },
            Asked::Operation(Operation::SetYawMode(gimbald::gimbals::operation::YawMode::Follow)),
        ];
        let mut ids = Vec::new();
        for asked in &asks {
            ids.push(world.ask_by_name("camera", asked));
            run(&mut world, places, SECOND / 2);
            assert_eq!(world.stored_turning, ["camera\t1/154\tgremsy"], "{generation:?} {asked:?}");
        }
        run(&mut world, places, 8 * SECOND);
        assert!(world.answers.contains(&(ids[1], Ok(()))), "{:?}", world.answers);
        assert_eq!(world.stored_turning, Vec::<String>::new(), "{generation:?}");
    }
}

/// "31011 p7=2 (FOLLOW, once, ACKed) then 205 p6=1" (gimbals 2.5), and no more than it takes.
#[test]
fn v1_the_mode_is_said_once_and_the_angle_as_often_as_it_takes() {
    let (mut world, places) = running(Generation::V1);
    demand(&mut world, places, [-30.0, 45.0, NAN, NAN, 0.0]);
    run(&mut world, places, 10 * SECOND);
    let (commands, setpoints) = orders(&mut world, places);
    assert_eq!(setpoints, []);
    assert_eq!(commands[0], packet::follow(GIMBAL));
    let degrees = Angle::from_degrees;
    let angles = GimbalAngles { roll: Angle::ZERO, pitch: degrees(-30.0), yaw: degrees(45.0) };
    assert!(commands[1..].iter().all(|command| *command == packet::rotate_to(GIMBAL, angles)), "{commands:?}");
    // Ten a second while it moves (some two seconds), then one.
    assert!((25..60).contains(&commands.len()), "{}", commands.len());
}

/// Yaw from North is turned with the vehicle where the gimbal's own North is not to be relied on; with the autopilot's
/// attitude in it, it is locked and told yaw from North.
#[test]
fn v1_yaw_from_north_by_the_vehicle_or_by_lock() {
    for combines in [false, true] {
        let (mut world, places) = running(Generation::V1);
        take_control(&mut world);
        assert_eq!(operate(&mut world, places, Operation::SetCombinedAttitude(combines)), Some(Ok(())));
        world.forget();
        let vehicle = world.snapshot().vehicle.heading_deg.expect("a heading");
        let asked = Asked::Point {
            roll: AxisDemand::default(),
            pitch: AxisDemand { angle: Some(Angle::from_degrees(-10.0)), rate: None },
            yaw: AxisDemand { angle: Some(Angle::from_degrees(vehicle + 20.0)), rate: None },
            yaw_frame: YawFrame::Earth,
        };
        assert_eq!(ask(&mut world, places, &asked), Some(Ok(())));
        let earth = seen(&world).attitude.yaw_earth_deg.expect("a yaw");
        let off = (earth - vehicle - 20.0).rem_euclid(360.0);
        // The vehicle turns at 7 degrees a second, and what follows it is a little behind.
        assert!(!(3.0..=357.0).contains(&off), "combined {combines}: {off}");
        let (commands, _) = orders(&mut world, places);
        let expected = if combines { packet::lock(GIMBAL) } else { packet::follow(GIMBAL) };
        assert_eq!(commands[0], expected);
        // The vehicle turns all the time, so without LOCK it is told another angle all the time.
        assert_eq!(commands.len() > 100, !combines, "{}", commands.len());
    }
}

/// The flags of every 285 that a ground station gets in the next second.
fn told_flags(world: &mut World, places: Places) -> Vec<u16> {
    world.forget();
    run(world, places, SECOND);
    let told: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = world.take_messages(places.ground);
    let mut flags: Vec<u16> = told.iter().map(|told| told.flags).collect();
    flags.dedup();
    flags
}

/// "31011 p7=1 (LOCK) then 205 yaw earth only if attitude is fed; otherwise vehicle yaw" (gimbals 2.5); "without autopilot attitude
/// … it drifts; north is not known" (1.7); "autopilot attitude stale 1.0 s -> earth-yaw clients demoted: hold last vehicle yaw" (5.8);
/// fed again, its North is right after 2 s (5.1).
#[test]
fn v1_no_yaw_is_from_north_without_the_autopilots_attitude() {
    let north = command_long(MANAGER, 1000, &[-10.0, 90.0, NAN, NAN, 92.0, 0.0, 0.0]);
    let (mut world, places) = running(Generation::V1);
    assert_eq!(seen(&world).details.combined_attitude, Some(true));
    assert_eq!(world.result_of(places.ground, GCS, &north), Some(ACCEPTED));
    run(&mut world, places, 6 * SECOND);
    assert_eq!(orders(&mut world, places).0[0], packet::lock(GIMBAL));

    world.unplug(places.autopilot);
    run(&mut world, places, 2 * SECOND);
    let follows = orders(&mut world, places).0.contains(&packet::follow(GIMBAL));
    let (_, held) = looks(&world);
    assert!(follows && seen(&world).setpoint.expect("a setpoint").stale, "{:?}", seen(&world).setpoint);
    run(&mut world, places, 5 * SECOND);
    assert!((looks(&world).1 - held).abs() < 1.0, "{held} became {}", looks(&world).1);
    assert_eq!(world.result_of(places.ground, GCS, &north), Some(TEMPORARILY_REJECTED));
    // YAW_IN_VEHICLE_FRAME, and no yaw from North is taken; what was asked for is to lock it.
    assert_eq!(told_flags(&mut world, places), [0x3c]);

    world.plug_in(places.autopilot);
    run(&mut world, places, SECOND);
    assert_eq!(world.result_of(places.ground, GCS, &north), Some(ACCEPTED));
    run(&mut world, places, SECOND);
    assert!(!orders(&mut world, places).0.contains(&packet::lock(GIMBAL)), "its North is not right yet");
    run(&mut world, places, 3 * SECOND);
    assert!(orders(&mut world, places).0.contains(&packet::lock(GIMBAL)));

    // No autopilot was ever heard.
    let (mut world, places) = without_gimbal(GremsySettings::default());
    world.install(places.gimbal, Device::new(Timestamp::ZERO, device(Generation::V1)));
    run(&mut world, places, 25 * SECOND);
    world.forget();
    assert_eq!(world.result_of(places.ground, GCS, &north), Some(TEMPORARILY_REJECTED));
    assert_eq!(orders(&mut world, places), (vec![], vec![]));
    assert_eq!(told_flags(&mut world, places), [0x2c]);
}

/// "flags 0x2C | (0x10 if LOCK)" (gimbals 2.5): its 285 tells the mode that it is in, whoever asked for that.
#[test]
#[rustfmt::skip]
fn v1_its_285_tells_the_mode_that_it_is_in() {
    use gimbald::gimbals::operation::YawMode;
    let (mut world, places) = running(Generation::V1);
    take_control(&mut world);
    for (operation,                                flags) in [
        (Operation::SetYawMode(YawMode::Lock),     0x0bc),
        (Operation::Reset(ResetMode::PitchAndYaw), 0x0bc),
        (Operation::RadioControl,                  0x1bc),
        (Operation::SetYawMode(YawMode::Follow),   0x0ac),
    ] {
        let named = format!("{operation:?}");
        assert_eq!(operate(&mut world, places, operation), Some(Ok(())), "{named}");
        assert_eq!(told_flags(&mut world, places), [flags], "{named}");
    }
    // What somebody demands shows at once: ground stations take their lock button from it.
    for (demanded, flags) in [(28.0, 0xbc), (12.0, 0xac), (28.0, 0xbc), (12.0, 0xac)] {
        take_control(&mut world);
        let id = world.ask_by_name("camera", &Asked::ReleaseControl);
        assert!(world.answers.contains(&(id, Ok(()))));
        demand(&mut world, places, [-10.0, 20.0, NAN, NAN, demanded]);
        assert_eq!(told_flags(&mut world, places), [flags], "{demanded}");
    }
}

/// "flags 0x0C plus YAW_LOCK/frame bits"; firmware before 7.8.7 knows no frame bits and gets none (gimbals 1.5, 1.7).
#[test]
#[rustfmt::skip]
fn v2_flags_by_the_firmware() {
    let level = GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK;
    for (device,                                  flags) in [
        (device(Generation::V2),                  level | GimbalFlags::YAW_IN_VEHICLE_FRAME),
        (with_firmware(Generation::V2, 7, 8, 8),  level | GimbalFlags::YAW_IN_VEHICLE_FRAME),
        (with_firmware(Generation::V2, 7, 8, 6),  level),
        (with_firmware(Generation::V2, 7, 7, 3),  level),
    ] {
        let firmware = device.firmware;
        let (mut world, places) = running_with(device, GremsySettings::default());
        demand(&mut world, places, [-30.0, 45.0, NAN, NAN, 0.0]);
        run(&mut world, places, 4 * SECOND);
        let (commands, setpoints) = orders(&mut world, places);
        assert_eq!(commands, [], "{firmware}");
        assert!(setpoints.iter().all(|setpoint| setpoint.flags == flags.bits()), "{firmware} {:?}", setpoints[0].flags);
        // At once and 20 times a second.
        assert!((78..=84).contains(&setpoints.len()), "{}", setpoints.len());
        assert_looks(&world, -30.0, 45.0);
    }
}

/// Gimbal statement 27: "Quaternion with norm 1.2 is rejected; norm 1.05 is normalised and sent." The protocol notes (3.7)
/// take squared norms of 0.9 to 1.1 and win: 1.04 is normalised.
#[test]
fn statement_27_quaternions_that_are_none() {
    for (norm, taken) in [(1.2, false), (1.06, false), (1.04, true), (0.96, true), (0.9, false)] {
        let (mut world, places) = running(Generation::V2);
        let q = quaternion(-20.0, 10.0).map(|element| element * norm);
        world.send(places.ground, GCS, &set_attitude(q, [NAN; 3], 44));
        run(&mut world, places, 3 * SECOND);
        let (_, setpoints) = orders(&mut world, places);
        assert_eq!(!setpoints.is_empty(), taken, "norm {norm}");
        for setpoint in setpoints {
            let squared: f32 = setpoint.q.iter().map(|element| element * element).sum();
            assert!((squared - 1.0).abs() < 1e-5, "{squared}");
        }
    }
}

/// Gimbal statement 30: "RETRACT to a Gremsy profile with retract_allowed=false drives to the stow angle and never sends
/// motor-off."
#[test]
fn statement_30_retract_is_a_place_to_stow_unless_it_is_allowed() {
    for generation in [Generation::V1, Generation::V2] {
        let stow = GremsySettings {
            stow_pitch: Angle::from_degrees(-60.0),
            stow_yaw: Angle::from_degrees(30.0),
            ..GremsySettings::default()
        };
        let (mut world, places) = running_with(device(generation), stow);
        demand(&mut world, places, [0.0, 0.0, NAN, NAN, 1.0]);
        run(&mut world, places, 5 * SECOND);
        assert_looks(&world, -60.0, 30.0);
        assert_eq!(seen(&world).details.motors_on, Some(true));
        let (commands, setpoints) = orders(&mut world, places);
        assert!(commands.iter().all(|command| command.command != command::USER_1), "{commands:?}");
        assert!(setpoints.iter().all(|setpoint| setpoint.flags & 1 == 0));
        // Client checklist E49: "RETRACT bit in 285 while retracted; cleared by the next angle command." What a v2 gimbal says
        // of itself goes by untouched (D2), and its flag means that the motors are off; the manager's 281 has it.
        assert_eq!(told_retracted(&mut world, places), (generation == Generation::V1, true), "{generation:?}");
        demand(&mut world, places, [-10.0, 20.0, NAN, NAN, 0.0]);
        run(&mut world, places, 2 * SECOND);
        assert_eq!(told_retracted(&mut world, places), (false, false), "{generation:?}");

        // Allowed, it switches them off, and the next angle on again.
        let allowed = GremsySettings { retract_allowed: true, ..stow };
        let (mut world, places) = running_with(device(generation), allowed);
        demand(&mut world, places, [0.0, 0.0, NAN, NAN, 1.0]);
        run(&mut world, places, 3 * SECOND);
        assert_eq!(seen(&world).details.motors_on, Some(false), "{generation:?}");
        demand(&mut world, places, [-10.0, 20.0, NAN, NAN, 0.0]);
        run(&mut world, places, 8 * SECOND);
        assert_eq!(seen(&world).details.motors_on, Some(true), "{generation:?}");
        assert_looks(&world, -10.0, 20.0);
    }
}

/// Whether a ground station has RETRACT in the latest 285 and 281.
fn told_retracted(world: &mut World, places: Places) -> (bool, bool) {
    let arrivals = world.arrivals(places.ground).iter();
    let mut statuses =
        arrivals.clone().filter_map(|arrival| arrival.frame().decode::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>());
    let mut managed = arrivals.filter_map(|arrival| arrival.frame().decode::<GIMBAL_MANAGER_STATUS_DATA>());
    let device = statuses.next_back().expect("a 285").flags;
    let manager = managed.next_back().expect("a 281").flags;
    world.forget();
    (device & 1 != 0, manager & 1 != 0)
}

/// Neutral is its home in v1, and a flag in v2.
#[test]
fn neutral_takes_it_home() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        demand(&mut world, places, [-30.0, 45.0, NAN, NAN, 0.0]);
        run(&mut world, places, 4 * SECOND);
        world.forget();
        demand(&mut world, places, [0.0, 0.0, NAN, NAN, 2.0]);
        run(&mut world, places, 5 * SECOND);
        assert_looks(&world, 0.0, 0.0);
        let (commands, setpoints) = orders(&mut world, places);
        match generation {
            Generation::V1 => {
                assert_eq!((commands, setpoints), (vec![packet::reset(GIMBAL, ResetMode::PitchAndYaw)], vec![]));
            }
            Generation::V2 => {
                assert_eq!(commands, []);
                let neutral = |setpoint: &GIMBAL_DEVICE_SET_ATTITUDE_DATA| setpoint.flags & 2 != 0;
                assert!(!setpoints.is_empty() && setpoints.iter().all(neutral), "{setpoints:?}");
            }
        }
    }
}

/// `MAV_CMD_DO_SET_ROI_NONE`: "the gimbal ... should ... assume a neutral position"; "YAW_IN_VEHICLE_FRAME: yaw angle ... relative to
/// the vehicle heading": after a yaw from North neutral is the nose, wherever the vehicle turns. A v1 gimbal that is locked is told
/// FOLLOW for that.
#[test]
fn neutral_stays_ahead_of_a_vehicle_that_turns() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        demand(&mut world, places, [-20.0, 90.0, NAN, NAN, 92.0]);
        run(&mut world, places, 4 * SECOND);
        assert!(seen(&world).flags.contains(&"yaw_lock".to_owned()), "{generation:?}");
        world.forget();
        demand(&mut world, places, [0.0, 0.0, NAN, NAN, 2.0]);
        run(&mut world, places, 10 * SECOND);
        let turned = world.snapshot().vehicle.heading_deg;
        for _ in 0..10 {
            assert_looks(&world, 0.0, 0.0);
            run(&mut world, places, SECOND);
        }
        assert_ne!(world.snapshot().vehicle.heading_deg, turned, "the vehicle turns");
        let (commands, setpoints) = orders(&mut world, places);
        match generation {
            Generation::V1 => {
                let home = packet::reset(GIMBAL, ResetMode::PitchAndYaw);
                assert_eq!((commands, setpoints), (vec![packet::follow(GIMBAL), home], vec![]));
            }
            Generation::V2 => assert_eq!(commands, []),
        }
    }
}

/// `RC_EXCLUSIVE` hands it to its own radio receiver (204, p1 = 3), and nothing is told to it until somebody takes it back.
#[test]
fn a_gimbal_that_was_handed_to_its_radio_control_is_told_nothing() {
    let (mut world, places) = running(Generation::V1);
    demand(&mut world, places, [-10.0, 20.0, NAN, NAN, 0.0]);
    run(&mut world, places, SECOND);
    world.forget();
    demand(&mut world, places, [0.0, 0.0, NAN, NAN, 256.0]);
    run(&mut world, places, 3 * SECOND);
    assert_eq!(seen(&world).setpoint, None);
    let (commands, setpoints) = orders(&mut world, places);
    assert_eq!((commands, setpoints), (vec![packet::hand_to_rc(GIMBAL)], vec![]));
    assert!(is_handed_over(&world), "{:?}", seen(&world).flags);
}

/// "DENIED (204 and 205 with mode 3: UNSUPPORTED), as its 283 tells of no RC inputs; by name (`radio-control`) 204 with mode 3 …; when it has acknowledged that, the flag is
/// in 281, as 285 is its own" (`docs/families/gremsy.md`).
#[test]
fn a_gimbal_of_v2_is_handed_to_its_radio_control_by_name_only() {
    let (mut world, places) = running(Generation::V2);
    let given = command_long(MANAGER, 1000, &[0.0, 0.0, NAN, NAN, 256.0, 0.0, 0.0]);
    assert_eq!(world.result_of(places.ground, GCS, &given), Some(DENIED));
    let by_mount = command_long(MANAGER, command::DO_MOUNT_CONFIGURE, &[3.0]);
    assert_eq!(world.result_of(places.ground, GCS, &by_mount), Some(UNSUPPORTED));
    let why = "255/190 was refused: the gimbal tells of no radio control of its own; a Gremsy may be left to it by name \
               (radio-control)";
    assert!(world.snapshot().events.iter().any(|event| event.text == why), "{:?}", world.snapshot().events);
    run(&mut world, places, SECOND);
    assert_eq!(orders(&mut world, places), (vec![], vec![]));

    take_control(&mut world);
    assert_eq!(operate(&mut world, places, Operation::RadioControl), Some(Ok(())));
    run(&mut world, places, SECOND);
    assert_eq!(orders(&mut world, places), (vec![packet::hand_to_rc(GIMBAL)], vec![]));
    assert!(is_handed_over(&world), "{:?}", seen(&world).flags);
}

/// A v2 gimbal tells of no radio control itself, so that it is shown what it has acknowledged; and whatever else is asked of it
/// takes it back in either generation, to be steered on.
#[test]
fn one_that_was_left_to_its_radio_control_by_name_is_shown_so_until_something_else_is_asked() {
    use gimbald::gimbals::operation::YawMode;
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        assert_eq!(operate(&mut world, places, Operation::RadioControl), Some(Ok(())), "{generation:?}");
        assert!(is_handed_over(&world), "{generation:?} {:?}", seen(&world).flags);
        world.forget();
        run(&mut world, places, 3 * SECOND);
        assert_eq!((orders(&mut world, places), seen(&world).setpoint), ((vec![], vec![]), None), "{generation:?}");
        assert_eq!(operate(&mut world, places, Operation::SetYawMode(YawMode::Follow)), Some(Ok(())), "{generation:?}");
        assert!(!is_handed_over(&world), "{generation:?} {:?}", seen(&world).flags);
        point(&mut world, -20.0, 10.0);
        run(&mut world, places, 5 * SECOND);
        assert_looks(&world, -20.0, 10.0);
    }
}

fn is_handed_over(world: &World) -> bool {
    seen(world).flags.iter().any(|flag| flag == "rc_exclusive")
}

/// The flag tells what the gimbal has done, not what was asked of it: it comes with the acknowledgement, and never after one
/// that refuses, nor when somebody took the gimbal back meanwhile.
#[test]
fn its_radio_control_has_it_when_it_has_acknowledged_that() {
    for (result, taken_back, has_it) in [
        (CommandResult::Accepted, false, true),
        (CommandResult::Denied, false, false),
        (CommandResult::Accepted, true, false),
    ] {
        let (mut world, places) = running(Generation::V1);
        world.remove(places.gimbal);
        world.forget();
        demand(&mut world, places, [0.0, 0.0, NAN, NAN, 256.0]);
        assert_eq!(orders(&mut world, places).0, [packet::hand_to_rc(GIMBAL)]);
        let tells = |world: &mut World| {
            let orientation =
                MOUNT_ORIENTATION_DATA { time_boot_ms: 90_000, roll: 0.0, pitch: 0.0, yaw: 0.0, yaw_absolute: 0.0 };
            world.send(places.gimbal, GIMBAL, &MavMessage::MOUNT_ORIENTATION(orientation));
        };
        tells(&mut world);
        assert!(!is_handed_over(&world), "it has not acknowledged it");
        if taken_back {
            demand(&mut world, places, [-10.0, 20.0, NAN, NAN, 0.0]);
        }
        let ack = COMMAND_ACK_DATA {
            command: command::DO_MOUNT_CONFIGURE,
            result: result as u8,
            progress: 0,
            result_param2: 0,
            target_system: MANAGER.system,
            target_component: MANAGER.component,
        };
        world.send(places.gimbal, GIMBAL, &MavMessage::COMMAND_ACK(ack));
        tells(&mut world);
        assert_eq!(is_handed_over(&world), has_it, "{result:?} {taken_back}");
    }
}

/// Gimbal statement 20: "MOUNT_STATUS never updates the attitude estimate of a Gremsy profile; it updates the encoder
/// values only." 19: "In LOCK the attitude yaw comes from yaw_absolute, in FOLLOW from yaw."
#[test]
fn statements_19_and_20_what_is_the_attitude() {
    use gimbald::wire::dialect::{MOUNT_STATUS_DATA, SYS_STATUS_DATA};
    let (mut world, places) = running(Generation::V1);
    world.remove(places.gimbal);
    let before = looks(&world);
    let encoders = MOUNT_STATUS_DATA {
        pointing_a: 16_384,
        pointing_b: 0,
        pointing_c: -16_384,
        target_system: 0,
        target_component: 0,
        mount_mode: 0,
    };
    world.send(places.gimbal, GIMBAL, &MavMessage::MOUNT_STATUS(encoders));
    assert_eq!(looks(&world), before);
    let told = seen(&world).details.encoders.expect("encoders");
    assert_eq!((told.raw, told.tilt_deg, told.pan_deg), ([16_384, 0, -16_384], 90.0, -90.0));

    let mut status = SYS_STATUS_DATA {
        onboard_control_sensors_present: 0,
        onboard_control_sensors_enabled: 0,
        onboard_control_sensors_health: 0,
        load: 0,
        voltage_battery: 0,
        current_battery: 0,
        battery_remaining: 0,
        drop_rate_comm: 0,
        errors_comm: 0,
        errors_count1: 0x0011,
        errors_count2: 0,
        errors_count3: 0,
        errors_count4: 0,
        onboard_control_sensors_present_extended: 0,
        onboard_control_sensors_enabled_extended: 0,
        onboard_control_sensors_health_extended: 0,
    };
    let orientation =
        MOUNT_ORIENTATION_DATA { time_boot_ms: 90_000, roll: 0.0, pitch: -30.0, yaw: 15.0, yaw_absolute: 120.0 };
    for (activity, frame, yaw) in [(0x0011, "yaw_in_vehicle_frame", 15.0), (0x0010, "yaw_in_earth_frame", 120.0)] {
        status.errors_count1 = activity;
        world.send(places.gimbal, GIMBAL, &MavMessage::SYS_STATUS(status.clone()));
        world.send(places.gimbal, GIMBAL, &MavMessage::MOUNT_ORIENTATION(orientation.clone()));
        let seen = seen(&world);
        assert!(seen.flags.iter().any(|flag| flag == frame), "{:?}", seen.flags);
        let told =
            if frame == "yaw_in_earth_frame" { seen.attitude.yaw_earth_deg } else { seen.attitude.yaw_vehicle_deg };
        assert!((told.expect("a yaw") - yaw).abs() < 1e-3, "{told:?}");
    }
}

/// Gimbal statement 28: "With the 7.8.6 profile 285 without YAW_IN flags and YAW_LOCK set is interpreted as earth yaw; with
/// the 7.8.9 profile YAW_IN bits win over YAW_LOCK." What 7.8.0 to 7.8.7 tell of North is known to be wrong, so that yaw comes
/// from the nose there. 29: "Reported vehicle yaw equals earth yaw − delta_yaw".
#[test]
#[rustfmt::skip]
fn statements_28_and_29_the_frame_of_a_reported_yaw() {
    use crate::support::script::device_status;
    use Yaw::{Known, OfHeading};
    /// Degrees; where 285 tells one yaw only the other is that and the autopilot's heading.
    #[derive(Clone, Copy, Debug)]
    enum Yaw {
        Known(f64),
        OfHeading { plus: f64, sign: f64 },
    }
    let from_nose = |yaw| (OfHeading { plus: yaw, sign: 1.0 }, Known(yaw));
    let over_ground = |yaw| (Known(yaw), OfHeading { plus: yaw, sign: -1.0 });
    for (firmware,   flags,        delta_yaw, pan,   (earth, vehicle)) in [
        ((7, 7, 3),  0x0c | 0x10,  0.0,       None,        over_ground(100.0)),
        ((7, 7, 3),  0x0c,         0.0,       None,        from_nose(100.0)),
        ((7, 8, 9),  0x1c | 0x20,  70.0,      None,        (Known(170.0), Known(100.0))),
        ((7, 8, 9),  0x0c | 0x40,  70.0,      None,        (Known(100.0), Known(30.0))),
        // Of these yaw from North is wrong: what is wrong cancels out, or `MOUNT_ORIENTATION` tells the one from the nose.
        ((7, 8, 7),  0x1c | 0x40,  70.0,      Some(-20.0), from_nose(30.0)),
        ((7, 8, 6),  0x0c | 0x10,  0.0,       Some(-20.0), from_nose(-20.0)),
        ((7, 8, 6),  0x0c,         0.0,       Some(-20.0), from_nose(100.0)),
    ] {
        let (x, y, z) = firmware;
        let (mut world, places) = running_with(with_firmware(Generation::V2, x, y, z), GremsySettings::default());
        world.remove(places.gimbal);
        if let Some(yaw) = pan {
            let told = MOUNT_ORIENTATION_DATA { time_boot_ms: 60_000, roll: 0.0, pitch: -30.0, yaw, yaw_absolute: 100.0 };
            world.send(places.gimbal, GIMBAL, &MavMessage::MOUNT_ORIENTATION(told));
        }
        let mut status: GIMBAL_DEVICE_ATTITUDE_STATUS_DATA = device_status(Timestamp::from_secs(60), flags, -30.0, 100.0);
        status.delta_yaw = f32::to_radians(delta_yaw);
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
        let attitude = seen(&world).attitude;
        let heading = world.snapshot().vehicle.heading_deg.expect("it flies");
        for (told, expected) in [(attitude.yaw_earth_deg, earth), (attitude.yaw_vehicle_deg, vehicle)] {
            let expected = match expected {
                Known(yaw) => yaw,
                OfHeading { plus, sign } => plus + sign * heading,
            };
            let off = Angle::from_degrees(told.expect("a yaw") - expected).wrapped().degrees();
            assert!(off.abs() < 0.01, "{firmware:?} {flags:#x}: {attitude:?}, heading {heading}, expected {earth:?} {vehicle:?}");
        }
    }
}

/// What the driver for v2 devices would send is what a Gremsy gets, but for what its firmware wants otherwise.
#[test]
fn a_rate_without_roll_is_one_with_none() {
    let turning = Turning {
        roll: None,
        pitch: AngularRate::from_degrees_per_second(10.0),
        yaw: AngularRate::ZERO,
        yaw_frame: YawFrame::Vehicle,
        stabilised: Stabilised::BOTH,
        radio_control: RadioControl::Off,
    };
    let MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(plain) =
        mavlink_v2::packet::set_attitude(GIMBAL, &Setpoint::Turn(turning))
    else {
        panic!("a setpoint");
    };
    assert!(plain.angular_velocity_x.is_nan());
    let (mut world, places) = running(Generation::V2);
    demand(&mut world, places, [NAN, NAN, 10.0, 0.0, 0.0]);
    run(&mut world, places, Duration::from_millis(100));
    let (_, setpoints) = orders(&mut world, places);
    assert_eq!(setpoints[0].angular_velocity_x, 0.0);
    assert_eq!(setpoints[0].angular_velocity_y, plain.angular_velocity_y);
}
