//! How fast the autopilot means the vehicle to turn.
//!
//! `POSITION_TARGET_LOCAL_NED` comes first, then `POSITION_TARGET_GLOBAL_INT`: their `yaw_rate` is the intention itself,
//! and what PX4 puts in `feed_forward_angular_velocity_z`. In modes without a trajectory there is `ATTITUDE_TARGET`: its
//! body rates, which correct the present error too, or else how fast its attitude turns. `NAV_CONTROLLER_OUTPUT` is not
//! used: whole degrees of a bearing make no rate.

use std::time::Duration;

use super::ATTITUDE_WITHIN;
use super::dated::Dated;
use crate::geometry::{Angle, AngularRate, AngularVelocity, Attitude, EarthFrame};
use crate::timestamp::Timestamp;
use crate::wire::dialect::{ATTITUDE_TARGET_DATA, POSITION_TARGET_GLOBAL_INT_DATA, POSITION_TARGET_LOCAL_NED_DATA};
use crate::wire::ids::{attitude_target_typemask, position_target_typemask};

/// Between two targets, more is a jump and no turn.
const FASTEST: AngularRate = AngularRate::from_radians_per_second(3.5);

/// Two targets further apart are not of one movement.
const CONTINUES_WITHIN: Duration = Duration::from_millis(500);

/// The last target out of each message that carries one; `None` also where it says that it does not tell.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct YawTargets {
    local: Option<Dated<AngularRate>>,
    global: Option<Dated<AngularRate>>,
    attitude: Option<Dated<AngularRate>>,
    /// Where `ATTITUDE_TARGET` last pointed, and when by the autopilot's clock, in milliseconds.
    last_heading: Option<(u32, Angle)>,
}

impl YawTargets {
    pub fn handle_position_target_local_ned(&mut self, now: Timestamp, message: &POSITION_TARGET_LOCAL_NED_DATA) {
        self.local = told(message.type_mask, message.yaw_rate).map(|rate| Dated::new(now, rate));
    }

    pub fn handle_position_target_global_int(&mut self, now: Timestamp, message: &POSITION_TARGET_GLOBAL_INT_DATA) {
        self.global = told(message.type_mask, message.yaw_rate).map(|rate| Dated::new(now, rate));
    }

    /// `attitude` is the vehicle's, for a target that has none of its own.
    pub fn handle_attitude_target(
        &mut self,
        now: Timestamp,
        message: &ATTITUDE_TARGET_DATA,
        attitude: Option<Attitude<EarthFrame>>,
    ) {
        let target = match message.type_mask & attitude_target_typemask::ATTITUDE_IGNORE {
            0 => Attitude::<EarthFrame>::from_wxyz(message.q).ok().flatten(),
            _ => None,
        };
        let from_rates = body_rates(message).zip(target.or(attitude));
        let from_rates = from_rates.map(|(rates, attitude)| attitude.turn_in_frame(rates).about_down());
        let rate = from_rates.or_else(|| self.rate_of_heading(message.time_boot_ms, target?.heading()));
        self.last_heading = target.map(|target| (message.time_boot_ms, target.heading()));
        self.attitude = rate.map(|rate| Dated::new(now, rate));
    }

    /// Positive to the right; not older than 1 s.
    pub fn rate(&self, now: Timestamp) -> Option<AngularRate> {
        let sources = [self.local, self.global, self.attitude].into_iter().flatten();
        sources.filter_map(|told| told.within(now, ATTITUDE_WITHIN)).next()
    }

    fn rate_of_heading(&self, boot_ms: u32, heading: Angle) -> Option<AngularRate> {
        let (before_ms, before) = self.last_heading?;
        let time = Duration::from_millis(boot_ms.wrapping_sub(before_ms).into());
        if time.is_zero() || time > CONTINUES_WITHIN {
            return None;
        }
        let turned = (heading - before).wrapped().radians();
        Some(AngularRate::from_radians_per_second(turned / time.as_secs_f64())).filter(|rate| rate.abs() <= FASTEST)
    }
}

