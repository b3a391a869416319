//! Several gimbals, and gimbals that come late, move, change their ids or share one (protocol notes 4.1, 4.2, 4.6).

mod ids;
mod kept_ids;

use std::time::Duration;

use gimbald::bridge::settings::{LinkSettings, Role, Settings, Transport};
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_SET_PITCHYAW_DATA,
    GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA, MavMessage,
};

use crate::support::script::{
    ACCEPTED, NAN, TEMPORARILY_REJECTED, command_long, device_information, device_status, gimbal_heartbeat, of,
    pitch_yaw_deg, px4_heartbeat, request_message, usual_capabilities,
};
use crate::support::world::{Arrival, GCS, GIMBAL, MANAGER, Place, World, link, three_links};

const SECOND: Duration = Duration::from_secs(1);
const TENTH: Duration = Duration::from_millis(100);
const SECOND_GIMBAL: MavId = MavId::new(1, 171);
const SECOND_MANAGER: MavId = MavId::new(1, 192);
const WHOLE_SYSTEM: MavId = MavId::new(1, 0);

type Setpoint = GIMBAL_DEVICE_SET_ATTITUDE_DATA;

/// D1: "A request to 191 concerns its gimbal only; a request to component 0 concerns all", with one answer from each
/// manager concerned. Protocol notes 4.1: "Id 0 in set-points/commands = every gimbal whose manager lives on the
/// addressed component".
#[test]
#[rustfmt::skip]
fn d1_a_command_concerns_the_gimbals_of_the_managers_it_names() {
    let both = &[MANAGER, SECOND_MANAGER][..];
    for (target, gimbal, answers, moved) in [
        (MANAGER,        0.0,   &[MANAGER][..],        &[154][..]),
        (MANAGER,        154.0, &[MANAGER],            &[154]),
        (SECOND_MANAGER, 0.0,   &[SECOND_MANAGER],     &[171]),
        (SECOND_MANAGER, 171.0, &[SECOND_MANAGER],     &[171]),
        (WHOLE_SYSTEM,   0.0,   both,                  &[154, 171]),
        (WHOLE_SYSTEM,   171.0, &[SECOND_MANAGER],     &[171]),
        (WHOLE_SYSTEM,   154.0, &[MANAGER],            &[154]),
        (WHOLE_SYSTEM,   99.0,  &[],                   &[]),
        (MavId::new(0, 0), 0.0, both,                  &[154, 171]),
    ] {
        let mut rig = Rig::two_gimbals();
        let command = command_long(target, 1000, &[-20.0, 0.0, NAN, NAN, 44.0, 0.0, gimbal]);

        let heard = rig.world.ask(rig.ground, GCS, &command);

        let acks: Vec<Arrival> = heard.into_iter().filter(|arrival| arrival.id() == ACK).collect();
        assert!(of::<COMMAND_ACK_DATA>(&acks).iter().all(|ack| (ack.command, ack.result) == (1000, ACCEPTED)));
        assert_eq!(acks.iter().map(Arrival::source).collect::<Vec<_>>(), answers, "{target}, gimbal {gimbal}");
        assert_eq!(rig.steered(rig.gimbals), moved, "{target}, gimbal {gimbal}");
    }
}

/// The same for messages, which are never answered: "Unknown id: … message → ignored".
#[test]
#[rustfmt::skip]
fn d1_a_message_concerns_the_gimbals_of_the_managers_it_names() {
    for (target, gimbal, moved) in [
        (MANAGER,        0,   &[154][..]),
        (MANAGER,        171, &[]),
        (SECOND_MANAGER, 171, &[171]),
        (WHOLE_SYSTEM,   0,   &[154, 171]),
        (WHOLE_SYSTEM,   171, &[171]),
        (WHOLE_SYSTEM,   6,   &[]),
    ] {
        let mut rig = Rig::two_gimbals();
        let message = MavMessage::GIMBAL_MANAGER_SET_PITCHYAW(GIMBAL_MANAGER_SET_PITCHYAW_DATA {
            flags: 44, pitch: -0.5, yaw: 0.0, pitch_rate: NAN, yaw_rate: NAN,
            target_system: target.system, target_component: target.component, gimbal_device_id: gimbal,
        });

        rig.world.ask(rig.ground, GCS, &message);

        assert_eq!(rig.steered(rig.gimbals), moved, "{target}, gimbal {gimbal}");
    }
}

