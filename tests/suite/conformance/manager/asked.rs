//! What is asked of a gimbal by its name, over HTTP: D5, "one gate for v2 messages, v2 commands, v1 commands, ROI, RC and
//! HTTP. Nothing moves the gimbal that did not pass it. In 281, HTTP and RC appear as the manager's own ids; the status says
//! `"http"` or `"rc"`".

use std::time::Duration;

use gimbald::bridge::Input;
use gimbald::bridge::settings::Settings;
use gimbald::geometry::{Angle, AngularRate, YawFrame};
use gimbald::gimbals::operation::{Motors, Operation, OperationError, ResetMode, Restart};
use gimbald::gimbals::settings::{GimbalSettings, Takeover};
use gimbald::manager::asked::{Answer, Asked, NotDone};
use gimbald::manager::request::{AxisDemand, Refusal};
use gimbald::manager::roi::Datum;
use gimbald::manager::settings::ControlSettings;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{CharArray, MavMessage, PARAM_REQUEST_LIST_DATA, PARAM_VALUE_DATA};

use super::{
    FIELD, SECOND, fly, look, only_setpoint, run_flying, run_looking, setpoints, told_control, with_gimbal,
    with_gimbal_that,
};
use crate::support::script::{
    ACCEPTED, DENIED, NAN, again, configure, device_status, ground_heartbeat, pitch_yaw_deg, pitchyaw, take_control,
    usual_capabilities,
};
use crate::support::world::{GCS, GIMBAL, MANAGER, World, three_links};

const NAME: &str = "gimbal-154";
const NOBODY: MavId = MavId::new(0, 0);

/// Asks for one thing and gives its one answer, which must come at once.
fn ask(world: &mut World, asked: &Asked) -> Answer {
    world.answers.clear();
    let id = world.ask_by_name(NAME, asked);
    let [(answered, answer)] = &world.answers[..] else { panic!("{:?} is no single answer", world.answers) };
    assert_eq!(*answered, id);
    answer.clone()
}

fn denied(reason: &'static str, holder: Option<MavId>) -> Answer {
    Err(NotDone::Refused { refusal: Refusal::denied(reason), holder })
}

fn later(reason: &'static str) -> Answer {
    Err(NotDone::Refused { refusal: Refusal::later(reason), holder: None })
}

fn angle(degrees: f64) -> AxisDemand {
    AxisDemand { angle: Some(Angle::from_degrees(degrees)), rate: None }
}

fn down_to_the_right() -> Asked {
    Asked::Point { roll: AxisDemand::default(), pitch: angle(-30.0), yaw: angle(20.0), yaw_frame: YawFrame::Vehicle }
}

fn turn_right() -> Asked {
    let yaw = AngularRate::from_degrees_per_second(10.0);
    Asked::Turn { roll: None, pitch: AngularRate::ZERO, yaw, yaw_frame: YawFrame::Vehicle }
}

fn control_of(world: &World) -> (Option<String>, Option<String>) {
    let gimbal = world.snapshot().gimbals.remove(0);
    (gimbal.primary, gimbal.setpoint.and_then(|setpoint| setpoint.source))
}

fn closed() -> Settings {
    let control = ControlSettings { open_when_unclaimed: false, ..ControlSettings::default() };
    Settings { control, ..three_links() }
}

