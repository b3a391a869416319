//! "Our ids must be stable: PX4 latches (sysid, compid, device id) for good" (notes on peers 2.2): a gimbal without an entry
//! has the ids that an earlier run gave it, whichever is found first.

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::detection::V1_BY_ITS_SILENCE_AFTER;
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, MavMessage};

use super::{Rig, SECOND, four_links};
use crate::support::script::{device_status, gimbal_heartbeat};
use crate::support::world::{GIMBAL, three_links};

/// Gimbals that have no manager by their ids.
const A: MavId = MavId::new(1, 70);
const B: MavId = MavId::new(1, 77);
const C: MavId = MavId::new(1, 80);
const NEW: MavId = MavId::new(1, 90);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Only beats.
    V1,
    V2,
}

/// Device, manager, and device id.
type Given = (String, u8, Option<u8>);

/// The daemon starts on these, with what an earlier run kept, and finds the gimbals one after the other.
fn flight(kept: &[String], entries: &[GimbalSettings], devices: &[MavId], kind: Kind) -> (Rig, Vec<Given>) {
    let settings = Settings { kept_ids: kept.to_vec(), gimbals: entries.to_vec(), ..three_links() };
    let mut rig = Rig::new(settings);
    for count in 1..=devices.len() {
        if kind == Kind::V2 {
            rig.introduce(rig.gimbals, devices[count - 1]);
        }
        let speakers: Vec<_> = devices[..count].iter().map(|device| (rig.gimbals, *device)).collect();
        rig.speak_for(SECOND, &speakers);
    }
    let speakers: Vec<_> = devices.iter().map(|device| (rig.gimbals, *device)).collect();
    // One that waits until the known ones had their time is found out after that.
    rig.speak_for(V1_BY_ITS_SILENCE_AFTER + 12 * SECOND, &speakers);
    let given = given(&rig);
    (rig, given)
}

fn given(rig: &Rig) -> Vec<Given> {
    let gimbals = rig.world.snapshot().gimbals.into_iter();
    let mut given: Vec<Given> =
        gimbals.filter_map(|gimbal| Some((gimbal.device?, gimbal.manager_component_id, gimbal.device_id))).collect();
    given.sort();
    given
}

fn kept(rig: &Rig) -> Vec<String> {
    rig.world.stored_gimbal_ids.last().cloned().unwrap_or_default()
}

fn lines(lines: &[&str]) -> Vec<String> {
    lines.iter().map(|line| (*line).to_owned()).collect()
}

fn expected(given: &[(MavId, u8, u8)]) -> Vec<Given> {
    given.iter().map(|(device, manager, id)| (device.to_string(), *manager, Some(*id))).collect()
}

#[test]
fn every_gimbal_has_the_ids_of_the_first_start_whichever_is_found_first() {
    for kind in [Kind::V1, Kind::V2] {
        let (first, given) = flight(&[], &[], &[A, B, C], kind);
        let ids = match kind {
            Kind::V1 => [1, 2, 3],
            Kind::V2 => [70, 77, 80],
        };
        assert_eq!(given, expected(&[(A, 192, ids[0]), (B, 193, ids[1]), (C, 194, ids[2])]));
        let stored = match kind {
            Kind::V1 => ["1/70\t192\t1", "1/77\t193\t2", "1/80\t194\t3"],
            Kind::V2 => ["1/70\t192\t-", "1/77\t193\t-", "1/80\t194\t-"],
        };
        assert_eq!(kept(&first), stored);
        for order in [[A, C, B], [B, A, C], [B, C, A], [C, A, B], [C, B, A]] {
            let (next, again) = flight(&kept(&first), &[], &order, kind);
            assert_eq!(again, given, "{kind:?} {order:?}");
            assert_eq!(next.world.stored_gimbal_ids, Vec::<Vec<String>>::new(), "nothing is new: {order:?}");
        }
    }
}

/// The managers of 154 and 171 to 173 follow from their ids, the device ids of v1 gimbals under these do not.
#[test]
fn v1_gimbals_under_the_usual_ids_keep_their_device_ids() {
    let usual = [GIMBAL, MavId::new(1, 171), MavId::new(1, 172)];
    let (first, given) = flight(&[], &[], &usual, Kind::V1);
    assert_eq!(given, expected(&[(usual[0], 191, 1), (usual[1], 192, 2), (usual[2], 193, 3)]));
    let (_, again) = flight(&kept(&first), &[], &[usual[2], usual[1], usual[0]], Kind::V1);
    assert_eq!(again, given);
}

