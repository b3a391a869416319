//! What a Gremsy tells of itself, as the manager is told: who it is, what it can do, where it looks.

use super::effect::{Finding, Pose};
use super::faults::Fault;
use super::mount::Order;
use super::operations::{attitude_of, shown_mode};
use super::{Generation, GremsyDriver, HandOver};
use crate::geometry::{Angle, AxisLimits, Limits, Yaw};
use crate::gimbals::capabilities::Capabilities;
use crate::gimbals::driver::DriverOutput;
use crate::gimbals::gremsy::parameters::{AngleLimits, Axis, AxisFlags, Parameter, RcType, TiltSense};
use crate::gimbals::gremsy::readings::{Negated, Orientation};
use crate::gimbals::gremsy::status::{Activity, Alignment};
use crate::gimbals::operation::YawMode;
use crate::gimbals::report::{GimbalStatus, Identity, Report};
use crate::gimbals::rest_watch::Look;
use crate::timestamp::Timestamp;
use crate::wire::dialect::MOUNT_ORIENTATION_DATA;
use crate::wire::ids::{CapFlags, FailureFlags, GimbalFlags};
use crate::wire::{Frame, MavId};

/// Beside another message, an orientation counts for so long.
const ORIENTATION_FRESH: std::time::Duration = std::time::Duration::from_millis(500);

/// The autopilot's attitude puts its North right within so long.
const NORTH_WITHIN: std::time::Duration = std::time::Duration::from_secs(2);

impl GremsyDriver {
    /// `MOUNT_ORIENTATION`: the attitude in v1.
    pub(super) fn handle_orientation(&mut self, now: Timestamp, device: MavId, frame: &Frame<'_>) {
        let Some(orientation) = Orientation::read(frame, self.negated) else { return };
        self.heard.orientation = Some((now, orientation));
        if let Some(yaw_absolute) = orientation.yaw_absolute {
            self.vehicle_turn.handle_heading(now, (yaw_absolute - orientation.yaw).wrapped());
        }
        if self.search.decided() != Some(Generation::V1) {
            return;
        }
        if let Some(message) = frame.decode::<MOUNT_ORIENTATION_DATA>() {
            self.handle_boot_ms(now, device, message.time_boot_ms);
        }
        self.tell_orientation(now, orientation);
    }

    /// In v1, that it was told to combine attitudes or no more is known before it tells where it looks again.
    pub(super) fn tell_north(&mut self, now: Timestamp) {
        let told = self.heard.attitude.map(|(_, status)| status.accepts_earth_yaw);
        let latest = self.heard.orientation.filter(|(at, _)| now.since(*at) <= ORIENTATION_FRESH);
        if let (Some(Generation::V1), Some((_, orientation))) = (self.search.decided(), latest)
            && told.is_some_and(|told| told != self.knows_north(now))
        {
            self.tell_orientation(now, orientation);
        }
    }

    fn tell_orientation(&mut self, now: Timestamp, orientation: Orientation) {
        let is_locked = self.is_locked();
        let knows_north = self.knows_north(now);
        // In LOCK its yaw from North counts, where it knows that.
        let attitude = orientation.attitude(is_locked && knows_north);
        let mut flags = GimbalFlags::ROLL_LOCK | GimbalFlags::PITCH_LOCK;
        flags.set(GimbalFlags::YAW_LOCK, is_locked);
        flags |= match attitude.yaw() {
            Yaw::InVehicleFrame(_) => GimbalFlags::YAW_IN_VEHICLE_FRAME,
            Yaw::InEarthFrame(_) => GimbalFlags::YAW_IN_EARTH_FRAME,
        };
        let motors_off = self.heard.status.is_some_and(|(_, status)| !status.motors_on());
        let is_stowed = self.is_to_be_stowed && matches!(self.mount.wanted(), Some(Order::Point { .. }));
        flags.set(GimbalFlags::RETRACT, motors_off || is_stowed || self.mount.wanted() == Some(Order::Retract));
        flags.set(GimbalFlags::NEUTRAL, self.mount.wanted() == Some(Order::Home));
        flags.set(GimbalFlags::RC_EXCLUSIVE, self.hand_over == HandOver::Done);
        self.tell_attitude(
            now,
            GimbalStatus {
                is_assumed: false,
                attitude,
                rates: [None; 3],
                heading: None,
                flags,
                failures: self.failures(),
                accepts_earth_yaw: knows_north,
            },
        );
    }