/// Protocol checklist 40, and client checklist E16 with D1: one 280 for each gimbal, each from its manager.
#[test]
fn item_40_every_manager_that_is_asked_tells_of_its_gimbal() {
    let mut rig = Rig::two_gimbals();

    let heard = rig.world.ask(rig.ground, GCS, &request_message(WHOLE_SYSTEM, 280));

    let said: Vec<(MavId, u32)> = heard.iter().map(|arrival| (arrival.source(), arrival.id())).collect();
    assert_eq!(said, [(MANAGER, ACK), (MANAGER, 280), (SECOND_MANAGER, ACK), (SECOND_MANAGER, 280)]);
    let devices = of::<GIMBAL_MANAGER_INFORMATION_DATA>(&heard);
    assert_eq!(devices.iter().map(|told| told.gimbal_device_id).collect::<Vec<_>>(), [154, 171]);
}

/// D1: 154, 171, 172 and 173 have 191 to 194; "a fifth needs `manager_component_id`".
#[test]
fn d1_of_six_gimbals_four_are_managed_and_two_named() {
    let mut rig = Rig::new(three_links());
    for component in 171..=175 {
        rig.introduce(rig.gimbals, MavId::new(1, component));
    }
    rig.introduce(rig.gimbals, GIMBAL);

    let expected = [(191, "1/154"), (192, "1/171"), (193, "1/172"), (194, "1/173")];
    assert_eq!(rig.managed(), expected.map(|(manager, device)| (manager, device.to_owned())));
    let conflicts = rig.conflicts();
    assert_eq!(conflicts.len(), 2, "{conflicts:?}");
    for device in ["1/174", "1/175"] {
        assert!(conflicts.iter().any(|text| text.contains(device) && text.contains("manager_component_id")));
    }
}

/// With entries that say so, all six are managed, each by a component of its own.
#[test]
fn d1_six_gimbals_with_entries_are_all_managed() {
    let ids = [(154, 191), (171, 192), (172, 193), (173, 194), (174, 195), (175, 196)];
    let entries = ids.map(|(component, manager)| GimbalSettings {
        component_id: Some(component),
        manager_component_id: Some(manager),
        ..GimbalSettings::found(format!("camera-{component}"))
    });
    let mut rig = Rig::new(Settings { gimbals: entries.to_vec(), ..three_links() });
    for (component, _) in ids.iter().rev() {
        rig.introduce(rig.gimbals, MavId::new(1, *component));
    }

    assert_eq!(rig.managed(), ids.map(|(component, manager)| (manager, format!("1/{component}"))));
    assert_eq!(rig.conflicts(), [""; 0]);
    for (component, manager) in ids {
        let command = command_long(MavId::new(1, manager), 1000, &[-20.0, 0.0, NAN, NAN, 44.0, 0.0, 0.0]);
        assert_eq!(rig.world.result_of(rig.ground, GCS, &command), Some(ACCEPTED));
        assert_eq!(rig.steered(rig.gimbals), [component]);
    }
}

/// A manager goes to another gimbal only when its own is lost for good; who comes back in time finds it.
#[test]
fn d1_the_manager_of_a_lost_gimbal_waits_for_it() {
    let four = [154, 171, 172, 173].map(|component| MavId::new(1, component));
    let mut rig = Rig::new(three_links());
    for device in four {
        rig.introduce(rig.gimbals, device);
    }
    let others = [GIMBAL, MavId::new(1, 172), MavId::new(1, 173), MavId::new(1, 174)];
    rig.speak_for(9 * SECOND, &others.map(|device| (rig.gimbals, device)));
    assert_eq!(rig.managed()[1], (192, "1/171".to_owned()), "lost for 9 s");
    rig.introduce(rig.gimbals, MavId::new(1, 171));
    assert_eq!(rig.world.snapshot().gimbals[1].state, "alive");

    rig.speak_for(11 * SECOND, &others.map(|device| (rig.gimbals, device)));

    assert_eq!(rig.managed()[1], (192, "1/174".to_owned()));
}

