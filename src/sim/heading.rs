//! Where a simulated gimbal believes North is: the heading that its autopilot tells it.

use std::time::Duration;

use crate::geometry::{Angle, AngularRate, Attitude, EarthFrame};
use crate::sim::peer::PlatformMotion;
use crate::timestamp::Timestamp;
use crate::wire::Frame;
use crate::wire::dialect::{ATTITUDE_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA};
use crate::wire::ids::component;

/// A heading that is older counts as unknown.
const VALID: Duration = Duration::from_secs(1);
/// While 286 comes at least as often, `ATTITUDE` is not looked at.
const PREFERENCE: Duration = Duration::from_millis(500);
/// Holding a direction needs at least ten headings a second, for two seconds.
const REFERENCE_GAP: Duration = Duration::from_millis(100);
const REFERENCE_TIME: Duration = Duration::from_secs(2);
/// Between two headings, a faster turn is a jump and no rate; radians per second.
const FASTEST_TURN: f64 = 3.5;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum HeadingSource {
    /// `AUTOPILOT_STATE_FOR_GIMBAL_DEVICE`.
    State,
    /// `ATTITUDE`.
    Attitude,
}

#[derive(Clone, Copy, Debug)]
struct Sample {
    at: Timestamp,
    source: HeadingSource,
    heading: Angle,
    rate: AngularRate,
}

/// The vehicle's heading as it was last told, and since when it has been told often enough to lean on.
#[derive(Clone, Copy, Debug, Default)]
pub struct HeadingBelief {
    last: Option<Sample>,
    steady_since: Option<Timestamp>,
}

impl HeadingBelief {
    /// What a frame tells of the vehicle's motion: `AUTOPILOT_STATE_FOR_GIMBAL_DEVICE`, or `ATTITUDE` of an autopilot
    /// while that does not come.
    pub fn handle_frame(&mut self, now: Timestamp, frame: &Frame<'_>) -> Option<PlatformMotion> {
        if let Some(state) = frame.decode() {
            self.handle_state(now, &state)
        } else if frame.source().component == component::AUTOPILOT1 {
            self.handle_attitude(now, &frame.decode()?)
        } else {
            None
        }
    }

    fn handle_state(
        &mut self,
        now: Timestamp,
        state: &AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA,
    ) -> Option<PlatformMotion> {
        let attitude = Attitude::<EarthFrame>::from_wxyz(state.q).ok().flatten()?;
        // Zero stands for unknown in this field.
        let rate = f64::from(state.angular_velocity_z);
        let rate = (rate.is_finite() && rate != 0.0).then(|| AngularRate::from_radians_per_second(rate));
        self.handle_heading(now, HeadingSource::State, attitude.heading(), rate)
            .then(|| self.motion(now, [0.0, 0.0]))
            .flatten()
    }

    fn handle_attitude(&mut self, now: Timestamp, attitude: &ATTITUDE_DATA) -> Option<PlatformMotion> {
        let [yaw, roll_rate, pitch_rate, yaw_rate] =
            [attitude.yaw, attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed].map(f64::from);
        if !yaw.is_finite() {
            return None;
        }
        let rate = yaw_rate.is_finite().then(|| AngularRate::from_radians_per_second(yaw_rate));
        let finite = |rate: f64| if rate.is_finite() { rate } else { 0.0 };
        self.handle_heading(now, HeadingSource::Attitude, Angle::from_radians(yaw), rate)
            .then(|| self.motion(now, [finite(roll_rate), finite(pitch_rate)]))
            .flatten()
    }

    fn motion(&self, now: Timestamp, roll_and_pitch_rate: [f64; 2]) -> Option<PlatformMotion> {
        let (heading, heading_rate) = self.at(now)?;
        let [roll_rate, pitch_rate] = roll_and_pitch_rate.map(AngularRate::from_radians_per_second);
        Some(PlatformMotion { heading, heading_rate, roll_rate, pitch_rate })
    }

    /// Takes a heading, and the rate of turn if it came with one; false when a better source makes it superfluous.
    fn handle_heading(
        &mut self,
        now: Timestamp,
        source: HeadingSource,
        heading: Angle,
        rate: Option<AngularRate>,
    ) -> bool {
        let before = self.last.filter(|last| now.since(last.at) <= VALID);
        if let Some(last) = before
            && source == HeadingSource::Attitude
            && last.source == HeadingSource::State
            && now.since(last.at) <= PREFERENCE
        {
            return false;
        }
        let measured = before.and_then(|last| {
            let time = now.since(last.at).as_secs_f64();
            let rate = (heading - last.heading).wrapped().radians() / time;
            (rate.abs() <= FASTEST_TURN).then(|| AngularRate::from_radians_per_second(rate))
        });
        if self.last.is_none_or(|last| now.since(last.at) > REFERENCE_GAP) {
            self.steady_since = Some(now);
        }
        let rate = rate.or(measured).unwrap_or(AngularRate::ZERO);
        self.last = Some(Sample { at: now, source, heading, rate });
        true
    }

    /// Heading and rate of turn at `now`; `None` when none was told for a second.
    pub fn at(&self, now: Timestamp) -> Option<(Angle, AngularRate)> {
        let last = self.last.filter(|last| now.since(last.at) <= VALID)?;
        Some((last.heading + last.rate.over(now.since(last.at)), last.rate))
    }

    /// Whether headings come often enough to hold a direction without drift.
    pub fn is_reference(&self, now: Timestamp) -> bool {
        let Some((last, since)) = self.last.zip(self.steady_since) else { return false };
        now.since(last.at) <= REFERENCE_GAP && last.at.since(since) >= REFERENCE_TIME
    }
}
