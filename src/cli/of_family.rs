//! Options of a simulated gimbal that only one family has.
//!
//! Each is refused with another family: without effect it would let its user believe in a gimbal that is not there.

use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{ArgMatches, Command, ValueEnum};

use super::SimulatedFamily;

/// The options, by clap's name for them.
const OPTIONS: [(&str, SimulatedFamily); 10] = [
    ("frames", SimulatedFamily::MavlinkV2),
    ("status_frame", SimulatedFamily::MavlinkV2),
    ("v1_reports", SimulatedFamily::MavlinkV1),
    ("v1_reversed", SimulatedFamily::MavlinkV1),
    ("gremsy_generation", SimulatedFamily::Gremsy),
    ("gremsy_firmware", SimulatedFamily::Gremsy),
    ("gremsy_rc_type", SimulatedFamily::Gremsy),
    ("gremsy_quiet", SimulatedFamily::Gremsy),
    ("gremsy_inverted_pitch", SimulatedFamily::Gremsy),
    ("gremsy_latched", SimulatedFamily::Gremsy),
];

/// Whether every option that was given is one of the family that was given, or is usual.
pub(super) fn check(command: &mut Command, matches: &ArgMatches) -> Result<(), clap::Error> {
    let (command, matches) = innermost(command, matches);
    let Ok(Some(&family)) = matches.try_get_one::<SimulatedFamily>("family") else { return Ok(()) };
    let given = |option| {
        matches!(matches.try_contains_id(option), Ok(true))
            && matches.value_source(option) == Some(ValueSource::CommandLine)
    };
    let foreign: Vec<String> = OPTIONS
        .iter()
        .filter(|(option, owner)| *owner != family && given(option))
        .map(|(option, owner)| described(option, *owner, family))
        .collect();
    if foreign.is_empty() { Ok(()) } else { Err(command.error(ErrorKind::ArgumentConflict, foreign.join("\n"))) }
}

/// The command that was given, of those below `command`.
fn innermost<'a>(command: &'a mut Command, matches: &'a ArgMatches) -> (&'a mut Command, &'a ArgMatches) {
    match matches.subcommand() {
        Some((name, matches)) => {
            let command = command.find_subcommand_mut(name).expect("clap has read its arguments");
            innermost(command, matches)
        }
        None => (command, matches),
    }
}

fn described(option: &str, owner: SimulatedFamily, family: SimulatedFamily) -> String {
    let name = |family: SimulatedFamily| {
        family.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    };
    let (option, owner, family) = (option.replace('_', "-"), name(owner), name(family));
    format!("--{option} is for family {owner}, and this gimbal is a {family}: use --family {owner}, or leave it out")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    fn refusal(line: &str) -> Option<String> {
        let mut command = Cli::command();
        let matches = command.try_get_matches_from_mut(line.split(' ')).expect("clap takes it");
        let error = check(&mut command, &matches).err()?;
        assert!(error.use_stderr(), "a usage error");
        Some(error.to_string())
    }

    /// "Bad input gets a clear error that names the place and the remedy": all at once, with the usage of the command.
    #[test]
    fn an_option_of_another_family_is_named_with_what_to_do() {
        let said = refusal("gimbald sim gimbal --endpoint udpin:127.0.0.1:1 --gremsy-quiet --v1-reports nothing");
        assert_eq!(
            said.as_deref(),
            Some(
                "\
error: --v1-reports is for family mavlink_v1, and this gimbal is a mavlink_v2: use --family mavlink_v1, or leave it out
--gremsy-quiet is for family gremsy, and this gimbal is a mavlink_v2: use --family gremsy, or leave it out

Usage: gimbald sim gimbal [OPTIONS] --endpoint <ENDPOINT>

For more information, try '--help'.
"
            )
        );
    }

    /// Every option of one family, with each of the three: where it is of no effect it is refused, also when its value is
    /// the usual one; with its own family, and where it is not given, it is not.
    #[test]
    fn each_option_is_taken_by_its_family_only() {
        let options = [
            ("--frames legacy", "mavlink_v2"),
            ("--status-frame earth", "mavlink_v2"),
            ("--v1-reports orientation", "mavlink_v1"),
            ("--v1-reversed", "mavlink_v1"),
            ("--gremsy-generation v2", "gremsy"),
            ("--gremsy-firmware 7.8.9", "gremsy"),
            ("--gremsy-rc-type sync", "gremsy"),
            ("--gremsy-quiet", "gremsy"),
            ("--gremsy-inverted-pitch", "gremsy"),
            ("--gremsy-latched", "gremsy"),
        ];
        assert_eq!(options.map(|(option, _)| named(option)), OPTIONS.map(|(option, _)| option.replace('_', "-")));
        for family in ["mavlink_v2", "mavlink_v1", "gremsy"] {
            let commands = [
                format!("gimbald sim gimbal --endpoint udpin:127.0.0.1:1 --family {family}"),
                format!("gimbald demo --family {family}"),
            ];
            for command in &commands {
                assert_eq!(refusal(command), None, "{command}");
            }
            for (option, owner) in options {
                let demo_has_it = owner == "gremsy";
                for command in &commands[..if demo_has_it { 2 } else { 1 }] {
                    let said = refusal(&format!("{command} {option}"));
                    let expected = format!("error: --{} is for family {owner}", named(option));
                    assert_eq!(said.is_none(), family == owner, "{command} {option}");
                    assert!(said.is_none_or(|said| said.starts_with(&expected)), "{command} {option}");
                }
            }
        }
    }

    fn named(option: &str) -> String {
        option.trim_start_matches("--").split(' ').next().unwrap_or_default().to_owned()
    }

    /// An option that is shown under a family's heading, or named for one, has its place in the table.
    #[test]
    fn no_option_of_a_family_is_left_out() {
        let mut command = Cli::command();
        command.build();
        let sim = command.find_subcommand("sim").and_then(|sim| sim.find_subcommand("gimbal"));
        let demo = command.find_subcommand("demo");
        for command in [sim, demo].map(|command| command.expect("there is such a command")) {
            for option in command.get_arguments() {
                let is_headed =
                    option.get_help_heading().is_some_and(|heading| heading.starts_with("Options of family"));
                let is_known = OPTIONS.iter().any(|(known, _)| option.get_id() == *known);
                assert_eq!(is_headed, is_known, "{}", option.get_id());
            }
        }
    }
}