#[test]
fn a_new_gimbal_takes_no_id_of_one_that_is_found_after_it() {
    for kind in [Kind::V1, Kind::V2] {
        let (first, given) = flight(&[], &[], &[A, B], kind);
        let (second, more) = flight(&kept(&first), &[], &[NEW, B, A], kind);
        assert_eq!(more[..2], given);
        let id = if kind == Kind::V1 { 3 } else { 90 };
        assert_eq!(more[2], ("1/90".to_owned(), 194, Some(id)));
        let (_, last) = flight(&kept(&second), &[], &[A, NEW, B], kind);
        assert_eq!(last, more);
    }
}

/// "171 has 192" by its id, but another has that, also while it is not found yet.
#[test]
fn the_manager_of_a_known_gimbal_goes_to_none_that_has_it_by_its_id() {
    let usual = MavId::new(1, 171);
    let (first, given) = flight(&[], &[], &[A], Kind::V2);
    assert_eq!(given, expected(&[(A, 192, 70)]));
    for order in [[A, usual], [usual, A]] {
        let (second, more) = flight(&kept(&first), &[], &order, Kind::V2);
        assert_eq!(more, expected(&[(usual, 193, 171), (A, 192, 70)]), "{order:?}");
        let (_, last) = flight(&kept(&second), &[], &[usual, A], Kind::V2);
        assert_eq!(last, more);
    }
}

/// Four managers are too few for all that ever were there: one that is not found any more gives up its own, but nobody does who
/// is only found later.
#[test]
fn a_new_gimbal_has_the_ids_of_one_that_is_gone_when_none_are_left() {
    for order in [[NEW, A, B], [NEW, B, A], [A, NEW, B]] {
        let (first, given) = flight(&[], &[], &[C, A, B], Kind::V1);
        assert_eq!(given, expected(&[(A, 193, 2), (B, 194, 3), (C, 192, 1)]));
        let (second, more) = flight(&kept(&first), &[], &order, Kind::V1);
        assert_eq!(more, expected(&[(A, 193, 2), (B, 194, 3), (NEW, 192, 4)]), "{order:?}");
        assert!(kept(&second).contains(&"1/80\t-\t1".to_owned()), "{:?}", kept(&second));
        let (_, last) = flight(&kept(&second), &[], &[NEW, B, A], Kind::V1);
        assert_eq!(last, more);
    }
}

/// A new one is no worse off for what was there before: under 154 it has 191, at once, and any has a device id.
#[test]
fn a_lone_gimbal_has_its_ids_whatever_was_there_before() {
    let full = lines(&["1/70\t192\t1", "1/77\t193\t2", "1/80\t194\t3", "1/81\t-\t4", "1/82\t-\t5", "1/83\t-\t6"]);
    let none = Vec::new();
    for (known, device, manager) in [
        (&none, GIMBAL, 191),
        (&none, MavId::new(1, 173), 194),
        (&none, NEW, 192),
        (&full, GIMBAL, 191),
        (&full, NEW, 192),
    ] {
        let (rig, given) = flight(known, &[], &[device], Kind::V1);
        assert_eq!(given, expected(&[(device, manager, 1)]), "{device}");
        assert!(kept(&rig).contains(&format!("{device}\t{manager}\t1")), "{:?}", kept(&rig));
    }
    let mut rig = Rig::new(Settings { kept_ids: full, ..three_links() });
    rig.introduce(rig.gimbals, GIMBAL);
    assert_eq!(rig.managed(), [(191, "1/154".to_owned())]);
}

/// "Entries of the configuration always come first": what an entry has that was written later is no other's any more, and who
/// had it has its new ids from then on.
#[test]
fn an_entry_that_is_added_later_comes_first() {
    let (first, given) = flight(&[], &[], &[A, B, C], Kind::V1);
    assert_eq!(given, expected(&[(A, 192, 1), (B, 193, 2), (C, 194, 3)]));
    let entry = GimbalSettings {
        family: Family::MavlinkV1,
        component_id: Some(B.component),
        manager_component_id: Some(192),
        ..GimbalSettings::found("camera".to_owned())
    };
    for order in [[A, B, C], [C, B, A], [B, A, C]] {
        let (second, more) = flight(&kept(&first), std::slice::from_ref(&entry), &order, Kind::V1);
        // What B had is free, and no manager stands on 191 where an entry says which.
        assert_eq!(more, expected(&[(A, 191, 2), (B, 192, 1), (C, 194, 3)]), "{order:?}");
        let mut reversed = order;
        reversed.reverse();
        let (_, last) = flight(&kept(&second), std::slice::from_ref(&entry), &reversed, Kind::V1);
        assert_eq!(last, more);
    }
}