    /// `GIMBAL_DEVICE_ATTITUDE_STATUS`: the attitude in v2.
    pub(super) fn handle_device_status(&mut self, now: Timestamp, status: GimbalStatus) {
        self.heard.device_status = Some(now);
        self.faults.clear(|fault| *fault == Fault::NoAttitude);
        self.search.handle_attitude_status();
        if self.search.decided() != Some(Generation::V2) {
            return;
        }
        if let (Some(change), Some(device)) = (self.mode_change, self.device) {
            let step = change.handle_flags(status.flags);
            self.handle_mode_step(now, device, step);
        }
        // Nothing says that it tells that itself.
        let mut flags = status.flags;
        flags.set(
            GimbalFlags::RC_EXCLUSIVE,
            flags.contains(GimbalFlags::RC_EXCLUSIVE) || self.hand_over == HandOver::Done,
        );
        let status = GimbalStatus { flags, failures: status.failures | self.failures(), ..status };
        let is_wrong = self.version().is_some_and(|version| version.has_wrong_earth_yaw());
        let status = if is_wrong { self.without_earth_yaw(now, status) } else { status };
        self.tell_attitude(now, status);
    }

    /// Its yaw from North is not believed: yaw comes from the nose, and the autopilot says where that points.
    fn without_earth_yaw(&self, now: Timestamp, status: GimbalStatus) -> GimbalStatus {
        let angles = status.attitude.angles();
        let orientation = self.heard.orientation.filter(|(at, _)| now.since(*at) <= ORIENTATION_FRESH);
        let yaw = match (status.attitude.yaw(), status.heading, orientation) {
            (yaw @ Yaw::InVehicleFrame(_), ..) => yaw,
            // What is wrong in both cancels out.
            (Yaw::InEarthFrame(yaw), Some(heading), _) => Yaw::InVehicleFrame((yaw - heading).wrapped()),
            (_, None, Some((_, orientation))) => Yaw::InVehicleFrame(orientation.yaw),
            (yaw, None, None) => yaw,
        };
        GimbalStatus { attitude: attitude_of(angles, yaw), heading: None, accepts_earth_yaw: false, ..status }
    }

    fn tell_attitude(&mut self, now: Timestamp, status: GimbalStatus) {
        self.heard.attitude = Some((now, status));
        self.outputs.push_back(DriverOutput::Report(Report::Attitude(status)));
        let pose = Pose { pitch: status.attitude.angles().pitch, yaw: status.attitude.yaw() };
        if let Some(stopping) = &mut self.stopping {
            let is_v1 = self.search.decided() == Some(Generation::V1);
            let own = self.heard.orientation.and_then(|(_, told)| Some(told.yaw_absolute? - told.yaw));
            let heading = if is_v1 { own.or(self.vehicle_heading) } else { self.vehicle_heading };
            let roll = status.attitude.angles().roll;
            let turns_on = stopping.handle_report(now, Look { roll, pitch: pose.pitch, yaw: pose.yaw, heading });
            if turns_on && is_v1 {
                self.mount.assume_turning();
            }
        }
        let limits = FailureFlags::AT_PITCH_LIMIT | FailureFlags::AT_YAW_LIMIT | FailureFlags::AT_ROLL_LIMIT;
        let motors_off = self.heard.status.is_some_and(|(_, status)| !status.motors_on());
        // What it does not acknowledge it need not do.
        let is_unheard = matches!(self.mount.wanted(), Some(Order::Point { .. })) && !self.mount.has_heard(now);
        if motors_off || is_unheard {
            return self.effect.pause();
        }
        match self.effect.handle_report(now, pose, status.failures.intersects(limits)) {
            Some(Finding::Works) => self.faults.clear(|fault| *fault == Fault::NoEffect),
            Some(Finding::NoEffect) => self.raise(Fault::NoEffect),
            Some(Finding::InvertedPitch)
                if self.settings.report_sign.is_none() && self.search.decided() == Some(Generation::V1) =>
            {
                self.negated = Negated { pitch: !self.negated.pitch, ..self.negated };
                if self.negated.pitch {
                    self.raise(Fault::InvertedPitch);
                } else {
                    self.faults.clear(|fault| *fault == Fault::InvertedPitch);
                }
            }
            Some(Finding::InvertedPitch) => self.raise(Fault::NoEffect),
            None => {}
        }
    }

