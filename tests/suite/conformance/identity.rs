//! Which system id is ours, and what our heartbeats say (protocol checklist 8.2).

use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, SystemId, Transport};
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA, MavMessage,
};

use crate::support::script::{
    ACCEPTED, DENIED, NAN, command_long, device_information, gimbal_heartbeat, ground_heartbeat, of, pitchyaw,
    px4_heartbeat, request_message, set_manual_control, set_pitchyaw, take_control, usual_capabilities,
};
use crate::support::world::{
    AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Place, Places, World, heartbeat, link, three_links,
};

const SECOND: Duration = Duration::from_secs(1);

/// "When started in `auto` mode with no autopilot, no own frame appears on any link for the first 10 s (except UDP
/// bootstrap links), then HEARTBEAT with fallback sysid at 1 Hz."
#[test]
fn item_14_without_an_autopilot_the_fallback_id_is_used_after_ten_seconds() {
    let mut settings = auto();
    let bootstrap = link("bootstrap", Role::Autopilot, Transport::Datagrams);
    settings.links.push(gimbald::bridge::settings::LinkSettings { speaks_first: true, ..bootstrap });
    let (mut world, places) = World::new(settings);

    world.run_for(Duration::from_micros(9_999_999));

    for place in &places[..3] {
        assert_eq!(world.take(*place), []);
    }
    let first = world.take(places[3]);
    assert_eq!(times_ms(&first), (0..10).map(|second| second * 1_000).collect::<Vec<_>>());
    assert!(first.iter().all(|arrival| arrival.decode::<HEARTBEAT_DATA>() == own_heartbeat(1)), "state BOOT");
    assert!(first.iter().all(|arrival| arrival.source() == MavId::new(1, 191)));

    world.run_for(Duration::from_millis(5_500));

    for place in &places {
        let arrivals = world.take(*place);
        assert_eq!(times_ms(&arrivals), [10_000, 11_000, 12_000, 13_000, 14_000, 15_000]);
        assert!(arrivals.iter().all(|arrival| arrival.source() == MavId::new(1, 191)));
        assert!(arrivals.iter().all(|arrival| arrival.decode::<HEARTBEAT_DATA>() == own_heartbeat(1)));
    }
    assert!(world.stored_system_ids.is_empty(), "the fallback is not worth keeping");
}

/// "When exactly one autopilot system (say 7) beats for 3 s on the AP link, every own frame thereafter has sysid 7."
#[test]
fn item_15_the_one_autopilot_gives_us_its_system_id() {
    let (mut world, places) = World::empty(auto());
    let autopilot = (SECOND, places.autopilot, MavId::new(7, 1), px4_heartbeat());
    let gimbal = (SECOND, places.gimbal, MavId::new(7, 154), gimbal_heartbeat());
    // Without it there is no status: what it speaks decides on the id that it has there.
    let information = MavMessage::GIMBAL_DEVICE_INFORMATION(device_information(world.now, usual_capabilities()));
    let information = (SECOND, places.gimbal, MavId::new(7, 154), information);

    world.run_with(Duration::from_micros(2_999_999), &[autopilot.clone(), gimbal.clone()]);
    assert_eq!(own_frames(&mut world, places, 191), 0, "nothing before the window is over");

    world.run_with(Duration::from_secs(10), &[autopilot, gimbal, information]);
    for place in [places.autopilot, places.gimbal, places.ground] {
        let own: Vec<Arrival> = world.take(place).into_iter().filter(|at| at.source().component == 191).collect();
        assert!(own.len() > 10, "heartbeats and status");
        assert!(own.iter().all(|arrival| arrival.source().system == 7));
        assert_eq!(own[0].id(), HEARTBEAT, "the first thing said under a new id");
    }
    assert_eq!(world.stored_system_ids, [7]);
}

