//! `gimbald sim`: one simulated peer on an endpoint.

use std::io::Write;
use std::time::Duration;

use crate::cli::{
    GremsyArgs, SimCommand, SimGimbalArgs, SimVehicleArgs, SimulatedAutopilot, SimulatedFamily, SimulatedFrames,
    SimulatedGeneration, SimulatedGimbalOutput, SimulatedReports, SimulatedStatusFrame,
};
use crate::daemon::clock::unix_time_us;
use crate::endpoint::Endpoint;
use crate::exit_code::ExitCode;
use crate::geometry::{Angle, AngularRate, AxisLimits, Limits};
use crate::gimbals::gremsy::sim::Generation;
use crate::gimbals::gremsy::version::FirmwareVersion;
use crate::gimbals::mavlink_v2::sim::{Device, DeviceSettings, StatusFrame, Strictness, SystemId};
use crate::gimbals::signs::Signs;
use crate::gimbals::{gremsy, mavlink_v1};
use crate::links;
use crate::sim::faults::{Faults, FaultyPeer};
use crate::sim::host;
use crate::sim::peer::Peer;
use crate::sim::plant::PlantSettings;
use crate::sim::vehicle::{Autopilot, ClientVersion, GimbalOutput, StateForGimbals, Vehicle, VehicleSettings};
use crate::timestamp::Timestamp;
use crate::wire::ids::CapFlags;

const DEFAULT_SLEW_DPS: f64 = 100.0;

/// Runs the simulated peer until SIGTERM, SIGINT or SIGHUP.
pub fn sim(command: &SimCommand, errors: &mut impl Write) -> ExitCode {
    match command {
        SimCommand::Gimbal(arguments) => run_sim_gimbal(arguments, errors),
        SimCommand::Vehicle(arguments) => run_sim_vehicle(arguments, errors),
    }
}

pub fn run_sim_gimbal(arguments: &SimGimbalArgs, errors: &mut impl Write) -> ExitCode {
    let faults = match arguments.faults.join(",").parse::<Faults>() {
        Ok(faults) => Faults { seed: arguments.seed, ..faults },
        Err(error) => {
            // The exit code says it too; nobody is left to tell when the reader is gone.
            let _ = writeln!(errors, "gimbald sim gimbal: --fault: {error}");
            return ExitCode::Usage;
        }
    };
    match arguments.family {
        SimulatedFamily::MavlinkV2 => {
            let device = Device::new(Timestamp::ZERO, device_settings(arguments));
            run(FaultyPeer::new(device, faults), &arguments.endpoint, errors)
        }
        SimulatedFamily::MavlinkV1 => {
            let device = mavlink_v1::sim::Device::new(Timestamp::ZERO, v1_settings(arguments));
            run(FaultyPeer::new(device, faults), &arguments.endpoint, errors)
        }
        SimulatedFamily::Gremsy => match gremsy_settings_on_link(arguments) {
            Ok(settings) => {
                let device = gremsy::sim::Device::new(Timestamp::ZERO, settings);
                run(FaultyPeer::new(device, faults), &arguments.endpoint, errors)
            }
            Err(error) => {
                // As above.
                let _ = writeln!(errors, "gimbald sim gimbal: {error}");
                ExitCode::Usage
            }
        },
    }
}

/// Why there is no such Gremsy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("--gremsy-firmware {0}: before 7.7.3 there is no v2; add --gremsy-generation v1")]
pub struct NoSuchGremsy(FirmwareVersion);

/// The gimbal that the arguments describe, under the system id of the first vehicle it hears.
pub fn gremsy_settings(arguments: &GremsyArgs) -> Result<gremsy::sim::DeviceSettings, NoSuchGremsy> {
    let generation = match arguments.gremsy_generation {
        SimulatedGeneration::V1 => Generation::V1,
        SimulatedGeneration::V2 => Generation::V2,
    };
    let defaults = gremsy::sim::DeviceSettings::of(generation);
    let firmware = arguments.gremsy_firmware.unwrap_or(defaults.firmware);
    if generation == Generation::V2 && !firmware.may_speak_v2() {
        return Err(NoSuchGremsy(firmware));
    }
    Ok(gremsy::sim::DeviceSettings {
        firmware,
        rc_type: arguments.gremsy_rc_type,
        has_usual_streams: !arguments.gremsy_quiet,
        has_inverted_pitch: arguments.gremsy_inverted_pitch,
        is_latched_by_retract: arguments.gremsy_latched,
        ..defaults
    })
}

