use super::*;
use crate::geometry::{Angle, Yaw, YawFrame};
use crate::gimbals::mavlink_v2;
use crate::gimbals::setpoint::{Pointing, RadioControl, Setpoint, Stabilised, Turning};
use crate::wire::ids::message;
use crate::wire::{FrameBuffer, encode_to_vec};

const HOST: MavId = MavId::new(1, 191);
const GIMBAL: MavId = MavId::new(1, 154);

/// A frame as the dossier prints it.
fn bytes(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).expect("a byte in hexadecimal")).collect()
}

fn degrees(roll: f64, pitch: f64, yaw: f64) -> GimbalAngles {
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::from_degrees);
    GimbalAngles { roll, pitch, yaw }
}

/// Gimbal statement 5: "COMMAND_LONG 205 for pitch −30 yaw 45 with seq 1 from 1/191 equals the golden frame of §0.4
/// byte for byte."
#[test]
fn statement_5_mount_control_is_the_golden_frame() {
    let golden = bytes(
        "FD 20 00 00 01 01 BF 4C 00 00 00 00 F0 C1 00 00 00 00 00 00 34 42 00 00 00 00 00 00 00 00 00 00 80 3F 00 00 \
         00 40 CD 00 01 9A 65 4E",
    );
    assert_eq!(encode_to_vec(HOST, 1, &rotate_to(GIMBAL, degrees(0.0, -30.0, 45.0))), golden);
}

/// Gimbal statement 6: "Motor-on, FOLLOW, home, 511 and 512 frames equal their golden frames."
#[test]
fn statement_6_commands_are_the_golden_frames() {
    let zeros = |count: usize| "00 ".repeat(count);
    for (sequence, command, golden) in [
        (2, set_motors(GIMBAL, true), format!("FD 20 00 00 02 01 BF 4C 00 00 {} 80 3F 22 79 01 9A 6F EA", zeros(26))),
        (3, follow(GIMBAL), format!("FD 20 00 00 03 01 BF 4C 00 00 {} 40 23 79 01 9A 50 D5", zeros(27))),
        (
            4,
            reset(GIMBAL, ResetMode::PitchAndYaw),
            format!("FD 20 00 00 04 01 BF 4C 00 00 {} 40 40 00 00 80 40 23 79 01 9A A8 33", zeros(22)),
        ),
        (
            5,
            set_message_rate(GIMBAL, message::GIMBAL_DEVICE_ATTITUDE_STATUS, MessageRate::Hertz(50)),
            format!("FD 20 00 00 05 01 BF 4C 00 00 00 80 8E 43 00 40 9C 46 {} FF 01 01 9A E8 EF", zeros(20)),
        ),
        (
            6,
            request_message(GIMBAL, message::GIMBAL_DEVICE_INFORMATION),
            format!("FD 20 00 00 06 01 BF 4C 00 00 00 80 8D 43 {} 00 02 01 9A 6C 62", zeros(24)),
        ),
    ] {
        assert_eq!(encode_to_vec(HOST, sequence, &command), bytes(&golden), "{command:?}");
    }
}

/// Gimbal statement 18: "set_msg rate 50 Hz yields p2 = 20000; −1 and 0 are passed unchanged."
#[test]
fn statement_18_rates_are_intervals() {
    for (rate, expected) in [
        (MessageRate::Hertz(50), 20_000.0),
        (MessageRate::Hertz(75), 13_333.0),
        (MessageRate::Off, -1.0),
        (MessageRate::Default, 0.0),
    ] {
        let command = set_message_rate(GIMBAL, message::MOUNT_ORIENTATION, rate);
        assert_eq!((command.command, command.param1, command.param2), (511, 265.0, expected));
    }
}

