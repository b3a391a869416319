//! Taking control from one who has it, and what the autopilot borrows (protocol.md 2.4, decisions D6, D9 and D24).

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::gimbals::settings::{GimbalSettings, Takeover};
use gimbald::manager::settings::ControlSettings;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{ATTITUDE_DATA, COMMAND_ACK_DATA, MavMessage};

use super::{COMPANION, SECOND, only_setpoint, run_looking, setpoints, told_control, with_gimbal_that};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, configure, device_status, ids, of, pitch_yaw_deg, pitchyaw, px4_heartbeat, set_pitchyaw,
    take_control, usual_capabilities,
};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, Place, Places, World, heartbeat, three_links};

const NOBODY: MavId = MavId::new(0, 0);
/// A program on the ground that does not call itself a ground station.
const SCRIPT: MavId = MavId::new(245, 191);
/// A second ground station.
const TABLET: MavId = MavId::new(254, 190);

/// `takeover = "open"`: anyone takes. `"ask"` (D24): "another's CONFIGURE is DENIED … until the holder releases", but the
/// autopilot may borrow. `"priority"`: only who ranks higher, and a ground station ranks above the autopilot, that above
/// the rest of the vehicle, that above anybody else. `"exclusive"`: nobody, the autopilot neither.
#[test]
#[rustfmt::skip]
fn each_policy_lets_some_take_over() {
    const OPEN: Takeover = Takeover::Open;
    const ASK: Takeover = Takeover::Ask;
    const PRIORITY: Takeover = Takeover::Priority;
    const EXCLUSIVE: Takeover = Takeover::Exclusive;
    for (policy,    holder,    taker,     result) in [
        (OPEN,      GCS,       SCRIPT,    ACCEPTED),
        (OPEN,      GCS,       AUTOPILOT, ACCEPTED),
        (ASK,       GCS,       TABLET,    DENIED),
        (ASK,       COMPANION, GCS,       DENIED),
        (ASK,       GCS,       AUTOPILOT, ACCEPTED),
        (PRIORITY,  GCS,       TABLET,    DENIED),
        (PRIORITY,  GCS,       AUTOPILOT, DENIED),
        (PRIORITY,  GCS,       SCRIPT,    DENIED),
        (PRIORITY,  AUTOPILOT, TABLET,    ACCEPTED),
        (PRIORITY,  AUTOPILOT, COMPANION, DENIED),
        (PRIORITY,  COMPANION, AUTOPILOT, ACCEPTED),
        (PRIORITY,  COMPANION, SCRIPT,    DENIED),
        (PRIORITY,  SCRIPT,    COMPANION, ACCEPTED),
        (PRIORITY,  SCRIPT,    GCS,       ACCEPTED),
        (EXCLUSIVE, SCRIPT,    GCS,       DENIED),
        (EXCLUSIVE, COMPANION, AUTOPILOT, DENIED),
    ] {
        for [mine, other] in [[0, 1], [1, 0]] {
            let (mut world, places) = under(policy);
            let claim = |id: MavId, place: usize| {
                let mut pairs = [[-1.0, -1.0]; 2];
                pairs[place] = [id.system.into(), id.component.into()];
                configure(pairs[0], pairs[1])
            };
            assert_eq!(world.result_of(at(places, holder), holder, &claim(holder, mine)), Some(ACCEPTED));

            let answer = world.result_of(at(places, taker), taker, &claim(taker, mine));

            // The secondary place is never borrowed: under "ask" the autopilot gets none.
            let borrows_secondary = policy == ASK && taker == AUTOPILOT && mine == 1;
            let expected = if borrows_secondary { DENIED } else { result };
            assert_eq!(answer, Some(expected), "{policy:?}: {taker} takes {mine} from {holder}");
            let mut held = [NOBODY; 2];
            held[mine] = if expected == ACCEPTED { taker } else { holder };
            assert_eq!(in_control(&mut world, places), (held[0], held[1]));
            // And primary control that nobody has is free under each policy; secondary control, beside it, is the primary's.
            let is_free = other == 0 || expected == ACCEPTED;
            let other_result = if is_free { ACCEPTED } else { DENIED };
            assert_eq!(world.result_of(at(places, taker), taker, &claim(taker, other)), Some(other_result));
        }
    }
}

