//! Commands of the maker's own over MAVLink: motors (31010), modes and resets (31011), restarts (246).

use gimbald::bridge::Input;
use gimbald::gimbals::gremsy::packet;
use gimbald::wire::MavId;
use gimbald::wire::dialect::COMMAND_ACK_DATA;

use super::*;
use crate::support::script::{ACCEPTED, DENIED, NAN, TEMPORARILY_REJECTED, UNSUPPORTED, again, of, to};
use crate::support::world::{AUTOPILOT, GIMBAL};

const IN_PROGRESS: u8 = 5;
const SCRIPT: MavId = MavId::new(245, 191);

/// Primary control for the ground station.
fn claim(world: &mut World, places: Places) {
    let take = command_long(MANAGER, 1001, &[-2.0, -2.0, -1.0, -1.0, 0.0, 0.0, 0.0]);
    assert_eq!(world.result_of(places.ground, GCS, &take), Some(ACCEPTED));
}

/// What a command is answered, one answer after the other.
fn answers(world: &mut World, places: Places, sender: MavId, number: u16, params: &[f32]) -> Vec<u8> {
    world.take(places.ground);
    world.send(places.ground, sender, &command_long(MANAGER, number, params));
    run(world, places, 8 * SECOND);
    let acks: Vec<COMMAND_ACK_DATA> = of(&world.take(places.ground));
    acks.into_iter().filter(|ack| ack.command == number).map(|ack| ack.result).collect()
}

/// "Motors on and off, lock, follow, reset modes, reboot … MAVLink where the protocol has a way": each is begun, done by
/// the gimbal, and answered when it is. Client checklist E121, "no answer of ours ever has result IN_PROGRESS", is not kept for
/// these alone: what they ask for takes seconds.
#[test]
#[rustfmt::skip]
fn each_command_does_what_the_maker_says() {
    let v1 = |command: COMMAND_LONG_DATA| Some(command);
    for (number, params,                                      on_v1) in [
        (31010,  [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],         v1(packet::set_motors(GIMBAL, true))),
        (31010,  [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],         v1(packet::set_motors(GIMBAL, false))),
        (31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 4.0],         v1(packet::reset(GIMBAL, ResetMode::Yaw))),
        (31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 4.0],         v1(packet::reset(GIMBAL, ResetMode::PitchAndYaw))),
        (31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 11.0, 4.0],        v1(packet::reset(GIMBAL, ResetMode::PitchDownUpAndYaw))),
        (31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 12.0, 4.0],        v1(packet::reset(GIMBAL, ResetMode::PitchDownUp))),
        (31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 13.0, 4.0],        v1(packet::reset(GIMBAL, ResetMode::PitchMapping))),
        (246,    [0.0, 0.0, 1.0, 154.0, 0.0, 0.0, 0.0],       v1(packet::reboot(GIMBAL))),
        (246,    [0.0, 0.0, 2.0, 154.0, 0.0, 0.0, 0.0],       v1(packet::reboot_or_shutdown(GIMBAL, packet::RebootAction::Shutdown))),
    ] {
        for generation in [Generation::V1, Generation::V2] {
            let (mut world, places) = running(generation);
            claim(&mut world, places);
            let results = answers(&mut world, places, GCS, number, &params);
            assert_eq!(results, [IN_PROGRESS, ACCEPTED], "{generation:?} {number} {params:?}");
            if let (Some(expected), Generation::V1) = (&on_v1, generation) {
                let (commands, _) = orders(&mut world, places);
                assert_eq!(&commands[0], expected);
            }
        }
    }
}

/// Lock and follow are demands like any other: it stays, and keeps yaw to North or to the nose. They travel "as an angle with yaw
/// from North or from the nose" (`docs/families/gremsy.md`): one of v1 is in LOCK only where it combines the autopilot's attitude.
#[test]
fn lock_and_follow_are_demands() {
    for (generation, combines) in [(Generation::V1, false), (Generation::V1, true), (Generation::V2, true)] {
        let (mut world, places) = running(generation);
        take_control(&mut world);
        assert_eq!(operate(&mut world, places, Operation::SetCombinedAttitude(combines)), Some(Ok(())));
        assert_eq!(ask(&mut world, places, &Asked::ReleaseControl), Some(Ok(())));
        world.forget();
        assert_eq!(answers(&mut world, places, GCS, 31011, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]), [ACCEPTED]);
        assert!(seen(&world).flags.iter().any(|flag| flag == "yaw_lock"), "{generation:?}");
        assert_eq!(answers(&mut world, places, GCS, 31011, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]), [ACCEPTED]);
        assert!(!seen(&world).flags.iter().any(|flag| flag == "yaw_lock"), "{generation:?}");

        let (commands, setpoints) = orders(&mut world, places);
        let (modes, angles): (Vec<_>, Vec<_>) = commands.into_iter().partition(|command| command.command == 31011);
        let (locks, follows) = (packet::lock(GIMBAL), packet::follow(GIMBAL));
        let expected = match (generation, combines) {
            (Generation::V1, false) => vec![follows],
            (Generation::V1, true) => vec![locks, follows],
            (Generation::V2, _) => vec![],
        };
        assert_eq!(modes, expected, "{generation:?} {combines}");
        assert!(angles.iter().all(|angle| (angle.command, angle.param6) == (205, 1.0)), "{angles:?}");
        let is_v1 = generation == Generation::V1;
        assert_eq!((angles.is_empty(), setpoints.is_empty()), (!is_v1, is_v1), "{generation:?}");
    }
}

