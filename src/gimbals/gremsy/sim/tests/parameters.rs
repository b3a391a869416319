//! The parameters of the device.

use super::*;
use crate::gimbals::gremsy::parameters::ParameterTable;
use crate::wire::dialect::{
    CharArray, MOUNT_STATUS_DATA, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA, PARAM_VALUE_DATA,
    RAW_IMU_DATA,
};

/// `MAV_PARAM_TYPE_INT16`.
const INT16: u8 = 4;

pub fn set(name: &str, param_value: f32) -> PARAM_SET_DATA {
    PARAM_SET_DATA {
        param_value,
        target_system: 1,
        target_component: 154,
        param_id: CharArray::from(name),
        param_type: INT16,
    }
}

fn values(bench: &Bench) -> Vec<(String, f32, u16)> {
    let all = bench.messages::<PARAM_VALUE_DATA>();
    let text = |value: &PARAM_VALUE_DATA| value.param_id.to_str().expect("a name").to_owned();
    assert!(all.iter().all(|(_, value)| value.param_type == INT16));
    all.iter().map(|(_, value)| (text(value), value.param_value, value.param_index)).collect()
}

/// "Parameters: full new table §1.6 with sparse indices 0…52 … variant `old_fw = true` serves the old table" (gimbals
/// 5.3); "Limits: tilt −90…+45 shown with negated/swapped parameters".
#[test]
#[rustfmt::skip]
fn the_whole_table_comes_on_request() {
    for (firmware,                           table,               some) in [
        (FirmwareVersion::official(7, 7, 3), ParameterTable::New, [("VERSION_Y", 7.0, 45), ("VERSION_Z", 3.0, 46), ("RC_LIM_MIN_TILT", -45.0, 23), ("RC_LIM_MAX_TILT", 90.0, 24), ("RC_LIM_MIN_PAN", -320.0, 47), ("RC_TYPE", 7.0, 21)]),
        (FirmwareVersion::official(7, 5, 6), ParameterTable::Old, [("VERSION_Y", 5.0, 67), ("VERSION_Z", 6.0, 68), ("TRAVEL_MIN_PIT", -90.0, 30), ("TRAVEL_MAX_PIT", 45.0, 31), ("TRAVEL_MIN_PAN", -320.0, 69), ("ENC_TYPE_SEND", 1.0, 75)]),
    ] {
        let mut bench = Bench::running(Generation::V1, |settings| settings.firmware = firmware);
        bench.hear(MANAGER, &PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 154 });
        bench.run_for(1000);

        let listed = values(&bench);
        assert_eq!(listed.len(), table.rows().len());
        assert_eq!(ParameterTable::recognised_by(listed.iter().map(|(name, ..)| name.as_str())), Some(table));
        for row in table.rows() {
            let (_, _, index) = listed.iter().find(|(name, ..)| name == row.name).expect("it is listed");
            assert!(row.index.is_none_or(|place| place == *index), "{row:?}");
        }
        for (name, value, index) in some {
            assert!(listed.contains(&(name.to_owned(), value, index)), "{name} in {listed:?}");
        }
    }
}

/// "PARAM_REQUEST_READ by name (index −1) and by index; PARAM_SET echo after 20–200 ms; out-of-range value → echo of the
/// old value" (gimbals 5.3).
#[test]
fn parameters_are_read_and_written() {
    let mut bench = Bench::running(Generation::V2, |_| ());
    let read = |name: &str, param_index| PARAM_REQUEST_READ_DATA {
        param_index,
        target_system: 1,
        target_component: 154,
        param_id: CharArray::from(name),
    };
    bench.hear(MANAGER, &read("RC_SPD_PAN", -1));
    bench.hear(MANAGER, &read("", 0));
    bench.hear(MANAGER, &read("", 1));
    assert_eq!(values(&bench), [("RC_SPD_PAN".to_owned(), 30.0, 43), ("VERSION_X".to_owned(), 7.0, 0)]);

    for (name, written, expected) in [("RC_SPD_PAN", 45.0, 45.0), ("RC_SPD_PAN", 300.0, 45.0), ("VERSION_X", 8.0, 7.0)]
    {
        bench.sent.clear();
        let asked = bench.now;
        bench.hear(MANAGER, &set(name, written));
        bench.run_for(200);
        let echo = bench.messages::<PARAM_VALUE_DATA>();
        assert_eq!((echo.len(), echo[0].1.param_value), (1, expected));
        assert!((20..=200).contains(&echo[0].0.since(asked).as_millis()), "{echo:?}");
    }
}

