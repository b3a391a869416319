//! D10: "284, 204, 205 and 220 from others to a managed device are not delivered and are counted (`firewall = "warn"`
//! lets them pass); a device's own 280/281 do not leave their link".

use gimbald::bridge::settings::{Settings, SystemId};
use gimbald::manager::settings::{ControlSettings, Firewall};

use super::*;
use crate::support::world::{AUTOPILOT, GIMBAL};

const SET_ATTITUDE: u32 = 284;
const MOUNT_CONFIGURE: u32 = 156;
const MOUNT_CONTROL: u32 = 157;

fn rig(firewall: Firewall) -> Rig {
    let control = ControlSettings { firewall, ..ControlSettings::default() };
    let mut rig = Rig::with(Settings { system_id: SystemId::Fixed(1), control, ..Settings::default() });
    rig.introduce("autopilot", AUTOPILOT);
    rig.introduce("gimbal", GIMBAL);
    rig
}

/// Setpoints and mount commands of an autopilot, as ArduPilot (directed) and PX4 (to 1/0 and 0/0) send them, and who
/// gets them when nothing is kept away.
fn steering() -> Vec<(Vec<u8>, &'static [&'static str])> {
    let mut frames: Vec<(Vec<u8>, &'static [&'static str])> = Vec::new();
    let all = &["gimbal", "ground", "radio", "peer"][..];
    for (target, receivers) in [((1, 154), &["gimbal"][..]), ((1, 0), &["gimbal"]), ((0, 0), all)] {
        frames.push((addressed(AUTOPILOT, SET_ATTITUDE, target), receivers));
        if target != (1, 0) && target != (0, 0) {
            // What older autopilots say; to everybody no gimbal's link gets it anyway (R18).
            frames.push((addressed(AUTOPILOT, MOUNT_CONFIGURE, target), receivers));
            frames.push((addressed(AUTOPILOT, MOUNT_CONTROL, target), receivers));
        }
        for number in [204, 205, 220] {
            frames.push((command(AUTOPILOT, COMMAND_LONG, number, target), receivers));
            frames.push((command(AUTOPILOT, COMMAND_INT, number, target), receivers));
        }
    }
    frames
}

/// Protocol checklist 153: "When 284 or 205 for S/154 arrives from outside and `conflict = firewall`, it is not sent to
/// the gimbal link and is counted".
#[test]
fn item_153_nobody_else_steers_a_managed_gimbal() {
    let mut rig = rig(Firewall::On);
    for (count, (bytes, receivers)) in steering().into_iter().enumerate() {
        let others: Vec<_> = receivers.iter().copied().filter(|name| *name != "gimbal").collect();
        assert_eq!(rig.deliver_amid_ours("autopilot", &bytes), others, "{bytes:02x?}");
        assert_eq!(rig.dropped("gimbal", "firewall"), count as u64 + 1);
    }
    let conflicts = rig.world.snapshot().conflicts;
    assert!(conflicts.len() == 1 && conflicts[0].contains("MNT_MODE_IN"), "{conflicts:?}");
    assert_eq!(rig.dropped("gimbal", "not_for_gimbal"), 0);
}

/// Protocol checklist 153: "with `warn` it is forwarded", however it is addressed.
#[test]
fn item_153_with_warn_it_is_forwarded_and_told() {
    let mut rig = rig(Firewall::Warn);
    for (bytes, receivers) in steering() {
        assert_eq!(rig.deliver_amid_ours("autopilot", &bytes), receivers, "{bytes:02x?}");
    }
    assert_eq!(rig.world.snapshot().links[1].dropped_frames, 0);
    let conflicts = rig.world.snapshot().conflicts;
    assert!(conflicts.len() == 1 && conflicts[0].contains("fight with ours"), "{conflicts:?}");
}

