//! Which of its estimates the autopilot trusts, in the words of `ESTIMATOR_STATUS_FLAGS`.

use crate::wire::dialect::{EKF_STATUS_REPORT_DATA, ESTIMATOR_STATUS_DATA};
use crate::wire::ids::{ekf_status, estimator_status};

/// `ESTIMATOR_STATUS`, which PX4 sends.
pub(super) fn from_estimator_status(message: &ESTIMATOR_STATUS_DATA) -> u16 {
    message.flags
}

/// `EKF_STATUS_REPORT`, which ArduPilot sends: the same bits up to 512, but 1024 is a filter that never started, which
/// has no estimates, and what others call a GPS glitch (1024) is 32768.
pub(super) fn from_ekf_status_report(message: &EKF_STATUS_REPORT_DATA) -> u16 {
    if message.flags & ekf_status::UNINITIALIZED != 0 {
        return 0;
    }
    let glitch = if message.flags & ekf_status::GPS_GLITCHING != 0 { estimator_status::GPS_GLITCH } else { 0 };
    message.flags & estimator_status::IN_COMMON | glitch
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ekf_flags_become_estimator_flags() {
        for (flags, expected) in
            [(0, 0), (831, 831), (1023, 1023), (1024, 0), (1024 | 831, 0), (32_768 | 831, 1024 | 831), (0x7800 | 1, 1)]
        {
            let report = EKF_STATUS_REPORT_DATA { flags, ..EKF_STATUS_REPORT_DATA::DEFAULT };
            assert_eq!(from_ekf_status_report(&report), expected, "{flags}");
        }
        let status = ESTIMATOR_STATUS_DATA { flags: 3_905, ..ESTIMATOR_STATUS_DATA::DEFAULT };
        assert_eq!(from_estimator_status(&status), 3_905);
    }
}
