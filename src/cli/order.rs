//! The commands of `gimbald gimbal NAME`, made from the table of what can be asked.

use std::time::Duration;

use clap::builder::PossibleValuesParser;
use clap::error::ErrorKind;
use clap::{Arg, ArgAction, ArgMatches, Command, Error, FromArgMatches, Subcommand};
use serde_json::Value;

use crate::actions::{self, ACTIONS, Action, CONFIRM, Danger, Field, Kind, Wrong};

/// What is to be done with a gimbal, besides showing it.
#[derive(Clone, Debug)]
pub enum Order {
    /// Shows its parameters, or one.
    Parameters {
        name: Option<String>,
    },
    Act(Act),
}

/// Something asked of it.
#[derive(Clone, Debug)]
pub struct Act {
    pub action: &'static Action,
    /// What stands in the path.
    pub in_path: Option<String>,
    pub body: Vec<u8>,
    /// Asked again and again for so long, and then stopped.
    pub lasting: Option<Duration>,
}

const PARAMETERS: &str = "parameters";
const LASTING: &str = "for";

/// The option that says that what is dangerous is meant.
pub fn confirmation(word: &str) -> String {
    format!("yes-{}", word.replace(' ', "-"))
}

fn command(action: &'static Action) -> Command {
    let mut command = Command::new(action.command).about(action.about);
    for (at, field) in action.fields.iter().enumerate() {
        command = command.arg(argument(field).display_order(at));
    }
    if let Some(Danger { word, when, cost }) = action.danger {
        let when = when.map(|when| format!(" ({when})").replace('`', "")).unwrap_or_default();
        let help = format!("Without it '{word}' is not done{when}, which can cost the camera or the flight: {cost}");
        command = command.arg(Arg::new(CONFIRM).long(confirmation(word)).action(ArgAction::SetTrue).help(help));
    }
    if action.command == "turn" {
        let help = "Ask for it again and again for so long, then stop; Ctrl-C stops as well";
        command = command.arg(Arg::new(LASTING).long(LASTING).value_name("SECONDS").help(help).value_parser(seconds));
    }
    with_name_in_usage(command)
}

/// The gimbal's name stands before its commands, which clap leaves out of what it shows as their usage.
fn with_name_in_usage(command: Command) -> Command {
    let named = format!("gimbald gimbal NAME {}", command.get_name());
    let usage = command.clone().bin_name(&named).render_usage().to_string();
    let arguments = usage.trim_start_matches("Usage: ").trim_start_matches(&named).replace(" [OPTIONS]", "");
    command.override_usage(format!("{named} [OPTIONS]{arguments}"))
}

fn argument(field: &'static Field) -> Arg {
    let name = field.name.to_uppercase();
    let arg = Arg::new(field.name).value_name(name).help(field.about).allow_negative_numbers(true);
    let arg = match field.kind {
        Kind::Word(words) => arg.value_parser(PossibleValuesParser::new(words)),
        Kind::Flag => arg.value_parser(PossibleValuesParser::new(["on", "off"])),
        Kind::Number { .. } | Kind::WholeOrWord { .. } | Kind::Name { .. } => {
            arg.help(format!("{}; {}", field.about, field.kind.expected()))
        }
    };
    if field.required { arg.required(true) } else { arg.long(field.name.replace('_', "-")) }
}

/// A field as it is typed; other words stay as they are.
fn typed(action: &Action, name: &str) -> String {
    match action.fields.iter().find(|field| field.name == name) {
        Some(field) if field.required => name.to_uppercase(),
        Some(_) => format!("--{}", name.replace('_', "-")),
        None => name.to_owned(),
    }
}

/// What is to be typed for what is dangerous to be done.
pub fn unconfirmed(Danger { word, cost, .. }: &Danger) -> String {
    let option = confirmation(word);
    format!("'{word}' can cost the camera or the flight: {cost}; if it is meant, add --{option}")
}

/// What is wrong, in the words of the command line.
fn in_typed_words(action: &Action, wrong: Wrong) -> String {
    match wrong {
        Wrong::Unconfirmed(danger) => unconfirmed(danger),
        Wrong::Value { name, found, expected } => {
            format!("{}: found {found}; expected {expected}", typed(action, name))
        }
        Wrong::Nothing(names) => {
            let names: Vec<String> = names.iter().map(|name| typed(action, name)).collect();
            format!("nothing is asked for; expected at least one of {}", names.join(", "))
        }
        Wrong::Together(text) => text.split(' ').map(|word| typed(action, word)).collect::<Vec<_>>().join(" "),
        Wrong::NotJson(_) | Wrong::Twice { .. } | Wrong::UnknownField { .. } | Wrong::Missing { .. } => {
            wrong.to_string()
        }
    }
}

fn seconds(text: &str) -> Result<Duration, SecondsError> {
    let seconds: Option<f64> = text.parse().ok(); // no number is no number of seconds
    let seconds = seconds.filter(|seconds| (0.1..=3600.0).contains(seconds)).ok_or(SecondsError)?;
    Ok(Duration::from_secs_f64(seconds))
}