/// D5: who asks over HTTP stands in 281 as the manager's own ids, in the status and its events as `http`, and keeps others
/// from steering as every holder does.
#[test]
fn http_holds_control_as_everybody_does() {
    let (mut world, places) = with_gimbal();

    assert_eq!(ask(&mut world, &Asked::TakeControl), Ok(()));

    assert_eq!(told_control(&world.take(places.ground)), Some((MANAGER, NOBODY)));
    assert_eq!(control_of(&world), (Some("http".to_owned()), None));
    assert_eq!(world.snapshot().events[0].text, "http took control");
    assert_eq!(world.snapshot().events[0].to.as_deref(), Some("http"));
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(DENIED));
    assert_eq!(world.snapshot().events[0].text, "255/190 was refused: http is in control");
    assert!(setpoints(&mut world, places).is_empty());

    assert_eq!(ask(&mut world, &down_to_the_right()), Ok(()));
    let setpoint = only_setpoint(&mut world, places);
    let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
    assert_eq!((setpoint.flags, pitch.round(), yaw.round()), (0x2c, -30.0, 20.0));
    assert_eq!(control_of(&world), (Some("http".to_owned()), Some("http".to_owned())));

    assert_eq!(ask(&mut world, &Asked::ReleaseControl), Ok(()));
    assert_eq!(told_control(&world.take(places.ground)), Some((NOBODY, NOBODY)));
}

/// D5: "one gate": as secondary HTTP says nothing of places and of what the gimbal does while the primary is active, as
/// everybody, and gives that place up when it releases.
#[test]
fn http_as_secondary_has_the_voice_of_a_secondary() {
    let (mut world, places) = with_gimbal();
    assert_eq!(world.result_of(places.ground, GCS, &configure([255.0, 190.0], [1.0, 191.0])), Some(ACCEPTED));
    assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(-10.0, 0.0, NAN, NAN, 44.0)), Some(ACCEPTED));
    fly(&mut world, places, FIELD, 0.0);
    let place = Asked::LookAt { latitude_deg: 47.5, longitude_deg: 8.5, altitude_m: 400.0, datum: Datum::MeanSeaLevel };
    let told = world.snapshot().gimbals[0].setpoint.clone();
    for asked in [place, Asked::EndRoi, Asked::Stop, Asked::Operation(Operation::Reset(ResetMode::Yaw))] {
        assert_eq!(ask(&mut world, &asked), denied("primary_is_active", Some(GCS)), "{asked:?}");
    }
    assert_eq!(world.snapshot().gimbals[0].setpoint, told);

    assert_eq!(world.snapshot().gimbals[0].secondary.as_deref(), Some("http"));
    assert_eq!(ask(&mut world, &Asked::ReleaseControl), Ok(()));
    let gimbal = &world.snapshot().gimbals[0];
    assert_eq!((gimbal.primary.as_deref(), gimbal.secondary.as_deref()), (Some("255/190"), None));
}

/// "`setpoint`: what it is told": its roll as well, an angle (level unless somebody asks for another) or a rate, where one is
/// demanded.
#[test]
fn the_status_tells_the_roll_that_is_demanded() {
    let (mut world, _) = with_gimbal();
    let degrees_per_second = AngularRate::from_degrees_per_second;
    let rolled =
        Asked::Point { roll: angle(10.0), pitch: angle(-30.0), yaw: angle(20.0), yaw_frame: YawFrame::Vehicle };
    let rolling = Asked::Turn {
        roll: Some(degrees_per_second(5.0)),
        pitch: AngularRate::ZERO,
        yaw: degrees_per_second(10.0),
        yaw_frame: YawFrame::Vehicle,
    };
    for (asked, mode, roll_deg, roll_rate_dps) in [
        (rolled, "angle", Some(10.0), None),
        (down_to_the_right(), "angle", Some(0.0), None),
        (rolling, "rate", None, Some(5.0)),
        (turn_right(), "rate", None, None),
        (Asked::Neutral, "neutral", None, None),
    ] {
        assert_eq!(ask(&mut world, &asked), Ok(()));
        let told = world.snapshot().gimbals.remove(0).setpoint.expect("it is told");
        let round = |value: Option<f64>| value.map(|value| value.round() + 0.0);
        assert_eq!(
            (told.mode.as_str(), round(told.roll_deg), round(told.roll_rate_dps)),
            (mode, roll_deg, roll_rate_dps),
            "{asked:?}"
        );
    }
}