/// Protocol checklist 138: "When 246 arrives with p4 = 0, the daemon does not reboot." Nor does the gimbal: only one that
/// names it is for it, and what has no meaning is denied.
#[test]
#[rustfmt::skip]
fn item_138_a_restart_that_names_no_gimbal_restarts_nothing() {
    let (mut world, places) = running(Generation::V1);
    claim(&mut world, places);
    world.forget();
    for (number, params) in [
        (246,    [0.0; 7]),
        (246,    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (246,    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        (246,    [0.0, 0.0, 0.0, 154.0, 0.0, 0.0, 0.0]),
        (246,    [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
        (246,    [0.0, 0.0, 1.0, 171.0, 0.0, 0.0, 0.0]),
        (246,    [NAN; 7]),
        (31010,  [NAN; 7]),
        (31010,  [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]),
        (31011,  [0.0; 7]),
        (31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 4.0]),
        (31011,  [NAN; 7]),
    ] {
        assert_eq!(answers(&mut world, places, GCS, number, &params), [DENIED], "{number} {params:?}");
    }
    assert_eq!(orders(&mut world, places), (vec![], vec![]));
}

/// "TEMPORARILY_REJECTED: it may work later: no gimbal yet, one that starts" (`docs/gimbal-manager.md`). A gimbal that is not there yet, or starts, is not known
/// to have no such functions; of one that is known to be no Gremsy they are UNSUPPORTED at once.
#[test]
#[rustfmt::skip]
fn who_asks_before_it_is_known_may_ask_again() {
    let motors = command_long(MANAGER, 31010, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let lock = command_long(MANAGER, 31011, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let reset = command_long(MANAGER, 31011, &[0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 4.0]);
    let reboot = command_long(MANAGER, 246, &[0.0, 0.0, 1.0, 154.0, 0.0, 0.0, 0.0]);
    let no_mode = command_long(MANAGER, 31011, &[0.0; 7]);
    let others = command_long(MANAGER, 246, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for (family,           known_after_s, [before, starting, known]) in [
        (Family::Gremsy,   12,            [TEMPORARILY_REJECTED, TEMPORARILY_REJECTED, IN_PROGRESS]),
        (Family::Auto,     20,            [TEMPORARILY_REJECTED, TEMPORARILY_REJECTED, IN_PROGRESS]),
        (Family::MavlinkV2, 12,           [UNSUPPORTED, UNSUPPORTED, UNSUPPORTED]),
    ] {
        let gimbal = GimbalSettings { family, ..GimbalSettings::found("camera".to_owned()) };
        let (mut world, places) = World::empty(Settings { gimbals: vec![gimbal], ..three_links() });
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        run(&mut world, places, SECOND);
        for command in [&motors, &lock, &reset] {
            assert_eq!(world.result_of(places.ground, GCS, command), Some(before), "{family:?} {command:?}");
        }
        assert_eq!(world.result_of(places.ground, GCS, &reboot), Some(DENIED), "it names none that is there");

        world.install(places.gimbal, Device::new(world.now, device(Generation::V2)));
        for _ in 0..100 {
            if seen(&world).state == "searching" {
                run(&mut world, places, SECOND / 10);
            }
        }
        assert_eq!(seen(&world).state, "alive", "{family:?}");
        for command in [&motors, &lock, &reset] {
            assert_eq!(world.result_of(places.ground, GCS, command), Some(starting), "{family:?} {command:?}");
        }
        let of_reboot = if family == Family::MavlinkV2 { DENIED } else { starting };
        assert_eq!(world.result_of(places.ground, GCS, &reboot), Some(of_reboot), "{family:?}");
        for command in [&no_mode, &others] {
            let wrong = if family == Family::MavlinkV2 && *command == no_mode { UNSUPPORTED } else { DENIED };
            assert_eq!(world.result_of(places.ground, GCS, command), Some(wrong), "{family:?} {command:?}");
        }
        assert_eq!(orders(&mut world, places), (vec![], vec![]), "{family:?}");

        run(&mut world, places, known_after_s * SECOND);
        assert_eq!(world.result_of(places.ground, GCS, &reset), Some(known), "{family:?}");
    }
}

/// "Dangerous ones (motors off, reboot) need … the holder's right"; all of them pass the gate.
#[test]
#[rustfmt::skip]
fn they_pass_the_gate_and_dangerous_ones_are_the_holders() {
    let off = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let home = [0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 4.0];
    let reboot = [0.0, 0.0, 1.0, 154.0, 0.0, 0.0, 0.0];
    let (mut world, places) = running(Generation::V1);
    // Nobody has control: everybody may steer, and nobody may cut the motors.
    for (number, params, expected) in [(31010, off, vec![DENIED]), (246, reboot, vec![DENIED]), (31011, home, vec![IN_PROGRESS, ACCEPTED])] {
        assert_eq!(answers(&mut world, places, GCS, number, &params), expected, "{number}");
    }
    claim(&mut world, places);
    world.forget();
    for (number, params) in [(31010, off), (246, reboot), (31011, home)] {
        assert_eq!(answers(&mut world, places, SCRIPT, number, &params), [DENIED], "{number}");
    }
    assert_eq!(orders(&mut world, places), (vec![], vec![]));
}

/// A command that is said again because its answer is slow is done once.
#[test]
fn a_repeat_is_done_once() {
    let (mut world, places) = running(Generation::V1);
    claim(&mut world, places);
    world.forget();
    let off = command_long(MANAGER, 31010, &[0.0; 7]);
    for confirmation in 0..3 {
        world.send(places.ground, GCS, &again(confirmation, off.clone()));
    }
    run(&mut world, places, 8 * SECOND);
    let acks: Vec<COMMAND_ACK_DATA> = of(&world.take(places.ground));
    let results: Vec<u8> = acks.iter().filter(|ack| ack.command == 31010).map(|ack| ack.result).collect();
    assert_eq!(results, [IN_PROGRESS, IN_PROGRESS, IN_PROGRESS, ACCEPTED]);
    assert_eq!(told(&mut world, places, 31010).len(), 1);
}

/// A gimbal that does not answer is said to have failed, once.
#[test]
fn a_gimbal_that_does_not_answer_has_failed() {
    let (mut world, places) = running(Generation::V1);
    world.remove(places.gimbal);
    let results = answers(&mut world, places, GCS, 31011, &[0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 4.0]);
    assert_eq!(results, [IN_PROGRESS, 4]);
}

/// The same straight to a managed gimbal are kept away, as mount commands are (`docs/routing.md`, R15); with
/// `firewall = "warn"` they pass.
#[test]
fn what_others_send_straight_to_it_is_kept_away() {
    use gimbald::manager::settings::{ControlSettings, Firewall};
    for firewall in [Firewall::On, Firewall::Warn] {
        let gimbal = GimbalSettings { family: Family::Gremsy, ..GimbalSettings::found("camera".to_owned()) };
        let control = ControlSettings { firewall, ..ControlSettings::default() };
        let (mut world, places) = World::empty(Settings { gimbals: vec![gimbal], control, ..three_links() });
        world.install(places.gimbal, Device::new(Timestamp::ZERO, device(Generation::V1)));
        run(&mut world, places, 12 * SECOND);
        world.forget();
        for (number, params) in [
            (31010, [0.0; 7]),
            (31011, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
            (246, [0.0, 0.0, 1.0, 154.0, 0.0, 0.0, 0.0]),
            (246, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        ] {
            for (place, sender) in [(places.ground, GCS), (places.autopilot, AUTOPILOT)] {
                for target in [GIMBAL, MavId::new(1, 0), MavId::new(0, 0)] {
                    world.input(Input::LinkUp { link: 0 });
                    world.send(place, sender, &to(target, command_long(MANAGER, number, &params)));
                }
            }
        }
        let foreign = world
            .arrivals(places.gimbal)
            .iter()
            .filter(|arrival| matches!(arrival.source(), GCS | AUTOPILOT) && matches!(arrival.id(), 75 | 76));
        assert_eq!(foreign.count() > 0, firewall == Firewall::Warn, "{firewall:?}");
        for sender in [GCS, AUTOPILOT] {
            let names_it = |conflict: &String| conflict.contains(&sender.to_string());
            assert!(world.snapshot().conflicts.iter().any(names_it), "{firewall:?} {sender}");
        }
    }
}