/// Why something is no time to turn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("expected a number of seconds from 0.1 to 3600")]
pub struct SecondsError;

impl Subcommand for Order {
    fn augment_subcommands(parent: Command) -> Command {
        let name = Arg::new("parameter").value_name("PARAMETER").help("Only this one");
        let parameters =
            Command::new(PARAMETERS).about("Show the gimbal's parameters, as far as they were read").arg(name);
        parent.subcommand(with_name_in_usage(parameters)).subcommands(ACTIONS.iter().map(command))
    }

    fn augment_subcommands_for_update(parent: Command) -> Command {
        Self::augment_subcommands(parent)
    }

    fn has_subcommand(name: &str) -> bool {
        name == PARAMETERS || Action::of_command(name).is_some()
    }
}

impl FromArgMatches for Order {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let Some((name, matches)) = matches.subcommand() else {
            return Err(Error::raw(ErrorKind::MissingSubcommand, "a command is missing\n"));
        };
        match Action::of_command(name) {
            Some(action) => read(action, matches).map(Self::Act),
            None => Ok(Self::Parameters { name: matches.get_one::<String>("parameter").cloned() }),
        }
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// What was typed, read as the daemon will read it, so that what is wrong is said before anybody is asked.
fn read(action: &'static Action, matches: &ArgMatches) -> Result<Act, Error> {
    let given = |field: &Field| matches.get_one::<String>(field.name);
    let mut body: Vec<(String, Value)> = action
        .body_fields()
        .filter_map(|field| given(field).map(|text| (field.name.to_owned(), field.kind.of_text(text))))
        .collect();
    if let Some(word) = action.word().filter(|_| matches.get_flag(CONFIRM)) {
        body.push((CONFIRM.to_owned(), word.into()));
    }
    let in_path = action.path_field().and_then(given).cloned();
    let lasting = if action.command == "turn" { matches.get_one::<Duration>(LASTING).copied() } else { None };
    let body = actions::body(body);
    action.read(in_path.as_deref(), &body).map_err(|wrong| {
        let mut command = command(action);
        Error::raw(ErrorKind::ValueValidation, in_typed_words(action, wrong) + "\n").format(&mut command)
    })?;
    Ok(Act { action, in_path, body, lasting })
}

#[cfg(test)]
mod tests {
    use std::ffi::OsString;

    use super::*;
    use crate::cli::{self, Cli, GimbalArgs};

    fn read(line: &str) -> Result<GimbalArgs, String> {
        use clap::Parser;
        let words = ["gimbald", "gimbal", "camera"].into_iter().chain(line.split(' ')).map(OsString::from);
        match Cli::try_parse_from(words) {
            Ok(Cli { command: cli::Command::Gimbal(arguments), .. }) => Ok(arguments),
            Ok(other) => panic!("{other:?}"),
            Err(error) => Err(error.to_string()),
        }
    }

    fn act(line: &str) -> Result<(String, Option<String>, String), String> {
        let Some(Order::Act(act)) = read(line)?.order else { panic!("{line} is something to do") };
        Ok((act.action.command.to_owned(), act.in_path, String::from_utf8(act.body).expect("text")))
    }

    /// "One table in code from which routes, CLI and docs agree": every row of it is a command, with every field.
    #[test]
    fn every_action_is_a_command() {
        for action in ACTIONS {
            let mut line = vec![action.command.to_owned()];
            for field in action.fields {
                if !field.required {
                    line.push(format!("--{}", field.name.replace('_', "-")));
                }
                line.push(match field.kind {
                    Kind::Number { min, .. } => format!("{}", min.max(-7.0)),
                    Kind::Word(words) => words[words.len() - 1].to_owned(),
                    Kind::WholeOrWord { words, .. } => words[0].to_owned(),
                    Kind::Flag => "on".to_owned(),
                    Kind::Name { .. } => "PWR_PAN".to_owned(),
                });
            }
            // Limits must be in order.
            if action.command == "limits" {
                line.pop();
                line.push("7".to_owned());
            }
            line.extend(action.word().map(|word| format!("--{}", confirmation(word))));
            let line = line.join(" ");

            let (command, in_path, body) = act(&line).unwrap_or_else(|error| panic!("{line}: {error}"));

            assert_eq!(command, action.command);
            assert_eq!(in_path.is_some(), action.path_field().is_some(), "{line}");
            let body: Value = serde_json::from_str(&body).expect("JSON");
            for field in action.body_fields() {
                assert!(!body[field.name].is_null(), "{line}: {body}");
            }
            assert!(body[CONFIRM].as_str() == action.word(), "{line}: {body}");
        }
    }

