//! Asking things of gimbals, by `POST` with the token.
//!
//! Whoever knows the token may: it comes as `Authorization: Bearer …`, which a page of another origin cannot send without
//! our consent, and we give none (no CORS). The gate in the core decides over the rest.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use axum::Json;
use axum::body::{Body, to_bytes};
use axum::extract::RawPathParams;
use axum::extract::rejection::RawPathParamsRejection;
use axum::http::header::{AUTHORIZATION, CONTENT_LENGTH, CONTENT_TYPE, HOST, ORIGIN};
use axum::http::{HeaderMap, HeaderValue, Request, StatusCode};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use tokio::sync::{mpsc, oneshot};
use tokio::time::timeout;

use super::gimbals::{is_unread, not_read, unknown_gimbal};
use super::routes::{Refusal, Window};
use super::server::Visit;
use crate::actions::{Action, Wrong};
use crate::daemon::window::CoreRequest;
use crate::gimbals::operation::{Operation, OperationError};
use crate::manager::asked::{Answer, Asked, NotDone, UNCONFIRMED};
use crate::manager::control::STANDS_IN_THE_WAY;
use crate::manager::events::{Names, why};
use crate::token::Token;
use crate::wire::ids::CommandResult;

/// The largest body; the longest that is right has a few hundred bytes.
const BODY_BYTES: usize = 4096;

/// How long the core may take for what is done at once, …
const CORE_DEADLINE: Duration = Duration::from_secs(2);

/// … and for what the gimbal has to do; the core itself gives up before.
const OPERATION_DEADLINE: Duration = Duration::from_secs(23);

/// Who may control gimbals, and the way to the core.
#[derive(Clone)]
pub struct Controls {
    token: Option<Arc<Token>>,
    requests: mpsc::Sender<CoreRequest>,
    /// How often a wrong token came.
    guesses: Arc<AtomicU64>,
    /// How long a body may take to come.
    patience: Duration,
}

impl Controls {
    pub fn new(token: Option<Token>, requests: mpsc::Sender<CoreRequest>, patience: Duration) -> Self {
        Self { token: token.map(Arc::new), requests, guesses: Arc::default(), patience }
    }

    /// Fails with the answer to give.
    pub(super) fn check_token(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let Some(token) = &self.token else {
            return Err(Refusal::new(
                StatusCode::FORBIDDEN,
                "nothing can be controlled over HTTP here: name a file with a token in [http] token_file",
            ));
        };
        let mut given = headers.get_all(AUTHORIZATION).iter();
        let (Some(given), None) = (given.next(), given.next()) else {
            return Err(Refusal::new(
                StatusCode::UNAUTHORIZED,
                "control needs the token, once: Authorization: Bearer TOKEN",
            ));
        };
        let bearer = given.as_bytes().split_at_checked(BEARER.len());
        match bearer.filter(|(scheme, _)| scheme.eq_ignore_ascii_case(BEARER)) {
            None => Err(Refusal::new(StatusCode::UNAUTHORIZED, "control needs the token: Authorization: Bearer TOKEN")),
            Some((_, given)) if token.is(given.trim_ascii()) => Ok(()),
            Some(_) => {
                let guesses = 1 + self.guesses.fetch_add(1, Ordering::Relaxed);
                if guesses.is_power_of_two() {
                    tracing::warn!(guesses, "somebody tried to control a gimbal over HTTP with a wrong token");
                }
                Err(Refusal::new(StatusCode::FORBIDDEN, "this is not the token"))
            }
        }
    }

    /// Asks the core; `None` when it does not answer in time.
    async fn ask(&self, gimbal: String, asked: Asked) -> Option<Answer> {
        let deadline = if matches!(asked, Asked::Operation(_)) { OPERATION_DEADLINE } else { CORE_DEADLINE };
        let (answer, answered) = oneshot::channel();
        let asking = async {
            self.requests.send(CoreRequest::Ask { gimbal, asked, answer }).await.ok()?; // the core is gone
            answered.await.ok() // the same
        };
        timeout(deadline, asking).await.ok().flatten() // too late is the same as no answer
    }
}

const BEARER: &[u8] = b"bearer ";

