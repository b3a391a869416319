//! How clients take, share and give back control (client checklist E54 to E74).

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::settings::{GimbalSettings, Takeover};
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, GIMBAL_MANAGER_STATUS_DATA, MavMessage};

use super::frames::turn_vehicle;
use super::{COMPANION, SECOND, assert_near, run_looking, setpoints, told_control, with_gimbal, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, ack, command_long, configure, device_information, device_status, gimbal_heartbeat, ids, of,
    pitch_yaw_deg, pitchyaw, px4_heartbeat, set_attitude, set_pitchyaw, take_control, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Place, Places, World, three_links};

const NOBODY: MavId = MavId::new(0, 0);
/// MAVSDK as a ground station.
const MAVSDK: MavId = MavId::new(245, 190);

/// Client checklist E54: "1001 with 255,190,−1,−1,NaN,NaN,1: ACCEPTED; 281 has primary 255/190, secondary unchanged."
/// Client checklist E55: "1001 with −3,−3,−1,−1 from the owner: primary 0/0, secondary unchanged."
/// Client checklist E56: "The same from a non-owner: primary unchanged; … 281 shows the true owner."
/// Client checklist E57: "1001 with 245,190,245,190,NaN,NaN,1: both pairs are 245/190."
/// Client checklist E58: "1001 with −3×4 from the owner of both: all zero; from the owner of one pair: only that pair."
/// Client checklist E61: "1001 with −2 in p1 and p2: sender becomes primary. With −2 in p1 and 191 in p2: sender's system
/// with 191." Half a pair is DENIED here: it is more likely a mistake than meant so.
/// Client checklist E62: "1001 with 0,0,−1,−1: nobody is primary", from who is, or from the vehicle's autopilot.
/// Client checklist E63: "1001 with NaN in p1..p4: unchanged, ACCEPTED."
/// Client checklist E64: "1001 with 300, −4 or 1.5 in p1: DENIED, nothing changes."
#[test]
#[rustfmt::skip]
fn client_items_e54_to_e58_and_e61_to_e64_what_clients_say_to_get_control() {
    let both = (MAVSDK, MAVSDK);
    let shared = (GCS, COMPANION);
    for (before,          sender,    [p1, p2, p3, p4],               result,   after) in [
        ((NOBODY, COMPANION), GCS,   [255.0, 190.0, -1.0, -1.0],     ACCEPTED, shared),
        ((NOBODY, NOBODY), GCS,      [255.0, 190.0, -1.0, -1.0],     ACCEPTED, (GCS, NOBODY)),
        (shared,          GCS,       [-3.0, -3.0, -1.0, -1.0],       ACCEPTED, (NOBODY, COMPANION)),
        (shared,          COMPANION, [-3.0, -3.0, -1.0, -1.0],       ACCEPTED, shared),
        (shared,          MAVSDK,    [-3.0, -3.0, -1.0, -1.0],       ACCEPTED, shared),
        ((NOBODY, NOBODY), MAVSDK,   [245.0, 190.0, 245.0, 190.0],   ACCEPTED, both),
        (both,            MAVSDK,    [-3.0, -3.0, -3.0, -3.0],       ACCEPTED, (NOBODY, NOBODY)),
        (shared,          GCS,       [-3.0, -3.0, -3.0, -3.0],       ACCEPTED, (NOBODY, COMPANION)),
        (shared,          COMPANION, [-3.0, -3.0, -3.0, -3.0],       ACCEPTED, (GCS, NOBODY)),
        ((NOBODY, NOBODY), COMPANION, [-2.0, -2.0, -1.0, -1.0],      ACCEPTED, (COMPANION, NOBODY)),
        ((NOBODY, NOBODY), COMPANION, [-2.0, 191.0, -1.0, -1.0],     DENIED,   (NOBODY, NOBODY)),
        (shared,          GCS,       [0.0, 0.0, -1.0, -1.0],         ACCEPTED, (NOBODY, COMPANION)),
        (shared,          AUTOPILOT, [0.0, 0.0, -1.0, -1.0],         ACCEPTED, (NOBODY, COMPANION)),
        (shared,          MAVSDK,    [0.0, 0.0, -1.0, -1.0],         DENIED,   shared),
        (shared,          MAVSDK,    [NAN, NAN, NAN, NAN],           ACCEPTED, shared),
        (shared,          GCS,       [NAN, NAN, NAN, NAN],           ACCEPTED, shared),
        (shared,          GCS,       [300.0, 190.0, -1.0, -1.0],     DENIED,   shared),
        (shared,          GCS,       [-4.0, -4.0, -1.0, -1.0],       DENIED,   shared),
        (shared,          GCS,       [1.5, 190.0, -1.0, -1.0],       DENIED,   shared),
    ] {
        let (mut world, places) = held(before);
        let place = place_of(sender, places);

        let answers = world.ask(place, sender, &configure([p1, p2], [p3, p4]));

        let case = format!("{before:?}, {sender} sent {p1} {p2} {p3} {p4}");
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(sender, 1001, result)], "{case}");
        let told = told_control(&answers);
        assert_eq!(told, (after != before).then_some(after), "told at once, and only a change: {case}");
        run_looking(&mut world, places, SECOND / 5, 0.0, 0.0);
        assert_eq!(told_control(&world.take(places.ground)), Some(after), "{case}");
    }
}

