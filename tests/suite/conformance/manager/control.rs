//! Who may steer (protocol checklist 8.5).

use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, Transport};
use gimbald::manager::settings::ControlSettings;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_LONG_DATA, MavMessage};

use super::{COMPANION, SECOND, Setpoint, run_looking, setpoints, told_control, with_gimbal, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, command_long, configure, device_information, device_status, gimbal_heartbeat, ids, pitchyaw,
    px4_heartbeat, quaternion, set_attitude, set_manual_control, set_pitchyaw, take_control, usual_capabilities,
};
use crate::support::wire::hex;
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, Places, World, link, three_links};

const NOBODY: MavId = MavId::new(0, 0);

/// "When CONFIGURE (255,190,−1,−1,NaN,NaN,154) arrives from 255/190 (GV-10), ACK ACCEPTED (GV-11 apart from seq) is
/// sent now and 281 shows 255/190 primary."
#[test]
fn item_59_a_ground_station_takes_control_byte_for_byte() {
    let (mut world, places) = with_gimbal();

    let taken = hex("fd20000008ffbe4c000000007f4300003e43000080bf000080bf0000c07f0000c07f00001a43e90301bf6cfd");
    world.send_bytes(places.ground, &taken);

    let answers = world.take(places.ground);
    assert_eq!(ids(&answers), [77, 281]);
    let golden = hex("fd0a00000901bf4d0000e90300ff00000000ffbe5ce7");
    let answer = &answers[0].bytes;
    assert_eq!([&answer[..4], &answer[5..20]].concat(), [&golden[..4], &golden[5..20]].concat());
    assert_eq!(told_control(&answers), Some((GCS, NOBODY)));
}