/// Protocol notes 4.6: a gimbal is looked for for ever, and a client that was told to wait is told (A-24, as long as it
/// listens).
#[test]
fn item_26_a_gimbal_that_comes_after_ninety_seconds_is_found() {
    let mut rig = Rig::new(three_links());
    rig.world.run_for(90 * SECOND);
    rig.world.forget();

    rig.introduce(rig.gimbals, GIMBAL);

    let heard = rig.world.take(rig.ground);
    assert_eq!(of::<GIMBAL_MANAGER_INFORMATION_DATA>(&heard).len(), 1);
    assert_eq!(rig.managed(), [(191, "1/154".to_owned())]);
}

/// Protocol checklist 34 and 35, client checklist E124: a gimbal that falls silent on a line that stays up is lost, which
/// the heartbeat, 281 and the answers tell; its manager goes on answering. When it speaks again it is asked who it is, can
/// be used, and is not moved before somebody wants it.
#[test]
fn items_34_and_35_a_gimbal_lost_on_a_line_that_is_up_recovers() {
    let mut rig = Rig::new(three_links());
    rig.introduce(rig.gimbals, GIMBAL);
    let status = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { flags: 44, ..device_status(rig.world.now, 44, 0.0, 0.0) };
    rig.world.send(rig.gimbals, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    rig.steer_down(MANAGER);
    rig.speak_for(SECOND, &[(rig.gimbals, GIMBAL)]);
    let flags = |rig: &mut Rig| -> Vec<u32> {
        rig.world.take_messages::<GIMBAL_MANAGER_STATUS_DATA>(rig.ground).iter().map(|told| told.flags).collect()
    };
    assert!(flags(&mut rig).ends_with(&[44]));

    rig.world.run_for(4 * SECOND);
    assert!(flags(&mut rig).ends_with(&[0]), "no state of a gimbal that is not there");
    rig.world.run_for(SECOND);
    assert_eq!(rig.states(), [(191, 5)]);
    assert_eq!(rig.world.snapshot().links[1].state, "up");
    let down = command_long(MANAGER, 1000, &[-45.0, 0.0, NAN, NAN, 44.0, 0.0, 0.0]);
    assert_eq!(rig.world.result_of(rig.ground, GCS, &down), Some(FAILED));
    let take = command_long(MANAGER, 1001, &[255.0, 190.0, -1.0, -1.0, NAN, NAN, 154.0]);
    assert_eq!(rig.world.result_of(rig.ground, GCS, &take), Some(ACCEPTED), "ownership works");
    let heard = rig.world.ask(rig.ground, GCS, &request_message(MANAGER, 280));
    assert_eq!(of::<GIMBAL_MANAGER_INFORMATION_DATA>(&heard).len(), 1);

    rig.world.forget();
    rig.world.send(rig.gimbals, GIMBAL, &gimbal_heartbeat());
    let asked: Vec<COMMAND_LONG_DATA> = rig.world.take_messages(rig.gimbals);
    assert_eq!(asked.iter().map(|asked| (asked.command, asked.param1)).collect::<Vec<_>>(), [(512, 283.0)]);
    rig.introduce(rig.gimbals, GIMBAL);
    rig.speak_for(2 * SECOND, &[(rig.gimbals, GIMBAL)]);
    assert_eq!(rig.steered(rig.gimbals), [0; 0]);
    assert_eq!(rig.states().last(), Some(&(191, 4)));
    assert_eq!(rig.world.result_of(rig.ground, GCS, &down), Some(ACCEPTED));
    assert_eq!(rig.steered(rig.gimbals), [154]);
}

/// A device that is given another component id is the gimbal of the entry that names none: its manager stays, and
/// clients are told of the new id.
#[test]
fn d1_the_entry_follows_a_device_that_changes_its_component_id() {
    let entry = GimbalSettings::found("camera".to_owned());
    let mut rig = Rig::new(Settings { gimbals: vec![entry], ..three_links() });
    rig.introduce(rig.gimbals, GIMBAL);
    rig.speak_for(SECOND, &[(rig.gimbals, GIMBAL)]);
    rig.world.forget();

    rig.speak_for(4 * SECOND, &[(rig.gimbals, SECOND_GIMBAL)]);
    let ahead = command_long(MANAGER, 1000, &[0.0, 0.0, NAN, NAN, 44.0, 0.0, 0.0]);
    let too_early = rig.world.result_of(rig.ground, GCS, &ahead);
    assert_eq!(too_early, Some(TEMPORARILY_REJECTED), "what the former one could do is not known of this one");
    rig.introduce(rig.gimbals, SECOND_GIMBAL);

    assert_eq!(rig.managed(), [(191, "1/171".to_owned())]);
    let heard = rig.world.take(rig.ground);
    let told: Vec<u8> =
        of::<GIMBAL_MANAGER_INFORMATION_DATA>(&heard).iter().map(|told| told.gimbal_device_id).collect();
    assert_eq!(told, [171], "asked for anew, and told");
    rig.world.run_for(SECOND);
    let status: Vec<GIMBAL_MANAGER_STATUS_DATA> = rig.world.take_messages(rig.ground);
    assert!(status.len() >= 5 && status.iter().all(|status| status.gimbal_device_id == 171));
    assert_eq!(rig.conflicts(), [""; 0]);
}

/// … but a second gimbal beside it is a second one, however the entry is written.
#[test]
fn d1_a_second_gimbal_beside_an_entry_without_an_id_is_found() {
    let entry = GimbalSettings::found("camera".to_owned());
    let mut rig = Rig::new(Settings { gimbals: vec![entry], ..three_links() });

    rig.speak_for(2 * SECOND, &[(rig.gimbals, SECOND_GIMBAL), (rig.gimbals, GIMBAL)]);

    assert_eq!(rig.managed(), [(191, "1/171".to_owned()), (192, "1/154".to_owned())]);
}

/// A device without an entry that is given another component id has the manager of that id (D1), and nobody misses the
/// former one: it is known again by its number.
#[test]
fn d1_a_found_device_that_changes_its_component_id_is_not_missed_under_the_old_one() {
    let mut rig = Rig::new(three_links());
    rig.introduce(rig.gimbals, GIMBAL);
    rig.speak_for(SECOND, &[(rig.gimbals, GIMBAL)]);
    rig.world.run_for(SECOND);
    rig.introduce(rig.gimbals, SECOND_GIMBAL);
    rig.speak_for(5 * SECOND, &[(rig.gimbals, SECOND_GIMBAL)]);

    assert_eq!(rig.managed(), [(192, "1/171".to_owned())]);
    rig.world.forget();
    rig.speak_for(SECOND, &[(rig.gimbals, SECOND_GIMBAL)]);
    assert_eq!(rig.states(), [(191, 3), (192, 4)], "191 has no gimbal, and lost none");
}

/// Two gimbals of the same make may have the same number: one that was heard beside the other is another.
#[test]
fn d1_a_gimbal_that_is_lost_is_missed_whatever_its_number() {
    let mut rig = Rig::two_gimbals();
    rig.speak_for(SECOND, &[(rig.gimbals, GIMBAL), (rig.gimbals, SECOND_GIMBAL)]);

    rig.speak_for(5 * SECOND, &[(rig.gimbals, SECOND_GIMBAL)]);

    assert_eq!(rig.managed(), [(191, "1/154".to_owned()), (192, "1/171".to_owned())]);
    assert_eq!(rig.world.snapshot().gimbals[0].state, "lost");
    rig.world.forget();
    rig.speak_for(SECOND, &[(rig.gimbals, SECOND_GIMBAL)]);
    assert_eq!(rig.states(), [(191, 5), (192, 4)]);
}

/// An entry that names the component is kept for it; what has happened is told.
#[test]
fn d1_the_entry_of_a_device_that_changed_its_id_is_named() {
    let entry = GimbalSettings { component_id: Some(154), ..GimbalSettings::found("camera".to_owned()) };
    let mut rig = Rig::new(Settings { gimbals: vec![entry], ..three_links() });
    rig.introduce(rig.gimbals, GIMBAL);
    rig.world.run_for(SECOND);
    rig.introduce(rig.gimbals, SECOND_GIMBAL);
    rig.speak_for(5 * SECOND, &[(rig.gimbals, SECOND_GIMBAL)]);

    assert_eq!(rig.managed(), [(191, "1/154".to_owned()), (192, "1/171".to_owned())]);
    let conflicts = rig.conflicts();
    assert!(conflicts.len() == 1 && conflicts[0].contains("component_id = 154"), "{conflicts:?}");
}

/// A gimbal that is plugged in elsewhere is driven there as soon as it is lost where it was: at once when that channel
/// is closed, else after 3 s. It is no conflict.
#[test]
fn a_gimbal_that_moves_to_another_link_is_driven_there() {
    for (unplugged, found_after_ms) in [(true, 0), (false, 2_900)] {
        let mut rig = Rig::new(four_links());
        rig.introduce(rig.gimbals, GIMBAL);
        rig.speak_for(SECOND, &[(rig.gimbals, GIMBAL)]);
        rig.steer_down(MANAGER);
        // The last was heard a tenth of a second before.
        let silent_since = rig.world.now;
        if unplugged {
            rig.world.unplug(rig.gimbals);
        }
        rig.world.forget();

        while !rig.conducts(rig.peer) && rig.world.now - silent_since < 10 * SECOND {
            rig.speak_for(TENTH, &[(rig.peer, GIMBAL)]);
            rig.introduce(rig.peer, GIMBAL);
        }

        let took = rig.world.now - silent_since;
        let expected = Duration::from_millis(found_after_ms);
        assert!((expected..=expected + 2 * TENTH).contains(&took), "{took:?}");
        assert_eq!(rig.managed(), [(191, "1/154".to_owned())]);
        assert_eq!(rig.conflicts(), [""; 0], "unplugged: {unplugged}");
    }
}

/// Of two devices with the same id on two links the first is managed and the other named, with what to do; nothing of
/// the second is believed, and it is told nothing.
#[test]
fn of_two_devices_under_one_id_the_first_is_managed() {
    let mut rig = Rig::twins();
    assert_eq!(rig.managed(), [(191, "1/154".to_owned())]);
    let conflicts = rig.conflicts();
    assert!(
        conflicts.len() == 1
            && ["link gimbal", "link payload", "another component id"].iter().all(|text| conflicts[0].contains(text)),
        "{conflicts:?}"
    );
    rig.world.forget();

    // The first looks straight ahead, the other far aside; what cannot be reached there can be here.
    for _ in 0..50 {
        rig.look(rig.gimbals, 0.0, 0.0);
        rig.look(rig.peer, -70.0, 100.0);
        let mut information = device_information(rig.world.now, usual_capabilities());
        (information.pitch_min, information.pitch_max) = (-0.1, 0.1);
        rig.world.send(rig.peer, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
        rig.world.run_for(TENTH);
        let snapshot = rig.world.snapshot();
        assert_eq!(snapshot.gimbals[0].attitude.yaw_vehicle_deg.map(f64::round), Some(0.0));
    }
    rig.steer_down(MANAGER);
    rig.speak_for(SECOND, &[(rig.gimbals, GIMBAL), (rig.peer, GIMBAL)]);

    let told: Vec<Setpoint> = rig.world.take_messages(rig.gimbals);
    assert!(told.len() >= 20 && told.iter().all(|told| (pitch_yaw_deg(told.q).0 + 45.0).abs() < 0.01));
    let other = rig.world.take(rig.peer);
    assert!(other.iter().all(|arrival| ![284, COMMAND_LONG].contains(&arrival.id())), "it is told and asked nothing");
}

/// Two UDP peers of one link may be two such devices as well.
#[test]
fn of_two_devices_under_one_id_on_one_link_the_first_is_managed() {
    let mut rig = Rig::new(three_links());
    rig.peer = rig.world.open(1);
    rig.introduce(rig.gimbals, GIMBAL);
    rig.speak_for(2 * SECOND, &[(rig.gimbals, GIMBAL), (rig.peer, GIMBAL)]);

    let conflicts = rig.conflicts();
    assert!(conflicts.len() == 1 && conflicts[0].contains("both on link gimbal"), "{conflicts:?}");
    assert!(rig.conducts(rig.gimbals) && !rig.conducts(rig.peer));
}

/// R21: clients, who cannot tell them apart either, see the first only; with `firewall = "warn"` both.
#[test]
fn of_two_devices_under_one_id_clients_see_the_one_that_is_managed() {
    use gimbald::manager::settings::{ControlSettings, Firewall};
    for (firewall, expected) in [(Firewall::On, vec![0.0; 10]), (Firewall::Warn, [0.0, 100.0].repeat(10))] {
        let control = ControlSettings { firewall, ..ControlSettings::default() };
        let mut rig = Rig::twins_with(Settings { control, ..four_links() });
        rig.world.forget();

        for _ in 0..10 {
            rig.look(rig.gimbals, 0.0, 0.0);
            rig.look(rig.peer, -70.0, 100.0);
            rig.world.run_for(TENTH);
        }
        let information =
            MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(rig.world.now, usual_capabilities()));
        rig.world.send(rig.peer, GIMBAL, &information);

        let heard = rig.world.take(rig.ground);
        let yaws: Vec<f64> = of::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>(&heard)
            .iter()
            .map(|status| pitch_yaw_deg(status.q).1.round())
            .collect();
        assert_eq!(yaws, expected);
        let informed = of::<GIMBAL_DEVICE_INFORMATION_DATA>(&heard).len();
        assert_eq!(informed, usize::from(firewall == Firewall::Warn));
        let dropped = rig.world.snapshot().links[3].dropped.get("not_the_gimbal").copied();
        assert_eq!(dropped, (firewall == Firewall::On).then_some(11));
    }
}

/// When the first is lost for good the second takes its place, and keeps it: they never alternate.
#[test]
fn of_two_devices_under_one_id_the_second_comes_next_and_stays() {
    let mut rig = Rig::twins();
    let (first, second) = ((rig.gimbals, GIMBAL), (rig.peer, GIMBAL));

    rig.speak_for(9 * SECOND, &[second]);
    assert!(!rig.conducts(rig.peer), "the first may come back");
    rig.speak_for(SECOND, &[first, second]);
    assert!(rig.conducts(rig.gimbals), "it did");

    rig.speak_for(11 * SECOND, &[second]);
    assert!(rig.conducts(rig.peer));
    // It is asked who it is, as it comes after another.
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(rig.world.now, usual_capabilities()));
    rig.world.send(rig.peer, GIMBAL, &information);
    for _ in 0..30 {
        rig.speak_for(SECOND, &[first, second]);
        assert!(rig.conducts(rig.peer) && !rig.conducts(rig.gimbals));
    }
}