/// "When two autopilot systems beat within the 3 s window, the configured sysid is kept."
#[test]
fn item_16_of_two_autopilots_neither_is_taken() {
    for (settings, expected, conflict) in [(auto(), 1, true), (fixed(42), 42, false)] {
        let (mut world, places) = World::empty(settings);
        let first = (SECOND, places.autopilot, MavId::new(7, 1), px4_heartbeat());
        let second = (SECOND, places.autopilot, MavId::new(8, 1), px4_heartbeat());

        world.run_with(Duration::from_secs(12), &[first, second]);

        let own: Vec<Arrival> = own(&world.take(places.ground)).cloned().collect();
        assert!(own.iter().all(|arrival| arrival.source() == MavId::new(expected, 191)));
        assert!(own.len() >= 9);
        assert_eq!(world.snapshot().system_id, Some(expected));
        let told = world.snapshot().conflicts.iter().any(|text| text.contains("several autopilots"));
        assert_eq!(told, conflict, "with a fixed id two autopilots are no conflict");
    }
}

/// "When a GCS (type 6) beats first, sysid is not adopted from it."
/// Protocol checklist 18: "When a type-26 component with autopilot = 0 (GENERIC) beats, it is not taken for an autopilot."
#[test]
fn items_17_and_18_neither_a_ground_station_nor_a_gimbal_is_an_autopilot() {
    for (source, message) in [
        (GCS, ground_heartbeat()),
        (GCS, heartbeat(6, 0)),
        (MavId::new(9, 154), heartbeat(26, 0)),
        (MavId::new(9, 191), heartbeat(18, 8)),
    ] {
        let (mut world, places) = World::empty(auto());

        world.run_with(Duration::from_secs(12), &[(SECOND, places.autopilot, source, message)]);

        let snapshot = world.snapshot();
        assert_eq!((snapshot.system_id, snapshot.vehicle.system_id), (Some(1), None), "{source}");
    }
}

/// An autopilot that beats on a ground link flies elsewhere: "Latch only from links marked `autopilot`".
#[test]
fn item_15_only_links_to_an_autopilot_are_believed() {
    let (mut world, places) = World::empty(auto());

    world.run_with(Duration::from_secs(12), &[(SECOND, places.ground, MavId::new(9, 1), px4_heartbeat())]);

    assert_eq!(world.snapshot().system_id, Some(1));
}

/// "When running, HEARTBEAT (type 18, autopilot 8, base_mode 0, custom_mode 0, version 3) appears on every link at
/// 1 Hz ± 10 %."
/// Client checklist E4: "type 26, autopilot 8, base_mode 0, custom_mode 0, mavlink_version 3", where the type of a manager
/// on a component of its own is 18.
#[test]
fn item_19_every_link_gets_one_heartbeat_a_second() {
    let (mut world, places) = World::empty(three_links());
    // The gimbal link gets one more when it opens.
    world.run_for(SECOND / 2);
    world.forget();

    world.run_for(Duration::from_secs(9));

    for place in [places.autopilot, places.gimbal, places.ground] {
        let arrivals = world.take(place);
        assert_eq!(times_ms(&arrivals), (1..10).map(|second| second * 1_000).collect::<Vec<_>>());
        for arrival in arrivals {
            assert_eq!((arrival.source(), arrival.decode::<HEARTBEAT_DATA>()), (MANAGER, own_heartbeat(3)));
        }
    }
}

/// "When no device is present, system_status is STANDBY (3); when it becomes alive, ACTIVE (4) within 1.1 s; when lost,
/// CRITICAL (5) within 4.1 s."
#[test]
fn item_21_the_heartbeat_tells_how_the_gimbal_is() {
    let (mut world, places) = World::empty(three_links());
    world.run_for(Duration::from_millis(4_500));
    assert_eq!(states(&mut world, places), [3, 3, 3, 3, 3]);

    world.run_with(Duration::from_secs(3), &[(SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())]);
    let last_heard = Timestamp::from_millis(6_500);
    assert_eq!(states(&mut world, places), [4, 4, 4], "the first within 1.1 s");

    world.run_for(Duration::from_secs(5));
    let beats: Vec<Arrival> = world.take(places.ground).into_iter().filter(|at| at.source() == MANAGER).collect();
    let critical = beats.iter().find(|at| at.id() == HEARTBEAT && at.decode::<HEARTBEAT_DATA>().system_status == 5);
    let after = critical.expect("it is told").at - last_heard;
    assert!(after >= Duration::from_secs(3) && after <= Duration::from_millis(4_100), "{after:?}");
}

