//! The arguments of `gimbald sim`, and what of it `gimbald demo` takes as well.

use clap::{Args, Subcommand, ValueEnum};

use super::ENDPOINTS;
use crate::endpoint::Endpoint;
use crate::gimbals::gremsy::parameters::RcType;
use crate::gimbals::gremsy::version::FirmwareVersion;
use crate::sim::faults::WORDS;

const OF_V2: &str = "Options of family mavlink_v2";
const OF_V1: &str = "Options of family mavlink_v1";

#[derive(Debug, Subcommand)]
pub enum SimCommand {
    /// A simulated gimbal on an endpoint
    #[command(after_help = format!("\
Examples:
  gimbald sim gimbal --endpoint udpout:127.0.0.1:14541
  gimbald sim gimbal --endpoint serial:/dev/ttyUSB1:115200 --component-id 171
  gimbald sim gimbal --endpoint udpout:127.0.0.1:14540 --system-id 33 --slew 80 --yaw-range 160
  gimbald sim gimbal --endpoint udpin:127.0.0.1:14541 --family gremsy --gremsy-firmware 7.8.7
  gimbald sim gimbal --endpoint tcpin:0.0.0.0:5790 --fault drop=0.1 --fault reboot@20s --seed 7

A Gremsy says nothing until it hears a heartbeat: let gimbald speak first, with udpout: in its link.

Faults: {WORDS}.
Each with a probability (drop=0.1), a duration (delay=250ms), or a time since the start (silence=5s@20s, reboot@20s).

{ENDPOINTS}"))]
    Gimbal(SimGimbalArgs),

    /// A simulated autopilot on an endpoint
    #[command(after_help = format!("\
Examples:
  gimbald sim vehicle --endpoint udpout:127.0.0.1:14540
  gimbald sim vehicle --endpoint udpout:127.0.0.1:14540 --autopilot ardupilot --system-id 3
  gimbald sim vehicle --endpoint udpout:127.0.0.1:14540 --autopilot ardupilot --gimbal-output device

{ENDPOINTS}"))]
    Vehicle(SimVehicleArgs),
}

#[derive(Debug, Args)]
pub struct SimGimbalArgs {
    /// The other end of the gimbal's cable
    #[arg(long, value_name = "ENDPOINT")]
    pub endpoint: Endpoint,

    /// What kind of gimbal to simulate
    #[arg(long, value_name = "FAMILY", value_enum, default_value_t = SimulatedFamily::MavlinkV2)]
    pub family: SimulatedFamily,

    /// The gimbal's MAVLink component id
    #[arg(long, value_name = "N", default_value_t = 154, value_parser = clap::value_parser!(u8).range(1..))]
    pub component_id: u8,

    /// The gimbal's MAVLink system id
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    pub system_id: u8,

    /// Something that goes wrong, such as drop=0.1 or reboot@20s; may be given several times
    #[arg(long = "fault", value_name = "FAULT")]
    pub faults: Vec<String>,

    /// Start of the random numbers behind faults; the same seed gives the same run
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,

    /// How the gimbal reads the yaw of a setpoint
    #[arg(long, value_name = "FRAMES", value_enum, default_value_t = SimulatedFrames::Legacy, help_heading = OF_V2)]
    pub frames: SimulatedFrames,

    /// From where the gimbal counts the yaw that it reports
    #[arg(long, value_name = "FRAME", value_enum, default_value_t = SimulatedStatusFrame::Earth, help_heading = OF_V2)]
    pub status_frame: SimulatedStatusFrame,

    /// How fast the gimbal turns at most, degrees per second; without it 100, and 30 with family gremsy
    #[arg(long, value_name = "DPS", value_parser = slew)]
    pub slew: Option<f64>,

    /// How far the gimbal yaws to either side, degrees; without it, without end, or as far as its family does
    #[arg(long, value_name = "DEG", value_parser = yaw_range)]
    pub yaw_range: Option<f64>,

    /// How it says where it looks
    #[arg(long, value_name = "MESSAGE", value_enum, default_value_t = SimulatedReports::Orientation, help_heading = OF_V1)]
    pub v1_reports: SimulatedReports,

    /// It counts pitch and yaw the other way round, as ArduPilot does towards a STorM32
    #[arg(long, help_heading = OF_V1)]
    pub v1_reversed: bool,

    #[command(flatten)]
    pub gremsy: GremsyArgs,
}

/// Which gimbal of family gremsy.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Options of family gremsy")]
pub struct GremsyArgs {
    /// Which protocol it is steered by
    #[arg(long, value_name = "GENERATION", value_enum, default_value_t = SimulatedGeneration::V2)]
    pub gremsy_generation: SimulatedGeneration,