/// A link that is interrupted now and then does not make them alternate either.
#[test]
fn of_two_devices_under_one_id_a_gap_of_the_first_changes_nothing() {
    let mut rig = Rig::twins();
    for _ in 0..10 {
        rig.speak_for(6 * SECOND, &[(rig.peer, GIMBAL)]);
        rig.speak_for(2 * SECOND, &[(rig.gimbals, GIMBAL), (rig.peer, GIMBAL)]);
        assert!(rig.conducts(rig.gimbals) && !rig.conducts(rig.peer));
    }
}

/// Two devices of different systems with one component id on one line are two gimbals, and neither takes the other's
/// place however they alternate.
#[test]
fn two_systems_with_one_component_id_on_one_line_are_two_gimbals() {
    let foreign = MavId::new(42, 154);
    for [first, second] in [[GIMBAL, foreign], [foreign, GIMBAL]] {
        let mut rig = Rig::new(three_links());
        rig.introduce(rig.gimbals, first);
        rig.speak_for(2 * SECOND, &[(rig.gimbals, first), (rig.gimbals, second)]);

        // The one on the vehicle's system id has its manager, whoever came first.
        let expected = [(191, "1/154".to_owned()), (192, "42/154".to_owned())];
        for _ in 0..20 {
            assert_eq!(rig.managed(), expected, "{first} first");
            rig.speak_for(SECOND, &[(rig.gimbals, second), (rig.gimbals, first)]);
        }
        assert_eq!(rig.conflicts().len(), 1, "42/154 is not on the vehicle's system id");
    }
}