/// `takeover`: "This holds for primary and secondary control": a stranger who is denied primary control gets no secondary
/// control beside it either, from where it would steer while the holder says nothing.
#[test]
fn who_may_not_take_control_does_not_get_in_beside_the_holder() {
    for (policy, reason) in [
        (Takeover::Ask, "holder_must_release"),
        (Takeover::Priority, "holder_ranks_no_lower"),
        (Takeover::Exclusive, "exclusively_held"),
    ] {
        let (mut world, places) = under(policy);
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-30.0, 40.0, NAN, NAN, 44.0)), Some(ACCEPTED));
        run_looking(&mut world, places, 3 * SECOND, -30.0, 40.0);
        world.forget();

        // For itself, and for another.
        for secondary in [[-2.0, -2.0], [245.0, 191.0], [1.0, 192.0]] {
            let claim = configure([-1.0, -1.0], secondary);
            assert_eq!(world.result_of(places.ground, SCRIPT, &claim), Some(DENIED), "{policy:?}: {secondary:?}");
        }
        let angle = pitchyaw(-85.0, -120.0, NAN, NAN, 44.0);
        assert_eq!(world.result_of(places.ground, SCRIPT, &angle), Some(DENIED), "{policy:?}");
        assert_eq!(setpoints(&mut world, places), []);
        assert_eq!(world.snapshot().gimbals[0].rejected["245/191"][reason], 3, "{policy:?}");
        // Giving up what it does not have changes nothing, and is no claim.
        for nothing in [[-3.0, -3.0], [0.0, 0.0], [-1.0, -1.0]] {
            let nothing = configure([-1.0, -1.0], nothing);
            assert_eq!(world.result_of(places.ground, SCRIPT, &nothing), Some(ACCEPTED), "{policy:?}");
        }
        assert_eq!(in_control(&mut world, places), (GCS, NOBODY));

        // The holder gives it, also together with its own place; then who has it moves the camera.
        assert_eq!(world.result_of(places.ground, GCS, &configure([-1.0, -1.0], [245.0, 191.0])), Some(ACCEPTED));
        assert_eq!(world.result_of(places.ground, SCRIPT, &angle), Some(ACCEPTED), "{policy:?}");
        assert_eq!(world.result_of(places.ground, SCRIPT, &configure([-1.0, -1.0], [-3.0, -3.0])), Some(ACCEPTED));
        assert_eq!(world.result_of(places.ground, GCS, &configure([254.0, 190.0], [245.0, 191.0])), Some(ACCEPTED));
        assert_eq!(in_control(&mut world, places), (TABLET, SCRIPT), "{policy:?}");
    }
}

/// Under `"open"`, and under `"priority"` for who ranks higher, secondary control that nobody has is there for the taking.
#[test]
fn who_may_take_control_may_get_in_beside_the_holder() {
    for (policy, holder, taker) in [
        (Takeover::Open, GCS, SCRIPT),
        (Takeover::Priority, COMPANION, GCS),
        (Takeover::Priority, COMPANION, AUTOPILOT),
        (Takeover::Priority, SCRIPT, COMPANION),
    ] {
        let (mut world, places) = under(policy);
        assert_eq!(world.result_of(at(places, holder), holder, &take_control()), Some(ACCEPTED));
        let claim = configure([-1.0, -1.0], [-2.0, -2.0]);
        assert_eq!(world.result_of(at(places, taker), taker, &claim), Some(ACCEPTED), "{policy:?}: {taker}");
        assert_eq!(in_control(&mut world, places), (holder, taker));
    }
}

/// 281: "0 = none". A component with a 0 in its ids, as pymavlink's scripts have by default, is nobody whom 281 could name:
/// it is denied control, and everybody else goes on to have a say. It steers what nobody holds, as anybody does (D3).
#[test]
fn who_has_no_ids_of_its_own_gets_no_control() {
    for nobody in [MavId::new(255, 0), MavId::new(0, 190), MavId::new(0, 0)] {
        let (mut world, places) = under(Takeover::Open);
        for places_claimed in [([-2.0, -2.0], [-1.0, -1.0]), ([-1.0, -1.0], [-2.0, -2.0])] {
            let claim = configure(places_claimed.0, places_claimed.1);
            let answers = world.ask(places.ground, nobody, &claim);
            let acks: Vec<_> = of::<COMMAND_ACK_DATA>(&answers);
            assert_eq!(acks.iter().map(|ack| ack.result).collect::<Vec<_>>(), [DENIED], "{nobody}: {claim:?}");
        }
        assert_eq!(in_control(&mut world, places), (NOBODY, NOBODY), "{nobody}");
        let gimbal = &world.snapshot().gimbals[0];
        assert_eq!((&gimbal.primary, &gimbal.secondary), (&None, &None), "{nobody}");
        assert_eq!(gimbal.rejected[&nobody.to_string()]["id_of_nobody"], 2);

        world.send(places.ground, nobody, &pitchyaw(-20.0, 0.0, NAN, NAN, 44.0));
        assert_eq!(world.snapshot().gimbals[0].setpoint.as_ref().and_then(|it| it.pitch_deg), Some(-20.0), "{nobody}");
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
        world.send(places.ground, nobody, &pitchyaw(-20.0, 0.0, NAN, NAN, 44.0));
        assert_eq!(world.snapshot().gimbals[0].setpoint.as_ref().and_then(|it| it.pitch_deg), Some(-10.0), "{nobody}");
    }
}