fn told(type_mask: u16, yaw_rate: f32) -> Option<AngularRate> {
    let ignored = type_mask & position_target_typemask::YAW_RATE_IGNORE != 0;
    (!ignored && yaw_rate.is_finite()).then(|| AngularRate::from_radians_per_second(f64::from(yaw_rate)))
}

/// `None` without a rate about the body's z axis; the others are zero where they are not told.
fn body_rates(message: &ATTITUDE_TARGET_DATA) -> Option<AngularVelocity<crate::geometry::BodyFrame>> {
    use attitude_target_typemask::{BODY_PITCH_RATE_IGNORE, BODY_ROLL_RATE_IGNORE, BODY_YAW_RATE_IGNORE};
    let rate = |ignored: u8, rate: f32| if message.type_mask & ignored == 0 { f64::from(rate) } else { 0.0 };
    if message.type_mask & BODY_YAW_RATE_IGNORE != 0 {
        return None;
    }
    AngularVelocity::from_radians_per_second([
        rate(BODY_ROLL_RATE_IGNORE, message.body_roll_rate),
        rate(BODY_PITCH_RATE_IGNORE, message.body_pitch_rate),
        f64::from(message.body_yaw_rate),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAN: f32 = f32::NAN;

    fn at(millis: u64) -> Timestamp {
        Timestamp::from_millis(millis)
    }

    fn local(type_mask: u16, yaw_rate: f32) -> POSITION_TARGET_LOCAL_NED_DATA {
        POSITION_TARGET_LOCAL_NED_DATA { type_mask, yaw_rate, ..POSITION_TARGET_LOCAL_NED_DATA::DEFAULT }
    }

    fn global(type_mask: u16, yaw_rate: f32) -> POSITION_TARGET_GLOBAL_INT_DATA {
        POSITION_TARGET_GLOBAL_INT_DATA { type_mask, yaw_rate, ..POSITION_TARGET_GLOBAL_INT_DATA::DEFAULT }
    }

    fn facing(roll_deg: f64, yaw_deg: f64) -> Attitude<EarthFrame> {
        let [roll, yaw] = [roll_deg, yaw_deg].map(Angle::from_degrees);
        Attitude::from_aircraft_angles(crate::geometry::AircraftAngles { roll, yaw, ..Default::default() })
    }

    fn attitude_target(
        boot_ms: u32,
        type_mask: u8,
        attitude: Attitude<EarthFrame>,
        rates: [f32; 3],
    ) -> ATTITUDE_TARGET_DATA {
        let [body_roll_rate, body_pitch_rate, body_yaw_rate] = rates;
        let (time_boot_ms, q, thrust) = (boot_ms, attitude.to_wxyz(), 0.5);
        ATTITUDE_TARGET_DATA { time_boot_ms, q, body_roll_rate, body_pitch_rate, body_yaw_rate, thrust, type_mask }
    }

    /// Radians per second, to the digits that single precision has.
    fn rate_at(targets: &YawTargets, millis: u64) -> Option<f64> {
        targets.rate(at(millis)).map(|rate| (rate.radians_per_second() * 1e5).round() / 1e5)
    }

    #[test]
    fn the_trajectory_comes_first_and_each_counts_for_a_second() {
        let mut targets = YawTargets::default();
        targets.handle_position_target_local_ned(at(0), &local(0, 0.1));
        targets.handle_position_target_global_int(at(200), &global(0, 0.2));
        targets.handle_attitude_target(at(400), &attitude_target(400, 0, facing(0.0, 0.0), [0.0, 0.0, 0.3]), None);

        assert_eq!(rate_at(&targets, 1_000), Some(0.1));
        assert_eq!(rate_at(&targets, 1_001), Some(0.2));
        assert_eq!(rate_at(&targets, 1_201), Some(0.3));
        assert_eq!(rate_at(&targets, 1_401), None);
    }

    /// `POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE` (2048), and NaN, which PX4 sends where it has no such target.
    #[test]
    fn a_masked_or_unknown_rate_is_no_target() {
        for (type_mask, yaw_rate, expected) in
            [(0, -0.5, Some(-0.5)), (0, 0.0, Some(0.0)), (2048, -0.5, None), (0, NAN, None), (0xf7ff, -0.5, Some(-0.5))]
        {
            let mut targets = YawTargets::default();
            targets.handle_position_target_local_ned(at(0), &local(0, 0.1));
            targets.handle_position_target_local_ned(at(100), &local(type_mask, yaw_rate));
            assert_eq!(rate_at(&targets, 100), expected, "{type_mask} {yaw_rate}");

            let mut targets = YawTargets::default();
            targets.handle_position_target_global_int(at(0), &global(0, 0.1));
            targets.handle_position_target_global_int(at(100), &global(type_mask, yaw_rate));
            assert_eq!(rate_at(&targets, 100), expected, "{type_mask} {yaw_rate}");
        }
    }

    /// Body rates become one about Down by the attitude they are meant for; rates that are masked (1, 2) are none.
    #[test]
    #[rustfmt::skip]
    fn body_rates_are_those_of_the_target_attitude() {
        for (mask, target,            vehicle,                 rates,            expected) in [
            (0,    facing( 0.0, 0.0), None,                    [0.0, 0.0,  0.4], Some(0.4)),
            (0,    facing(60.0, 0.0), None,                    [0.0, 0.0,  0.4], Some(0.2)),
            (0,    facing(90.0, 0.0), None,                    [0.0, 0.4,  0.0], Some(0.4)),
            (3,    facing(90.0, 0.0), None,                    [0.4, 0.4,  0.0], Some(0.0)),
            (128,  facing(60.0, 0.0), Some(facing(0.0, 30.0)), [0.0, 0.0,  0.4], Some(0.4)),
            (128,  facing(60.0, 0.0), None,                    [0.0, 0.0,  0.4], None),
            (0,    facing( 0.0, 0.0), None,                    [0.0, 0.0,  NAN], None),
            (4,    facing( 0.0, 0.0), None,                    [0.0, 0.0,  0.4], None),
        ] {
            let mut targets = YawTargets::default();
            targets.handle_attitude_target(at(0), &attitude_target(10, mask, target, rates), vehicle);
            assert_eq!(rate_at(&targets, 0), expected, "{mask} {target:?} {rates:?}");
        }
    }

    /// Without rates the attitude that is aimed for tells how fast it turns, by the autopilot's clock.
    #[test]
    fn a_turning_target_tells_a_rate() {
        let target = |boot_ms: u32, yaw_deg| attitude_target(boot_ms, 4, facing(0.0, yaw_deg), [0.0; 3]);
        for (first_ms, second_ms, first_deg, second_deg, expected) in [
            (1_000, 1_100, 10.0, 11.0, Some(0.174_53)),
            (1_000, 1_100, 179.5, -179.5, Some(0.174_53)),
            (u32::MAX - 49, 50, 11.0, 10.0, Some(-0.174_53)),
            (1_000, 1_100, 10.0, 50.0, None),
            (1_000, 1_501, 10.0, 11.0, None),
            (1_000, 1_000, 10.0, 11.0, None),
            (1_000, 900, 10.0, 11.0, None),
        ] {
            let mut targets = YawTargets::default();
            targets.handle_attitude_target(at(0), &target(first_ms, first_deg), None);
            assert_eq!(rate_at(&targets, 0), None);
            targets.handle_attitude_target(at(130), &target(second_ms, second_deg), None);
            assert_eq!(rate_at(&targets, 130), expected, "{first_deg} at {first_ms}, {second_deg} at {second_ms}");
        }
    }
}