/// What a parameter changes: the speed of control, the software limits, the way to an angle.
#[test]
fn parameters_change_how_it_moves() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.hear(MANAGER, &set("RC_SPD_PAN", 60.0));
    // Up to 20°, down to 60°.
    bench.hear(MANAGER, &set("RC_LIM_MIN_TILT", -20.0));
    bench.hear(MANAGER, &set("RC_LIM_MAX_TILT", 60.0));
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -90.0, 170.0)));
    bench.run_for(5000);
    assert_eq!(bench.pose(), [0.0, -60.0, 170.0]);
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, 45.0, -170.0)));
    bench.run_for(4000);
    // The shorter way leads on past 180°.
    assert_eq!(bench.pose(), [0.0, 20.0, 190.0]);

    bench.hear(MANAGER, &set("CTRL_ANGLE_MODE", 1.0));
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, 0.0, -170.0)));
    bench.run_for(8000);
    assert_eq!(bench.pose(), [0.0, 0.0, -170.0]);
}

/// "return home when change mode: RC_REVERSE_AXIS bit 0x08" (gimbals 1.5).
#[test]
fn it_may_return_home_when_the_mode_changes() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.hear(MANAGER, &set("RC_REVERSE_AXIS", 24.0));
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -30.0, 40.0)));
    bench.run_for(3000);
    bench.accept(&packet::lock(GIMBAL));
    bench.run_for(3000);
    assert_eq!(bench.pose(), [0.0, 0.0, 0.0]);
}

/// "MOUNT_STATUS 10 Hz encoder (counts or cdeg by MAV_TS_ENCNT)" (gimbals 5.3), as int16.
#[test]
fn encoders_are_counts_or_angles() {
    let mut bench = Bench::running(Generation::V1, |settings| settings.control_speed_dps = 90);
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -45.0, 150.0)));
    bench.run_for(4000);
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -45.0, 270.0)));
    bench.run_for(4000);
    let encoders = |bench: &Bench| {
        let status = bench.last::<MOUNT_STATUS_DATA>();
        [status.pointing_a, status.pointing_b, status.pointing_c]
    };
    // 270° is −90°.
    assert_eq!(encoders(&bench), [-8192, 0, -16_384]);
    bench.hear(MANAGER, &set("MAV_TS_ENCNT", 0.0));
    bench.run_for(200);
    assert_eq!(encoders(&bench), [-4500, 0, 27_000]);
}

/// "RAW_IMU 10 Hz (z ≈ 8192·cosθ)" (gimbals 5.3).
#[test]
fn the_imu_feels_gravity() {
    let mut bench = Bench::running(Generation::V1, |_| ());
    bench.accept(&packet::rotate_to(GIMBAL, angles(0.0, -60.0, 0.0)));
    bench.run_for(1000);
    assert_near(f64::from(bench.last::<RAW_IMU_DATA>().ygyro), -30.0 * 32.8, 20.0);
    let from = bench.now;
    bench.run_for(4000);
    assert_eq!(bench.count::<RAW_IMU_DATA>(from), 40);
    let imu = bench.last::<RAW_IMU_DATA>();
    assert_eq!((imu.xacc, imu.yacc, imu.zacc), (7094, 0, 4096));
    assert_eq!(imu.ygyro, 0);
}
