//! `gimbald gimbal NAME …`: shows a gimbal, or asks something of it, through a running daemon.

use std::future::poll_fn;
use std::io::{self, Write};
use std::path::PathBuf;
use std::task::Poll;
use std::time::Duration;

use serde::Deserialize;
use serde_json::Value;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::time::{Instant, sleep_until};

use super::client::{ClientError, Target, printable, printable_text};
use super::daemon_address;
use super::status::text;
use crate::actions::percent_encoded;
use crate::bridge::snapshot::GimbalSnapshot;
use crate::cli::GimbalArgs;
use crate::cli::order::{Act, Order, unconfirmed};
use crate::config::DEFAULT_FILE;
use crate::exit_code::ExitCode;
use crate::manager::asked::UNCONFIRMED;
use crate::token::{Token, TokenError};

/// Between two requests to turn on; well below the shortest sensible `rate_timeout_s`.
const REFRESH: Duration = Duration::from_millis(400);

/// Why it could not be shown, or was not done.
#[derive(Debug, thiserror::Error)]
enum GimbalError {
    #[error(transparent)]
    Client(#[from] ClientError),
    #[error("the name of the gimbal is missing: gimbald gimbal NAME COMMAND; 'gimbald gimbal' lists them")]
    NoName,
    /// It is dangerous to this gimbal, which the daemon alone knows.
    #[error("{0}")]
    Unconfirmed(String),
    #[error("control needs the token: name its file with --token-file, or in [http] token_file of {}", .0.display())]
    NoToken(PathBuf),
    #[error("the token file {} {error}{}", path.display(), if is_forbidden(error) { "; run it with sudo" } else { "" })]
    Token { path: PathBuf, error: TokenError },
}

impl GimbalError {
    fn exit_code(&self) -> ExitCode {
        match self {
            Self::Client(error) => error.exit_code(),
            Self::NoName | Self::Unconfirmed(_) => ExitCode::Usage,
            Self::NoToken(_) => ExitCode::NoPermission,
            Self::Token { error, .. } if is_forbidden(error) => ExitCode::NoPermission,
            Self::Token { .. } => ExitCode::Config,
        }
    }
}

fn is_forbidden(error: &TokenError) -> bool {
    matches!(error, TokenError::Unreadable(error) if error.kind() == io::ErrorKind::PermissionDenied)
}

/// Prints what was to be shown or what became of what was asked, and to `errors` why not.
pub fn gimbal(arguments: &GimbalArgs, output: &mut impl Write, errors: &mut impl Write) -> ExitCode {
    match run(arguments, output) {
        Ok(()) => ExitCode::Ok,
        // `gimbald gimbal camera | head` has seen enough.
        Err(GimbalError::Client(ClientError::Output(error))) if error.kind() == io::ErrorKind::BrokenPipe => {
            ExitCode::Ok
        }
        Err(error) => {
            // The exit code says it too; nobody is left to tell when the reader is gone.
            let _ = writeln!(errors, "gimbald: {error}");
            error.exit_code()
        }
    }
}

fn run(arguments: &GimbalArgs, output: &mut impl Write) -> Result<(), GimbalError> {
    let target = daemon_address::target(&arguments.daemon)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ClientError::Output)?;
    let result = runtime.block_on(async {
        let Some(name) = &arguments.name else {
            return if arguments.order.is_some() {
                Err(GimbalError::NoName)
            } else {
                names(&target, arguments.json).await
            };
        };
        let of_gimbal = format!("/gimbals/{}", percent_encoded(name));
        match &arguments.order {
            None => show(&target, &of_gimbal, arguments.json).await,
            Some(Order::Parameters { name }) => parameters(&target, &of_gimbal, name.as_deref(), arguments.json).await,
            Some(Order::Act(act)) => {
                let token = token(arguments)?;
                let answer =
                    carry_out(&target, &of_gimbal, act, &token).await.map_err(|error| in_typed_words(act, error))?;
                let Done { done } = serde_json::from_slice(&answer).map_err(|error| target.not_gimbald(error))?;
                Ok(if arguments.json {
                    as_it_is(&answer)
                } else {
                    format!("{}: {} done\n", printable_text(name), printable_text(&done))
                })
            }
        }
    });
    // A name that is still being resolved must not keep the command from ending.
    runtime.shutdown_background();
    output.write_all(result?.as_bytes()).and_then(|()| output.flush()).map_err(ClientError::Output)?;
    Ok(())
}

/// What is to be typed, where the daemon answered what is to stand in a body.
fn in_typed_words(act: &Act, error: GimbalError) -> GimbalError {
    match (&error, act.action.danger) {
        (GimbalError::Client(ClientError::Refused { word: Some(word), .. }), Some(danger)) if word == UNCONFIRMED => {
            GimbalError::Unconfirmed(unconfirmed(danger))
        }
        _ => error,
    }
}

/// The answer to what was asked for.
#[derive(Deserialize)]
struct Done {
    done: String,
}

/// Those that there are, a line for each.
async fn names(target: &Target, json: bool) -> Result<String, GimbalError> {
    let answer = target.get("/gimbals").await?;
    if json {
        return Ok(as_it_is(&answer));
    }
    let value: Value = serde_json::from_slice(&answer).map_err(|error| target.not_gimbald(error))?;
    match printable(value).get("gimbals") {
        Some(Value::Array(names)) if names.is_empty() => Ok("there is none yet\n".to_owned()),
        Some(Value::Array(names)) => {
            Ok(names.iter().filter_map(Value::as_str).map(|name| format!("{name}\n")).collect())
        }
        _ => Err(target.not_gimbald("no list of gimbals").into()),
    }
}