/// Answers one request.
pub async fn act(
    window: Window,
    action: &'static Action,
    params: Result<RawPathParams, RawPathParamsRejection>,
    request: Request<Body>,
) -> Response {
    let (parts, body) = request.into_parts();
    let asked = async {
        window.controls.check_token(&parts.headers)?;
        check_origin(&parts.headers)?;
        let params = params.map_err(|_| Refusal::new(StatusCode::BAD_REQUEST, "the path is not UTF-8"))?;
        let param = |name: &str| params.iter().find(|(key, _)| *key == name).map(|(_, value)| value.to_owned());
        let body = read_body(&parts.headers, body, window.controls.patience).await?;
        if let Some(visit) = parts.extensions.get::<Visit>() {
            visit.has_asked();
        }
        let in_path = action.path_field().and_then(|field| param(field.name));
        let asked = action.read(in_path.as_deref(), &body).map_err(|wrong| {
            let status = match wrong {
                Wrong::NotJson(_) | Wrong::Twice { .. } => StatusCode::BAD_REQUEST,
                _ => StatusCode::UNPROCESSABLE_ENTITY,
            };
            Refusal::new(status, wrong.to_string())
        })?;
        Ok::<_, Refusal>((param("name").unwrap_or_default(), asked))
    };
    let (gimbal, asked) = match asked.await {
        Ok(asked) => asked,
        Err(refusal) => return refusal.into_response(),
    };
    let parameter = match &asked {
        Asked::Operation(Operation::SetParameter { name, .. }) => Some(name.clone()),
        _ => None,
    };
    let answer = window.controls.ask(gimbal.clone(), asked).await;
    if let (Some(parameter), Some(Err(NotDone::Operation(OperationError::NoAnswer)))) = (&parameter, &answer)
        // One that it has would have been read, as all the others were or by its name.
        && is_unread(&window.snapshots, &gimbal, parameter).await
    {
        return not_read(parameter).into_response();
    }
    match answer {
        Some(Ok(())) => Json(Done { gimbal, done: action.command }).into_response(),
        Some(Err(NotDone::Refused { refusal, .. }))
            if refusal.reason == UNCONFIRMED
                && let Some(danger) = action.danger =>
        {
            let text = Wrong::Unconfirmed(danger).to_string();
            Refusal { reason: Some(UNCONFIRMED), ..Refusal::new(StatusCode::UNPROCESSABLE_ENTITY, text) }
                .into_response()
        }
        Some(Err(NotDone::UnknownGimbal)) => unknown_gimbal(&window.snapshots, &gimbal).await,
        Some(Err(not_done)) => refused(not_done).into_response(),
        None => Refusal::new(StatusCode::GATEWAY_TIMEOUT, "the core did not answer in time").into_response(),
    }
}

#[derive(Serialize)]
struct Done {
    gimbal: String,
    done: &'static str,
}

/// A page of another origin has no business here, even if it knew the token.
fn check_origin(headers: &HeaderMap) -> Result<(), Refusal> {
    let Some(origin) = headers.get(ORIGIN) else { return Ok(()) };
    let host = headers.get(HOST).map(HeaderValue::as_bytes);
    let named = origin.as_bytes().strip_prefix(b"http://");
    if named.is_some() && named == host {
        return Ok(());
    }
    Err(Refusal::new(StatusCode::FORBIDDEN, "a page of another origin does not control gimbals"))
}

async fn read_body(headers: &HeaderMap, body: Body, patience: Duration) -> Result<Vec<u8>, Refusal> {
    let too_large = || Refusal::new(StatusCode::PAYLOAD_TOO_LARGE, "the body is larger than 4096 bytes");
    let length = headers.get(CONTENT_LENGTH).and_then(|length| length.to_str().ok()?.parse::<usize>().ok());
    if length.is_some_and(|length| length > BODY_BYTES) {
        return Err(too_large());
    }
    let bytes = match timeout(patience, to_bytes(body, BODY_BYTES)).await {
        Ok(Ok(bytes)) => bytes,
        // It is cut there when it says no length, or a wrong one.
        Ok(Err(error)) if is_too_large(&error) => return Err(too_large()),
        Ok(Err(_)) => return Err(Refusal::new(StatusCode::BAD_REQUEST, "the body did not come whole")),
        Err(_) => return Err(Refusal::new(StatusCode::REQUEST_TIMEOUT, "the body did not come in time")),
    };
    let is_json = headers.get(CONTENT_TYPE).is_some_and(|kind| {
        let kind = kind.as_bytes().split(|byte| *byte == b';').next().unwrap_or_default();
        kind.trim_ascii().eq_ignore_ascii_case(b"application/json")
    });
    if !bytes.is_empty() && !is_json {
        return Err(Refusal::new(
            StatusCode::UNSUPPORTED_MEDIA_TYPE,
            "the body must be JSON: Content-Type: application/json",
        ));
    }
    Ok(bytes.to_vec())
}