/// D4: "Someone else holds it: commands DENIED … counted per sender with the reason and shown", whatever is asked.
#[test]
fn who_is_not_in_control_is_refused_and_counted() {
    let settings = GimbalSettings { takeover: Takeover::Ask, ..GimbalSettings::found(NAME.to_owned()) };
    let (mut world, places) =
        with_gimbal_that(usual_capabilities(), Settings { gimbals: vec![settings], ..three_links() });
    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));
    world.forget();
    let place = Asked::LookAt { latitude_deg: 47.0, longitude_deg: 8.0, altitude_m: 400.0, datum: Datum::MeanSeaLevel };
    let all = [
        down_to_the_right(),
        turn_right(),
        Asked::Stop,
        Asked::Lock,
        Asked::Follow,
        Asked::Neutral,
        Asked::Retract { may_cut_motors: false },
        place,
        Asked::EndRoi,
        Asked::Operation(Operation::Motors(Motors::On)),
        Asked::Operation(Operation::Restart(Restart::Reboot)),
        Asked::Operation(Operation::SetParameter { name: "PWR_PAN".to_owned(), value: 1.0 }),
    ];
    for asked in &all {
        assert_eq!(ask(&mut world, asked), denied("not_in_control", Some(GCS)), "{asked:?}");
    }
    assert_eq!(ask(&mut world, &Asked::TakeControl), denied("holder_must_release", Some(GCS)));
    let expected = [("holder_must_release".to_owned(), 1), ("not_in_control".to_owned(), all.len() as u64)].into();
    assert_eq!(world.snapshot().gimbals[0].rejected, [("http".to_owned(), expected)].into());
    assert!(setpoints(&mut world, places).is_empty());

    // What moves nothing needs no control.
    let information = Asked::Operation(Operation::RequestInformation);
    assert_eq!(ask(&mut world, &information), Err(NotDone::Operation(OperationError::Unsupported)));
    let refresh = Asked::Operation(Operation::RefreshParameters);
    world.ask_by_name(NAME, &refresh);
    let lists: Vec<PARAM_REQUEST_LIST_DATA> = world.take_messages(places.gimbal);
    assert_eq!(lists.len(), 1, "it is asked for them");
}

/// D3: "`unclaimed = \"open\"`: accept setpoints and commands from anyone … `\"closed\"` is the text of the protocol".
#[test]
fn an_unclaimed_gimbal_is_open_or_closed_to_http_as_to_everybody() {
    for (settings, expected) in [(three_links(), Ok(())), (closed(), denied("nobody_in_control", None))] {
        let (mut world, places) = with_gimbal_that(usual_capabilities(), settings);
        assert_eq!(ask(&mut world, &down_to_the_right()), expected);
        assert_eq!(setpoints(&mut world, places).len(), usize::from(expected.is_ok()));
        assert_eq!(ask(&mut world, &Asked::TakeControl), Ok(()));
        assert_eq!(ask(&mut world, &down_to_the_right()), Ok(()));
    }
}

/// D6: "holder's heartbeat *and* traffic missing for `lease_timeout_s`: slot cleared". A request is being heard; what another
/// sends under the manager's ids is not.
#[test]
fn http_keeps_control_by_asking_and_loses_it_by_silence() {
    let (mut world, places) = with_gimbal();
    assert_eq!(ask(&mut world, &Asked::TakeControl), Ok(()));
    run_looking(&mut world, places, 9 * SECOND, 0.0, 0.0);
    assert_eq!(ask(&mut world, &Asked::TakeControl), Ok(()));
    run_looking(&mut world, places, 9 * SECOND, 0.0, 0.0);
    world.send(places.autopilot, MANAGER, &ground_heartbeat());
    assert_eq!(control_of(&world).0.as_deref(), Some("http"));
    world.forget();

    run_looking(&mut world, places, SECOND, 0.0, 0.0);

    assert_eq!(control_of(&world).0, None);
    assert_eq!(world.snapshot().events[0].text, "http is silent and lost control");
    assert_eq!(told_control(&world.take(places.ground)), Some((NOBODY, NOBODY)));
}