/// "Assigning ids other than the sender's is allowed (delegation)"; the holder may, whatever the policy, and a place
/// given up is free.
#[test]
fn a_holder_gives_its_place_to_whom_it_likes() {
    for policy in [Takeover::Open, Takeover::Ask, Takeover::Priority, Takeover::Exclusive] {
        let (mut world, places) = under(policy);
        assert_eq!(world.result_of(places.ground, GCS, &configure([-2.0, -2.0], [-2.0, -2.0])), Some(ACCEPTED));

        let given = configure([245.0, 191.0], [1.0, 192.0]);
        assert_eq!(world.result_of(places.ground, GCS, &given), Some(ACCEPTED), "{policy:?}");
        assert_eq!(in_control(&mut world, places), (SCRIPT, COMPANION));

        let released = configure([-3.0, -3.0], [-1.0, -1.0]);
        assert_eq!(world.result_of(places.ground, SCRIPT, &released), Some(ACCEPTED), "{policy:?}");
        assert_eq!(world.result_of(places.ground, TABLET, &take_control()), Some(ACCEPTED), "{policy:?}");
        assert_eq!(in_control(&mut world, places), (TABLET, COMPANION));
    }
}

/// "Clearing to 0/0 by someone who is not the holder: … allow only the holder, our own system's autopilot"; and that one
/// only where the policy lets it have the place.
#[test]
fn the_autopilot_clears_where_it_may_take() {
    for (policy, holder, result) in [
        (Takeover::Open, GCS, ACCEPTED),
        (Takeover::Ask, GCS, DENIED),
        (Takeover::Priority, GCS, DENIED),
        (Takeover::Priority, COMPANION, ACCEPTED),
        (Takeover::Exclusive, COMPANION, DENIED),
    ] {
        let (mut world, places) = under(policy);
        assert_eq!(world.result_of(at(places, holder), holder, &take_control()), Some(ACCEPTED));

        let cleared = configure([0.0, 0.0], [-1.0, -1.0]);
        assert_eq!(
            world.result_of(places.autopilot, AUTOPILOT, &cleared),
            Some(result),
            "{policy:?}, held by {holder}"
        );

        let left = if result == ACCEPTED { NOBODY } else { holder };
        assert_eq!(in_control(&mut world, places), (left, NOBODY), "{policy:?}, held by {holder}");
    }
}

/// D6: "the autopilot's take-over … is a borrow: the former holder, if alive, is restored when it releases", by −3, by 0,
/// or by −2 where `px4_release_quirk` is on.
#[test]
fn the_autopilot_gives_back_what_it_borrowed() {
    for (quirk, release) in [(false, -3.0), (false, 0.0), (true, -2.0)] {
        let (mut world, places) = with_quirk(quirk);
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
        let take = configure([1.0, 1.0], [-1.0, -1.0]);

        let borrowed = world.ask(places.autopilot, AUTOPILOT, &take);
        assert_eq!((ids(&borrowed), told_control(&borrowed)), (vec![77, 281, 253], Some((AUTOPILOT, NOBODY))));
        assert_eq!(told_control(&world.take(places.ground)), Some((AUTOPILOT, NOBODY)), "told to all at once");

        let given_back = world.ask(places.autopilot, AUTOPILOT, &configure([release, release], [-1.0, -1.0]));
        assert_eq!(
            (ids(&given_back), told_control(&given_back)),
            (vec![77, 281, 253], Some((GCS, NOBODY))),
            "{release}"
        );
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    }
}

