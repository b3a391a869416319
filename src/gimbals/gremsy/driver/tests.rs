use super::*;
use crate::geometry::{AngularRate, YawFrame};
use crate::gimbals::setpoint::{RadioControl, Stabilised};
use crate::wire::dialect::{GIMBAL_DEVICE_SET_ATTITUDE_DATA, HEARTBEAT_DATA, MessageData, SYS_STATUS_DATA};
use crate::wire::ids::mav_state;
use crate::wire::{DatagramFrames, encode_to_vec};

const GIMBAL: MavId = MavId::new(1, 154);

fn hear<M: MessageData>(driver: &mut GremsyDriver, now: Timestamp, message: &M) {
    let bytes = encode_to_vec(GIMBAL, 0, message);
    driver.handle_received(now, &DatagramFrames::new(&bytes).next_frame().expect("a frame"));
}

fn setpoints(driver: &mut GremsyDriver) -> Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> {
    let mut all = Vec::new();
    while let Some(output) = driver.poll_output() {
        if let DriverOutput::Message(message) = output
            && let MavMessage::GIMBAL_DEVICE_SET_ATTITUDE(setpoint) = *message
        {
            all.push(setpoint);
        }
    }
    all
}

/// A gimbal that beats and is ready, without parameters, for so many milliseconds.
fn run(driver: &mut GremsyDriver, from: u64, to: u64) -> Vec<(u64, GIMBAL_DEVICE_SET_ATTITUDE_DATA)> {
    let heartbeat = HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: 26,
        autopilot: 8,
        base_mode: 0,
        system_status: mav_state::ACTIVE,
        mavlink_version: 3,
    };
    let status = SYS_STATUS_DATA {
        onboard_control_sensors_present: 0,
        onboard_control_sensors_enabled: 0,
        onboard_control_sensors_health: 0,
        load: 0,
        voltage_battery: 0,
        current_battery: 0,
        battery_remaining: 0,
        drop_rate_comm: 0,
        errors_comm: 0,
        errors_count1: 0x0011,
        errors_count2: 0,
        errors_count3: 0,
        errors_count4: 0,
        onboard_control_sensors_present_extended: 0,
        onboard_control_sensors_enabled_extended: 0,
        onboard_control_sensors_health_extended: 0,
    };
    let mut sent = Vec::new();
    for millis in from..to {
        let now = Timestamp::from_millis(millis);
        if millis.is_multiple_of(1_000) {
            hear(driver, now, &heartbeat);
            hear(driver, now, &status);
        }
        if driver.poll_timeout().is_some_and(|due| due <= now) {
            driver.handle_timeout(now);
            assert!(driver.poll_timeout().is_none_or(|due| due > now), "a timeout that never passes at {now}");
        }
        sent.extend(setpoints(driver).into_iter().map(|setpoint| (millis, setpoint)));
    }
    sent
}

/// Nobody repeats a rotation, for whatever reason: it ends in v2 as well.
#[test]
fn a_rate_in_v2_that_nobody_repeats_is_stopped() {
    let mut driver =
        GremsyDriver::new(GremsySettings { generation: Some(Generation::V2), ..GremsySettings::default() });
    driver.adopt(Timestamp::ZERO, GIMBAL);
    assert_eq!(run(&mut driver, 0, 12_000), []);
    assert_eq!(driver.details(Timestamp::from_secs(12)).stage.as_deref(), Some("running"));
    let turning = Turning {
        roll: None,
        pitch: AngularRate::ZERO,
        yaw: AngularRate::from_degrees_per_second(20.0),
        yaw_frame: YawFrame::Vehicle,
        stabilised: Stabilised::BOTH,
        radio_control: RadioControl::Off,
    };

    driver.handle_setpoint(Timestamp::from_secs(12), Setpoint::Turn(turning));
    let sent = run(&mut driver, 12_000, 16_000);

    let rates: Vec<(u64, bool)> = sent.iter().map(|(at, sent)| (*at, sent.angular_velocity_z == 0.0)).collect();
    assert_eq!(rates, [(12_000, false), (12_500, true)]);
}