fn gremsy_settings_on_link(arguments: &SimGimbalArgs) -> Result<gremsy::sim::DeviceSettings, NoSuchGremsy> {
    let settings = gremsy_settings(&arguments.gremsy)?;
    let yaw = arguments.yaw_range.map(Angle::from_degrees).and_then(|range| AxisLimits::new(-range, range));
    let limits = Limits { yaw: yaw.or(settings.plant.limits.yaw), ..settings.plant.limits };
    Ok(gremsy::sim::DeviceSettings {
        component_id: arguments.component_id,
        system_id: SystemId::Fixed(arguments.system_id),
        // The gimbal takes whole degrees per second, up to 255; a float cast saturates.
        control_speed_dps: arguments.slew.map_or(settings.control_speed_dps, |slew| i16::from(slew.round() as u8)),
        plant: PlantSettings { limits, ..settings.plant },
        ..settings
    })
}

fn v1_settings(arguments: &SimGimbalArgs) -> mavlink_v1::sim::DeviceSettings {
    use mavlink_v1::sim::{Feedback, SystemId};

    let defaults = mavlink_v1::sim::DeviceSettings::default();
    let yaw = arguments.yaw_range.map(Angle::from_degrees).and_then(|range| AxisLimits::new(-range, range));
    mavlink_v1::sim::DeviceSettings {
        component_id: arguments.component_id,
        system_id: SystemId::Fixed(arguments.system_id),
        signs: if arguments.v1_reversed { Signs::REVERSED } else { Signs::NORMAL },
        feedback: match arguments.v1_reports {
            SimulatedReports::Orientation => Feedback::Orientation,
            SimulatedReports::Status => Feedback::Status,
            SimulatedReports::Nothing => Feedback::Nothing,
        },
        plant: PlantSettings {
            limits: Limits { yaw: yaw.or(defaults.plant.limits.yaw), ..defaults.plant.limits },
            ..defaults.plant.clone().with_max_rate(slew(arguments))
        },
        ..defaults
    }
}

fn device_settings(arguments: &SimGimbalArgs) -> DeviceSettings {
    let defaults = DeviceSettings::default();
    let yaw = arguments.yaw_range.map(Angle::from_degrees).and_then(|range| AxisLimits::new(-range, range));
    DeviceSettings {
        component_id: arguments.component_id,
        system_id: SystemId::Fixed(arguments.system_id),
        // Its id is settled, and on some endpoints nobody can speak before it does.
        listens_first: Some(Duration::ZERO),
        capabilities: if yaw.is_some() {
            defaults.capabilities.difference(CapFlags::SUPPORTS_INFINITE_YAW)
        } else {
            defaults.capabilities
        },
        strictness: match arguments.frames {
            SimulatedFrames::Legacy => Strictness::Legacy,
            SimulatedFrames::Strict => Strictness::Strict,
            SimulatedFrames::VehicleOnly => Strictness::VehicleOnly,
        },
        status_frame: match arguments.status_frame {
            SimulatedStatusFrame::Earth => StatusFrame::EarthWhenKnown,
            SimulatedStatusFrame::Lock => StatusFrame::FollowsLock,
            SimulatedStatusFrame::Legacy => StatusFrame::Legacy,
        },
        plant: PlantSettings {
            limits: Limits { yaw, ..defaults.plant.limits },
            ..defaults.plant.clone().with_max_rate(slew(arguments))
        },
        ..defaults
    }
}

/// How fast a gimbal that is no Gremsy turns.
fn slew(arguments: &SimGimbalArgs) -> AngularRate {
    AngularRate::from_degrees_per_second(arguments.slew.unwrap_or(DEFAULT_SLEW_DPS))
}