/// "When the first heartbeat is sent on the gimbal link, our sysid has been settled, and no GCS heartbeat has preceded
/// it there."
#[test]
fn item_22_the_gimbal_hears_us_before_anybody_else_whatever_starts_first() {
    const SYSTEM: u8 = 7;
    for order in [[0, 4, 8], [0, 8, 4], [4, 0, 8], [4, 8, 0], [8, 0, 4], [8, 4, 0], [0, 0, 0]] {
        let [ground_at, autopilot_at, gimbal_at] = order;
        let (mut world, places) = World::empty(auto());
        world.unplug(places.gimbal);
        for step in 0..40_u64 {
            if step == gimbal_at {
                world.plug_in(places.gimbal);
            }
            if step >= autopilot_at && step % 2 == 0 {
                world.send(places.autopilot, MavId::new(SYSTEM, 1), &px4_heartbeat());
            }
            if step >= ground_at {
                world.send(places.ground, GCS, &ground_heartbeat());
            }
            world.run_for(SECOND / 2);
        }
        let heard = world.take(places.gimbal);
        let who: Vec<MavId> = heard.iter().map(Arrival::source).collect();
        assert_eq!((heard[0].id(), who[0]), (HEARTBEAT, MavId::new(SYSTEM, 191)), "started at {order:?}");
        assert!(who.contains(&GCS) && who.contains(&MavId::new(SYSTEM, 1)), "later all are heard: {who:?}");
    }
}

/// Protocol checklist 22 again, with the frame that settles the id: everything behind it in the same read waits for our
/// heartbeat.
#[test]
fn item_22_our_heartbeat_comes_before_the_frame_that_settled_the_id() {
    let (mut world, places) = World::empty(auto());
    world.send(places.autopilot, MavId::new(7, 1), &px4_heartbeat());
    // The time for timeouts passes while frames wait to be read.
    world.now = Timestamp::from_secs(4);

    world.send(places.autopilot, MavId::new(7, 1), &px4_heartbeat());
    world.send(places.ground, GCS, &ground_heartbeat());

    let who: Vec<MavId> = world.take(places.gimbal).iter().map(Arrival::source).collect();
    assert_eq!(who, [MavId::new(7, 191), MavId::new(7, 1), GCS]);
}

/// "When a frame with our own (sysid, compid) as source is received, it is dropped, not forwarded, and counted as
/// loop." D20: "only frames identical to ones that we sent are dropped".
#[test]
fn item_23_our_own_frames_that_come_back_are_dropped() {
    let (mut world, places) = World::empty(three_links());
    world.run_for(SECOND / 2);
    let ours = world.take(places.ground).remove(0);
    world.forget();

    world.send_bytes(places.autopilot, &ours.bytes);

    for place in [places.autopilot, places.gimbal, places.ground] {
        assert_eq!(world.take(place), []);
    }
    let snapshot = world.snapshot();
    assert_eq!(snapshot.links[0].dropped.get("loop"), Some(&1));
    assert_eq!(snapshot.conflicts, [] as [String; 0]);
}

/// D20: "a frame with our source ids that we did not just send is not a loop: it is a conflict (mavros 2 beats as 191 by
/// default), shown with the key to change, and forwarded".
#[test]
fn d20_another_who_sends_as_us_is_a_conflict_and_is_forwarded() {
    let (mut world, places) = World::empty(three_links());
    world.run_for(SECOND / 2);
    world.forget();

    let sent = world.send(places.autopilot, MANAGER, &heartbeat(18, 8));

    for place in [places.gimbal, places.ground] {
        let heard: Vec<Vec<u8>> = world.take(place).into_iter().map(|arrival| arrival.bytes).collect();
        assert_eq!(heard, std::slice::from_ref(&sent));
    }
    assert_eq!(world.take(places.autopilot), []);
    let snapshot = world.snapshot();
    assert_eq!(snapshot.links[0].dropped, Default::default());
    assert_eq!(snapshot.conflicts.len(), 1);
    assert!(snapshot.conflicts[0].contains("1/191") && snapshot.conflicts[0].contains("manager_component_id"));
    // It is not learned from, or our own traffic would be kept from that link.
    assert_eq!(world.ask(places.ground, GCS, &request_message(MANAGER, 396)).len(), 2, "we still answer");
}

