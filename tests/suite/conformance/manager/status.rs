//! What a manager tells of itself and its gimbal (protocol checklist 8.4).

use std::time::Duration;

use gimbald::wire::MavId;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, COMPONENT_INFORMATION_BASIC_DATA, GIMBAL_DEVICE_INFORMATION_DATA,
    GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA, MESSAGE_INTERVAL_DATA, MavMessage,
};
use gimbald::wire::ids::CapFlags;

use super::{FIELD, SECOND, fly, frames, look, run_looking, told_control, with_gimbal};
use crate::support::script::{
    ACCEPTED, DENIED, TEMPORARILY_REJECTED, ack, command_long, device_information, gimbal_heartbeat, ids, of,
    request_message, roi_location, set_interval, take_control, usual_capabilities,
};
use crate::support::world::{Arrival, GCS, GIMBAL, MANAGER, Place, World, three_links};

const EVERYBODY: MavId = MavId::new(0, 0);

/// "When 512(280) directed to S/191 arrives and a device is known, COMMAND_ACK(512, ACCEPTED) and one 280 per managed
/// gimbal are sent on that link now."
/// Protocol checklist 41: "When 512(280) arrives as broadcast 0/0, the same happens."
#[test]
fn items_40_and_41_the_information_follows_its_acknowledgement() {
    for target in [MANAGER, MavId::new(1, 0), EVERYBODY] {
        let (mut world, places) = with_gimbal();

        let answers = world.ask(places.ground, GCS, &request_message(target, 280));

        assert_eq!(ids(&answers), [77, 280], "asked {target}");
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(GCS, 512, ACCEPTED)]);
        let information: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = of(&answers);
        let expected = GIMBAL_MANAGER_INFORMATION_DATA {
            time_boot_ms: 600,
            // What the device can do, and that it takes angles, and yaw from North.
            cap_flags: usual_capabilities().bits() | (1 << 16) | (1 << 12),
            roll_min: -0.5,
            roll_max: 0.5,
            pitch_min: -1.5,
            pitch_max: 0.5,
            yaw_min: -2.0,
            yaw_max: 2.0,
            gimbal_device_id: 154,
        };
        assert_eq!(information, [expected]);
        assert!(world.take(places.autopilot).iter().all(|arrival| arrival.source() == GCS), "on that link only");
    }
}

/// "When 512(280) arrives before any device is known, ACK is TEMPORARILY_REJECTED, and 280 is emitted as soon as a device
/// is known if within 30 s."
#[test]
fn item_42_the_information_asked_for_too_early_comes_when_it_can() {
    let (mut world, places) = World::empty(three_links());
    let asked = request_message(MANAGER, 280);
    assert_eq!(world.result_of(places.ground, GCS, &asked), Some(TEMPORARILY_REJECTED));
    world.run_for(Duration::from_secs(20));
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    assert_eq!(
        world.result_of(places.ground, GCS, &asked),
        Some(TEMPORARILY_REJECTED),
        "it said nothing of itself yet"
    );
    world.forget();

    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));

    assert_eq!(world.take_messages::<GIMBAL_MANAGER_INFORMATION_DATA>(places.ground).len(), 1);
}

/// "When 512(396) is directed to us, a 396 is sent whose capabilities & 262144 ≠ 0 and & 8192 ≠ 0."
#[test]
fn item_43_the_component_says_that_it_is_a_gimbal_manager() {
    let (mut world, places) = with_gimbal();

    let answers = world.ask(places.ground, GCS, &request_message(MANAGER, 396));

    assert_eq!(ids(&answers), [77, 396]);
    let basic: Vec<COMPONENT_INFORMATION_BASIC_DATA> = of(&answers);
    assert_eq!(basic[0].capabilities & (262_144 | 8_192), 262_144 | 8_192);
}

/// "When 512(283) for S/154 is directed to the device, it is forwarded to the gimbal link and *not* answered by us."
#[test]
fn item_44_a_request_to_the_device_is_the_devices_business() {
    let (mut world, places) = with_gimbal();

    world.forget();
    let sent = world.send(places.ground, GCS, &request_message(GIMBAL, 283));

    let heard: Vec<Vec<u8>> = world.take(places.gimbal).into_iter().map(|arrival| arrival.bytes).collect();
    assert_eq!(heard, [sent]);
    assert_eq!(world.take(places.ground), []);
    assert_eq!(world.take(places.autopilot), []);
}

/// "When 512 with an unknown message id is directed exactly to us, ACK is DENIED; when broadcast, no ACK is sent."
#[test]
fn item_45_an_unknown_message_is_refused_only_to_who_asked_us() {
    let (mut world, places) = with_gimbal();
    for message_id in [148, 283, 9_999_999] {
        assert_eq!(world.result_of(places.ground, GCS, &request_message(MANAGER, message_id)), Some(DENIED));
        assert_eq!(world.ask(places.ground, GCS, &request_message(EVERYBODY, message_id)), []);
    }
}