fn is_too_large(error: &axum::Error) -> bool {
    let mut source = std::error::Error::source(error);
    while let Some(error) = source {
        // Its type is of a crate that we do not name.
        if error.to_string() == "length limit exceeded" {
            return true;
        }
        source = error.source();
    }
    false
}

/// What the core has not done, and what might be done about it.
fn refused(not_done: NotDone) -> Refusal {
    match not_done {
        NotDone::UnknownGimbal => Refusal::new(StatusCode::NOT_FOUND, "no gimbal is called that"),
        NotDone::Refused { refusal, holder } => {
            let mut text = why(refusal.reason, holder, Names::default());
            if matches!(refusal.reason, "nobody_in_control" | "only_for_the_holder") {
                text.push_str("; take control first");
            }
            let status = match (refusal.reason, refusal.result) {
                ("nobody_in_control" | "only_for_the_holder" | "other_vehicle", _) => StatusCode::CONFLICT,
                (reason, _) if STANDS_IN_THE_WAY.contains(&reason) => StatusCode::CONFLICT,
                ("cannot_retract" | "no_rc_inputs" | "v1_radio_control_is_none", _)
                | (_, CommandResult::Unsupported) => StatusCode::NOT_IMPLEMENTED,
                (_, CommandResult::TemporarilyRejected | CommandResult::Failed) => StatusCode::SERVICE_UNAVAILABLE,
                _ => StatusCode::UNPROCESSABLE_ENTITY,
            };
            let holder = holder.map(|holder| holder.to_string());
            Refusal { reason: Some(refusal.reason), holder, ..Refusal::new(status, text) }
        }
        NotDone::Operation(error) => {
            let (status, reason) = match &error {
                OperationError::Unsupported => (StatusCode::NOT_IMPLEMENTED, "unsupported"),
                OperationError::NotConfigured(_) => (StatusCode::NOT_IMPLEMENTED, "not_configured"),
                OperationError::UnsupportedByDevice => (StatusCode::NOT_IMPLEMENTED, "unsupported_by_device"),
                OperationError::Invalid(_) => (StatusCode::UNPROCESSABLE_ENTITY, "invalid"),
                OperationError::NotThere => (StatusCode::SERVICE_UNAVAILABLE, "not_there"),
                OperationError::NotReady => (StatusCode::SERVICE_UNAVAILABLE, "not_ready"),
                OperationError::Busy => (StatusCode::SERVICE_UNAVAILABLE, "busy"),
                OperationError::Rejected => (StatusCode::SERVICE_UNAVAILABLE, "rejected"),
                OperationError::StillTurning => (StatusCode::SERVICE_UNAVAILABLE, "still_turning"),
                OperationError::Denied => (StatusCode::BAD_GATEWAY, "denied"),
                OperationError::Failed => (StatusCode::BAD_GATEWAY, "failed"),
                OperationError::NoEffect(_) => (StatusCode::BAD_GATEWAY, "no_effect"),
                OperationError::NoAnswer => (StatusCode::GATEWAY_TIMEOUT, "no_answer"),
                OperationError::NoParameters => (StatusCode::GATEWAY_TIMEOUT, "no_parameters"),
            };
            Refusal { reason: Some(reason), ..Refusal::new(status, error.to_string()) }
        }
        NotDone::TooMuch => Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "too much is being done already; ask again"),
        NotDone::Starting => {
            Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the system id of the vehicle is not settled yet")
        }
        NotDone::Ending => Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "gimbald is ending"),
    }
}