/// "When the sequence number of own frames is inspected per link, it increases by 1 modulo 256 per frame sent by that
/// component on that link."
#[test]
fn item_24_sequence_numbers_have_no_gap_on_any_link() {
    let (mut world, places) = World::with_one_gimbal(three_links());
    for _ in 0..60 {
        world.send(places.ground, GCS, &request_message(MANAGER, 280));
        world.run_for(SECOND);
    }
    world.send(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0));
    world.run_for(SECOND);

    for place in [places.autopilot, places.gimbal, places.ground] {
        let arrivals = world.take(place);
        let sequences: Vec<u8> = own(&arrivals).map(|arrival| arrival.bytes[4]).collect();
        assert!(sequences.len() > 300, "enough to wrap");
        assert!(sequences.windows(2).all(|pair| pair[1] == pair[0].wrapping_add(1)));
    }
}

/// Also on a full serial line, where setpoints give way to newer ones and control overtakes the rest.
#[test]
fn item_24_sequence_numbers_have_no_gap_on_a_full_serial_line() {
    let mut settings = three_links();
    settings.links[1].transport = Transport::Serial { baud: 9_600 };
    let (mut world, places) = World::with_one_gimbal(settings);
    let demands = [pitchyaw(-10.0, 0.0, NAN, NAN, 44.0), pitchyaw(-20.0, 5.0, NAN, NAN, 44.0)];
    for demand in demands.iter().cycle().take(400) {
        world.send(places.ground, GCS, demand);
        world.run_for(SECOND / 50);
    }

    assert!(world.snapshot().links[1].dropped["replaced_by_newer"] > 100, "setpoints gave way");
    let arrivals = world.take(places.gimbal);
    let sequences: Vec<u8> = own(&arrivals).map(|arrival| arrival.bytes[4]).collect();
    assert!(sequences.len() > 100);
    assert!(sequences.windows(2).all(|pair| pair[1] == pair[0].wrapping_add(1)), "{sequences:?}");
}