/// "When running with a known device, 281 appears on every link at 5 Hz ± 10 % with the right id, flags and control ids."
#[test]
fn item_46_the_status_is_sent_five_times_a_second() {
    let (mut world, places) = with_gimbal();
    world.send(places.ground, GCS, &take_control());
    world.forget();

    run_looking(&mut world, places, Duration::from_secs(4), 0.0, 0.0);

    for place in [places.autopilot, places.gimbal, places.ground] {
        let told = told(&mut world, place);
        assert_eq!(told.len(), 20);
        assert!(told.windows(2).all(|pair| pair[1].at - pair[0].at == Duration::from_millis(200)));
        for arrival in &told {
            let expected = GIMBAL_MANAGER_STATUS_DATA {
                time_boot_ms: arrival.at.boot_ms(),
                flags: 44,
                gimbal_device_id: 154,
                primary_control_sysid: 255,
                primary_control_compid: 190,
                secondary_control_sysid: 0,
                secondary_control_compid: 0,
            };
            assert_eq!((arrival.source(), arrival.decode::<GIMBAL_MANAGER_STATUS_DATA>()), (MANAGER, expected));
        }
    }
}

/// "When 511(281, 5 000 000) arrives from the GCS link, 281 slows to 0.2 Hz on that link only, and is ACKed ACCEPTED."
/// Protocol checklist 48: "When 511(281, 0) arrives, the default 5 Hz is restored on that link."
/// Protocol checklist 49: "When 511(281, −1) arrives, 281 stops on that link only."
#[test]
fn items_47_to_49_each_link_chooses_how_often_it_hears_the_status() {
    let (mut world, places) = with_gimbal();
    for (interval_us, expected) in [(5_000_000.0, 2), (0.0, 50), (-1.0, 0), (1_000_000.0, 10), (0.0, 50)] {
        let asked = set_interval(MANAGER, 281, interval_us);
        assert_eq!(world.result_of(places.ground, GCS, &asked), Some(ACCEPTED), "{interval_us}");
        world.forget();

        run_looking(&mut world, places, Duration::from_secs(10), 0.0, 0.0);

        assert_eq!(told(&mut world, places.ground).len(), expected, "{interval_us}");
        for elsewhere in [places.autopilot, places.gimbal] {
            assert_eq!(told(&mut world, elsewhere).len(), 50, "{interval_us}");
        }
    }
}

/// "When 510(281) arrives, ACK ACCEPTED and MESSAGE_INTERVAL(281, current µs of that link) follow."
/// Protocol checklist 51: "When 512(244) with param2 = 281 arrives, MESSAGE_INTERVAL(281, …) follows."
/// Protocol checklist 52: "When 512(244) asks for an unsupported id, MESSAGE_INTERVAL has interval 0."
#[test]
#[rustfmt::skip]
fn items_50_to_52_the_interval_is_told() {
    let (mut world, places) = with_gimbal();
    let by_510 = |id: f32| command_long(MANAGER, 510, &[id, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let by_512 = |id: f32| command_long(MANAGER, 512, &[244.0, id, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for (set_us,      question,        command, message_id, interval_us) in [
        (0.0,         by_510(281.0),   510,     281,        200_000),
        (0.0,         by_512(281.0),   512,     281,        200_000),
        (5_000_000.0, by_510(281.0),   510,     281,        5_000_000),
        (5_000_000.0, by_512(281.0),   512,     281,        5_000_000),
        (-1.0,        by_512(281.0),   512,     281,        -1),
        (0.0,         by_510(0.0),     510,     0,          1_000_000),
        (0.0,         by_512(283.0),   512,     283,        0),
        (0.0,         by_510(30_000.0), 510,    30_000,     0),
    ] {
        world.send(places.ground, GCS, &set_interval(MANAGER, 281, set_us));

        let answers = world.ask(places.ground, GCS, &question);

        assert_eq!(ids(&answers), [77, 244]);
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(GCS, command, ACCEPTED)]);
        assert_eq!(of::<MESSAGE_INTERVAL_DATA>(&answers), [MESSAGE_INTERVAL_DATA { interval_us, message_id }]);
    }
}

/// "When 511(0, x) arrives, ACK is DENIED and heartbeats keep 1 Hz."
#[test]
fn item_53_nobody_can_stop_the_heartbeat() {
    let (mut world, places) = with_gimbal();
    for interval_us in [-1.0, 0.0, 100_000.0, 60_000_000.0] {
        assert_eq!(world.result_of(places.ground, GCS, &set_interval(MANAGER, 0, interval_us)), Some(DENIED));
        run_looking(&mut world, places, Duration::from_secs(3), 0.0, 0.0);
        assert_eq!(world.take_messages::<HEARTBEAT_DATA>(places.ground).len(), 3);
    }
}

/// "When the device reported NaN limits, 280 contains finite substitutes."
#[test]
fn item_54_limits_that_nobody_stated_are_finite() {
    let (mut world, places) = World::empty(three_links());
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let information = GIMBAL_DEVICE_INFORMATION_DATA {
        roll_min: f32::NAN,
        roll_max: f32::NAN,
        pitch_min: f32::NAN,
        pitch_max: f32::NAN,
        yaw_min: f32::NAN,
        yaw_max: f32::NAN,
        ..device_information(world.now, usual_capabilities())
    };
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));

    let announced: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = world.take_messages(places.ground);

    let it = &announced[0];
    for (min, max) in [(it.roll_min, it.roll_max), (it.pitch_min, it.pitch_max), (it.yaw_min, it.yaw_max)] {
        assert!(min.is_finite() && max.is_finite() && min < max, "{it:?}");
    }
}

