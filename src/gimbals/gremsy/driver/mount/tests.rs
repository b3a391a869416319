use super::*;
use crate::geometry::{Angle, GimbalAngles};
use crate::gimbals::operation::ResetMode;

const ACCEPTED: CommandOutcome = CommandOutcome::Answered(CommandResult::Accepted as u8);
const DENIED: CommandOutcome = CommandOutcome::Answered(CommandResult::Denied as u8);

const GIMBAL: MavId = MavId::new(1, 154);
const READY: Condition =
    Condition { is_heard: true, is_ready: true, is_there: false, motors_on: true, is_watched: false };

fn at(millis: u64) -> Timestamp {
    Timestamp::from_millis(millis)
}

fn point(pitch: f64, yaw: f64, mode: YawMode) -> Order {
    let degrees = Angle::from_degrees;
    Order::Point { angles: GimbalAngles { roll: Angle::ZERO, pitch: degrees(pitch), yaw: degrees(yaw) }, mode }
}

fn turn(yaw: f64) -> Order {
    let rates = [AngularRate::ZERO, AngularRate::ZERO, AngularRate::from_degrees_per_second(yaw)];
    Order::Turn { rates, mode: YawMode::Follow }
}

fn drain(mount: &mut Mount) -> Vec<MountOutput> {
    std::iter::from_fn(|| mount.poll_output()).collect()
}

/// What is sent, and when, while the order is said 20 times a second.
fn stream(mount: &mut Mount, from: u64, to: u64, order: Order, condition: Condition) -> Vec<(u64, MountOutput)> {
    let mut sent = Vec::new();
    for millis in from..to {
        if millis.is_multiple_of(50) {
            mount.order(at(millis), order);
        }
        if millis.is_multiple_of(50) || mount.poll_timeout(condition).is_some_and(|due| due <= at(millis)) {
            mount.advance(at(millis), GIMBAL, condition);
        }
        sent.extend(drain(mount).into_iter().map(|output| (millis, output)));
    }
    sent
}

fn following() -> Mount {
    let mut mount = Mount::default();
    mount.note_mode(YawMode::Follow);
    mount
}

/// "v1 mode command first, ACKed, then 205"; "send one command and keep only the newest (coalesce) while an ACKed mode
/// command is outstanding" (gimbals 1.10, 2.5).
#[test]
fn the_mode_comes_first_and_then_the_newest_angle() {
    let mut mount = Mount::default();
    for (millis, pitch) in [(0, -10.0), (50, -20.0), (100, -30.0)] {
        mount.order(at(millis), point(pitch, 45.0, YawMode::Follow));
        mount.advance(at(millis), GIMBAL, READY);
    }
    assert_eq!(drain(&mut mount), [MountOutput::Command(packet::follow(GIMBAL))]);

    assert!(mount.handle_outcome(at(120), GIMBAL, &packet::follow(GIMBAL), ACCEPTED));
    mount.advance(at(120), GIMBAL, READY);

    let angles = GimbalAngles { roll: Angle::ZERO, pitch: Angle::from_degrees(-30.0), yaw: Angle::from_degrees(45.0) };
    assert_eq!(drain(&mut mount), [MountOutput::ModeTaken, MountOutput::Send(packet::rotate_to(GIMBAL, angles))]);

    // The same mode is not asked for again, another one is.
    mount.order(at(200), point(-30.0, 50.0, YawMode::Follow));
    mount.advance(at(200), GIMBAL, READY);
    assert!(matches!(drain(&mut mount)[..], [MountOutput::Send(_)]));
    mount.order(at(300), point(-30.0, 50.0, YawMode::Lock));
    mount.advance(at(300), GIMBAL, READY);
    assert_eq!(drain(&mut mount), [MountOutput::Command(packet::lock(GIMBAL))]);
}