/// D1: "one component per gimbal, type ONBOARD_CONTROLLER (18) … 191 always beats, the others from when their gimbal is
/// known. A request to 191 concerns its gimbal only; a request to component 0 concerns all."
/// Client checklist E6: "Default M is one of 154, 171–175"; those are the devices here, and the managers 191 to 194.
#[test]
fn d1_each_gimbal_has_a_manager_component_of_its_own() {
    let mut settings = three_links();
    settings.gimbals = [154, 171]
        .map(|component| GimbalSettings {
            family: Family::MavlinkV2,
            component_id: Some(component),
            ..GimbalSettings::found(format!("gimbal-{component}"))
        })
        .to_vec();
    let (mut world, places) = World::empty(settings);
    world.run_for(SECOND / 2);
    let heard = world.take(places.ground);
    assert_eq!(heard.iter().map(Arrival::source).collect::<Vec<_>>(), [MANAGER], "192 is silent without its gimbal");

    for component in [154, 171] {
        let device = MavId::new(1, component);
        world.send(places.gimbal, device, &gimbal_heartbeat());
        let information = device_information(world.now, usual_capabilities());
        world.send(places.gimbal, device, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    }
    world.forget();
    world.run_for(SECOND);
    let beats = world.take(places.ground);
    let beats: Vec<_> = beats.iter().filter(|at| at.id() == HEARTBEAT).map(Arrival::source).collect();
    assert_eq!(beats, [MANAGER, MavId::new(1, 192)]);

    for (component, expected) in [(191, vec![191]), (192, vec![192]), (0, vec![191, 192])] {
        let command = command_long(MavId::new(1, component), 1001, &[-2.0, -2.0, -1.0, -1.0, NAN, NAN, 0.0]);
        let answers = world.ask(places.ground, GCS, &command);
        let acked: Vec<u8> = answers
            .iter()
            .filter(|at| at.id() == 77 && at.decode::<COMMAND_ACK_DATA>().result == ACCEPTED)
            .map(|at| at.source().component)
            .collect();
        assert_eq!(acked, expected);
        let release = command_long(MavId::new(1, 0), 1001, &[-3.0, -3.0, -1.0, -1.0, NAN, NAN, 0.0]);
        world.send(places.ground, GCS, &release);
    }
}

/// D5: "Other vehicles' systems are routed, but never gate, latch or steer."
#[test]
fn d5_another_vehicle_is_routed_and_has_no_say() {
    const OTHER: MavId = MavId::new(9, 1);
    let mut settings = auto();
    settings.stored_system_id = Some(1);
    settings.links.push(link("fleet", Role::Peer, Transport::Datagrams));
    let (mut world, all) = World::new(settings);
    let places = Places { autopilot: all[0], gimbal: all[1], ground: all[2] };
    let fleet = all[3];
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
    let beat = world.send(fleet, OTHER, &px4_heartbeat());
    assert!(world.take(places.ground).iter().any(|arrival| arrival.bytes == beat), "routed");

    // Steers and gates: neither its autopilot nor its companion.
    for sender in [OTHER, MavId::new(9, 192)] {
        assert_eq!(world.result_of(fleet, sender, &take_control()), Some(DENIED));
        assert_eq!(world.result_of(fleet, sender, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(DENIED));
        let roi = command_long(MANAGER, 195, &[0.0, NAN, NAN, NAN, 47.0, 8.0, 500.0]);
        assert_eq!(world.result_of(fleet, sender, &roi), Some(DENIED));
        world.send(fleet, sender, &set_pitchyaw(-0.2, 0.0, NAN, NAN, 44));
    }
    // Latches: ten seconds of its heartbeat on its own link change nothing.
    let repeated = [
        (SECOND, fleet, OTHER, px4_heartbeat()),
        (SECOND, places.autopilot, AUTOPILOT, px4_heartbeat()),
        (SECOND, places.gimbal, GIMBAL, gimbal_heartbeat()),
    ];
    world.run_with(Duration::from_secs(10), &repeated);

    let snapshot = world.snapshot();
    assert_eq!((snapshot.system_id, snapshot.vehicle.system_id), (Some(1), Some(1)));
    assert_eq!((&snapshot.gimbals[0].primary, &snapshot.gimbals[0].setpoint), (&None, &None));
    assert_eq!(snapshot.gimbals[0].rejected["9/1"]["other_vehicle"], 4);
    assert_eq!(world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal), []);
    // A ground station, whatever its system id, has one.
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
}

/// D19: "the adopted id is kept in the state directory and used at once on restart; the 3 s window then only confirms."
#[test]
fn d19_a_stored_system_id_is_used_at_once() {
    let settings = Settings { stored_system_id: Some(7), ..auto() };
    let (mut world, places) = World::empty(settings);
    world.run_for(Duration::from_millis(500));
    for place in [places.autopilot, places.gimbal, places.ground] {
        let heard = world.take(place);
        assert!(heard.iter().all(|arrival| arrival.decode::<HEARTBEAT_DATA>() == own_heartbeat(3)));
        assert!(heard.iter().all(|arrival| (arrival.at, arrival.source()) == (Timestamp::ZERO, MavId::new(7, 191))));
        assert!(!heard.is_empty());
    }

    world.run_with(Duration::from_secs(5), &[(SECOND, places.autopilot, MavId::new(7, 1), px4_heartbeat())]);
    assert_eq!((world.snapshot().system_id, world.stored_system_ids.clone()), (Some(7), vec![]), "confirmed");

    // Another autopilot in its stead is believed after the window, as long as nobody is in control.
    world.run_with(Duration::from_secs(10), &[(SECOND, places.autopilot, MavId::new(8, 1), px4_heartbeat())]);
    assert_eq!((world.snapshot().system_id, world.stored_system_ids.clone()), (Some(8), vec![8]));
}

/// Protocol 4.4: "An autopilot that changes its id … → re-latch, re-announce, drop routes of the old id, clear control
/// slots that name the old id", "only while no client is in control".
#[test]
fn item_15_a_changed_system_id_waits_until_nobody_is_in_control() {
    let (mut world, places) = World::empty(Settings { stored_system_id: Some(1), ..auto() });
    let gimbal = (SECOND, places.gimbal, GIMBAL, gimbal_heartbeat());
    world.run_with(SECOND, &[gimbal.clone(), (SECOND, places.autopilot, AUTOPILOT, px4_heartbeat())]);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));

    let changed = (SECOND, places.autopilot, MavId::new(7, 1), px4_heartbeat());
    let ground = (SECOND, places.ground, GCS, ground_heartbeat());
    world.run_with(Duration::from_secs(12), &[gimbal.clone(), changed.clone(), ground]);
    assert_eq!(world.snapshot().system_id, Some(1), "the ground station is in control");

    // It falls silent, and its control lapses.
    world.run_with(Duration::from_secs(12), &[gimbal, changed]);
    assert_eq!((world.snapshot().system_id, world.stored_system_ids.clone()), (Some(7), vec![7]));
    assert_eq!(world.snapshot().gimbals[0].primary, None);
}