/// "If the gimbal shows up with a foreign system id … warn", for as long as it has it; on a link that is not one of
/// gimbals it is not driven, and where ground stations are it is another vehicle's.
#[test]
fn item_25_a_foreign_system_id_is_told_as_long_as_it_lasts() {
    let foreign = MavId::new(42, 154);
    for (at, managed, told) in [("gimbal", true, true), ("peer", false, true), ("ground", false, false)] {
        let mut rig = Rig::new(four_links());
        let place = match at {
            "gimbal" => rig.gimbals,
            "peer" => rig.peer,
            _ => rig.ground,
        };
        rig.introduce(place, foreign);
        rig.speak_for(40 * SECOND, &[(place, foreign)]);

        let expected = if managed { vec![(191, "42/154".to_owned())] } else { vec![] };
        assert_eq!(rig.managed(), expected, "on link {at}");
        let conflicts = rig.conflicts();
        assert_eq!(conflicts.len(), usize::from(told), "{conflicts:?}");
        assert!(conflicts.iter().all(|text| text.contains("42/154") && text.contains("not managed") != managed));
    }
    // Beside its own autopilot it is that vehicle's.
    let mut rig = Rig::new(four_links());
    rig.world.send(rig.peer, MavId::new(42, 1), &px4_heartbeat());
    rig.introduce(rig.peer, foreign);
    assert_eq!((rig.managed(), rig.conflicts()), (vec![], vec![]));
}