/// Client checklist E59: "1001 immediately followed by 1000, in one datagram and in two: both ACCEPTED, in this order,
/// gimbal moves."
#[test]
fn client_item_e59_control_and_an_angle_come_together() {
    for one_datagram in [true, false] {
        let (mut world, places) = with_gimbal();
        // Only who is in control is obeyed.
        world.send(places.ground, COMPANION, &take_control());
        let frames: Vec<Vec<u8>> = [take_control(), pitchyaw(-30.0, 20.0, NAN, NAN, 44.0)]
            .iter()
            .enumerate()
            .map(|(at, message)| encode(at as u8, message))
            .collect();
        world.forget();

        if one_datagram {
            world.send_bytes(places.ground, &frames.concat());
        } else {
            frames.iter().for_each(|frame| world.send_bytes(places.ground, frame));
        }

        let heard = world.take(places.ground);
        assert_eq!(of::<COMMAND_ACK_DATA>(&heard), [ack(GCS, 1001, ACCEPTED), ack(GCS, 1000, ACCEPTED)]);
        let told = setpoints(&mut world, places);
        let (pitch, yaw) = pitch_yaw_deg(told.last().expect("it moves").1.q);
        assert_near(pitch, -30.0, 0.01);
        assert_near(yaw, 20.0, 0.01);
    }
}

/// Client checklist E60: "While A owns, 1001 by B naming B takes over (policy as configured) and 281 tells it to both
/// within 200 ms."
#[test]
fn client_item_e60_taking_over_is_told_to_both_at_once() {
    for (takeover, result, holder) in
        [(Takeover::Open, ACCEPTED, COMPANION), (Takeover::Ask, DENIED, GCS), (Takeover::Exclusive, DENIED, GCS)]
    {
        let camera = GimbalSettings { takeover, ..GimbalSettings::found("camera".to_owned()) };
        let settings = Settings { gimbals: vec![camera], ..three_links() };
        let (mut world, places) = with_gimbal_that(usual_capabilities(), settings);
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));

        let claim = configure([1.0, 192.0], [-1.0, -1.0]);
        assert_eq!(world.result_of(places.autopilot, COMPANION, &claim), Some(result), "{takeover:?}");

        let told = |world: &mut World, place| told_control(&world.take(place));
        if result == ACCEPTED {
            assert_eq!(told(&mut world, places.ground), Some((holder, NOBODY)), "in the same moment");
        }
        world.forget();
        run_looking(&mut world, places, SECOND / 5, 0.0, 0.0);
        for place in [places.ground, places.autopilot] {
            assert_eq!(told(&mut world, place), Some((holder, NOBODY)), "{takeover:?}");
        }
    }
}