/// "A gimbal that turns after its operator is gone is our worst bug": one that hears its system alone is told to stop under the
/// id that told it to turn, before we take another.
#[test]
fn item_15_a_changed_system_id_waits_until_a_gimbal_has_stopped() {
    use gimbald::gimbals::gremsy::sim::{Device, DeviceSettings, Generation};
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = World::empty(Settings { stored_system_id: Some(1), ..auto() });
        world.install(places.gimbal, Device::new(world.now, DeviceSettings::of(generation)));
        let former = (SECOND, places.autopilot, AUTOPILOT, px4_heartbeat());
        let changed = (SECOND, places.autopilot, MavId::new(7, 1), px4_heartbeat());
        let stick = (SECOND / 5, places.ground, GCS, set_manual_control(NAN, NAN, 0.0, 0.2));
        world.run_with(25 * SECOND, std::slice::from_ref(&former));
        world.run_with(3 * SECOND, &[former, stick.clone()]);
        world.run_with(6 * SECOND, &[changed.clone(), stick]);
        let looks = |world: &World| world.snapshot().gimbals[0].attitude.yaw_vehicle_deg.expect("it is told");
        let before = looks(&world);
        assert!(before > 30.0, "{generation:?}: it turns: {before}");
        assert_eq!(world.snapshot().system_id, Some(1), "{generation:?}");
        // Its operator is gone.
        world.run_with(8 * SECOND, std::slice::from_ref(&changed));
        assert_eq!(world.snapshot().system_id, Some(7), "{generation:?}");
        let stopped = looks(&world);
        world.run_with(5 * SECOND, &[changed]);
        assert!((looks(&world) - stopped).abs() < 0.5, "{generation:?}: it turns on: {stopped} {}", looks(&world));
    }
}

const HEARTBEAT: u32 = 0;

fn auto() -> Settings {
    Settings { system_id: SystemId::Auto, ..three_links() }
}

fn fixed(system: u8) -> Settings {
    Settings { system_id: SystemId::Fixed(system), ..three_links() }
}

fn own_heartbeat(system_status: u8) -> HEARTBEAT_DATA {
    HEARTBEAT_DATA { custom_mode: 0, mavtype: 18, autopilot: 8, base_mode: 0, system_status, mavlink_version: 3 }
}

fn own(arrivals: &[Arrival]) -> impl Iterator<Item = &Arrival> {
    arrivals.iter().filter(|arrival| arrival.source().component == 191)
}

fn own_frames(world: &mut World, places: Places, component: u8) -> usize {
    [places.autopilot, places.gimbal, places.ground]
        .into_iter()
        .flat_map(|place: Place| world.take(place))
        .filter(|arrival| arrival.source().component == component)
        .count()
}

/// `system_status` of our heartbeats at the ground.
fn states(world: &mut World, places: Places) -> Vec<u8> {
    let arrivals: Vec<Arrival> = world.take(places.ground).into_iter().filter(|at| at.source() == MANAGER).collect();
    assert!(of::<GIMBAL_MANAGER_STATUS_DATA>(&arrivals).iter().all(|status| status.gimbal_device_id == 154));
    of::<HEARTBEAT_DATA>(&arrivals).iter().map(|beat| beat.system_status).collect()
}

fn times_ms(arrivals: &[Arrival]) -> Vec<u64> {
    arrivals.iter().map(|arrival| arrival.at.as_micros() / 1_000).collect()
}