/// What each CONFIGURE does to the two places, and how it is answered.
///
/// Protocol checklist 60: "When CONFIGURE (−2,−2,−1,−1,…,154) arrives from 255/190, 281 shows 255/190 primary."
/// Protocol checklist 61: "When CONFIGURE (−3,−3,−1,−1,…,154) arrives from the holder, 281 shows 0/0; from anyone else
/// nothing changes; ACK ACCEPTED in both cases."
/// Protocol checklist 62: "When the holder 255/190 exists and 255/191 sends −3,−3 the slot is unchanged."
/// Protocol checklist 64: "When CONFIGURE has (−1,−1,−1,−1), nothing changes, ACCEPTED."
/// Protocol checklist 65: "When CONFIGURE has (0,0,0,0) from the holder, both slots are cleared."
/// Protocol checklist 67: "When CONFIGURE has (−2, 5,…) (mixed pair), ACK is DENIED and nothing changes."
/// Protocol checklist 68: "When CONFIGURE has 0.5 in any of p1..p4, ACK is DENIED."
/// Protocol checklist 69: "When CONFIGURE has 300 or −4, ACK is DENIED."
#[test]
#[rustfmt::skip]
fn items_60_to_69_configure_decides_who_is_in_control() {
    let other = MavId::new(255, 191);
    for (sender,    primary,         secondary,      result,   expected) in [
        (GCS,       [-2.0, -2.0],    [-1.0, -1.0],   ACCEPTED, (GCS, COMPANION)),
        (COMPANION, [-2.0, -2.0],    [-1.0, -1.0],   ACCEPTED, (COMPANION, COMPANION)),
        (GCS,       [-3.0, -3.0],    [-1.0, -1.0],   ACCEPTED, (NOBODY, COMPANION)),
        (COMPANION, [-3.0, -3.0],    [-1.0, -1.0],   ACCEPTED, (GCS, COMPANION)),
        (other,     [-3.0, -3.0],    [-1.0, -1.0],   ACCEPTED, (GCS, COMPANION)),
        (GCS,       [-1.0, -1.0],    [-1.0, -1.0],   ACCEPTED, (GCS, COMPANION)),
        (GCS,       [0.0, 0.0],      [0.0, 0.0],     DENIED,   (GCS, COMPANION)),
        (GCS,       [0.0, 0.0],      [-1.0, -1.0],   ACCEPTED, (NOBODY, COMPANION)),
        (COMPANION, [0.0, 0.0],      [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (GCS,       [-2.0, 5.0],     [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (other,     [-2.0, -3.0],    [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (other,     [-1.0, -2.0],    [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (other,     [-2.0, -2.0],    [-2.0, 5.0],    DENIED,   (GCS, COMPANION)),
        (other,     [0.5, 190.0],    [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (other,     [255.0, 0.5],    [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (other,     [-2.0, -2.0],    [0.5, 1.0],     DENIED,   (GCS, COMPANION)),
        (other,     [-2.0, -2.0],    [1.0, 0.5],     DENIED,   (GCS, COMPANION)),
        (other,     [300.0, 190.0],  [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (other,     [255.0, 300.0],  [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (other,     [-4.0, -4.0],    [-1.0, -1.0],   DENIED,   (GCS, COMPANION)),
        (other,     [NAN, NAN],      [NAN, NAN],     ACCEPTED, (GCS, COMPANION)),
        (other,     [12.0, 34.0],    [NAN, NAN],     ACCEPTED, (MavId::new(12, 34), COMPANION)),
    ] {
        let (mut world, places) = with_gimbal();
        let both = configure([255.0, 190.0], [1.0, 192.0]);
        assert_eq!(world.result_of(places.ground, GCS, &both), Some(ACCEPTED));

        let sent = configure(primary, secondary);
        assert_eq!(world.result_of(places.ground, sender, &sent), Some(result), "{sender}: {primary:?} {secondary:?}");

        run_looking(&mut world, places, SECOND, 0.0, 0.0);
        assert_eq!(told_control(&world.take(places.ground)), Some(expected), "{sender}: {primary:?} {secondary:?}");
    }
}

/// "When CONFIGURE has (0,0,0,0) from the holder, both slots are cleared."
#[test]
fn item_65_the_holder_of_both_places_clears_both() {
    let (mut world, places) = with_gimbal();
    let both = configure([255.0, 190.0], [255.0, 190.0]);
    assert_eq!(world.result_of(places.ground, GCS, &both), Some(ACCEPTED));

    assert_eq!(world.result_of(places.ground, GCS, &configure([0.0, 0.0], [0.0, 0.0])), Some(ACCEPTED));

    assert_eq!(told_control(&world.take(places.autopilot)), Some((NOBODY, NOBODY)));
}

/// "When the autopilot S/1 is primary and sends (−2,−2,−1,−1), the slot becomes 0/0 (quirk Q-PX4R on); an identical
/// repeat 0.5 s later is ACCEPTED and leaves it 0/0; with the quirk off it stays S/1."
#[test]
fn item_63_px4_gives_control_back_in_its_own_way() {
    for (quirk, expected) in [(true, NOBODY), (false, AUTOPILOT)] {
        let control = ControlSettings { px4_release_quirk: quirk, ..ControlSettings::default() };
        let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });
        world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
        let take = configure([1.0, 1.0], [-1.0, -1.0]);
        assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &take), Some(ACCEPTED));

        for _ in 0..2 {
            assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &take_control()), Some(ACCEPTED));
            world.run_for(SECOND / 2);
            assert_eq!(told_control(&world.take(places.ground)), Some((expected, NOBODY)), "quirk: {quirk}");
        }
    }
}

/// "When CONFIGURE assigns S/192 as secondary, 281 shows it and S/192's nudges work." Here: its angles, while the
/// primary says nothing.
#[test]
fn item_66_a_secondary_may_steer_while_the_primary_is_silent() {
    let (mut world, places) = with_gimbal();
    let both = configure([255.0, 190.0], [1.0, 192.0]);
    assert_eq!(world.result_of(places.ground, GCS, &both), Some(ACCEPTED));
    assert_eq!(told_control(&world.take(places.autopilot)), Some((GCS, COMPANION)));
    world.forget();

    world.send(places.autopilot, COMPANION, &set_pitchyaw(-0.2, NAN, NAN, NAN, 44));

    assert_eq!(setpoints(&mut world, places).len(), 1);
}

/// "When CONFIGURE addresses device id 99, ACK is DENIED."
#[test]
fn item_70_an_unknown_gimbal_is_refused() {
    let (mut world, places) = with_gimbal();
    for gimbal in [99.0, 1.0, 300.0, -1.0, 0.5] {
        for (number, params) in
            [(1001, [-2.0, -2.0, -1.0, -1.0, NAN, NAN, gimbal]), (1000, [0.0, 0.0, NAN, NAN, 44.0, NAN, gimbal])]
        {
            let command = command_long(MavId::new(1, 191), number, &params);
            assert_eq!(world.result_of(places.ground, GCS, &command), Some(DENIED), "{number} for {gimbal}");
        }
    }
    assert_eq!(setpoints(&mut world, places), []);
}

/// "When CONFIGURE has device id 0 and two gimbals are managed, both change."
#[test]
fn item_71_device_id_0_is_every_gimbal() {
    let (mut world, places) = with_gimbal();
    let second = MavId::new(1, 171);
    world.send(places.gimbal, second, &gimbal_heartbeat());
    let information = device_information(world.now, usual_capabilities());
    world.send(places.gimbal, second, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));

    let command = command_long(MavId::new(1, 0), 1001, &[-2.0, -2.0, -1.0, -1.0, NAN, NAN, 0.0]);
    world.send(places.ground, GCS, &command);

    let holders: Vec<Option<String>> = world.snapshot().gimbals.into_iter().map(|gimbal| gimbal.primary).collect();
    assert_eq!(holders, [Some(GCS.to_string()), Some(GCS.to_string())]);
}

/// "When the identical CONFIGURE is received again with confirmation 1, the same ACK is sent again and no second change
/// event occurs."
#[test]
fn item_72_a_repeated_configure_is_answered_again_and_changes_nothing() {
    let (mut world, places) = with_gimbal();
    let first = world.ask(places.ground, GCS, &take_control());
    assert_eq!(ids(&first), [77, 281]);
    let MavMessage::COMMAND_LONG(command) = take_control() else { unreachable!() };
    let again = MavMessage::COMMAND_LONG(COMMAND_LONG_DATA { confirmation: 1, ..command });

    let second = world.ask(places.ground, GCS, &again);

    assert_eq!(ids(&second), [77]);
    assert_eq!(second[0].bytes[10..20], first[0].bytes[10..20]);
}

/// "When command 1000 arrives from a non-holder while someone else holds control, ACK is DENIED and no 284 changes."
/// Protocol checklist 74: "When 282/287/288 arrive from a non-holder, nothing is sent to the device, no reply is sent, a
/// counter rises."
#[test]
fn items_73_and_74_who_is_not_in_control_moves_nothing() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));

    let command = pitchyaw(-30.0, 0.0, NAN, NAN, 44.0);
    assert_eq!(world.result_of(places.autopilot, COMPANION, &command), Some(DENIED));
    let messages = [
        set_attitude(quaternion(-30.0, 0.0), [NAN; 3], 44),
        set_pitchyaw(-0.5, 0.0, NAN, NAN, 44),
        set_manual_control(0.5, 0.0, NAN, NAN),
        set_manual_control(NAN, NAN, 0.5, 0.5),
    ];
    for message in messages {
        assert_eq!(world.ask(places.autopilot, COMPANION, &message), []);
        assert_eq!(world.take(places.gimbal), []);
    }
    let rejected = &world.snapshot().gimbals[0].rejected;
    assert_eq!(rejected["1/192"]["not_in_control"], 5);

    // And while the holder's setpoint is streamed, it stays what it is.
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    assert_eq!(world.result_of(places.autopilot, COMPANION, &command), Some(DENIED));
    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    let streamed = setpoints(&mut world, places);
    assert!(streamed.len() >= 20);
    assert!(streamed.iter().all(|(_, setpoint)| setpoint.q == quaternion(-10.0, 0.0)));
}

/// "When nobody holds control and `open_when_unclaimed` is off, 1000 is DENIED; when on, it is executed."
#[test]
fn item_75_a_gimbal_nobody_holds_is_free_or_closed() {
    for (open, result) in [(true, ACCEPTED), (false, DENIED)] {
        let control = ControlSettings { open_when_unclaimed: open, ..ControlSettings::default() };
        let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });

        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-30.0, 0.0, NAN, NAN, 44.0)), Some(result));
        assert_eq!(setpoints(&mut world, places).len(), usize::from(open));
        world.send(places.ground, GCS, &set_pitchyaw(-0.2, 0.0, NAN, NAN, 44));
        assert_eq!(setpoints(&mut world, places).len(), usize::from(open));

        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-30.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    }
}

/// "When the primary's heartbeat is missing for 10 s, the slot is cleared, rates are zeroed, 281 is sent."
#[test]
fn item_76_the_control_of_a_silent_holder_lapses() {
    // A rate that would outlast its holder.
    let control = ControlSettings { command_rate_timeout: Duration::ZERO, ..ControlSettings::default() };
    let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    world.run_for(SECOND / 2);
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(NAN, NAN, 5.0, 0.0, 44.0)), Some(ACCEPTED));
    let lapses = world.now + Duration::from_secs(10);
    let status = device_status(world.now, 44, 0.0, 0.0);
    let status = (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status));
    world.forget();

    world.run_with(Duration::from_secs(12), &[status]);

    let heard = world.take(places.ground);
    let lapsed = heard.iter().find(|at| told_control(std::slice::from_ref(at)) == Some((NOBODY, NOBODY)));
    assert_eq!(lapsed.expect("it is told").at, lapses);
    let told = setpoints(&mut world, places);
    let (at, stopped) = told.iter().find(|(_, told)| told.angular_velocity_y == 0.0).expect("it is stopped");
    assert_eq!((*at, stopped.angular_velocity_z), (lapses, 0.0));
    assert!(told.last().is_some_and(|(_, held)| held.angular_velocity_y.is_nan() && held.q == [1.0, 0.0, 0.0, 0.0]));
}