/// A yaw in the wrong frame would turn the camera anywhere, so it is not sent; a stop is.
#[test]
fn without_its_mode_an_angle_is_not_sent_and_a_stop_is() {
    let mut mount = Mount::default();
    mount.order(at(0), point(-10.0, 45.0, YawMode::Lock));
    mount.advance(at(0), GIMBAL, READY);
    mount.handle_outcome(at(10), GIMBAL, &packet::lock(GIMBAL), DENIED);
    mount.advance(at(10), GIMBAL, READY);
    assert_eq!(drain(&mut mount), [MountOutput::Command(packet::lock(GIMBAL)), MountOutput::ModeRefused]);

    mount.order(at(20), turn(0.0));
    mount.advance(at(20), GIMBAL, READY);
    assert_eq!(drain(&mut mount), [MountOutput::Send(packet::turn_at(GIMBAL, [AngularRate::ZERO; 3]))]);

    // It is asked again, but not at once.
    let asked = stream(&mut mount, 50, 4_100, point(-10.0, 45.0, YawMode::Lock), READY);
    assert_eq!(asked, [(2_050, MountOutput::Command(packet::lock(GIMBAL)))].map(|(at, output)| (at - 40, output)));
}

/// "205 at 10–25 Hz while targets change, 1 Hz when idle" (gimbals 1.10).
#[test]
fn an_angle_is_repeated_ten_times_a_second_until_it_is_reached_and_then_once_a_second() {
    let mut mount = following();
    let order = point(-30.0, 0.0, YawMode::Follow);
    let moving = stream(&mut mount, 0, 3_000, order, READY);
    assert_eq!(moving.len(), 30, "{moving:?}");
    let there = stream(&mut mount, 3_000, 8_000, order, Condition { is_there: true, ..READY });
    assert_eq!(there.len(), 5, "{there:?}");
    // One that never gets there is not told ten times a second for ever.
    let mut mount = following();
    assert_eq!(stream(&mut mount, 0, 20_000, order, READY).len(), 110);
}

#[test]
fn no_more_than_25_a_second_however_fast_the_angle_changes() {
    let mut mount = following();
    let mut sent = 0;
    for millis in 0..1_000 {
        mount.order(at(millis), point(-0.01 * millis as f64, 0.0, YawMode::Follow));
        mount.advance(at(millis), GIMBAL, READY);
        sent += drain(&mut mount).len();
    }
    assert_eq!(sent, 25);
}

/// "rate … must repeat ≥ 5 Hz and end with zeros" (gimbals 2.5). A gimbal that turns on after its operator is gone is the
/// worst that can be.
#[test]
fn a_rate_is_repeated_and_ends_with_zeros_at_once() {
    let mut mount = following();
    let turning = stream(&mut mount, 0, 1_000, turn(20.0), READY);
    assert_eq!(turning.len(), 10);
    // Right behind the last rate, and whatever its state is.
    mount.forget_mode();
    mount.order(at(1_001), turn(0.0));
    mount.advance(at(1_001), GIMBAL, Condition { is_ready: false, ..READY });
    let stop = MountOutput::Send(packet::turn_at(GIMBAL, [AngularRate::ZERO; 3]));
    assert_eq!(drain(&mut mount), std::slice::from_ref(&stop));
    let stopping = stream(&mut mount, 1_050, 2_000, turn(0.0), READY);
    assert!(stopping.len() >= 9 && stopping.iter().all(|(_, output)| *output == stop), "{stopping:?}");
}

/// Nobody repeats it any more: it is stopped all the same.
#[test]
fn a_rate_that_nobody_repeats_is_stopped() {
    let mut mount = following();
    stream(&mut mount, 0, 1_000, turn(20.0), READY);
    let mut sent = Vec::new();
    for millis in 1_000..3_000 {
        if mount.poll_timeout(READY).is_some_and(|due| due <= at(millis)) {
            mount.advance(at(millis), GIMBAL, READY);
        }
        sent.extend(drain(&mut mount).into_iter().map(|output| (millis, output)));
    }
    let stop = MountOutput::Send(packet::turn_at(GIMBAL, [AngularRate::ZERO; 3]));
    let first = sent.iter().find(|(_, output)| *output == stop).expect("it is stopped");
    assert_eq!(first.0, 1_450, "half a second after it was last said");
    assert_eq!(sent.last().map(|(_, output)| output), Some(&stop));
}

