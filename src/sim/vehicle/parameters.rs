//! The few parameters of a simulated autopilot: those by which ground stations know it and find it set up.

use super::{Autopilot, GimbalOutput};
use crate::sim::parameters::ParameterValue::{Float, Integer};
use crate::sim::parameters::{IntegerEncoding, ParameterServer};

pub(super) fn parameters(autopilot: Autopilot, system: u8, output: GimbalOutput) -> ParameterServer {
    // Where it drives none, the gimbal is left to its manager on the companion.
    let (mount_type, mode_in, mode_out) = match output {
        GimbalOutput::None => (0, -1, 0),
        GimbalOutput::Device => (6, -1, 0),
        GimbalOutput::Manager(_) => (0, 0, 3),
    };
    let system = Integer(i32::from(system));
    match autopilot {
        Autopilot::Px4 => ParameterServer::new(
            vec![
                ("BAT1_N_CELLS", Integer(4)),
                ("BAT1_V_CHARGED", Float(4.05)),
                ("BAT1_V_EMPTY", Float(3.6)),
                ("CAL_ACC0_ID", Integer(1_310_988)),
                ("CAL_GYRO0_ID", Integer(1_310_988)),
                ("CAL_MAG0_ID", Integer(197_388)),
                ("COM_RC_IN_MODE", Integer(1)),
                ("MAV_COMP_ID", Integer(1)),
                ("MAV_SYS_ID", system),
                ("MAV_TYPE", Integer(2)),
                ("MIS_TAKEOFF_ALT", Float(10.0)),
                ("MNT_MODE_IN", Integer(mode_in)),
                ("MNT_MODE_OUT", Integer(mode_out)),
                ("NAV_DLL_ACT", Integer(0)),
                ("NAV_RCL_ACT", Integer(2)),
                ("RTL_RETURN_ALT", Float(30.0)),
                ("SYS_AUTOCONFIG", Integer(0)),
                ("SYS_AUTOSTART", Integer(4001)),
            ],
            IntegerEncoding::Bytewise,
        )
        .with_hash(),
        Autopilot::ArduPilot => ParameterServer::new(
            vec![
                ("ARMING_CHECK", Integer(1)),
                ("BATT_MONITOR", Integer(4)),
                ("COMPASS_DEV_ID", Integer(97_539)),
                ("FLTMODE1", Integer(7)),
                ("FLTMODE2", Integer(9)),
                ("FLTMODE3", Integer(6)),
                ("FLTMODE4", Integer(3)),
                ("FLTMODE5", Integer(5)),
                ("FLTMODE6", Integer(0)),
                ("FORMAT_VERSION", Integer(120)),
                ("FRAME_CLASS", Integer(1)),
                ("FRAME_TYPE", Integer(1)),
                ("INS_ACCOFFS_X", Float(0.001)),
                ("INS_ACCOFFS_Y", Float(0.001)),
                ("INS_ACCOFFS_Z", Float(0.001)),
                ("MNT1_TYPE", Integer(mount_type)),
                ("RTL_ALT", Integer(1500)),
                ("SYSID_MYGCS", Integer(255)),
                ("SYSID_THISMAV", system),
            ],
            IntegerEncoding::CCast,
        ),
    }
}