/// D5: "Nothing moves the gimbal that did not pass" the gate: a gimbal may know the commands to managers as well. Everybody
/// else gets them, and so does a gimbal that is named.
#[test]
fn d5_what_is_said_to_every_manager_reaches_no_gimbal() {
    for number in [195, 196, 197, 198, 201, 1000, 1001] {
        for form in [COMMAND_LONG, COMMAND_INT] {
            let mut rig = rig(Firewall::On);
            for (count, target) in [(1, 0), (0, 0)].into_iter().enumerate() {
                let told = rig.deliver_amid_ours("ground", &command(GROUND, form, number, target));
                assert!(told.contains(&"autopilot") && !told.contains(&"gimbal"), "{number} {target:?} {told:?}");
                assert_eq!(rig.dropped("gimbal", "firewall"), count as u64 + 1);
            }
            assert_eq!(rig.deliver("ground", &command(GROUND, form, number, (1, 154))), ["gimbal"], "{number}");
            assert_eq!(rig.world.snapshot().conflicts, [""; 0]);
        }
    }
    let mut warns = self::rig(Firewall::Warn);
    assert!(warns.deliver_amid_ours("ground", &command(GROUND, COMMAND_LONG, 195, (1, 0))).contains(&"gimbal"));
    assert_eq!(warns.world.snapshot().conflicts, [""; 0], "it is for the managers, which do it");
}

/// R15: the conflict is shown, "but for 204, 205, 220, `MOUNT_CONFIGURE` and `MOUNT_CONTROL` to no component in particular,
/// which are for the managers as well"; with `firewall = "warn"` each is.
#[test]
fn what_a_mount_is_told_by_everybody_is_a_conflict_where_it_arrives() {
    for (firewall, shown) in [(Firewall::On, 0), (Firewall::Warn, 1)] {
        for number in [204, 205, 220] {
            let mut rig = rig(firewall);
            let told = rig.deliver_amid_ours("ground", &command(GROUND, COMMAND_LONG, number, (1, 0)));
            assert_eq!(told.contains(&"gimbal"), firewall == Firewall::Warn, "{number} {firewall:?} {told:?}");
            assert_eq!(rig.world.snapshot().conflicts.len(), shown, "{number} {firewall:?}");
        }
    }
}

/// The firewall is about the devices that we manage, on whatever link they are, and about nothing else.
#[test]
fn item_153_other_devices_and_other_commands_pass() {
    let mut rig = rig(Firewall::On);
    rig.introduce("peer", MavId::new(9, 154));
    assert_eq!(rig.deliver("ground", &addressed(GROUND, SET_ATTITUDE, (9, 154))), ["peer"]);
    assert_eq!(rig.deliver("ground", &command(GROUND, COMMAND_LONG, 205, (1, 1))), ["autopilot"]);
    assert_eq!(rig.deliver("ground", &command(GROUND, COMMAND_LONG, 246, (1, 154))), ["gimbal"]);

    rig.introduce("peer", MavId::new(1, 171));
    assert_eq!(rig.deliver("ground", &addressed(GROUND, SET_ATTITUDE, (1, 171))), [""; 0]);
    assert_eq!(rig.dropped("peer", "firewall"), 1);
}

/// R15: "neither to a managed device nor to any link of role `gimbal`": there may be a gimbal that is not known to us yet, or
/// that has no manager.
#[test]
fn item_153_a_link_of_gimbals_is_kept_from_who_steers_whomever_he_means() {
    let mut rig = rig(Firewall::On);
    rig.introduce("gimbal", MavId::new(1, 100));
    assert_eq!(rig.deliver("ground", &addressed(GROUND, SET_ATTITUDE, (1, 100))), [""; 0]);
    assert_eq!(rig.deliver("ground", &command(GROUND, COMMAND_LONG, 205, (1, 100))), [""; 0]);
    assert_eq!(rig.dropped("gimbal", "firewall"), 2);
    assert_eq!(rig.deliver("ground", &command(GROUND, COMMAND_LONG, 400, (1, 100))), ["gimbal"]);
}

/// "a device's own 280/281 do not leave their link": two managers of one gimbal would be seen.
#[test]
fn what_a_device_says_as_a_manager_stays_on_its_link() {
    let mut rig = rig(Firewall::On);
    rig.open_beside("gimbal", "second gimbal");
    for (count, id) in [(1, 280), (2, 281)] {
        assert_eq!(rig.deliver("gimbal", &broadcast(GIMBAL, id)), [""; 0]);
        assert_eq!(rig.dropped("gimbal", "device_manager_message"), count);
        // Another's are forwarded.
        assert_eq!(rig.deliver("peer", &broadcast(MavId::new(9, 154), id)), ["autopilot", "ground", "radio"]);
    }
    let conflicts = rig.world.snapshot().conflicts;
    assert!(conflicts.iter().any(|conflict| conflict.contains("280 and 281")), "{conflicts:?}");
}