    /// Its firmware, 7.7.3 or later for v2; before that a gimbal has the parameters of 2021. Without it 7.7.3 (v1) or
    /// 7.8.9 (v2)
    #[arg(long, value_name = "X.Y.Z")]
    pub gremsy_firmware: Option<FirmwareVersion>,

    /// Where control comes from, by name (sbus_fasst, joystick …) or number; with any but sync it acknowledges and does
    /// not move
    #[arg(long, value_name = "TYPE", default_value = "sync", value_parser = rc_type)]
    pub gremsy_rc_type: RcType,

    /// Send orientation, encoders, IMU and attitude only when asked for, as the AEVO series does
    #[arg(long)]
    pub gremsy_quiet: bool,

    /// Tell pitch in MOUNT_ORIENTATION the wrong way round
    #[arg(long)]
    pub gremsy_inverted_pitch: bool,

    /// Take motors that RETRACT switched off back only after a restart
    #[arg(long)]
    pub gremsy_latched: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SimulatedGeneration {
    /// DO_MOUNT_CONTROL and the vendor's own commands
    V1,
    /// The MAVLink Gimbal Protocol v2
    V2,
}

#[derive(Debug, Args)]
pub struct SimVehicleArgs {
    /// The other end of the autopilot's telemetry port
    #[arg(long, value_name = "ENDPOINT")]
    pub endpoint: Endpoint,

    /// Whose habits to imitate
    #[arg(long, value_name = "AUTOPILOT", value_enum, default_value_t = SimulatedAutopilot::Px4)]
    pub autopilot: SimulatedAutopilot,

    /// The vehicle's MAVLink system id
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..))]
    pub system_id: u8,

    /// How it drives a gimbal by itself
    #[arg(long, value_name = "WAY", value_enum, default_value_t = SimulatedGimbalOutput::None)]
    pub gimbal_output: SimulatedGimbalOutput,

    /// Do not send AUTOPILOT_STATE_FOR_GIMBAL_DEVICE, and refuse requests for it
    #[arg(long)]
    pub no_autopilot_state: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SimulatedFamily {
    /// A gimbal device of the MAVLink Gimbal Protocol v2
    #[value(name = "mavlink_v2")]
    MavlinkV2,
    /// A gimbal that is told where to look by DO_MOUNT_CONTROL
    #[value(name = "mavlink_v1")]
    MavlinkV1,
    /// A gimbal by Gremsy
    #[value(name = "gremsy")]
    Gremsy,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SimulatedReports {
    /// MOUNT_ORIENTATION, ten times a second
    Orientation,
    /// MOUNT_STATUS, four times a second
    Status,
    Nothing,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SimulatedFrames {
    /// By its frame flag; without one, from North with YAW_LOCK, else from the vehicle's nose
    Legacy,
    /// By its frame flag; a setpoint without one has no effect
    Strict,
    /// From the vehicle's nose; a setpoint from North has no effect
    VehicleOnly,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SimulatedStatusFrame {
    /// From North as soon as the autopilot tells the heading, until then from the vehicle's nose
    Earth,
    /// From North while a setpoint locks yaw and the heading is known, else from the vehicle's nose
    Lock,
    /// As devices without frame flags: from North while yaw is locked, else from the vehicle's nose, and no delta_yaw
    Legacy,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SimulatedGimbalOutput {
    /// Not at all; it is left to its manager on the companion
    None,
    /// A gimbal device of its own, as ArduPilot with MNT1_TYPE 6
    Device,
    /// Through a gimbal manager, as PX4 with MNT_MODE_OUT 3
    Manager,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum SimulatedAutopilot {
    Px4,
    #[value(name = "ardupilot")]
    ArduPilot,
}

/// Why a number of degrees is none that the simulation can work with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a number from {least} to {most}")]
pub struct DegreesError {
    least: u16,
    most: u16,
}

fn slew(text: &str) -> Result<f64, DegreesError> {
    degrees(text, 1, 1000)
}

/// Why a text is no RC type.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a number from 0 to 31, or one of {}", RcType::names().collect::<Vec<_>>().join(", "))]
pub struct RcTypeError;

fn rc_type(text: &str) -> Result<RcType, RcTypeError> {
    let number = text.parse().ok().filter(|code| (0..=31).contains(code)).map(RcType::from_code);
    RcType::from_name(text).or(number).ok_or(RcTypeError)
}

fn yaw_range(text: &str) -> Result<f64, DegreesError> {
    degrees(text, 1, 360)
}

fn degrees(text: &str, least: u16, most: u16) -> Result<f64, DegreesError> {
    let within = |degrees: &f64| (f64::from(least)..=f64::from(most)).contains(degrees);
    text.parse().ok().filter(within).ok_or(DegreesError { least, most })
}