/// A line that nobody wrote spoils no other, and a file of anything keeps no gimbal from being managed.
#[test]
fn a_damaged_file_spoils_no_more_than_its_bad_lines() {
    let damaged =
        lines(&["", "\u{fffd}\0", "1/80\t192", "1/77\t193\t2", "camera\t1/70", "1/70\t250\t9", "1/70\t194\t5"]);
    let (rig, given) = flight(&damaged, &[], &[C, B, A], Kind::V1);
    assert_eq!(given, expected(&[(A, 194, 5), (B, 193, 2), (C, 192, 1)]));
    assert_eq!(kept(&rig), ["1/77\t193\t2", "1/70\t194\t5", "1/80\t192\t1"]);

    let anything: Vec<String> =
        (0..1_000).map(|at| format!("{}/{}\t{}\t{}", 1 + at % 9, 100 + at % 150, 191 + at % 4, 1 + at % 6)).collect();
    let (rig, given) = flight(&anything, &[], &[A, B, C], Kind::V1);
    let mut ids: Vec<_> = given.iter().map(|(_, manager, id)| (*manager, *id)).collect();
    ids.sort();
    ids.dedup();
    assert_eq!((given.len(), ids.len()), (3, 3), "{given:?}");
    assert!(kept(&rig).len() <= 10, "{:?}", kept(&rig));
}

/// "A device that takes the vehicle's system id is the one we had", and the vehicle's may be another at the next start.
#[test]
fn a_gimbal_in_another_system_has_the_ids_that_it_had() {
    let known = lines(&["7/70\t193\t2", "7/77\t192\t1"]);
    for order in [[A, B], [B, A]] {
        let (_, given) = flight(&known, &[], &order, Kind::V1);
        assert_eq!(given, expected(&[(A, 193, 2), (B, 192, 1)]), "{order:?}");
    }
    let mut rig = Rig::new(Settings { kept_ids: known, ..three_links() });
    for device in [MavId::new(42, 70), A] {
        rig.introduce(rig.gimbals, device);
        rig.speak_for(5 * SECOND, &[(rig.gimbals, device)]);
        assert_eq!(rig.managed(), [(193, device.to_string())]);
    }
    assert_eq!(kept(&rig), ["7/77\t192\t1", "1/70\t193\t2"]);
}

/// Two gimbals of one component id, in two systems and on one line or two, are told apart by the system.
#[test]
fn two_systems_with_one_component_id_keep_a_manager_each() {
    let foreign = MavId::new(42, 154);
    let mut known = Vec::new();
    for (is_foreign_first, on_one_line) in [(false, false), (true, false), (false, true), (true, true)] {
        let mut rig = Rig::new(Settings { kept_ids: known.clone(), ..four_links() });
        let place = if on_one_line { rig.gimbals } else { rig.peer };
        let mut found = [(place, GIMBAL), (rig.gimbals, foreign)];
        if is_foreign_first {
            found.reverse();
        }
        for count in [1, 2] {
            rig.introduce(found[count - 1].0, found[count - 1].1);
            rig.speak_for(2 * SECOND, &found[..count]);
        }
        assert_eq!(rig.managed(), [(191, "1/154".to_owned()), (192, "42/154".to_owned())]);
        if known.is_empty() {
            known = kept(&rig);
        }
        assert_eq!(known, ["1/154\t191\t-", "42/154\t192\t-"]);
    }
}

/// What turns out to manage a gimbal of its own is none of ours, and has no ids.
#[test]
fn who_manages_a_gimbal_of_its_own_has_no_ids() {
    let mut rig = Rig::new(three_links());
    rig.world.send(rig.gimbals, A, &gimbal_heartbeat());
    assert_eq!(kept(&rig), ["1/70\t192\t-"]);
    let status =
        GIMBAL_DEVICE_ATTITUDE_STATUS_DATA { gimbal_device_id: 1, ..device_status(rig.world.now, 44, 0.0, 0.0) };
    rig.world.send(rig.gimbals, A, &MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    assert_eq!(kept(&rig), [""; 0]);
}