async fn show(target: &Target, of_gimbal: &str, json: bool) -> Result<String, GimbalError> {
    let answer = target.get(of_gimbal).await?;
    if json {
        return Ok(as_it_is(&answer));
    }
    let value: Value = serde_json::from_slice(&answer).map_err(|error| target.not_gimbald(error))?;
    let gimbal: GimbalSnapshot = serde_json::from_value(printable(value)).map_err(|error| target.not_gimbald(error))?;
    Ok(text::gimbal_report(&gimbal))
}

const NONE_WAS_READ: &str = "none was read; refresh-parameters reads them\n";

async fn parameters(target: &Target, of_gimbal: &str, name: Option<&str>, json: bool) -> Result<String, GimbalError> {
    let one = name.map(|name| format!("/{}", percent_encoded(name))).unwrap_or_default();
    let answer = target.get(&format!("{of_gimbal}/parameters{one}")).await?;
    if json {
        return Ok(as_it_is(&answer));
    }
    let value: Value = serde_json::from_slice(&answer).map_err(|error| target.not_gimbald(error))?;
    match (name, printable(value)) {
        (Some(_), Value::Object(parameter)) => {
            Ok(format!("{}\n", number(parameter.get("value").unwrap_or(&Value::Null))))
        }
        (None, Value::Object(all)) if all.is_empty() => Ok(NONE_WAS_READ.to_owned()),
        (None, Value::Object(all)) => {
            Ok(all.iter().map(|(name, value)| format!("{name:<16} {}\n", number(value))).collect())
        }
        (_, other) => Err(target.not_gimbald(other).into()),
    }
}

/// Most parameters are whole numbers.
fn number(value: &Value) -> String {
    value.as_f64().map_or_else(|| value.to_string(), |number| number.to_string())
}

/// Asks for it once, or as long as it is to last; then, and at Ctrl-C, what turns is stopped.
async fn carry_out(target: &Target, of_gimbal: &str, act: &Act, token: &Token) -> Result<Vec<u8>, GimbalError> {
    let path = format!("{of_gimbal}/{}", act.action.path_with(act.in_path.as_deref()));
    let ask = || target.post(&path, token, act.body.clone());
    let Some(lasting) = act.lasting else { return Ok(ask().await?) };
    // Before anything turns: whoever ends us from then on ends the rotation.
    let mut ended = Ended::new().map_err(ClientError::Output)?;
    let end = Instant::now() + lasting;
    let mut answer = Vec::new();
    let turned = tokio::select! {
        first = ask() => {
            // What was refused turns nothing.
            answer = first?;
            tokio::select! {
                turned = repeat(&ask, end - lasting, end) => turned,
                () = ended.wait() => Ok(()),
            }
        }
        // Whether it came or not: it is not to turn on.
        () = ended.wait() => Ok(()),
    };
    let stopped = target.post(&format!("{of_gimbal}/stop"), token, Vec::new()).await;
    turned?;
    let stopped = stopped?;
    Ok(if answer.is_empty() { stopped } else { answer })
}

/// Asks again and again from the first time on until `end`.
async fn repeat<F>(ask: &impl Fn() -> F, first: Instant, end: Instant) -> Result<(), ClientError>
where
    F: Future<Output = Result<Vec<u8>, ClientError>>,
{
    let mut next = first + REFRESH;
    while next < end {
        sleep_until(next).await;
        ask().await?;
        next += REFRESH;
    }
    sleep_until(end).await;
    Ok(())
}

/// The signals by which a person or a closed terminal ends a command.
struct Ended([Signal; 3]);

impl Ended {
    fn new() -> io::Result<Self> {
        let [interrupt, terminate, hangup] =
            [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()].map(signal);
        Ok(Self([interrupt?, terminate?, hangup?]))
    }

    async fn wait(&mut self) {
        poll_fn(|cx| {
            let any = self.0.iter_mut().any(|signal| signal.poll_recv(cx).is_ready());
            if any { Poll::Ready(()) } else { Poll::Pending }
        })
        .await;
    }
}

fn as_it_is(answer: &[u8]) -> String {
    format!("{}\n", String::from_utf8_lossy(answer))
}

fn token(arguments: &GimbalArgs) -> Result<Token, GimbalError> {
    let path = match &arguments.token_file {
        Some(path) => path.clone(),
        None => daemon_address::settings(&arguments.daemon)?.token_file.ok_or_else(|| {
            GimbalError::NoToken(arguments.daemon.config.clone().unwrap_or_else(|| DEFAULT_FILE.into()))
        })?,
    };
    Token::read(&path).map_err(|error| GimbalError::Token { path, error })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_may_not_read_the_token_is_told_what_to_do() {
        let error = TokenError::Unreadable(io::ErrorKind::PermissionDenied.into());
        let error = GimbalError::Token { path: "/etc/gimbald/http-token".into(), error };
        assert_eq!(
            error.to_string(),
            "the token file /etc/gimbald/http-token cannot be read: permission denied; run it with sudo"
        );
        assert_eq!(error.exit_code(), ExitCode::NoPermission);
    }
}