/// D7: "Rates expire"; of a program that is gone too: two seconds after it last asked the gimbal stands.
#[test]
fn a_rotation_ends_when_nobody_asks_for_it_any_more() {
    let (mut world, places) = with_gimbal();
    let begun = world.now;
    assert_eq!(ask(&mut world, &turn_right()), Ok(()));
    run_looking(&mut world, places, 3 * SECOND / 2, 0.0, 0.0);
    assert_eq!(ask(&mut world, &turn_right()), Ok(()), "asked for again in time");
    run_looking(&mut world, places, 4 * SECOND, 0.0, 0.0);

    let told = setpoints(&mut world, places);
    let last_turning = told.iter().rfind(|(_, setpoint)| setpoint.angular_velocity_z > 0.0).expect("it turned").0;
    let stood = last_turning.since(begun);
    assert!((Duration::from_millis(3_450)..=Duration::from_millis(3_700)).contains(&stood), "{stood:?}");
    assert!(!told.last().expect("it is told on").1.q[0].is_nan(), "it keeps where it came to rest");
    assert!(
        world.snapshot().events.iter().any(|event| event.text == "rotation stopped: http did not ask for it again")
    );
}

/// D7: "on … SIGTERM zero is sent at once"; and afterwards nothing is done for anybody.
#[test]
fn the_end_of_the_daemon_stops_what_http_turns() {
    let (mut world, places) = with_gimbal();
    assert_eq!(ask(&mut world, &turn_right()), Ok(()));
    world.forget();

    world.input(Input::Shutdown);

    let stopped = only_setpoint(&mut world, places);
    assert_eq!((stopped.angular_velocity_y, stopped.angular_velocity_z), (0.0, 0.0));
    assert_eq!(ask(&mut world, &turn_right()), Err(NotDone::Ending));
    assert!(setpoints(&mut world, places).is_empty());
}

/// D9: "no change of mode, frame … moves the camera by itself": stop, lock and follow keep where it looks.
#[test]
fn stop_lock_and_follow_keep_the_direction() {
    let (mut world, places) = with_gimbal();
    fly(&mut world, places, FIELD, 90.0);
    look(&mut world, places, -10.0, 5.0);
    for asked in [Asked::Lock, Asked::Follow, Asked::Lock, Asked::Stop] {
        world.forget();
        assert_eq!(ask(&mut world, &asked), Ok(()));
        let setpoint = only_setpoint(&mut world, places);
        // The device takes yaw from the nose only, so it is told the same angle in either case.
        let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
        assert_eq!((setpoint.flags, pitch.round(), yaw.round()), (0x2c, -10.0, 5.0), "{asked:?}");
    }
    // What was locked stays so while the vehicle turns.
    run_flying(&mut world, places, SECOND / 2, FIELD, 100.0);
    let told = setpoints(&mut world, places);
    assert_eq!(pitch_yaw_deg(told.last().expect("it is told on").1.q).1.round(), -5.0);
}

/// D9, when the heading is lost: the direction that is locked is not known from the nose any more, so that the camera keeps
/// where it looks.
#[test]
fn without_a_heading_what_was_locked_follows_from_where_it_looks() {
    let (mut world, places) = with_gimbal();
    fly(&mut world, places, FIELD, 90.0);
    look(&mut world, places, -10.0, 5.0);
    assert_eq!(ask(&mut world, &Asked::Lock), Ok(()));
    run_looking(&mut world, places, Duration::from_millis(1_100), -12.0, 7.0);
    world.forget();

    assert_eq!(ask(&mut world, &Asked::Follow), Ok(()));

    let setpoint = only_setpoint(&mut world, places);
    let (pitch, yaw) = pitch_yaw_deg(setpoint.q);
    assert_eq!((setpoint.flags, pitch.round(), yaw.round()), (0x2c, -12.0, 7.0));
    assert_eq!(ask(&mut world, &Asked::Lock), later("no_heading"));
}

