//! What an autopilot tells gimbals (`AUTOPILOT_STATE_FOR_GIMBAL_DEVICE`, 286), made of what it tells others.

use std::time::Duration;

use super::{LandedState, Vehicle};
use crate::geometry::AngularRate;
use crate::timestamp::Timestamp;
use crate::wire::Target;
use crate::wire::dialect::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA;

/// An attitude is turned on by its rates for so long; beyond that it is told as it was.
const EXTRAPOLATED_FOR: Duration = Duration::from_millis(250);

/// What an unknown flag of the estimator reads as.
const NO_ESTIMATES: u16 = 0;

/// "0: unknown" in `angular_velocity_z`; a measured zero is sent as this.
const MEASURED_ZERO: f32 = 1e-5;

impl Vehicle {
    /// The state at `now`, or `None` while no attitude of the last second is known.
    ///
    /// Between two attitudes the last one is turned on, so that each message tells something new; the delays are the
    /// true ones, of what was measured and not extrapolated: how much later it came than the autopilot's fastest message,
    /// and how long that takes. `time_boot_us` is the autopilot's time at `now`, or ours where it tells none: what is
    /// delayed was measured that much earlier.
    pub fn state_for_gimbals(&self, now: Timestamp, target: Target) -> Option<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA> {
        let told = self.attitudes.orientation(now)?;
        let age = told.age(now);
        let (attitude, turned_on) = match told.value.turn {
            Some(turn) => {
                let turned_on = age.min(EXTRAPOLATED_FOR);
                (told.value.attitude.after(turn, turned_on), turned_on)
            }
            None => (told.value.attitude, Duration::ZERO),
        };
        let one_way = self.round_trips.one_way().unwrap_or_default();
        let velocity = self.velocities.velocity(now);
        let [vx, vy, vz] = velocity.map_or([f32::NAN; 3], |velocity| velocity.value.ned);
        let turn = told.value.turn.map(|turn| turn.about_down().radians_per_second() as f32);
        Some(AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
            time_boot_us: self.clock.time_us(now + one_way).unwrap_or(now.as_micros()),
            q: attitude.to_wxyz(),
            q_estimated_delay_us: delay_us(age - turned_on, told.value.late.map(|late| late + one_way)),
            vx,
            vy,
            vz,
            v_estimated_delay_us: velocity
                .map_or(0, |velocity| delay_us(velocity.age(now), velocity.value.late.map(|late| late + one_way))),
            feed_forward_angular_velocity_z: self.yaw_targets.rate(now).map_or(f32::NAN, radians_per_second),
            estimator_status: self.estimator_status(now).unwrap_or(NO_ESTIMATES),
            target_system: target.system(),
            target_component: target.component(),
            landed_state: self.landed_state(now).map_or(0, LandedState::number),
            angular_velocity_z: match turn {
                None => 0.0,
                Some(0.0) => MEASURED_ZERO,
                Some(turn) => turn,
            },
        })
    }
}

/// "Estimated delay … 0 if unknown": a delay that is known is never 0, and one that does not fit is as long as fits.
fn delay_us(age: Duration, late: Option<Duration>) -> u32 {
    match late {
        None => saturating_micros(age),
        Some(late) => saturating_micros(age + late).max(1),
    }
}

fn saturating_micros(duration: Duration) -> u32 {
    u32::try_from(duration.as_micros()).unwrap_or(u32::MAX)
}

fn radians_per_second(rate: AngularRate) -> f32 {
    rate.radians_per_second() as f32
}

#[cfg(test)]
mod tests;