/// "When device caps carry bits above 0x3FFFF, 280.cap_flags does not."
/// Protocol checklist 56: "When the manager can compute ROI (position source configured), 280.cap_flags has 131072."
/// Client checklist E31: "CAN_POINT_LOCATION_LOCAL whenever angles are accepted, CAN_POINT_LOCATION_GLOBAL exactly if ROI
/// is accepted." So it is told again when the position comes, and when it is gone.
#[test]
fn items_55_and_56_the_capabilities_are_those_of_a_manager() {
    let (mut world, places) = World::empty(three_links());
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    let all = CapFlags::from_bits_retain(0xffff_ffff);
    let information = GIMBAL_DEVICE_INFORMATION_DATA { cap_flags2: 0xffff_ffff, ..device_information(world.now, all) };
    world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));

    let announced: Vec<GIMBAL_MANAGER_INFORMATION_DATA> = world.take_messages(places.ground);

    assert_eq!(announced[0].cap_flags, 0x1_ffff);
    let roi = roi_location(0, [47.4, 8.5], 400.0);
    for (millis, told) in [(1_000, true), (4_900, true), (200, false), (0, true)] {
        if millis != 200 {
            fly(&mut world, places, FIELD, 0.0);
        }
        look(&mut world, places, 0.0, 0.0);
        run_looking(&mut world, places, Duration::from_millis(millis), 0.0, 0.0);
        let heard: Vec<GIMBAL_MANAGER_INFORMATION_DATA> =
            of(&world.ask(places.ground, GCS, &request_message(MANAGER, 280)));
        assert_eq!(heard[0].cap_flags, if told { 0x3_ffff } else { 0x1_ffff }, "{millis}");
        frames::turn_vehicle(&mut world, places, 0.0);
        let accepted = world.result_of(places.ground, GCS, &roi) == Some(ACCEPTED);
        assert_eq!(accepted, told, "{millis}");
    }
}

/// "…and whenever its contents change" (protocol notes 1.2): 280 goes to everybody when the vehicle's position comes, and
/// when it is not known any more.
#[test]
fn item_56_what_a_client_may_ask_for_is_told_when_it_changes() {
    let (mut world, places) = with_gimbal();
    let mut told = Vec::new();
    for fixed in [false, true, true, false, false, true] {
        for _ in 0..40 {
            match fixed {
                true => fly(&mut world, places, FIELD, 0.0),
                false => frames::turn_vehicle(&mut world, places, 0.0),
            }
            run_looking(&mut world, places, SECOND / 10, 0.0, 0.0);
        }
        let heard = world.take(places.autopilot);
        let heard = of::<GIMBAL_MANAGER_INFORMATION_DATA>(&heard);
        told.push(heard.iter().map(|told| told.cap_flags & 131_072 != 0).collect::<Vec<_>>());
        assert_eq!(world.take_messages::<GIMBAL_MANAGER_INFORMATION_DATA>(places.ground), heard);
    }
    assert_eq!(told, [vec![], vec![true], vec![], vec![], vec![false], vec![true]]);
}

/// "When control ownership changes, a 281 with the new owner is sent on all links now, besides the regular stream."
/// Protocol checklist 58: "When nobody is in control, 281 carries 0/0 and 0/0."
#[test]
fn items_57_and_58_a_change_of_control_is_told_everywhere_at_once() {
    let (mut world, places) = with_gimbal();
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    let nobody = MavId::new(0, 0);
    assert_eq!(told_control(&world.take(places.autopilot)), Some((nobody, nobody)));
    world.forget();

    world.send(places.ground, GCS, &take_control());

    for place in [places.autopilot, places.gimbal, places.ground] {
        let heard = world.take(place);
        assert_eq!(heard.iter().filter(|arrival| arrival.id() == 281).count(), 1);
        assert_eq!(told_control(&heard), Some((GCS, nobody)));
    }
    // A repeat changes nothing, and is not told.
    world.send(places.ground, GCS, &take_control());
    for place in [places.autopilot, places.gimbal, places.ground] {
        assert_eq!(told(&mut world, place), []);
    }
}

fn told(world: &mut World, place: Place) -> Vec<Arrival> {
    world.take(place).into_iter().filter(|arrival| arrival.id() == 281).collect()
}