/// Whoever steers has let go of it, such as for the gimbal's own radio control: nothing is said any more.
#[test]
fn an_order_that_nobody_repeats_is_let_go() {
    let mut mount = following();
    stream(&mut mount, 0, 1_000, point(-10.0, 0.0, YawMode::Follow), READY);
    let mut sent = Vec::new();
    for millis in 1_000..5_000 {
        if mount.poll_timeout(READY).is_some_and(|due| due <= at(millis)) {
            mount.advance(at(millis), GIMBAL, READY);
        }
        sent.extend(drain(&mut mount).into_iter().map(|_| millis));
    }
    assert!(sent.last().is_none_or(|last| *last < 1_950), "{sent:?}");
    assert_eq!((mount.wanted(), mount.poll_timeout(READY)), (None, None));
}

fn stop() -> MountOutput {
    MountOutput::Send(packet::turn_at(GIMBAL, [AngularRate::ZERO; 3]))
}

/// What is sent, and when, while nobody says anything.
fn silent(mount: &mut Mount, from: u64, to: u64, condition: Condition) -> Vec<(u64, MountOutput)> {
    let mut sent = Vec::new();
    for millis in from..to {
        if mount.poll_timeout(condition).is_some_and(|due| due <= at(millis)) {
            mount.advance(at(millis), GIMBAL, condition);
            assert!(mount.poll_timeout(condition).is_none_or(|due| due > at(millis)), "never passes at {millis}");
        }
        sent.extend(drain(mount).into_iter().map(|output| (millis, output)));
    }
    sent
}

/// An operation takes its place: zeros go out until the gimbal has answered one.
#[test]
fn an_order_that_is_dropped_stops_what_turns() {
    let mut mount = following();
    stream(&mut mount, 0, 200, turn(20.0), READY);
    mount.handle_answer(true);
    mount.handle_answer(true);
    mount.drop_order(at(200), GIMBAL, READY);
    assert_eq!(drain(&mut mount), [stop()]);
    let sent = silent(&mut mount, 200, 1_550, READY);
    let expected: Vec<_> = (300..1_550).step_by(100).map(|millis| (millis, stop())).collect();
    assert_eq!((sent, mount.may_be_turning()), (expected, true));
    mount.handle_answer(true);
    assert!(!mount.may_be_turning());
    assert_eq!((silent(&mut mount, 1_550, 4_000, READY), mount.poll_timeout(READY)), (vec![], None));

    let mut mount = following();
    stream(&mut mount, 0, 200, point(-10.0, 0.0, YawMode::Follow), READY);
    mount.drop_order(at(200), GIMBAL, READY);
    assert_eq!(drain(&mut mount), []);
}

/// Whatever takes the place of a rotation and cannot be said at once: the gimbal is stopped before, and knows it.
#[test]
fn nothing_that_has_to_wait_lets_it_turn_on() {
    let not_ready = Condition { is_ready: false, ..READY };
    let angle = |mode| point(-10.0, 0.0, mode);
    for (order, condition, then) in [
        (angle(YawMode::Lock), READY, Some(packet::lock(GIMBAL))),
        (angle(YawMode::Follow), not_ready, None),
        (turn(20.0), not_ready, None),
        (Order::Home, READY, Some(packet::reset(GIMBAL, ResetMode::PitchAndYaw))),
        (Order::Home, not_ready, None),
        (Order::Retract, READY, Some(packet::set_motors(GIMBAL, false))),
        (Order::RadioControl, READY, Some(packet::hand_to_rc(GIMBAL))),
    ] {
        let mut mount = following();
        stream(&mut mount, 0, 1_000, turn(20.0), READY);
        let sent = stream(&mut mount, 1_000, 3_000, order, condition);
        let expected: Vec<_> = (1_000..3_000).step_by(100).map(|millis| (millis, stop())).collect();
        assert_eq!(sent, expected, "{order:?}");
        for _ in 0..20 {
            mount.handle_answer(true);
        }
        let sent = stream(&mut mount, 3_000, 4_000, order, condition);
        let expected: Vec<_> = then.into_iter().map(|command| (3_000, MountOutput::Command(command))).collect();
        assert_eq!((sent, mount.may_be_turning()), (expected, false), "{order:?}");
    }
    // An angle in the mode that it is in ends it by itself, and is repeated until it is answered.
    let mut mount = following();
    stream(&mut mount, 0, 1_000, turn(20.0), READY);
    let there = Condition { is_there: true, ..READY };
    let sent = stream(&mut mount, 1_000, 4_000, angle(YawMode::Follow), there);
    assert!(sent.len() == 30 && sent.iter().all(|(_, output)| *output != stop()), "{sent:?}");
}