pub fn run_sim_vehicle(arguments: &SimVehicleArgs, errors: &mut impl Write) -> ExitCode {
    let gimbal_output = match (arguments.gimbal_output, arguments.autopilot) {
        (SimulatedGimbalOutput::None, _) => GimbalOutput::None,
        (SimulatedGimbalOutput::Device, SimulatedAutopilot::ArduPilot) => GimbalOutput::Device,
        (SimulatedGimbalOutput::Manager, SimulatedAutopilot::Px4) => GimbalOutput::Manager(ClientVersion::Merged),
        (SimulatedGimbalOutput::Device | SimulatedGimbalOutput::Manager, _) => {
            // The exit code says it too; nobody is left to tell when the reader is gone.
            let _ = writeln!(
                errors,
                "gimbald sim vehicle: --gimbal-output: ardupilot drives a device, and px4 asks a manager"
            );
            return ExitCode::Usage;
        }
    };
    let settings = VehicleSettings {
        autopilot: match arguments.autopilot {
            SimulatedAutopilot::Px4 => Autopilot::Px4,
            SimulatedAutopilot::ArduPilot => Autopilot::ArduPilot,
        },
        system_id: arguments.system_id,
        state_for_gimbals: match arguments.no_autopilot_state {
            true => StateForGimbals::Denied,
            false => StateForGimbals::Told,
        },
        gimbal_output,
        uptime: Duration::ZERO,
        unix_time_us: unix_time_us(),
    };
    run(Vehicle::new(Timestamp::ZERO, settings), &arguments.endpoint, errors)
}