/// "Stays where it looks at this moment": also on the way to an angle, and while it looks at a place.
#[test]
fn stop_stops_whatever_moves() {
    for begin in [down_to_the_right(), Asked::Neutral, Asked::Retract { may_cut_motors: false }, turn_right()] {
        let (mut world, places) = with_gimbal();
        assert_eq!(ask(&mut world, &begin), Ok(()));
        look(&mut world, places, -10.0, 5.0);
        assert_eq!(ask(&mut world, &Asked::Stop), Ok(()));
        run_looking(&mut world, places, SECOND, -10.0, 5.0);
        let told = setpoints(&mut world, places);
        let last = &told.last().expect("it is told on").1;
        let (pitch, yaw) = pitch_yaw_deg(last.q);
        assert_eq!((last.flags, pitch.round(), yaw.round()), (0x2c, -10.0, 5.0), "{begin:?}");
    }
}

/// A place by degrees and metres; then neutral, as after `DO_SET_ROI_NONE`.
#[test]
fn a_place_is_looked_at_until_it_is_ended() {
    let (mut world, places) = with_gimbal();
    let [latitude_deg, longitude_deg, altitude_m] = FIELD;
    let place =
        |datum, altitude_m| Asked::LookAt { latitude_deg: latitude_deg + 0.01, longitude_deg, altitude_m, datum };
    assert_eq!(ask(&mut world, &place(Datum::MeanSeaLevel, 100.0)), later("no_vehicle_position"));
    fly(&mut world, places, FIELD, 90.0);
    world.forget();

    // 88 m above home at 488 m: level with the vehicle, due north, which is to the left.
    for asked in [place(Datum::MeanSeaLevel, altitude_m), place(Datum::Home, 88.0)] {
        assert_eq!(ask(&mut world, &asked), Ok(()));
        let (pitch, yaw) = pitch_yaw_deg(only_setpoint(&mut world, places).q);
        assert_eq!((pitch.round(), yaw.round()), (0.0, -90.0));
        assert!(world.snapshot().gimbals[0].roi.is_some());
    }
    assert_eq!(ask(&mut world, &Asked::EndRoi), Ok(()));
    assert_eq!(only_setpoint(&mut world, places).flags & 2, 2, "neutral");
    assert_eq!(world.snapshot().gimbals[0].roi, None);
}

/// "Dangerous ones (motors off, reboot) need … the holder's right": whoever may steer because nobody has control may not.
#[test]
fn what_is_dangerous_is_for_the_holder_only() {
    let (mut world, _) = with_gimbal();
    for dangerous in
        [Operation::Motors(Motors::Off), Operation::Restart(Restart::Reboot), Operation::Restart(Restart::Shutdown)]
    {
        assert_eq!(ask(&mut world, &Asked::ReleaseControl), Ok(()));
        let asked = Asked::Operation(dangerous);
        assert_eq!(ask(&mut world, &asked), denied("only_for_the_holder", None));
        assert_eq!(ask(&mut world, &Asked::TakeControl), Ok(()));
        let unsupported = Err(NotDone::Operation(OperationError::Unsupported));
        assert_eq!(ask(&mut world, &asked), unsupported, "it reaches the driver");
    }
    // A gimbal that has no such function was asked for nothing.
    assert_eq!(world.snapshot().events[0].text, "http took control");
}

/// An operation that a gimbal has not done leaves it to what it was told before.
#[test]
fn an_operation_that_is_not_done_changes_nothing() {
    let (mut world, places) = with_gimbal();
    assert_eq!(ask(&mut world, &down_to_the_right()), Ok(()));
    let before = only_setpoint(&mut world, places);

    let reset = Asked::Operation(Operation::Reset(ResetMode::PitchAndYaw));
    assert_eq!(ask(&mut world, &reset), Err(NotDone::Operation(OperationError::Unsupported)));

    run_looking(&mut world, places, SECOND, 0.0, 0.0);
    let told = setpoints(&mut world, places);
    assert_eq!(told.len(), 20);
    assert!(told.iter().all(|(_, setpoint)| setpoint.q == before.q && setpoint.flags == before.flags));
}

