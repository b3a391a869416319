//! The messages that demand an angle or a rate: 282, 287 and 288 of a manager, and 284 as an autopilot sends it to a device.

use super::demand::{AxisDemand, Demand, DemandKind, PITCH_RANGE, YAW_RANGE, angle, number, rate};
use super::{Refusal, Request};
use crate::geometry::{Angle, AngularRate, Attitude, EarthFrame, GimbalAngles};
use crate::wire::Target;
use crate::wire::dialect::{
    GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_SET_ATTITUDE_DATA, GIMBAL_MANAGER_SET_MANUAL_CONTROL_DATA,
    GIMBAL_MANAGER_SET_PITCHYAW_DATA,
};
use crate::wire::ids::GimbalFlags;

/// `GIMBAL_MANAGER_SET_ATTITUDE` (282): a quaternion of four NaN states no angle.
pub fn set_attitude(target: Target, message: &GIMBAL_MANAGER_SET_ATTITUDE_DATA) -> Result<Request, Refusal> {
    // The frame of the quaternion follows from the flags; the angles are the same numbers in either.
    let attitude: Option<Attitude<EarthFrame>> =
        Attitude::from_wxyz(message.q).map_err(|_| Refusal::denied("malformed_quaternion"))?;
    let angles = attitude.map(Attitude::gimbal_angles);
    let angle = |of: fn(GimbalAngles) -> Angle| angles.map(of);
    Ok(Request::Demand {
        target,
        gimbal: message.gimbal_device_id,
        demand: Demand {
            flags: GimbalFlags::from_bits_retain(message.flags as u16),
            roll: AxisDemand { angle: angle(|angles| angles.roll), rate: rate(message.angular_velocity_x)? },
            pitch: AxisDemand { angle: angle(|angles| angles.pitch), rate: rate(message.angular_velocity_y)? },
            yaw: AxisDemand { angle: angle(|angles| angles.yaw), rate: rate(message.angular_velocity_z)? },
            kind: DemandKind::Streamed,
        },
    })
}

/// `GIMBAL_DEVICE_SET_ATTITUDE` (284): what an autopilot tells a device. `None` where it demands nothing.
///
/// Whoever states an angle means no rate, except that PX4 sends the identity beside one.
pub fn device_set_attitude(message: &GIMBAL_DEVICE_SET_ATTITUDE_DATA) -> Result<Option<Demand>, Refusal> {
    let attitude: Option<Attitude<EarthFrame>> =
        Attitude::from_wxyz(message.q).map_err(|_| Refusal::denied("malformed_quaternion"))?;
    let [roll_rate, pitch_rate, yaw_rate] =
        [rate(message.angular_velocity_x)?, rate(message.angular_velocity_y)?, rate(message.angular_velocity_z)?];
    let turns = [roll_rate, pitch_rate, yaw_rate].iter().flatten().any(|rate| !rate.is_zero());
    let angles = attitude.filter(|_| !(turns && message.q == [1.0, 0.0, 0.0, 0.0])).map(Attitude::gimbal_angles);
    let axis = |of: fn(GimbalAngles) -> Angle, rate: Option<AngularRate>| match angles {
        Some(angles) => AxisDemand { angle: Some(of(angles)), rate: None },
        None => AxisDemand { angle: None, rate },
    };
    let demand = Demand {
        flags: GimbalFlags::from_bits_retain(message.flags),
        roll: axis(|angles| angles.roll, roll_rate),
        pitch: axis(|angles| angles.pitch, pitch_rate),
        yaw: axis(|angles| angles.yaw, yaw_rate),
        kind: DemandKind::Streamed,
    };
    demand.check()?;
    let poses = demand.flags.intersects(GimbalFlags::RETRACT | GimbalFlags::NEUTRAL);
    let is_empty = [demand.roll, demand.pitch, demand.yaw].iter().all(|axis| *axis == AxisDemand::default());
    Ok(Some(demand).filter(|_| poses || !is_empty))
}

/// `GIMBAL_MANAGER_SET_PITCHYAW` (287), in radians.
pub fn set_pitchyaw(target: Target, message: &GIMBAL_MANAGER_SET_PITCHYAW_DATA) -> Result<Request, Refusal> {
    Ok(Request::Demand {
        target,
        gimbal: message.gimbal_device_id,
        demand: Demand {
            flags: GimbalFlags::from_bits_retain(message.flags as u16),
            roll: AxisDemand::default(),
            pitch: AxisDemand { angle: angle(message.pitch, PITCH_RANGE)?, rate: rate(message.pitch_rate)? },
            yaw: AxisDemand {
                angle: angle(message.yaw, YAW_RANGE)?.map(Angle::wrapped),
                rate: rate(message.yaw_rate)?,
            },
            kind: DemandKind::Streamed,
        },
    })
}