    fn is_locked(&self) -> bool {
        match self.heard.status {
            Some((_, status)) => shown_mode(status) == YawMode::Lock,
            None => self.mount.mode() == Some(YawMode::Lock),
        }
    }

    /// Whether its yaw from North is one: "without autopilot attitude (286 or ATTITUDE) it drifts; north is not known", "combine
    /// attitude" in its parameters has it use that, and in some firmware it is wrong.
    fn knows_north(&self, now: Timestamp) -> bool {
        let is_wrong = self.version().is_some_and(|version| version.has_wrong_earth_yaw());
        let is_fed = self.is_fed_since.is_some_and(|since| now.since(since) >= NORTH_WITHIN);
        !is_wrong && is_fed && self.combines_attitude()
    }

    pub(super) fn combines_attitude(&self) -> bool {
        self.axis_flags().is_some_and(|flags| flags.contains(AxisFlags::COMBINE_ATTITUDE))
    }

    pub(super) fn axis_flags(&self) -> Option<AxisFlags> {
        self.number(Parameter::AxisFlags).map(AxisFlags::from_bits_retain)
    }

    /// A parameter by what it is for.
    pub(super) fn number(&self, parameter: Parameter) -> Option<i16> {
        let name = self.table()?.name(parameter)?;
        self.parameters.value(name).map(|value| value as i16)
    }

    fn failures(&self) -> FailureFlags {
        let Some((_, status)) = self.heard.status else { return FailureFlags::empty() };
        let (activity, alignment) = (status.activity, status.alignment);
        let is_starting = activity.contains(Activity::STARTING_UP);
        let encoders = Alignment::ENCODER_TILT | Alignment::ENCODER_ROLL | Alignment::ENCODER_PAN;
        let mut failures = FailureFlags::empty();
        failures.set(FailureFlags::ENCODER_ERROR, alignment.intersects(encoders) && !is_starting);
        let motors = Activity::MOTOR_PHASE_ERROR | Activity::MOTOR_ANGLE_ERROR;
        failures.set(FailureFlags::MOTOR_ERROR, activity.intersects(motors));
        let sensors = activity.contains(Activity::SENSOR_ERROR) || alignment.contains(Alignment::IMU);
        failures.set(FailureFlags::SOFTWARE_ERROR, sensors && !is_starting);
        failures.set(FailureFlags::POWER_ERROR, activity.contains(Activity::BATTERY_LOW));
        let calibrates = Activity::CALIBRATING | Activity::AUTO_TUNE;
        failures.set(FailureFlags::CALIBRATION_RUNNING, activity.intersects(calibrates));
        failures
    }

    /// Tells who it is and what it can do, where that has changed.
    pub(super) fn report_known(&mut self) {
        let known = (self.identity(), self.capabilities());
        if self.reported.as_ref() != Some(&known) {
            self.reported = Some(known.clone());
            self.outputs.push_back(DriverOutput::Report(Report::Known(known.0, known.1)));
        }
    }