/// "A repeat of the one that was accepted last is accepted again and not carried out again": after something that was asked
/// over HTTP and moves the camera, now or by a setting, a command is no repeat, whatever its `confirmation`. What is only
/// read, or was refused, changes nothing.
#[test]
fn after_what_http_asked_a_command_is_no_repeat() {
    let parameter = Operation::SetParameter { name: "PITCH_OFFSET".to_owned(), value: 1.0 };
    let place = Asked::LookAt { latitude_deg: 47.5, longitude_deg: 8.5, altitude_m: 400.0, datum: Datum::MeanSeaLevel };
    for (asked, is_carried_out) in [
        (down_to_the_right(), true),
        (Asked::Operation(parameter), true),
        (Asked::Operation(Operation::RefreshParameters), false),
        // Nobody knows where the vehicle is.
        (place, false),
    ] {
        let (mut world, places) = with_gimbal();
        look(&mut world, places, 0.0, 0.0);
        let command = pitchyaw(-10.0, 40.0, NAN, NAN, 44.0);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
        world.ask_by_name(NAME, &asked);
        world.forget();

        assert_eq!(world.result_of(places.ground, GCS, &again(1, command)), Some(ACCEPTED));

        let told: Vec<_> = setpoints(&mut world, places).iter().map(|(_, told)| pitch_yaw_deg(told.q)).collect();
        let told: Vec<_> = told.iter().map(|(pitch, yaw)| (pitch.round(), yaw.round())).collect();
        assert_eq!(told, vec![(-10.0, 40.0); usize::from(is_carried_out)], "{asked:?}");
    }
}

/// A gimbal that is lost, that was never heard, or that nobody has heard of: each is answered at once.
#[test]
fn who_is_not_there_does_nothing() {
    let (mut world, places) = with_gimbal();
    let id = world.ask_by_name("camera/../x", &Asked::Stop);
    assert_eq!(world.answers, [(id, Err(NotDone::UnknownGimbal))]);
    world.unplug(places.gimbal);
    let lost = |reason| {
        Err(NotDone::Refused {
            refusal: Refusal { result: gimbald::wire::ids::CommandResult::Failed, reason },
            holder: None,
        })
    };
    assert_eq!(ask(&mut world, &down_to_the_right()), lost("gimbal_lost"));
    let refresh = Asked::Operation(Operation::RefreshParameters);
    assert_eq!(ask(&mut world, &refresh), Err(NotDone::Operation(OperationError::NotThere)));

    let searching = Settings { gimbals: vec![GimbalSettings::found(NAME.to_owned())], ..three_links() };
    let (mut world, _) = World::empty(searching);
    world.run_for(SECOND);
    assert_eq!(ask(&mut world, &down_to_the_right()), later("no_gimbal_yet"));
    assert_eq!(ask(&mut world, &refresh), Err(NotDone::Operation(OperationError::NotThere)));
    assert_eq!(ask(&mut world, &Asked::TakeControl), Ok(()), "as by CONFIGURE");
}