/// Also one that is not heard may hear: it is told less often, until it has answered.
#[test]
fn one_that_is_lost_while_it_turns_is_stopped_when_it_is_back() {
    let mut mount = following();
    stream(&mut mount, 0, 200, turn(20.0), READY);
    mount.handle_lost();
    let unheard = Condition { is_heard: false, is_ready: false, ..READY };
    let expected: Vec<_> = (200..4_000).step_by(1_000).map(|millis| (millis, stop())).collect();
    assert_eq!(silent(&mut mount, 200, 4_000, unheard), expected);
    assert_eq!(silent(&mut mount, 4_000, 4_100, READY), [(4_000, stop())]);
}

/// "RETRACT: 31010 p7=0 (motors off) if allowed"; "leave RETRACT: 31010 p7=1, wait ACK + ec1 bit 0x10, then target"
/// (gimbals 2.5).
#[test]
fn retract_switches_the_motors_off_once_and_the_next_angle_on_again() {
    let mut mount = following();
    let off = stream(&mut mount, 0, 1_000, Order::Retract, READY);
    assert_eq!(off, [(0, MountOutput::Command(packet::set_motors(GIMBAL, false)))]);
    assert!(mount.handle_outcome(at(1_000), GIMBAL, &packet::set_motors(GIMBAL, false), ACCEPTED));

    let order = point(-10.0, 0.0, YawMode::Follow);
    let is_off = Condition { motors_on: false, ..READY };
    let on = stream(&mut mount, 1_000, 4_000, order, is_off);
    assert_eq!(on, [(1_000, MountOutput::Command(packet::set_motors(GIMBAL, true)))]);
    let then = stream(&mut mount, 4_000, 4_050, order, READY);
    assert!(matches!(then[..], [(4_000, MountOutput::Send(_))]), "{then:?}");

    // It never comes back: said once.
    let mut mount = following();
    stream(&mut mount, 0, 100, Order::Retract, READY);
    let on = stream(&mut mount, 1_000, 9_000, order, is_off);
    assert_eq!(on.iter().filter(|(_, output)| *output == MountOutput::StaysRetracted).count(), 1);
}

#[test]
fn home_and_radio_control_are_said_once() {
    for (order, command) in [
        (Order::Home, packet::reset(GIMBAL, ResetMode::PitchAndYaw)),
        (Order::RadioControl, packet::hand_to_rc(GIMBAL)),
    ] {
        let mut mount = following();
        assert_eq!(stream(&mut mount, 0, 3_000, order, READY), [(0, MountOutput::Command(command))]);
    }
}