/// `GIMBAL_MANAGER_SET_MANUAL_CONTROL` (288), −1 to 1; beyond that is taken for the end.
pub fn set_manual_control(
    target: Target,
    message: &GIMBAL_MANAGER_SET_MANUAL_CONTROL_DATA,
) -> Result<Request, Refusal> {
    let axis = |stick: f32, rate_stick: f32| -> Result<AxisDemand, Refusal> {
        let fraction = |stick: f32| Ok(number(stick)?.map(|stick| stick.clamp(-1.0, 1.0)));
        let rate = fraction(rate_stick)?.map(AngularRate::from_radians_per_second);
        // A rate that is given wins over an angle on the same axis.
        let angle = fraction(stick)?.filter(|_| rate.is_none()).map(Angle::from_radians);
        Ok(AxisDemand { angle, rate })
    };
    Ok(Request::Demand {
        target,
        gimbal: message.gimbal_device_id,
        demand: Demand {
            flags: GimbalFlags::from_bits_retain(message.flags as u16),
            roll: AxisDemand::default(),
            pitch: axis(message.pitch, message.pitch_rate)?,
            yaw: axis(message.yaw, message.yaw_rate)?,
            kind: DemandKind::Manual,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAN: f32 = f32::NAN;
    /// 90° to the right.
    const RIGHT: [f32; 4] = [0.707_106_77, 0.0, 0.0, 0.707_106_77];
    const AHEAD: [f32; 4] = [1.0, 0.0, 0.0, 0.0];
    const NONE: [f32; 4] = [NAN; 4];

    fn read(q: [f32; 4], [x, y, z]: [f32; 3], flags: u16) -> Result<Option<Demand>, Refusal> {
        device_set_attitude(&GIMBAL_DEVICE_SET_ATTITUDE_DATA {
            q,
            angular_velocity_x: x,
            angular_velocity_y: y,
            angular_velocity_z: z,
            flags,
            target_system: 1,
            target_component: 154,
        })
    }

    /// "284 with NaN q (rates, ArduPilot; no input yet, PX4) or identity q (rates, PX4)."
    #[test]
    #[rustfmt::skip]
    fn what_autopilots_tell_a_device_is_read_as_each_means_it() {
        for (q, rates, flags, expected) in [
            // Yaw, and yaw rate; whole degrees.
            (RIGHT, [NAN; 3],        0,  Ok(Some((Some(90), None)))),
            (RIGHT, [0.0, 0.0, 1.0], 28, Ok(Some((Some(90), None)))),
            (AHEAD, [0.0; 3],        32, Ok(Some((Some(0), None)))),
            (AHEAD, [0.0, 0.0, 1.0], 16, Ok(Some((None, Some(57))))),
            (NONE,  [0.0, 0.0, 1.0], 28, Ok(Some((None, Some(57))))),
            (NONE,  [0.0; 3],        28, Ok(Some((None, Some(0))))),
            (NONE,  [NAN; 3],        44, Ok(None)),
            (NONE,  [NAN; 3],        1,  Ok(Some((None, None)))),
            (NONE,  [0.0, 0.0, f32::INFINITY], 0, Err("infinite_number")),
            ([0.0; 4], [NAN; 3],     0,  Err("malformed_quaternion")),
            ([1.2, 0.0, 0.0, 0.0], [NAN; 3], 0, Err("malformed_quaternion")),
            (AHEAD, [NAN; 3],        32 | 64, Err("both_yaw_frames")),
        ] {
            let yaw = |demand: Demand| {
                let angle = demand.yaw.angle.map(|angle| angle.degrees().round() as i32);
                (angle, demand.yaw.rate.map(|rate| rate.degrees_per_second().round() as i32))
            };
            let found = read(q, rates, flags).map(|demand| demand.map(yaw)).map_err(|refusal| refusal.reason);
            assert_eq!(found, expected, "{q:?} {rates:?} {flags}");
        }
        assert!(read(NONE, [0.0, 0.0, 1.0], 28).is_ok_and(|demand| demand.is_some_and(|demand| demand.turns())));
        assert!(read(NONE, [0.0; 3], 28).is_ok_and(|demand| demand.is_some_and(|demand| !demand.turns())));
    }
}