/// What somebody else sets is no sign of who turns the gimbal: a rotation ends with the lease of who asked for it, however long
/// a rate may last.
#[test]
fn settings_do_not_keep_the_rotation_of_a_silent_sender_alive() {
    let parameter = Operation::SetParameter { name: "PWR_PAN".to_owned(), value: 1.0 };
    let echo = PARAM_VALUE_DATA {
        param_value: 1.0,
        param_count: 40,
        param_index: 10,
        param_id: CharArray::from("PWR_PAN"),
        param_type: 9,
    };
    let unsupported = Err(NotDone::Operation(OperationError::Unsupported));
    for (set, answer) in [(parameter, Ok(())), (Operation::SetCombinedAttitude(true), unsupported)] {
        let control = ControlSettings { command_rate_timeout: Duration::ZERO, ..ControlSettings::default() };
        let (mut world, places) = with_gimbal_that(usual_capabilities(), Settings { control, ..three_links() });
        world.send(places.gimbal, GIMBAL, &MavMessage::PARAM_VALUE(echo.clone()));
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw(NAN, NAN, 0.0, 5.0, 44.0)), Some(ACCEPTED));
        for second in 0..12 {
            let mode = world.snapshot().gimbals[0].setpoint.as_ref().expect("it was told").mode.clone();
            assert_eq!(mode == "rate", second < 10, "{mode} after {second} s, {set:?}");
            world.answers.clear();
            let id = world.ask_by_name(NAME, &Asked::Operation(set.clone()));
            world.send(places.gimbal, GIMBAL, &MavMessage::PARAM_VALUE(echo.clone()));
            assert_eq!(world.answers, [(id, answer.clone())], "{set:?}");
            let status = device_status(world.now, 44, 0.0, 0.0);
            let status = MavMessage::GIMBAL_DEVICE_ATTITUDE_STATUS(status);
            world.run_with(SECOND, &[(SECOND / 10, places.gimbal, GIMBAL, status)]);
        }
    }
}

/// A place that waits for a gimbal, and is told of nowhere, has no name; and before the system id is settled nothing is
/// done in its name.
#[test]
fn what_is_not_shown_has_no_name() {
    let (mut world, _) = World::empty(three_links());
    assert_eq!(ask(&mut world, &Asked::TakeControl), Err(NotDone::UnknownGimbal));
    let gimbals = vec![GimbalSettings::found(NAME.to_owned())];
    let (mut world, _) =
        World::empty(Settings { system_id: gimbald::bridge::settings::SystemId::Auto, gimbals, ..three_links() });
    assert_eq!(ask(&mut world, &Asked::TakeControl), Err(NotDone::Starting));
}

/// A component may give control to those who ask over HTTP by naming the manager's ids, and they lose it as it was given.
#[test]
fn control_can_be_given_to_http_and_taken_back() {
    let (mut world, places) = with_gimbal();
    let to_http = configure([f32::from(MANAGER.system), f32::from(MANAGER.component)], [-1.0, -1.0]);
    assert_eq!(world.result_of(places.ground, GCS, &to_http), Some(ACCEPTED));
    assert_eq!(control_of(&world).0.as_deref(), Some("http"));
    assert_eq!(ask(&mut world, &turn_right()), Ok(()));
    world.forget();

    assert_eq!(world.result_of(places.ground, GCS, &take_control()), Some(ACCEPTED));

    assert_eq!(only_setpoint(&mut world, places).angular_velocity_z, 0.0, "the rotation ends with the control");
    assert_eq!(ask(&mut world, &turn_right()), denied("not_in_control", Some(GCS)));
}

/// "One component per gimbal": who asks for one gimbal is nobody to the other.
#[test]
fn each_gimbal_is_asked_by_its_own_name() {
    let gimbals = ["left", "right"].map(|name| GimbalSettings::found(name.to_owned())).into();
    let (mut world, places) = World::empty(Settings { gimbals, ..three_links() });
    world.run_for(SECOND);
    let [right, other] = ["right", "Right"].map(|name| world.ask_by_name(name, &Asked::TakeControl));
    assert_eq!(world.answers, [(right, Ok(())), (other, Err(NotDone::UnknownGimbal))]);
    let held: Vec<Option<String>> = world.snapshot().gimbals.into_iter().map(|gimbal| gimbal.primary).collect();
    assert_eq!(held, [None, Some("http".to_owned())]);
    assert!(setpoints(&mut world, places).is_empty());
}
