//! `gimbald sim`: one simulated peer on an endpoint.

use std::io::Write;
use std::time::Duration;

use crate::cli::{SimCommand, SimGimbalArgs, SimVehicleArgs, SimulatedAutopilot, SimulatedFamily, SimulatedFrames};
use crate::daemon::clock::unix_time_us;
use crate::endpoint::Endpoint;
use crate::exit_code::ExitCode;
use crate::gimbals::mavlink_v2::sim::{Device, DeviceSettings, Strictness, SystemId};
use crate::links;
use crate::sim::faults::{Faults, FaultyPeer};
use crate::sim::host;
use crate::sim::peer::Peer;
use crate::sim::vehicle::{Autopilot, Vehicle, VehicleSettings};
use crate::timestamp::Timestamp;

/// Runs the simulated peer until SIGTERM or SIGINT.
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
    }
}

fn device_settings(arguments: &SimGimbalArgs) -> DeviceSettings {
    DeviceSettings {
        component_id: arguments.component_id,
        system_id: SystemId::Fixed(arguments.system_id),
        // Its id is settled, and on some endpoints nobody can speak before it does.
        listens_first: Some(Duration::ZERO),
        strictness: match arguments.frames {
            SimulatedFrames::Legacy => Strictness::Legacy,
            SimulatedFrames::Strict => Strictness::Strict,
            SimulatedFrames::VehicleOnly => Strictness::VehicleOnly,
        },
        ..DeviceSettings::default()
    }
}

pub fn run_sim_vehicle(arguments: &SimVehicleArgs, errors: &mut impl Write) -> ExitCode {
    let settings = VehicleSettings {
        autopilot: match arguments.autopilot {
            SimulatedAutopilot::Px4 => Autopilot::Px4,
            SimulatedAutopilot::ArduPilot => Autopilot::ArduPilot,
        },
        system_id: arguments.system_id,
        tells_gimbals: !arguments.no_autopilot_state,
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