/// Protocol checklist 32, and D2: "Any other gimbal: 1..6 … and the manager's component sends its 283 and 285 with that
/// id". A component that beats as a gimbal and speaks of such a one manages it itself: it is none of ours, and its 280
/// and 281 are the only ones there are of it.
#[test]
fn item_32_a_component_with_a_gimbal_of_its_own_is_left_to_itself() {
    for at in ["gimbal", "peer"] {
        let mut rig = Rig::new(four_links());
        let place = if at == "gimbal" { rig.gimbals } else { rig.peer };
        let status =
            GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { gimbal_device_id: 1, ..device_status(rig.world.now, 44, 0.0, 0.0) };
        rig.world.send(place, GIMBAL, &gimbal_heartbeat());
        for _ in 0..3 {
            rig.world.send(place, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status.clone()));
            rig.world.run_for(SECOND);
            rig.world.send(place, GIMBAL, &gimbal_heartbeat());
        }
        rig.world.forget();

        let own = MavMessage::GIMBAL_MANAGER_STATUS(GIMBAL_MANAGER_STATUS_DATA {
            time_boot_ms: 1,
            flags: 12,
            gimbal_device_id: 1,
            primary_control_sysid: 0,
            primary_control_compid: 0,
            secondary_control_sysid: 0,
            secondary_control_compid: 0,
        });
        let sent = rig.world.send(place, GIMBAL, &own);

        assert!(rig.world.take(rig.ground).iter().any(|arrival| arrival.bytes == sent), "on link {at}");
        assert_eq!((rig.managed(), rig.conflicts()), (vec![], vec![]), "on link {at}");
        rig.world.run_for(5 * SECOND);
        let beats: Vec<HEARTBEAT_DATA> = rig.world.take_messages(rig.ground);
        assert!(beats.iter().all(|beat| beat.system_status == 3), "no gimbal of ours was lost");

        // When it turns out to be a device after all, it is one.
        rig.introduce(place, GIMBAL);
        assert_eq!(rig.managed(), [(191, "1/154".to_owned())]);
    }
}