/// "When a new primary takes over during a rate set-point, a 284 with zero rates is sent now."
#[test]
fn item_77_a_new_holder_finds_the_gimbal_at_rest() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    world.send(places.ground, GCS, &set_pitchyaw(NAN, NAN, 0.1, 0.2, 44));
    world.forget();

    world.send(places.autopilot, COMPANION, &take_control());

    let stopped: Setpoint = super::only_setpoint(&mut world, places);
    assert_eq!((stopped.angular_velocity_y, stopped.angular_velocity_z), (0.0, 0.0));
}

/// "When MAVSDK-style CONFIGURE puts 245/191 in both slots, set-points of 245/191 are executed once, not doubled."
#[test]
fn item_78_one_who_holds_both_places_steers_once() {
    const MAVSDK: MavId = MavId::new(245, 191);
    let (mut world, places) = with_gimbal();
    let both = configure([245.0, 191.0], [245.0, 191.0]);
    assert_eq!(world.result_of(places.ground, MAVSDK, &both), Some(ACCEPTED));
    world.forget();

    world.send(places.ground, MAVSDK, &set_pitchyaw(-0.25, 0.5, NAN, NAN, 44));

    let setpoint = super::only_setpoint(&mut world, places);
    let (pitch, yaw) = crate::support::script::pitch_yaw_deg(setpoint.q);
    super::assert_near(pitch, -14.324, 0.001);
    super::assert_near(yaw, 28.648, 0.001);
}

/// D6: "holder's heartbeat *and* traffic missing": a holder that is heard on any link keeps control.
#[test]
fn item_76_a_holder_that_is_heard_keeps_control() {
    let mut settings = three_links();
    settings.links.push(link("second ground", Role::Ground, Transport::Datagrams));
    let (mut world, all) = World::new(settings);
    let places = Places { autopilot: all[0], gimbal: all[1], ground: all[2] };
    world.send(places.gimbal, GIMBAL, &gimbal_heartbeat());
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));

    let status = device_status(world.now, 44, 0.0, 0.0);
    let repeated = [
        (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
        (Duration::from_secs(9), all[3], GCS, crate::support::script::ground_heartbeat()),
    ];
    world.run_with(Duration::from_secs(60), &repeated);

    assert_eq!(world.snapshot().gimbals[0].primary, Some(GCS.to_string()));
}