/// D9: "no change of … owner … moves the camera by itself", and D7: "on change of owner … zero is sent at once"; also
/// when a borrow begins and when it ends.
#[test]
fn the_camera_rests_when_control_is_borrowed_and_when_it_goes_back() {
    let (mut world, places) = under(Takeover::Open);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    let release = configure([-3.0, -3.0], [-1.0, -1.0]);
    for (from, who, gives) in [(places.ground, GCS, take_control()), (places.autopilot, AUTOPILOT, release)] {
        world.send(from, who, &set_pitchyaw(NAN, NAN, 0.1, 0.2, 44));
        run_looking(&mut world, places, SECOND / 10, 5.0, 7.0);
        world.forget();

        world.send(places.autopilot, AUTOPILOT, &gives);

        let stopped = only_setpoint(&mut world, places);
        assert_eq!((stopped.angular_velocity_y, stopped.angular_velocity_z), (0.0, 0.0), "{who}");
        run_looking(&mut world, places, SECOND, 5.0, 7.0);
        let (_, held) = setpoints(&mut world, places).pop().expect("it is held");
        let (pitch, yaw) = pitch_yaw_deg(held.q);
        super::assert_near(pitch, 5.0, 0.001);
        super::assert_near(yaw, 7.0, 0.001);
    }
}

/// D6: "or its own lease lapses": an autopilot that is not heard gives control back without a word.
#[test]
fn an_autopilot_that_falls_silent_gives_back_what_it_borrowed() {
    let (mut world, places) = under(Takeover::Ask);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    world.run_for(SECOND / 2);
    assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &take_control()), Some(ACCEPTED));
    let lapses = world.now + Duration::from_secs(10);
    world.forget();

    run_looking(&mut world, places, Duration::from_secs(12), 0.0, 0.0);

    let heard = world.take(places.ground);
    let restored = heard.iter().find(|at| told_control(std::slice::from_ref(at)) == Some((GCS, NOBODY)));
    assert_eq!(restored.expect("it is told").at, lapses);
    let told = heard.iter().filter_map(|at| told_control(std::slice::from_ref(at)));
    assert!(told.into_iter().all(|(primary, _)| primary != NOBODY), "nobody is never told in between");
}

/// "When the autopilot has started again, what it had goes back": it has not when only its messages come faster than
/// before, because a radio does not hold them back any more.
#[test]
fn an_autopilot_that_is_heard_sooner_than_before_has_not_started_again() {
    for late_ms in [1_500, 8_000] {
        let (mut world, places) = under(Takeover::Open);
        let tell = |world: &mut World, boot_ms: u64| {
            let attitude = ATTITUDE_DATA {
                time_boot_ms: boot_ms as u32,
                roll: 0.0,
                pitch: 0.0,
                yaw: 0.0,
                rollspeed: 0.0,
                pitchspeed: 0.0,
                yawspeed: 0.0,
            };
            world.send(places.autopilot, AUTOPILOT, &MavMessage::ATTITUDE(attitude));
            run_looking(world, places, SECOND / 10, 0.0, 0.0);
        };
        let boot_ms = |world: &World| 100_000 + world.now.as_micros() / 1_000;
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
        assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &take_control()), Some(ACCEPTED));
        for _ in 0..250 {
            let told = boot_ms(&world) - late_ms;
            tell(&mut world, told);
        }
        world.send(places.autopilot, AUTOPILOT, &set_pitchyaw(NAN, NAN, 0.0, 0.1, 44));
        for _ in 0..10 {
            let told = boot_ms(&world);
            tell(&mut world, told);
        }
        assert_eq!(in_control(&mut world, places), (AUTOPILOT, NOBODY), "{late_ms} ms");
        let setpoint = world.snapshot().gimbals[0].setpoint.clone();
        assert_eq!(setpoint.map(|it| it.mode), Some("rate".to_owned()), "it goes on to turn");

        tell(&mut world, 200);
        assert_eq!(in_control(&mut world, places), (GCS, NOBODY), "{late_ms} ms");
    }
}

