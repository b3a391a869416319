//! From power-on until it can be steered, and again after a restart.

use super::*;
use crate::gimbals::gremsy::packet::{MessageRate, RebootAction};

/// Gimbal statement 1: "No byte is transmitted by the simulated Gremsy before it received a HEARTBEAT; within 1.2 s after
/// one, a HEARTBEAT with type 26 from compid 154 arrives."
#[test]
fn statement_1_it_is_silent_until_it_hears_a_heartbeat() {
    for (generation, source, mavtype) in [
        (Generation::V1, MANAGER, mav_type::ONBOARD_CONTROLLER),
        (Generation::V2, GCS, mav_type::GCS),
        (Generation::V1, AUTOPILOT, mav_type::QUADROTOR),
    ] {
        let mut bench = Bench::new(generation, |_| ());
        // "0–2.0 s mute; 2.0 s onwards listens": a heartbeat before is not heard.
        bench.run_for(1900);
        bench.hear(source, &heartbeat(mavtype));
        bench.run_for(60_000);
        bench.hear(MANAGER, &packet::request_message(GIMBAL, 283));
        bench.run_for(100);
        assert_eq!(bench.sent, []);

        let woken = bench.now;
        bench.hear(source, &heartbeat(mavtype));
        bench.run_for(1200);

        let (at, first) = bench.messages::<HEARTBEAT_DATA>()[0].clone();
        assert!(at.since(woken) <= Duration::from_millis(1200), "{at:?}");
        assert_eq!((first.mavtype, first.autopilot, first.system_status), (mav_type::GIMBAL, 8, 4));
        let bytes = &bench.sent[0].1;
        assert_eq!(DatagramFrames::new(bytes).next_frame().expect("a frame").source(), GIMBAL);
        bench.run_for(4000);
        assert_eq!(bench.count::<HEARTBEAT_DATA>(woken + Duration::from_millis(100)), 5);
    }
}

/// Gimbal statement 33: "A gimbal simulator ignores HEARTBEATs of type 6 when choosing its sysid."
#[test]
fn statement_33_it_takes_the_system_id_of_a_vehicle() {
    let mut bench = Bench::new(Generation::V1, |_| ());
    bench.run_for(3000);
    bench.hear(GCS, &heartbeat(mav_type::GCS));
    assert_eq!(bench.device.id(), MavId::new(1, 154));
    bench.hear(MavId::new(33, 1), &heartbeat(mav_type::QUADROTOR));
    assert_eq!(bench.device.id(), MavId::new(33, 154));
    bench.hear(MavId::new(34, 1), &heartbeat(mav_type::QUADROTOR));
    assert_eq!(bench.device.id(), MavId::new(33, 154));

    let mut fixed = Bench::new(Generation::V1, |settings| settings.system_id = SystemId::Fixed(7));
    fixed.run_for(3000);
    fixed.hear(AUTOPILOT, &heartbeat(mav_type::QUADROTOR));
    assert_eq!(fixed.device.id(), MavId::new(7, 154));
}

/// "Start-up flags: ec1 = 0x0800|0x0020 for 4.0 s (errors_count2 = 0x0E meanwhile), then ec1 = 0x0010|0x0001 (FOLLOW),
/// ec2 = 0" (gimbals 5.3).
#[test]
fn it_takes_its_time_to_start() {
    let mut bench = Bench::new(Generation::V1, |_| ());
    bench.run_for(2100);
    bench.hear(MANAGER, &heartbeat(mav_type::ONBOARD_CONTROLLER));
    bench.run_for(6000);

    let said: Vec<_> = bench
        .messages::<SYS_STATUS_DATA>()
        .into_iter()
        .map(|(at, status)| (at.as_micros() / 1000, status.errors_count1, status.errors_count2))
        .collect();
    let (starting, running) = ((0x0820, 0x000e), (0x0011, 0x0000));
    let expected: Vec<_> = [2100, 3100, 4100, 5100]
        .map(|at| (at, starting.0, starting.1))
        .into_iter()
        .chain([6100, 7100, 8100].map(|at| (at, running.0, running.1)))
        .collect();
    assert_eq!(said, expected);
    // "pitch −25°" without motors, then straight ahead.
    let pitch = bench.messages::<MOUNT_ORIENTATION_DATA>()[0].1.pitch;
    assert_near(f64::from(pitch), -25.0, 0.01);
    assert_eq!(bench.pose(), [0.0, 0.0, 0.0]);
}