/// Client checklist E65: "1001 with p7 = 0 acts on all gimbals of M. p7 = NaN likewise", of one component and of all.
/// Client checklist E66: "1001 for an unknown device id: DENIED (not silence)."
#[test]
fn client_items_e65_and_e66_the_device_id_says_which_gimbals() {
    let other = MavId::new(1, 192);
    let everybody = MavId::new(1, 0);
    for (target, device_id, results, after) in [
        (MANAGER, 0.0, vec![(MANAGER, ACCEPTED)], (GCS, NOBODY)),
        (MANAGER, NAN, vec![(MANAGER, ACCEPTED)], (GCS, NOBODY)),
        (MANAGER, 154.0, vec![(MANAGER, ACCEPTED)], (GCS, NOBODY)),
        (everybody, 0.0, vec![(MANAGER, ACCEPTED), (other, ACCEPTED)], (GCS, GCS)),
        (everybody, NAN, vec![(MANAGER, ACCEPTED), (other, ACCEPTED)], (GCS, GCS)),
        (everybody, 171.0, vec![(other, ACCEPTED)], (NOBODY, GCS)),
        (MANAGER, 171.0, vec![(MANAGER, DENIED)], (NOBODY, NOBODY)),
        (MANAGER, 1.0, vec![(MANAGER, DENIED)], (NOBODY, NOBODY)),
        (MANAGER, 255.0, vec![(MANAGER, DENIED)], (NOBODY, NOBODY)),
        (MANAGER, 1e9, vec![(MANAGER, DENIED)], (NOBODY, NOBODY)),
        (MANAGER, 154.5, vec![(MANAGER, DENIED)], (NOBODY, NOBODY)),
    ] {
        let (mut world, places) = with_gimbal();
        let second = MavId::new(1, 171);
        world.send(places.gimbal, second, &gimbal_heartbeat());
        let information = device_information(world.now, usual_capabilities());
        world.send(places.gimbal, second, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));

        let claim = command_long(target, 1001, &[-2.0, -2.0, -1.0, -1.0, NAN, NAN, device_id]);
        let answers = world.ask(places.ground, GCS, &claim);

        let acked: Vec<(MavId, u8)> = answers
            .iter()
            .filter(|answer| answer.id() == 77)
            .map(|answer| (answer.source(), answer.decode::<COMMAND_ACK_DATA>().result))
            .collect();
        assert_eq!(acked, results, "{target}, device {device_id}");
        world.forget();
        run_looking(&mut world, places, SECOND / 5, 0.0, 0.0);
        let heard = world.take(places.ground);
        let of_manager = |manager: MavId| {
            let told: Vec<Arrival> = heard.iter().filter(|arrival| arrival.source() == manager).cloned().collect();
            told_control(&told).expect("it tells who is in control").0
        };
        assert_eq!((of_manager(MANAGER), of_manager(other)), after, "{target}, device {device_id}");
    }
}

/// Client checklist E67: "281 never shows a half pair (system without component or the reverse)", whatever is asked for.
#[test]
fn client_item_e67_no_half_of_a_pair_is_ever_told() {
    let (mut world, places) = with_gimbal();
    let values = [-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 0.4, 190.0, 255.0, 256.0, NAN, f32::INFINITY];
    let mut told = Vec::new();
    for first in values {
        for second in values {
            for (sender, command) in [
                (GCS, configure([first, second], [-1.0, -1.0])),
                (COMPANION, configure([-1.0, -1.0], [first, second])),
                (GCS, configure([second, first], [first, second])),
            ] {
                assert!(world.result_of(places.ground, sender, &command).is_some(), "always answered");
                run_looking(&mut world, places, SECOND / 5, 0.0, 0.0);
                told.extend(world.take_messages::<GIMBAL_MANAGER_STATUS_DATA>(places.ground));
            }
        }
    }
    assert!(told.len() > 400);
    for status in told {
        assert_eq!(status.primary_control_sysid == 0, status.primary_control_compid == 0, "{status:?}");
        assert_eq!(status.secondary_control_sysid == 0, status.secondary_control_compid == 0, "{status:?}");
    }
}