/// "If alive (heard within the lease)": the lease of who lent control runs on meanwhile.
#[test]
fn a_lender_that_is_gone_gets_nothing_back() {
    let (mut world, places) = under(Takeover::Open);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &take_control()), Some(ACCEPTED));
    let status = device_status(world.now, 44, 0.0, 0.0);
    let repeated = [
        (SECOND / 10, places.gimbal, GIMBAL, MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status)),
        (SECOND, places.autopilot, AUTOPILOT, px4_heartbeat()),
    ];
    world.run_with(Duration::from_secs(11), &repeated);
    assert_eq!(in_control(&mut world, places), (AUTOPILOT, NOBODY));

    assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &configure([-3.0, -3.0], [-1.0, -1.0])), Some(ACCEPTED));

    assert_eq!(in_control(&mut world, places), (NOBODY, NOBODY));
}

/// "It taking control back, or releasing, or a third party taking over, ends the borrow."
#[test]
fn a_borrow_ends_with_the_next_who_takes_control() {
    let release = || configure([-3.0, -3.0], [-1.0, -1.0]);
    for (who, says, holder) in [(GCS, take_control(), GCS), (GCS, release(), NOBODY), (TABLET, take_control(), TABLET)]
    {
        let (mut world, places) = under(Takeover::Open);
        assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
        assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &take_control()), Some(ACCEPTED));

        assert_eq!(world.result_of(places.ground, who, &says), Some(ACCEPTED));
        assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &release()), Some(ACCEPTED));

        assert_eq!(in_control(&mut world, places), (holder, NOBODY), "{who}");
    }
}

/// D24 and D6 together: nobody asked the lender, so it need not ask; a third party must.
#[test]
fn under_ask_only_the_lender_takes_back_what_the_autopilot_borrowed() {
    let (mut world, places) = under(Takeover::Ask);
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    assert_eq!(world.result_of(places.autopilot, AUTOPILOT, &take_control()), Some(ACCEPTED));

    assert_eq!(world.result_of(places.ground, TABLET, &take_control()), Some(DENIED));
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    assert_eq!(in_control(&mut world, places), (GCS, NOBODY));
}

/// D6: "holder's heartbeat *and* traffic missing for `lease_timeout_s`: slot cleared". A place given to one that was never
/// heard lapses too, and anything that a holder sends keeps it.
#[test]
fn whoever_was_given_control_must_be_heard() {
    let (mut world, places) = under(Takeover::Exclusive);
    let given = configure([12.0, 34.0], [1.0, 192.0]);
    assert_eq!(world.result_of(places.ground, GCS, &given), Some(ACCEPTED));
    let lapses = world.now + Duration::from_secs(10);
    world.forget();

    let ping = MavMessage::PARAM_REQUEST_LIST(gimbald::wire::dialect::PARAM_REQUEST_LIST_DATA {
        target_system: 1,
        target_component: 1,
    });
    world.run_with(Duration::from_secs(12), &[(SECOND, places.autopilot, COMPANION, ping)]);

    let heard = world.take(places.ground);
    let lapsed = heard.iter().find(|at| told_control(std::slice::from_ref(at)) == Some((NOBODY, COMPANION)));
    assert_eq!(lapsed.expect("it is told").at, lapses);
    assert_eq!(in_control(&mut world, places), (NOBODY, COMPANION));
    assert_eq!(world.result_of(places.ground, SCRIPT, &take_control()), Some(ACCEPTED), "it is free");
}

/// A world under a policy, in which everybody has said what it is.
pub(super) fn under(takeover: Takeover) -> (World, Places) {
    with(takeover, ControlSettings::default())
}

fn with_quirk(px4_release_quirk: bool) -> (World, Places) {
    with(Takeover::Ask, ControlSettings { px4_release_quirk, ..ControlSettings::default() })
}

fn with(takeover: Takeover, control: ControlSettings) -> (World, Places) {
    let gimbals = vec![GimbalSettings { takeover, ..GimbalSettings::found("camera".to_owned()) }];
    let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, gimbals, ..three_links() });
    world.send(places.autopilot, AUTOPILOT, &px4_heartbeat());
    world.send(places.autopilot, COMPANION, &heartbeat(18, 8));
    world.send(places.ground, SCRIPT, &heartbeat(0, 8));
    world.send(places.ground, TABLET, &heartbeat(6, 8));
    world.forget();
    (world, places)
}

fn at(places: Places, id: MavId) -> Place {
    if id.system == 1 { places.autopilot } else { places.ground }
}

/// Who 281 says is in control, asked for.
fn in_control(world: &mut World, places: Places) -> (MavId, MavId) {
    let told = world.ask(places.ground, GCS, &crate::support::script::request_message(MavId::new(1, 191), 281));
    told_control(&told).expect("it is told")
}