/// Gimbal statement 25: "v2 rate command golden frame matches; q bytes are quiet NaN 00 00 C0 7F."
#[test]
fn statement_25_setpoints_of_v2_are_the_golden_frames() {
    let (stabilised, radio_control) = (Stabilised::BOTH, RadioControl::Off);
    let rate = AngularRate::from_degrees_per_second;
    let turn = Setpoint::Turn(Turning {
        roll: Some(AngularRate::ZERO),
        pitch: rate(10.0),
        yaw: rate(-20.0),
        yaw_frame: YawFrame::Vehicle,
        stabilised,
        radio_control,
    });
    let angles = degrees(0.0, -45.0, 30.0);
    let yaw = Yaw::InVehicleFrame(angles.yaw);
    let point = Setpoint::Point(Pointing { roll: angles.roll, pitch: angles.pitch, yaw, stabilised, radio_control });
    for (sequence, setpoint, golden) in [
        (
            7,
            point,
            "FD 20 00 00 07 01 BF 1C 01 00 44 74 64 3F 81 D8 CA 3D F4 41 BD BE 40 DB 74 3E 00 00 C0 7F 00 00 C0 7F 00 \
             00 C0 7F 2C 00 01 9A E7 FC",
        ),
        (
            8,
            turn,
            "FD 20 00 00 08 01 BF 1C 01 00 00 00 C0 7F 00 00 C0 7F 00 00 C0 7F 00 00 C0 7F 00 00 00 00 C2 B8 32 3E C2 \
             B8 B2 BE 2C 00 01 9A F3 4E",
        ),
    ] {
        let message = mavlink_v2::packet::set_attitude(GIMBAL, &setpoint);
        assert_eq!(FrameBuffer::default().encode_any(HOST, sequence, &message).bytes(), bytes(golden));
    }
}

fn params(command: &COMMAND_LONG_DATA) -> (u16, [f32; 7]) {
    let c = command;
    (c.command, [c.param1, c.param2, c.param3, c.param4, c.param5, c.param6, c.param7])
}

/// The rows of gimbals 1.5 that no golden frame shows: command and its seven parameters.
#[test]
#[rustfmt::skip]
fn functions_of_the_sdk_are_these_commands() {
    let rate = AngularRate::from_degrees_per_second;
    let turn = turn_at(GIMBAL, [rate(-0.0), rate(10.0), rate(-20.0)]);
    for (sdk,                              command,                                             number, expected) in [
        ("motors off",                     set_motors(GIMBAL, false),                           31010,  [0.0; 7]),
        ("lock",                           lock(GIMBAL),                                        31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        ("mapping",                        reset(GIMBAL, ResetMode::PitchMapping),              31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 13.0, 4.0]),
        ("reset of yaw",                   reset(GIMBAL, ResetMode::Yaw),                       31011,  [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 4.0]),
        ("set_gimbal_rotation_rate_sync",  turn,                                                205,    [10.0, 0.0, -20.0, 0.0, 0.0, 2.0, 2.0]),
        ("set_gimbal_rc_input_sync",       hand_to_rc(GIMBAL),                                  204,    [3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ("set_gimbal_reboot()",            reboot(GIMBAL),                                      246,    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
        ("set_gimbal_reboot(reboot)",      reboot_or_shutdown(GIMBAL, RebootAction::Reboot),    246,    [0.0, 0.0, 1.0, 154.0, 0.0, 0.0, 0.0]),
        ("set_gimbal_reboot(shutdown)",    reboot_or_shutdown(GIMBAL, RebootAction::Shutdown),  246,    [0.0, 0.0, 2.0, 154.0, 0.0, 0.0, 0.0]),
    ] {
        assert_eq!(params(&command), (number, expected), "{sdk}");
        assert_eq!((command.target_system, command.target_component, command.confirmation), (1, 154, 0));
    }
    assert!(turn_at(GIMBAL, [rate(-0.0); 3]).param2.is_sign_positive());
    assert_eq!(ResetMode::ALL.map(reset_code), [1, 3, 11, 12, 13]);
    assert_eq!(reset_of(11), Some(ResetMode::PitchDownUpAndYaw));
    assert_eq!(reset_of(2), None);
}