const ACK: u32 = 77;
const FAILED: u8 = 4;
const COMMAND_LONG: u32 = 76;

/// [`three_links`] and a fourth to something else, `payload`.
fn four_links() -> Settings {
    let mut settings = three_links();
    settings.links.push(LinkSettings { ..link("payload", Role::Peer, Transport::Datagrams) });
    settings
}

/// A world of scripted gimbals.
struct Rig {
    world: World,
    gimbals: Place,
    ground: Place,
    /// The fourth link where there is one, else the autopilot's.
    peer: Place,
}

impl Rig {
    fn new(settings: Settings) -> Self {
        let (mut world, places) = World::new(settings);
        world.run_for(SECOND / 2);
        let peer = places.get(3).copied().unwrap_or(places[0]);
        let mut rig = Self { world, gimbals: places[1], ground: places[2], peer };
        rig.world.forget();
        rig
    }

    /// 154 and 171 on the link of gimbals.
    fn two_gimbals() -> Self {
        let mut rig = Self::new(three_links());
        for device in [GIMBAL, SECOND_GIMBAL] {
            rig.introduce(rig.gimbals, device);
        }
        rig.world.forget();
        rig
    }

    /// 154 on the link of gimbals, and another 154 on the fourth link.
    fn twins() -> Self {
        Self::twins_with(four_links())
    }