fn run<P: Peer>(peer: P, endpoint: &Endpoint, errors: &mut impl Write) -> ExitCode {
    match host::run(peer, || Ok(links::link(endpoint)), host::interrupted()) {
        Ok(()) => ExitCode::Ok,
        Err(error) => {
            // As above.
            let _ = writeln!(errors, "gimbald sim: {error}");
            ExitCode::Unavailable
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::{Cli, Command};

    fn settings(options: &[&str]) -> DeviceSettings {
        let line = ["gimbald", "sim", "gimbal", "--endpoint", "udpin:127.0.0.1:0"].iter().chain(options);
        let Ok(Cli { command: Command::Sim(SimCommand::Gimbal(arguments)), .. }) = Cli::try_parse_from(line) else {
            panic!("it parses")
        };
        device_settings(&arguments)
    }

    /// Without options it is the device that the tests of the simulation know, and passes MAVSDK's tester; each option
    /// changes one thing.
    #[test]
    fn options_make_the_device() {
        let usual = DeviceSettings {
            system_id: SystemId::Fixed(1),
            listens_first: Some(Duration::ZERO),
            ..DeviceSettings::default()
        };
        assert_eq!(settings(&[]), usual);

        let system_id = SystemId::Fixed(33);
        assert_eq!(settings(&["--system-id", "33"]), DeviceSettings { system_id, ..usual.clone() });
        assert_eq!(settings(&["--component-id", "171"]), DeviceSettings { component_id: 171, ..usual.clone() });
        for (word, strictness) in [("strict", Strictness::Strict), ("vehicle-only", Strictness::VehicleOnly)] {
            assert_eq!(settings(&["--frames", word]), DeviceSettings { strictness, ..usual.clone() });
        }
        for (word, status_frame) in [("lock", StatusFrame::FollowsLock), ("legacy", StatusFrame::Legacy)] {
            assert_eq!(settings(&["--status-frame", word]), DeviceSettings { status_frame, ..usual.clone() });
        }

        let slow = settings(&["--slew", "20"]);
        assert_eq!(slow.plant.max_rate, AngularRate::from_degrees_per_second(20.0));
        assert_eq!(slow.plant.max_acceleration, usual.plant.max_acceleration / 5.0);
        assert_eq!(DeviceSettings { plant: usual.plant.clone(), ..slow }, usual);

        let limited = settings(&["--yaw-range", "160"]);
        assert_eq!(limited.plant.limits.yaw, AxisLimits::new(Angle::from_degrees(-160.0), Angle::from_degrees(160.0)));
        assert_eq!(limited.capabilities, usual.capabilities.difference(CapFlags::SUPPORTS_INFINITE_YAW));
    }

    /// ArduPilot asks no manager, and PX4 in that mode drives no device.
    #[test]
    fn an_autopilot_that_cannot_drive_a_gimbal_so_is_a_usage_error() {
        for (autopilot, output) in [("ardupilot", "manager"), ("px4", "device")] {
            let line = ["gimbald", "sim", "vehicle", "--endpoint", "udpin:127.0.0.1:0", "--autopilot", autopilot];
            let line = line.into_iter().chain(["--gimbal-output", output]);
            let Ok(Cli { command: Command::Sim(command), .. }) = Cli::try_parse_from(line) else { panic!("it parses") };
            let mut errors = Vec::new();

            assert_eq!(sim(&command, &mut errors), ExitCode::Usage);
            let said = String::from_utf8(errors).expect("text");
            assert!(said.starts_with("gimbald sim vehicle: --gimbal-output: ardupilot drives a device"), "{said}");
        }
    }

    fn gremsy(options: &[&str]) -> Result<gremsy::sim::DeviceSettings, String> {
        let line = ["gimbald", "sim", "gimbal", "--endpoint", "udpin:127.0.0.1:0", "--family", "gremsy"];
        let Ok(Cli { command: Command::Sim(SimCommand::Gimbal(arguments)), .. }) =
            Cli::try_parse_from(line.iter().chain(options))
        else {
            panic!("it parses")
        };
        gremsy_settings_on_link(&arguments).map_err(|error| error.to_string())
    }

    /// The same for a Gremsy: v2 unless told otherwise.
    #[test]
    fn options_make_the_gremsy() {
        use gremsy::parameters::RcType;
        use gremsy::sim::DeviceSettings;

        let of = |generation| DeviceSettings { system_id: SystemId::Fixed(1), ..DeviceSettings::of(generation) };
        let usual = of(Generation::V2);
        let v1 = ["--gremsy-generation", "v1"];
        for (options, expected) in [
            (&[][..], usual.clone()),
            (&v1, of(Generation::V1)),
            (
                &["--gremsy-firmware", "7.8.6"],
                DeviceSettings { firmware: FirmwareVersion::official(7, 8, 6), ..usual.clone() },
            ),
            (&["--gremsy-rc-type", "joystick"], DeviceSettings { rc_type: RcType::from_code(2), ..usual.clone() }),
            (&["--gremsy-rc-type", "15"], DeviceSettings { rc_type: RcType::Other(15), ..usual.clone() }),
            (&["--gremsy-quiet"], DeviceSettings { has_usual_streams: false, ..usual.clone() }),
            (&["--gremsy-inverted-pitch"], DeviceSettings { has_inverted_pitch: true, ..usual.clone() }),
            (&["--gremsy-latched"], DeviceSettings { is_latched_by_retract: true, ..usual.clone() }),
            (&["--slew", "300"], DeviceSettings { control_speed_dps: 255, ..usual.clone() }),
        ] {
            assert_eq!(gremsy(options), Ok(expected), "{options:?}");
        }
        let limited = gremsy(&["--yaw-range", "160"]).expect("a gimbal").plant.limits.yaw;
        assert_eq!(limited, AxisLimits::new(Angle::from_degrees(-160.0), Angle::from_degrees(160.0)));

        let old = ["--gremsy-firmware", "7.5.6"];
        assert!(gremsy(&[&v1[..], &old].concat()).expect("a gimbal").is_old());
        assert_eq!(
            gremsy(&old),
            Err("--gremsy-firmware 7.5.6: before 7.7.3 there is no v2; add --gremsy-generation v1".to_owned())
        );
    }

    /// "78 configuration, 64 usage": a fault that does not exist is a wrong argument.
    #[test]
    fn a_fault_that_does_not_exist_is_a_usage_error() {
        let line = ["gimbald", "sim", "gimbal", "--endpoint", "udpin:127.0.0.1:0", "--fault", "drop=1", "--fault", "x"];
        let Ok(Cli { command: Command::Sim(command), .. }) = Cli::try_parse_from(line) else { panic!("it parses") };
        let mut errors = Vec::new();

        assert_eq!(sim(&command, &mut errors), ExitCode::Usage);
        let said = String::from_utf8(errors).expect("text");
        assert!(said.starts_with("gimbald sim gimbal: --fault: \"x\" is not a fault; expected one of drop,"), "{said}");
    }
}