/// Client checklist E68: "With nobody in control, 1000 from any client: ACCEPTED, the gimbal moves, 281 still shows nobody
/// (no hidden take-over)."
/// Client checklist E71: "After release by A, B's next 1000 is ACCEPTED without its taking control."
#[test]
fn client_items_e68_and_e71_what_nobody_holds_anybody_may_steer() {
    let (mut world, places) = with_gimbal();
    let mut pitch = -10.0;
    for held_before in [false, true] {
        if held_before {
            assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
            assert_eq!(world.result_of(places.ground, COMPANION, &pitchyaw(-5.0, 0.0, NAN, NAN, 44.0)), Some(DENIED));
            let release = configure([-3.0, -3.0], [-1.0, -1.0]);
            assert_eq!(world.result_of(places.ground, GCS, &release), Some(ACCEPTED));
        }
        for sender in [COMPANION, GCS, MAVSDK] {
            pitch -= 5.0;
            let _ = setpoints(&mut world, places);
            let command = pitchyaw(pitch, 0.0, NAN, NAN, 0.0);
            assert_eq!(world.result_of(place_of(sender, places), sender, &command), Some(ACCEPTED), "{sender}");
            let told = setpoints(&mut world, places);
            assert_near(pitch_yaw_deg(told[0].1.q).0, f64::from(pitch), 0.01);
            run_looking(&mut world, places, SECOND, f64::from(pitch), 0.0);
            assert_eq!(told_control(&world.take(places.ground)), Some((NOBODY, NOBODY)));
        }
    }
}

/// Client checklist E69: "With A in primary control, 1000 from B: DENIED; gimbal unmoved; 281 shows A."
/// Client checklist E70: "With A in primary control, 282 and 287 from B: ignored, no ACK, no frame sent in answer, log
/// limited": a thousand of them are one line with their number.
#[test]
fn client_items_e69_and_e70_who_is_not_in_control_moves_nothing() {
    let (mut world, places) = held((GCS, NOBODY));
    world.send(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0));
    let _ = setpoints(&mut world, places);
    assert_eq!(world.result_of(places.ground, MAVSDK, &pitchyaw(-30.0, 20.0, NAN, NAN, 44.0)), Some(DENIED));
    for _ in 0..500 {
        for message in [set_attitude([1.0, 0.0, 0.0, 0.0], [NAN; 3], 12), set_pitchyaw(-0.5, 0.3, NAN, NAN, 44)] {
            assert_eq!(world.ask(places.ground, MAVSDK, &message), []);
        }
    }
    run_looking(&mut world, places, SECOND, -10.0, 0.0);

    assert_eq!(told_control(&world.take(places.ground)), Some((GCS, NOBODY)));
    for (_, setpoint) in setpoints(&mut world, places) {
        let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
        assert_near(pitch, -10.0, 0.01);
        assert_near(yaw, 0.0, 0.01);
    }
    let snapshot = world.snapshot();
    assert_eq!(snapshot.gimbals[0].rejected["245/190"].values().sum::<u64>(), 1_001);
    let refusals = snapshot.events.iter().filter(|event| event.what == "refused").count();
    assert!(refusals <= 3, "{:?}", snapshot.events);
}

/// Client checklist E72: "Owner silent (no heartbeat) for the configured time: ownership ends, 281 shows it, rates stop
/// before that."
#[test]
fn client_item_e72_a_silent_owner_loses_control_after_its_rates_have_stopped() {
    let (mut world, places) = held((MAVSDK, MAVSDK));
    world.send(places.ground, MAVSDK, &set_pitchyaw(NAN, NAN, 0.0, 0.2, 44));
    let start = world.now;
    let _ = setpoints(&mut world, places);

    // The others are well, and the gimbal.
    run_looking(&mut world, places, Duration::from_secs(12), 0.0, 0.0);

    let heard = world.take(places.ground);
    let free = heard
        .iter()
        .find(|arrival| arrival.id() == 281 && told_control(std::slice::from_ref(arrival)) == Some((NOBODY, NOBODY)));
    let free = free.expect("it is told").at - start;
    let told = setpoints(&mut world, places);
    let stopped = told.iter().find(|(_, setpoint)| setpoint.angular_velocity_z == 0.0).expect("it stops").0 - start;
    assert_eq!((stopped, free), (Duration::from_secs(2), Duration::from_secs(10)));
}