    fn twins_with(settings: Settings) -> Self {
        let mut rig = Self::new(settings);
        rig.introduce(rig.gimbals, GIMBAL);
        rig.speak_for(2 * SECOND, &[(rig.gimbals, GIMBAL), (rig.peer, GIMBAL)]);
        rig
    }

    /// A heartbeat and 283.
    fn introduce(&mut self, place: Place, device: MavId) {
        self.world.send(place, device, &gimbal_heartbeat());
        let information = device_information(self.world.now, usual_capabilities());
        self.world.send(place, device, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    }

    /// 285 of 154 at `place`.
    fn look(&mut self, place: Place, pitch_deg: f64, yaw_deg: f64) {
        let status = device_status(self.world.now, 44, pitch_deg, yaw_deg);
        self.world.send(place, GIMBAL, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    }

    /// Time passes while these gimbals beat ten times a second.
    fn speak_for(&mut self, duration: Duration, speakers: &[(Place, MavId)]) {
        let beat = |(place, device): &(Place, MavId)| (TENTH, *place, *device, gimbal_heartbeat());
        let repeated: Vec<_> = speakers.iter().map(beat).collect();
        self.world.run_with(duration, &repeated);
    }

    /// Managers and their devices.
    fn managed(&self) -> Vec<(u8, String)> {
        let gimbals = self.world.snapshot().gimbals.into_iter();
        let mut managed: Vec<(u8, String)> =
            gimbals.filter_map(|gimbal| Some((gimbal.manager_component_id, gimbal.device?))).collect();
        managed.sort();
        managed
    }

    /// The devices that were sent a setpoint at `place`.
    fn steered(&mut self, place: Place) -> Vec<u8> {
        let setpoints: Vec<Setpoint> = self.world.take_messages(place);
        assert!(setpoints.iter().all(|setpoint| setpoint.target_system == 1));
        setpoints.iter().map(|setpoint| setpoint.target_component).collect()
    }

    fn steer_down(&mut self, manager: MavId) {
        let command = command_long(manager, 1000, &[-45.0, 0.0, NAN, NAN, 44.0, 0.0, 0.0]);
        self.world.send(self.ground, GCS, &command);
    }

    /// Whether a demand reaches a gimbal at `place`.
    fn conducts(&mut self, place: Place) -> bool {
        self.world.forget();
        self.steer_down(MANAGER);
        !self.steered(place).is_empty()
    }

    fn conflicts(&self) -> Vec<String> {
        self.world.snapshot().conflicts
    }

    /// Components and states of our heartbeats at the ground.
    fn states(&mut self) -> Vec<(u8, u8)> {
        let heard = self.world.take(self.ground).into_iter().filter(|arrival| arrival.source().component > 190);
        let beats = heard.filter(|arrival| arrival.id() == 0);
        beats.map(|beat| (beat.source().component, beat.decode::<HEARTBEAT_DATA>().system_status)).collect()
    }
}