    fn identity(&self) -> Identity {
        let told = self.information.as_ref().map(|information| information.identity.clone()).unwrap_or_default();
        let or = |text: String, otherwise: &str| if text.is_empty() { otherwise.to_owned() } else { text };
        Identity {
            vendor: or(told.vendor, "GREMSY"),
            model: or(told.model, "gimbal"),
            firmware: told.firmware.or_else(|| self.version().map(|version| version.to_information())),
            ..told
        }
    }

    fn capabilities(&self) -> Capabilities {
        let told = self.information.as_ref().map(|information| information.capabilities);
        let limits = self.limits(told.map(|told| told.limits));
        let (flags, limits) = match (self.search.decided(), told) {
            (Some(Generation::V2), Some(told)) => {
                let infinite = told.flags.contains(CapFlags::SUPPORTS_INFINITE_YAW);
                let yaw = limits.yaw.filter(|_| !infinite);
                // "Retract" does work, whatever it is turned into.
                (told.flags | CapFlags::HAS_RETRACT | CapFlags::HAS_NEUTRAL, Limits { yaw, ..limits })
            }
            (_, _) => (v1_flags(), limits),
        };
        Capabilities {
            flags,
            limits,
            turns: true,
            operates: true,
            retract_cuts_motors: self.settings.retract_allowed,
            radio_control_untold: false,
        }
    }

    /// Its software limits where it tells them, or else its end stops, or else what autopilots let pass.
    fn limits(&self, told: Option<Limits>) -> Limits {
        let degrees = Angle::from_degrees;
        let of = |axis: Axis, told: Option<AxisLimits>, widest: f64| {
            let value = |name: &str| self.parameters.value(name).map(|value| value as i16);
            let software = self.table().and_then(|table| AngleLimits::read(table, TiltSense::of(table), axis, value));
            let software = software.and_then(|limits| {
                AxisLimits::new(degrees(f64::from(limits.min_deg)), degrees(f64::from(limits.max_deg)))
            });
            // One that is 0 to 0 was never set.
            let software = software.filter(|limits| limits.min() < limits.max());
            software.or(told).or(AxisLimits::new(degrees(-widest), degrees(widest)))
        };
        let told = told.unwrap_or_default();
        Limits {
            roll: of(Axis::Roll, told.roll, 180.0),
            pitch: of(Axis::Tilt, told.pitch, 90.0),
            yaw: of(Axis::Pan, told.yaw, 180.0),
        }
    }

    /// What its settings and its version say of faults.
    pub(super) fn look_at_settings(&mut self) {
        if !self.is_present {
            return;
        }
        match self.number(Parameter::RcType).map(RcType::from_code) {
            Some(RcType::SYNC) => self.faults.clear(|fault| matches!(fault, Fault::RadioType(_))),
            Some(kind) => self.raise(Fault::RadioType(kind)),
            None => {}
        }
        match self.version() {
            Some(version) if version.has_wrong_earth_yaw() => self.raise(Fault::EarthYaw(version)),
            Some(_) => self.faults.clear(|fault| matches!(fault, Fault::EarthYaw(_))),
            None => {}
        }
        if self.parameters.is_settled() && self.parameters.values().next().is_none() {
            self.raise(Fault::NoParameters);
        } else {
            self.faults.clear(|fault| *fault == Fault::NoParameters);
        }
        self.report_known();
    }
}

/// Of one that speaks v1, whatever it says of a protocol that it does not use.
fn v1_flags() -> CapFlags {
    CapFlags::HAS_RETRACT
        | CapFlags::HAS_NEUTRAL
        | CapFlags::HAS_ROLL_AXIS
        | CapFlags::HAS_ROLL_LOCK
        | CapFlags::HAS_PITCH_AXIS
        | CapFlags::HAS_PITCH_LOCK
        | CapFlags::HAS_YAW_AXIS
        | CapFlags::HAS_YAW_FOLLOW
        | CapFlags::HAS_YAW_LOCK
        | CapFlags::HAS_RC_INPUTS
}