    #[test]
    #[rustfmt::skip]
    fn what_is_typed_is_what_is_sent() {
        for (line, in_path, body) in [
            ("point --pitch-deg -30 --yaw-deg=20.5",  None,            r#"{"pitch_deg":-30.0,"yaw_deg":20.5}"#),
            ("roi -33.5 151.25 12",                   None,            r#"{"altitude_m":12,"latitude_deg":-33.5,"longitude_deg":151.25}"#),
            ("limits tilt -45 45",                    Some("tilt"),    r#"{"max_deg":45,"min_deg":-45.0}"#),
            ("set-parameter PWR_PAN 60",              Some("PWR_PAN"), r#"{"value":60}"#),
            ("stream-rate raw_imu off",               None,            r#"{"rate_hz":"off","stream":"raw_imu"}"#),
            ("stream-rate raw_imu 50",                None,            r#"{"rate_hz":50,"stream":"raw_imu"}"#),
            ("combined-attitude off",                 None,            r#"{"enabled":false}"#),
            ("motors on",                             None,            r#"{"state":"on"}"#),
            ("motors off --yes-motors-off",           None,            r#"{"confirm":"motors off","state":"off"}"#),
            ("retract --yes-motors-off",              None,            r#"{"confirm":"motors off"}"#),
            ("retract",                               None,            "{}"),
            ("stop",                                  None,            "{}"),
        ] {
            let (_, path, sent) = act(line).expect(line);
            assert_eq!((path.as_deref(), sent.as_str()), (in_path, body), "{line}");
        }
    }

    /// "Dangerous ones need the word typed"; what is wrong is said before anybody is asked.
    #[test]
    fn what_is_wrong_is_said_at_once() {
        for (line, expected) in [
            (
                "motors off",
                "'motors off' can cost the camera or the flight: the camera falls to where its weight takes it; to a \
                Gremsy that speaks v2 it is RETRACT, and some firmware switches the motors on again only after a restart; if it \
                is meant, add --yes-motors-off",
            ),
            (
                "motors --help",
                "camera falls to where its weight takes it; to a Gremsy that speaks v2 it is RETRACT, and some \
                firmware switches the motors on again only after a restart\n",
            ),
            (
                "reboot",
                "'reboot' can cost the camera or the flight: the camera is not held until the gimbal has started; if it is \
                meant, add --yes-reboot",
            ),
            ("shutdown --yes-reboot", "unexpected argument '--yes-reboot'"),
            ("point", "nothing is asked for; expected at least one of --pitch-deg, --yaw-deg, --roll-deg"),
            ("point", "Usage: gimbald gimbal NAME point [OPTIONS]\n"),
            ("point --help", "Usage: gimbald gimbal NAME point [OPTIONS]\n"),
            ("stop --help", "Usage: gimbald gimbal NAME stop [OPTIONS]\n"),
            ("limits --help", "Usage: gimbald gimbal NAME limits [OPTIONS] <AXIS> <MIN_DEG> <MAX_DEG>\n"),
            ("limits tilt", "Usage: gimbald gimbal NAME limits [OPTIONS] <AXIS> <MIN_DEG> <MAX_DEG>\n"),
            ("parameters --help", "Usage: gimbald gimbal NAME parameters [OPTIONS] [PARAMETER]\n"),
            ("limits tilt 5 -5", "MIN_DEG must not be above MAX_DEG"),
            ("roi 91 0 0", "LATITUDE_DEG: found 91; expected a number from -90 to 90"),
            ("point --help", "up is positive; a number from -180 to 180"),
            ("point --pitch-deg down", "--pitch-deg: found \"down\"; expected a number from -180 to 180"),
            ("point --pitch-deg NaN", "--pitch-deg: found \"NaN\"; expected a number from -180 to 180"),
            ("point --pitch-deg inf", "--pitch-deg: found \"inf\"; expected a number from -180 to 180"),
            ("point --pitch-deg -181", "--pitch-deg: found -181.0; expected a number from -180 to 180"),
            ("stream-rate raw_imu 0", "expected a whole number from 1 to 200, or off or default"),
            ("control grab", "possible values: take, release"),
            ("turn --yaw-dps 5 --for 0", "expected a number of seconds from 0.1 to 3600"),
            ("turn --yaw-dps 5 --for 3601", "expected a number of seconds from 0.1 to 3600"),
            ("stop --for 1", "unexpected argument '--for'"),
            ("dance", "unexpected argument 'dance'"),
        ] {
            let error = read(line).expect_err(line);
            assert!(error.contains(expected), "{line}: {error}");
        }
    }

    #[test]
    fn options_may_follow_the_command() {
        let arguments = read("stop --json --url http://drone:8080 --token-file t").expect("right");
        assert_eq!(
            (arguments.name.as_deref(), arguments.json, arguments.daemon.url.as_deref()),
            (Some("camera"), true, Some("http://drone:8080"))
        );
        let arguments = read("--json").expect("right");
        assert!(arguments.order.is_none() && arguments.json);
        let Some(Order::Act(act)) = read("turn --yaw-dps 5 --for 1.5").expect("right").order else { panic!("an act") };
        assert_eq!(act.lasting, Some(Duration::from_millis(1500)));
    }
}