/// "NEUTRAL: 31011 p6=3 p7=4" (gimbals 2.5) is ahead of the vehicle, and stays there: from LOCK, or where its mode is not known,
/// it is told FOLLOW first, and is taken home again when somebody else has locked it meanwhile.
#[test]
fn home_is_kept_to_the_nose() {
    let (follow, home) = (packet::follow(GIMBAL), packet::reset(GIMBAL, ResetMode::PitchAndYaw));
    let told = |millis, command: &COMMAND_LONG_DATA| (millis, MountOutput::Command(command.clone()));
    for before in [Some(YawMode::Lock), None] {
        let mut mount = Mount::default();
        if let Some(mode) = before {
            mount.note_mode(mode);
        }
        assert_eq!(stream(&mut mount, 0, 1_000, Order::Home, READY), [told(0, &follow)], "{before:?}");
        assert!(mount.handle_outcome(at(1_000), GIMBAL, &follow, ACCEPTED));
        let then = stream(&mut mount, 1_000, 3_000, Order::Home, READY);
        assert_eq!(then, [(1_000, MountOutput::ModeTaken), told(1_000, &home)], "{before:?}");
        assert!(mount.handle_outcome(at(3_000), GIMBAL, &home, ACCEPTED));

        mount.handle_shown_mode(YawMode::Lock);
        assert_eq!(stream(&mut mount, 3_000, 4_000, Order::Home, READY), [told(3_000, &follow)], "{before:?}");
        mount.handle_outcome(at(4_000), GIMBAL, &follow, DENIED);
        let refused = stream(&mut mount, 4_000, 6_050, Order::Home, READY);
        assert_eq!(refused, [(4_000, MountOutput::ModeRefused), told(6_000, &follow)], "{before:?}");
        mount.handle_outcome(at(6_050), GIMBAL, &follow, ACCEPTED);
        let again = stream(&mut mount, 6_050, 8_000, Order::Home, READY);
        assert_eq!(again, [(6_050, MountOutput::ModeTaken), told(6_050, &home)], "{before:?}");
    }
}

/// "leave RETRACT: 31010 p7=1, wait ACK + ec1 bit 0x10, then target" (gimbals 2.5): home is a target as well.
#[test]
fn home_is_a_place_to_come_back_to_from_retract() {
    let mut mount = following();
    stream(&mut mount, 0, 100, Order::Retract, READY);
    let is_off = Condition { motors_on: false, ..READY };
    let on = stream(&mut mount, 1_000, 4_000, Order::Home, is_off);
    assert_eq!(on, [(1_000, MountOutput::Command(packet::set_motors(GIMBAL, true)))]);
    let home = packet::reset(GIMBAL, ResetMode::PitchAndYaw);
    let then = stream(&mut mount, 4_000, 6_000, Order::Home, READY);
    assert_eq!(then, [(4_000, MountOutput::Command(home))]);
}

/// "treat HEARTBEAT.system_status ≠ ACTIVE as 'not ready': hold targets" (gimbals 2.5).
#[test]
fn what_it_is_told_before_it_is_ready_waits() {
    let mut mount = following();
    let not_ready = Condition { is_ready: false, ..READY };
    assert_eq!(stream(&mut mount, 0, 1_000, point(-10.0, 0.0, YawMode::Follow), not_ready), []);
    mount.advance(at(1_000), GIMBAL, READY);
    assert_eq!(drain(&mut mount).len(), 1);
}

#[test]
fn orders_that_are_never_answered_are_noticed() {
    let mut mount = following();
    stream(&mut mount, 0, 2_900, point(-10.0, 0.0, YawMode::Follow), READY);
    assert!(!mount.is_unanswered(at(2_900)));
    assert!(mount.is_unanswered(at(3_000)));
    mount.handle_answer(true);
    assert!(!mount.is_unanswered(at(3_000)));
}

/// A change of our system id gives up what is on its way: that is no gimbal that does not answer. It is asked again.
#[test]
fn what_is_given_up_is_not_unanswered() {
    for (outcome, told) in
        [(CommandOutcome::GivenUp, vec![]), (CommandOutcome::Unanswered, vec![MountOutput::Unanswered])]
    {
        let mut mount = Mount::default();
        mount.order(at(0), point(-10.0, 0.0, YawMode::Follow));
        mount.advance(at(0), GIMBAL, READY);
        assert_eq!(drain(&mut mount), [MountOutput::Command(packet::follow(GIMBAL))]);
        assert!(mount.handle_outcome(at(10), GIMBAL, &packet::follow(GIMBAL), outcome));
        assert_eq!(drain(&mut mount), told, "{outcome:?}");
        let again = stream(&mut mount, 10, 3_000, point(-10.0, 0.0, YawMode::Follow), READY);
        assert_eq!(again, [(2_010, MountOutput::Command(packet::follow(GIMBAL)))], "{outcome:?}");
    }
}
