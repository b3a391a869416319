//! Who is a gimbal by its id and its link, and which manager and name it is given (protocol notes 1.7, 4.1, 4.6).

use gimbald::bridge::Input;
use gimbald::bridge::settings::Settings;
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA, MavMessage};

use super::{Rig, SECOND, SECOND_GIMBAL, Setpoint, four_links};
use crate::support::script::{ACCEPTED, NAN, command_long, device_information, of, px4_heartbeat, usual_capabilities};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, three_links};

/// Protocol notes 1.7: 1 is the autopilot's component id, 2 to 6 belong to gimbals without MAVLink, and system 0 is nobody's.
/// What speaks like a gimbal under such an id is none of ours, and neither is an autopilot, whatever its id, that tells of
/// the gimbal it drives.
#[test]
fn who_speaks_under_an_id_that_no_gimbal_has_is_none() {
    for impostor in [MavId::new(1, 1), MavId::new(1, 3), MavId::new(1, 6), MavId::new(0, 154)] {
        let mut rig = Rig::new(three_links());
        rig.introduce(rig.gimbals, impostor);
        rig.speak_for(2 * SECOND, &[(rig.gimbals, impostor)]);
        assert_eq!(rig.managed(), [], "{impostor}");
    }
    let mut rig = Rig::new(three_links());
    let autopilot = MavId::new(1, 20);
    rig.world.send(rig.peer, autopilot, &px4_heartbeat());
    let information = device_information(rig.world.now, usual_capabilities());
    rig.world.send(rig.peer, autopilot, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    rig.world.run_for(SECOND);
    assert_eq!(rig.managed(), []);
    // The lowest that a gimbal may have.
    let mut rig = Rig::new(three_links());
    rig.introduce(rig.gimbals, MavId::new(1, 7));
    assert_eq!(rig.managed(), [(192, "1/7".to_owned())]);
}

/// Protocol checklist 25: "If the gimbal shows up with a foreign system id … warn", until it has the vehicle's.
#[test]
fn item_25_a_foreign_system_id_is_over_when_the_gimbal_has_ours() {
    let foreign = MavId::new(42, 154);
    let mut rig = Rig::new(three_links());
    rig.introduce(rig.gimbals, foreign);
    rig.speak_for(SECOND, &[(rig.gimbals, foreign)]);
    assert_eq!(rig.conflicts().len(), 1);

    rig.speak_for(5 * SECOND, &[(rig.gimbals, GIMBAL)]);

    assert_eq!((rig.managed(), rig.conflicts()), (vec![(191, "1/154".to_owned())], vec![]));
}

/// Behind a ground link other vehicles fly: the gimbal of one of them does not take the place of ours that was lost, though
/// ours has its id.
#[test]
fn another_vehicles_gimbal_does_not_take_the_place_of_one_that_was_lost() {
    let foreign = MavId::new(42, 154);
    let mut rig = Rig::new(three_links());
    rig.introduce(rig.gimbals, foreign);
    rig.speak_for(SECOND, &[(rig.gimbals, foreign)]);
    for seconds in [5, 20] {
        for _ in 0..seconds {
            rig.introduce(rig.ground, foreign);
            rig.speak_for(SECOND, &[(rig.ground, foreign)]);
        }
        assert_eq!(rig.world.snapshot().gimbals[0].state, "lost", "it was not heard where it is");
        assert!(!rig.conducts(rig.ground));
    }
}

/// "A device that takes the vehicle's system id is the one we had" where it speaks by the same channel; who comes by another
/// one is another, while the first is there.
#[test]
fn a_gimbal_on_another_channel_is_not_the_one_that_takes_our_system_id() {
    let foreign = MavId::new(42, 154);
    let mut rig = Rig::new(three_links());
    rig.peer = rig.world.open(1);
    rig.introduce(rig.gimbals, foreign);
    rig.speak_for(2 * SECOND, &[(rig.gimbals, foreign)]);

    rig.introduce(rig.peer, GIMBAL);

    for _ in 0..5 {
        assert!(rig.managed().contains(&(191, "42/154".to_owned())), "{:?}", rig.managed());
        rig.speak_for(SECOND, &[(rig.gimbals, foreign), (rig.peer, GIMBAL)]);
    }
    assert_eq!(rig.managed(), [(191, "42/154".to_owned()), (192, "1/154".to_owned())]);
}

/// R21: "What the other says of itself (283 and 285) … is not forwarded while that one is alive".
#[test]
fn of_two_devices_under_one_id_clients_see_the_other_when_the_first_is_lost() {
    let mut rig = Rig::twins();
    for (is_lost, expected) in [(false, (0, 0)), (true, (1, 1))] {
        if is_lost {
            rig.speak_for(4 * SECOND, &[(rig.peer, GIMBAL)]);
            assert!(!rig.conducts(rig.peer), "the first may come back");
        }
        rig.world.forget();
        rig.introduce(rig.peer, GIMBAL);
        rig.look(rig.peer, -70.0, 100.0);
        let heard = rig.world.take(rig.ground);
        let seen = (
            of::<GIMBAL_DEVICE_INFORMATION_DATA>(&heard).len(),
            of::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(&heard).len(),
        );
        assert_eq!(seen, expected, "the first is lost: {is_lost}");
    }
}

/// A gimbal with an entry keeps its manager however long it is away; the fifth has none.
#[test]
fn d1_the_manager_of_an_entry_goes_to_no_other_gimbal() {
    let entries = [154, 171, 172, 173].map(|component| GimbalSettings {
        component_id: Some(component),
        ..GimbalSettings::found(format!("camera-{component}"))
    });
    let mut rig = Rig::new(Settings { gimbals: entries.to_vec(), ..three_links() });
    for component in [154, 171, 172, 173] {
        rig.introduce(rig.gimbals, MavId::new(1, component));
    }
    let managed = rig.managed();
    assert_eq!(managed.len(), 4);
    rig.world.run_for(30 * SECOND);
    let fifth = MavId::new(1, 174);
    rig.introduce(rig.gimbals, fifth);
    rig.speak_for(20 * SECOND, &[(rig.gimbals, fifth)]);

    assert_eq!(rig.managed(), managed);
    let conflicts = rig.conflicts();
    assert!(conflicts.len() == 1 && conflicts[0].contains("1/174"), "{conflicts:?}");
}

/// A gimbal is asked for by its name over HTTP and on the command line, so each has one of its own; the one that a found
/// gimbal would have may be an entry's, which may be called anything.
#[test]
fn a_found_gimbal_has_a_name_that_no_entry_has() {
    for (entries, expected) in [
        (vec![(171, "gimbal-154")], vec![("gimbal-154", "1/171"), ("gimbal-191", "1/154")]),
        (vec![(154, "gimbal-171")], vec![("gimbal-1-171", "1/171"), ("gimbal-171", "1/154")]),
        (vec![(154, "camera")], vec![("camera", "1/154"), ("gimbal-171", "1/171")]),
        (
            vec![(171, "gimbal-154"), (172, "gimbal-191")],
            vec![("gimbal-154", "1/171"), ("gimbal-191", "1/172"), ("gimbal-191-2", "1/154")],
        ),
    ] {
        let entry = |(component, name): &(u8, &str)| GimbalSettings {
            component_id: Some(*component),
            ..GimbalSettings::found((*name).to_owned())
        };
        let mut rig = Rig::new(Settings { gimbals: entries.iter().map(entry).collect(), ..three_links() });
        for device in [SECOND_GIMBAL, GIMBAL, MavId::new(1, 172)].into_iter().take(entries.len() + 1) {
            rig.introduce(rig.gimbals, device);
        }

        let mut names: Vec<(String, Option<String>)> =
            rig.world.snapshot().gimbals.into_iter().map(|gimbal| (gimbal.name, gimbal.device)).collect();
        names.sort();
        let expected: Vec<_> =
            expected.into_iter().map(|(name, device)| (name.to_owned(), Some(device.to_owned()))).collect();
        assert_eq!(names, expected);
    }
}

/// 191 answers from the start, "unless the user gave the managers other ids": then nobody of ours speaks under it.
#[test]
fn nobody_speaks_as_191_where_managers_have_other_ids() {
    for (manager_component_id, expected) in [(None, vec![191; 3]), (Some(195), vec![])] {
        let entry = GimbalSettings { manager_component_id, ..GimbalSettings::found("camera".to_owned()) };
        let mut rig = Rig::new(Settings { gimbals: vec![entry], ..three_links() });
        rig.world.send(rig.peer, AUTOPILOT, &px4_heartbeat());
        rig.world.forget();
        rig.world.run_for(3 * SECOND);
        let beats = rig.states().into_iter().map(|(component, _)| component).collect::<Vec<_>>();
        assert_eq!(beats, expected);
    }
}

/// Two gimbals of the same make may have the same number: one on another line is not the one that was lost.
#[test]
fn d1_a_lost_gimbal_has_no_successor_on_another_line() {
    let mut rig = Rig::new(four_links());
    rig.introduce(rig.gimbals, GIMBAL);
    rig.speak_for(SECOND, &[(rig.gimbals, GIMBAL)]);
    rig.world.run_for(SECOND);
    rig.introduce(rig.peer, SECOND_GIMBAL);

    rig.speak_for(6 * SECOND, &[(rig.peer, SECOND_GIMBAL)]);

    assert_eq!(rig.managed(), [(191, "1/154".to_owned()), (192, "1/171".to_owned())]);
    rig.world.forget();
    rig.speak_for(SECOND, &[(rig.peer, SECOND_GIMBAL)]);
    assert_eq!(rig.states(), [(191, 5), (192, 4)], "it is missed");
}

/// An entry follows its device to another id on its line; who has another id on another line is another gimbal, also when the
/// entry's is lost.
#[test]
fn d1_the_entry_of_a_lost_gimbal_goes_to_none_on_another_line() {
    let entry = GimbalSettings::found("camera".to_owned());
    let mut rig = Rig::new(Settings { gimbals: vec![entry], ..four_links() });
    rig.introduce(rig.gimbals, GIMBAL);
    rig.speak_for(SECOND, &[(rig.gimbals, GIMBAL)]);
    rig.world.run_for(5 * SECOND);
    assert_eq!(rig.world.snapshot().gimbals[0].state, "lost");
    rig.introduce(rig.peer, SECOND_GIMBAL);

    rig.speak_for(20 * SECOND, &[(rig.peer, SECOND_GIMBAL)]);

    assert_eq!(rig.managed(), [(191, "1/154".to_owned()), (192, "1/171".to_owned())]);
    assert_eq!(rig.world.snapshot().gimbals[0].state, "lost", "it is missed");
}

/// The entry follows its device however often it changes its id, also to one that it had before.
#[test]
fn d1_the_entry_follows_a_device_that_changes_its_component_id_again_and_again() {
    let entry = GimbalSettings::found("camera".to_owned());
    let mut rig = Rig::new(Settings { gimbals: vec![entry], ..three_links() });
    for turn in 0..4 {
        for device in [GIMBAL, SECOND_GIMBAL] {
            rig.introduce(rig.gimbals, device);
            rig.speak_for(5 * SECOND, &[(rig.gimbals, device)]);
            assert_eq!(rig.managed(), [(191, device.to_string())], "turn {turn}");
        }
    }
}

/// "Who came to its link since is told to stop", also who has no place of his own: the fifth takes that of a gimbal that
/// stands, so that the one that may be turning is still waited for, and may be the fifth.
#[test]
fn d1_the_place_of_a_gimbal_that_may_be_turning_is_the_last_to_be_given_up() {
    let mut rig = Rig::new(three_links());
    // Each with a number of its own.
    let introduce = |rig: &mut Rig, component: u8| {
        let information = device_information(rig.world.now, usual_capabilities());
        let information = GIMBAL_DEVICE_INFORMATION_DATA { uid: component.into(), ..information };
        let device = MavId::new(1, component);
        rig.world.send(rig.gimbals, device, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    };
    for component in [154, 171, 172, 173] {
        introduce(&mut rig, component);
    }
    let turn = command_long(MANAGER, 1000, &[NAN, NAN, 0.0, 10.0, 44.0, 0.0, 0.0]);
    assert_eq!(rig.world.result_of(rig.ground, GCS, &turn), Some(ACCEPTED));
    // All of them fall silent.
    rig.world.run_for(15 * SECOND);
    rig.world.forget();
    introduce(&mut rig, 174);
    rig.speak_for(2 * SECOND, &[(rig.gimbals, MavId::new(1, 174))]);

    let expected = [(191, "1/154"), (192, "1/174"), (193, "1/172"), (194, "1/173")];
    assert_eq!(rig.managed(), expected.map(|(manager, device)| (manager, device.to_owned())));
    let told: Vec<Setpoint> = rig.world.take_messages(rig.gimbals);
    let zeros: Vec<_> = told.iter().filter(|told| told.target_component == 174).collect();
    assert!(!zeros.is_empty() && zeros.len() == told.len(), "{told:?}");
    assert_eq!([zeros[0].angular_velocity_y, zeros[0].angular_velocity_z], [0.0, 0.0], "it is told to stop");
    assert_eq!(rig.world.stored_turning.first().map(String::as_str), Some("gimbal-154\t1/154"));
}

/// "Then one POWEROFF heartbeat" of each manager that there was: one that waits for a gimbal that never came never beat, and
/// says no goodbye.
#[test]
fn a_manager_that_never_spoke_says_no_goodbye() {
    let entries = [154, 171].map(|component| GimbalSettings {
        component_id: Some(component),
        ..GimbalSettings::found(format!("camera-{component}"))
    });
    let mut rig = Rig::new(Settings { gimbals: entries.to_vec(), ..three_links() });
    rig.introduce(rig.gimbals, GIMBAL);
    rig.speak_for(2 * SECOND, &[(rig.gimbals, GIMBAL)]);
    rig.world.forget();
    rig.world.input(Input::Shutdown);
    assert_eq!(rig.states(), [(191, 7)]);
}