/// Client checklist E73: "281 flows with no client request at all; 1001 from 1/1 (p5 = p6 = 0), then 287 at 50 Hz for 5 s
/// with flags 88 and then 8, then −3,−3,−1,−1: the gimbal follows north, then the vehicle, then is free."
#[test]
fn client_item_e73_px4_is_a_client() {
    let (mut world, places) = with_gimbal();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    turn_vehicle(&mut world, places, 40.0);
    world.forget();
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    assert_eq!(of::<GIMBAL_MANAGER_STATUS_DATA>(&world.take(places.autopilot)).len(), 5);

    let acquire = command_long(MANAGER, 1001, &[1.0, 1.0, -1.0, -1.0, 0.0, 0.0, 154.0]);
    assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &acquire), Some(ACCEPTED));
    for (flags, yaw_deg, follows) in [(88, 70.0_f32, "North"), (8, -20.0, "the vehicle")] {
        let mut heading = 40.0;
        for step in 0..250 {
            // Every second it turns 10° further.
            heading = 40.0 + f64::from(step / 50) * 10.0;
            turn_vehicle(&mut world, places, heading);
            let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(device_status(world.now, 44, -10.0, 0.0));
            world.send(places.gimbal, GIMBAL, &status);
            world.forget();
            let demand = set_pitchyaw(-0.2, yaw_deg.to_radians(), NAN, NAN, flags);
            assert_eq!(answers(&world.ask(places.autopilot, AUTOPILOT, &demand)), 0, "never answered");
            let told = setpoints(&mut world, places);
            assert_eq!(told.len(), 1, "at once");
            let (pitch, yaw) = pitch_yaw_deg(told[0].1.q);
            let expected = if flags == 88 { f64::from(yaw_deg) - heading } else { f64::from(yaw_deg) };
            assert_near(yaw, expected, 0.01);
            assert_near(pitch, f64::to_degrees(-0.2), 0.01);
            world.run_for(Duration::from_millis(20));
        }
        assert_near(heading, 80.0, 0.01);
        assert_eq!(world.snapshot().gimbals[0].primary.as_deref(), Some("1/1"), "it follows {follows}");
    }
    let release = configure([-3.0, -3.0], [-1.0, -1.0]);
    assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &release), Some(ACCEPTED));
    assert_eq!(told_control(&world.take(places.ground)), Some((NOBODY, NOBODY)));
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-5.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
}

/// Client checklist E74: "Secondary owner's 1000 while a primary exists and is active: policy documented; never a crash,
/// always an ACK": its rates move the camera within the nudge, its angles wait until the primary has been silent for two
/// seconds.
#[test]
fn client_item_e74_the_secondary_always_has_an_answer() {
    for (pause, angles) in [(Duration::from_millis(500), DENIED), (Duration::from_millis(2_500), ACCEPTED)] {
        let (mut world, places) = held((GCS, COMPANION));
        let place = place_of(COMPANION, places);
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
        run_looking(&mut world, places, pause, -10.0, 0.0);
        for (command, result) in [
            (pitchyaw(NAN, NAN, 5.0, 0.0, 44.0), ACCEPTED),
            (pitchyaw(-20.0, 10.0, NAN, NAN, 44.0), angles),
            (pitchyaw(NAN, NAN, NAN, NAN, 1.0), angles),
            (pitchyaw(-20.0, 10.0, 5.0, 5.0, 44.0), angles),
        ] {
            assert_eq!(world.result_of(place, COMPANION, &command), Some(result), "after {pause:?}: {command:?}");
        }
    }
}

/// A gimbal held by these two, all of whom were heard.
fn held((primary, secondary): (MavId, MavId)) -> (World, Places) {
    let (mut world, places) = with_gimbal();
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    for holder in [primary, secondary].iter().filter(|holder| **holder != NOBODY) {
        let pair = [f32::from(holder.system), f32::from(holder.component)];
        let (one, two) = ([-1.0, -1.0], pair);
        let command = if *holder == primary { configure(two, one) } else { configure(one, two) };
        assert_eq!(world.result_of(place_of(*holder, places), *holder, &command), Some(ACCEPTED));
    }
    if primary == secondary && primary != NOBODY {
        let pair = [f32::from(primary.system), f32::from(primary.component)];
        assert_eq!(world.result_of(places.ground, primary, &configure(pair, pair)), Some(ACCEPTED));
    }
    world.run_for(SECOND / 10);
    world.forget();
    (world, places)
}

fn place_of(sender: MavId, places: Places) -> Place {
    if sender.system == 1 { places.autopilot } else { places.ground }
}

fn encode(sequence: u8, message: &MavMessage) -> Vec<u8> {
    gimbald::wire::FrameBuffer::default().encode_any(GCS, sequence, message).bytes().to_vec()
}

/// How many answers there are among what comes by itself.
fn answers(arrivals: &[Arrival]) -> usize {
    ids(arrivals).into_iter().filter(|id| *id != 281 && *id != 285).count()
}