/// "246 p4 = 1 (or p3=1,p4=154): ACK, then silence 10 s, then the whole timeline again including the heartbeat gate"
/// (gimbals 5.3). It "forgets \[its streams\] on power-up" (1.10) and keeps its parameters.
#[test]
fn a_restart_goes_through_everything_again() {
    for command in [packet::reboot(GIMBAL), packet::reboot_or_shutdown(GIMBAL, RebootAction::Reboot)] {
        let mut bench = Bench::running(Generation::V1, |_| ());
        bench.accept(&packet::set_message_rate(GIMBAL, message::RAW_IMU, MessageRate::Off));
        bench.hear(MANAGER, &parameters::set("RC_SPD_PAN", 45.0));
        bench.accept(&packet::lock(GIMBAL));

        assert_eq!(bench.ask(&command), Some((0, 0)));
        let rebooted = bench.now;
        bench.sent.clear();
        // Heartbeats go on, and are heard once it is on and past its first two seconds.
        for _ in 0..11 {
            bench.run_for(1000);
            bench.hear(MANAGER, &heartbeat(mav_type::ONBOARD_CONTROLLER));
        }
        assert_eq!(bench.sent, []);
        bench.run_for(2000);
        bench.hear(MANAGER, &heartbeat(mav_type::ONBOARD_CONTROLLER));
        bench.run_for(500);
        assert_eq!(bench.operation(), OperationState::INIT);
        bench.run_for(4000);
        assert_eq!(bench.operation(), OperationState::ON | OperationState::FOLLOW);
        assert!(bench.count::<crate::wire::dialect::RAW_IMU_DATA>(rebooted) > 10);
        assert_eq!(bench.device.parameter("RC_SPD_PAN"), Some(45));
    }
}

/// `reboot_action_t`: "REBOOT 1, SHUTDOWN 2"; anything else is none.
#[test]
fn a_shutdown_is_for_good() {
    let mut bench = Bench::running(Generation::V2, |_| ());
    let mut neither = packet::reboot(GIMBAL);
    neither.param4 = 0.0;
    neither.param1 = 1.0;
    assert_eq!(bench.ask(&neither).expect("an answer").1, 2);

    assert_eq!(bench.ask(&packet::reboot_or_shutdown(GIMBAL, RebootAction::Shutdown)), Some((0, 0)));
    bench.sent.clear();
    for _ in 0..60 {
        bench.run_for(1000);
        bench.hear(MANAGER, &heartbeat(mav_type::ONBOARD_CONTROLLER));
    }
    assert_eq!(bench.sent, []);
}

/// The fault `reboot`: the power is cut and back at once.
#[test]
fn a_power_cut_goes_through_everything_again_at_once() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.device.handle_reboot(bench.now);
    bench.sent.clear();
    bench.run_for(1900);
    bench.hear(MANAGER, &heartbeat(mav_type::ONBOARD_CONTROLLER));
    bench.run_for(5000);
    assert_eq!(bench.sent, []);
    bench.hear(MANAGER, &heartbeat(mav_type::ONBOARD_CONTROLLER));
    assert_eq!(bench.count::<HEARTBEAT_DATA>(Timestamp::ZERO), 1);
}

/// "AEVO models send nothing at default rate: set every stream interval explicitly" (gimbals 1.8).
#[test]
fn some_models_send_only_what_they_are_asked_for() {
    for generation in [Generation::V1, Generation::V2] {
        let mut bench = Bench::running(generation, |settings| settings.has_usual_streams = false);
        let all = bench.sent.len();
        let pushed = bench.messages::<HEARTBEAT_DATA>().len() + bench.messages::<SYS_STATUS_DATA>().len();
        assert_eq!((all, pushed), (14, 14));

        bench.accept(&packet::set_message_rate(GIMBAL, message::MOUNT_ORIENTATION, MessageRate::Hertz(20)));
        let from = bench.now;
        bench.run_for(1000);
        assert_eq!(bench.count::<MOUNT_ORIENTATION_DATA>(from), 20);
    }
}
