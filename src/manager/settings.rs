//! The `[control]` and `[roi]` parts of the configuration.

use std::time::Duration;

#[derive(Clone, Debug, PartialEq)]
pub struct ControlSettings {
    /// Anyone may steer a gimbal that nobody holds.
    pub open_when_unclaimed: bool,
    /// A holder not heard for so long loses control.
    pub lease_timeout: Duration,
    /// A rate streamed by message stops when it is not refreshed.
    pub rate_timeout: Duration,
    /// A rate set once by command stops; zero means never.
    pub command_rate_timeout: Duration,
    pub firewall: Firewall,
    /// Honour gimbal and ROI commands addressed to the autopilot that pass through us, without acknowledging them.
    pub snoop_autopilot: bool,
    /// Take angles of `DO_MOUNT_CONTROL` that no gimbal has for hundredths of a degree.
    pub accept_centidegrees: bool,
    /// A (-2, -2) pair from the autopilot that holds control is a release.
    pub px4_release_quirk: bool,
    /// Tell gimbals the state of the vehicle (286) when its autopilot refuses to, or ignores the request.
    pub synthesize_286: bool,
    pub roi_altitude: AltitudeReference,
}

impl Default for ControlSettings {
    fn default() -> Self {
        Self {
            open_when_unclaimed: true,
            lease_timeout: Duration::from_secs(10),
            rate_timeout: Duration::from_secs(2),
            command_rate_timeout: Duration::from_secs(10),
            firewall: Firewall::On,
            snoop_autopilot: false,
            accept_centidegrees: false,
            px4_release_quirk: false,
            synthesize_286: true,
            roi_altitude: AltitudeReference::Auto,
        }
    }
}

/// What happens to setpoints that others send straight to a managed device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Firewall {
    On,
    Warn,
}

/// What the altitude of a ROI in a `COMMAND_LONG`, which names no frame, is measured from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AltitudeReference {
    /// Home for ArduPilot, mean sea level otherwise.
    Auto,
    Amsl,
    Relative,
}
