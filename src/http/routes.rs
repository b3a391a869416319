//! What the window answers.

use std::borrow::Cow;
use std::net::SocketAddr;
use std::sync::LazyLock;
use std::time::Duration;

use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, REFERRER_POLICY, WWW_AUTHENTICATE, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderName, HeaderValue, StatusCode, Uri};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use serde::Serialize;

use super::control::{self, Controls};
use super::fresh::FreshSnapshots;
use super::hosts::Listening;
use super::page::page;
use super::readiness::Readiness;
use super::{gimbals, openapi};
use crate::actions::ACTIONS;

pub const STATUS_DEADLINE: Duration = Duration::from_millis(500);
const HEALTH_DEADLINE: Duration = Duration::from_secs(1);

/// What the handlers share.
#[derive(Clone)]
pub struct Window {
    pub snapshots: FreshSnapshots,
    pub controls: Controls,
}

/// The routes of a window that listens on `listen`.
pub fn router(window: Window, listen: SocketAddr) -> Router {
    let mut router = Router::new()
        .route("/", get(page))
        .route("/api/v1/status", get(status))
        .route("/api/v1/openapi.json", get(openapi))
        .route(GIMBALS, get(gimbals::names))
        .route(&of_gimbal(""), get(gimbals::gimbal))
        .route(&of_gimbal("/parameters/{parameter}"), get(gimbals::parameter))
        .route("/healthz", get(healthz))
        .route("/readyz", get(readyz));
    for (part, _) in gimbals::PARTS {
        let handler = move |State(window): State<Window>, name| gimbals::part(window, part, name);
        router = router.route(&of_gimbal(&format!("/{part}")), get(handler));
    }
    for action in ACTIONS {
        let handler =
            move |State(window): State<Window>, params, request| control::act(window, action, params, request);
        router = router.route(&of_gimbal(&format!("/{}", action.path)), post(handler));
    }
    router
        .fallback(unknown_path)
        .method_not_allowed_fallback(other_method)
        .layer(from_fn_with_state(Listening(listen), guard))
        .with_state(window)
}

pub const GIMBALS: &str = "/api/v1/gimbals";

fn of_gimbal(rest: &str) -> String {
    format!("{GIMBALS}/{{name}}{rest}")
}

async fn status(State(window): State<Window>) -> Response {
    match window.snapshots.within(STATUS_DEADLINE).await {
        Some(snapshot) => Json(snapshot.as_ref()).into_response(),
        None => Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the core did not answer within 500 ms").into_response(),
    }
}

/// The process is alive, and its loop turns.
async fn healthz(State(window): State<Window>) -> Response {
    match window.snapshots.within(HEALTH_DEADLINE).await {
        Some(_) => "ok".into_response(),
        None => Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the core did not answer within 1 s").into_response(),
    }
}

async fn readyz(State(window): State<Window>) -> Response {
    let readiness = match window.snapshots.within(STATUS_DEADLINE).await {
        Some(snapshot) => Readiness::of(&snapshot),
        None => Readiness::unknown("the core did not answer within 500 ms"),
    };
    let status = if readiness.ready { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    (status, Json(readiness)).into_response()
}

/// The same for as long as we run, and not small: whoever asks for it again and again is not to cost more than a page.
async fn openapi() -> Response {
    static DESCRIPTION: LazyLock<Bytes> = LazyLock::new(|| openapi::description().to_string().into());
    ([(CONTENT_TYPE, "application/json")], DESCRIPTION.clone()).into_response()
}

async fn unknown_path(uri: Uri) -> Response {
    let of_gimbal = uri.path().strip_prefix(GIMBALS).and_then(|rest| rest.strip_prefix('/')?.split_once('/'));
    let error = match of_gimbal {
        Some(_) => {
            let parts: Vec<_> = gimbals::PARTS.iter().map(|(part, _)| *part).collect();
            let actions: Vec<_> = ACTIONS.iter().map(|action| action.path).collect();
            format!(
                "a gimbal has nothing of that name; there are, to be read: {}; to be asked for with POST: {}",
                parts.join(", "),
                actions.join(", ")
            )
        }
        None => {
            "no such page; there are /, /api/v1/status, /api/v1/gimbals, /api/v1/openapi.json, /healthz and /readyz"
                .to_owned()
        }
    };
    Refusal::new(StatusCode::NOT_FOUND, error).into_response()
}

async fn other_method() -> Response {
    let error = "another method is needed here; Allow says which: GET reads, POST with the token asks for something";
    Refusal::new(StatusCode::METHOD_NOT_ALLOWED, error).into_response()
}

/// Checks who is asked for, and says how far each answer may be trusted.
async fn guard(State(listening): State<Listening>, request: Request, next: Next) -> Response {
    let (parts, body) = request.into_parts();
    let mut response = match listening.check_host(&parts) {
        Ok(()) => next.run(Request::from_parts(parts, body)).await,
        Err((status, why)) => Refusal::new(status, why).into_response(),
    };
    let headers = response.headers_mut();
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert(SAME_ORIGIN, HeaderValue::from_static("same-origin"));
    headers.entry(CONTENT_SECURITY_POLICY).or_insert(NOTHING_IS_LOADED);
    response
}

/// Other sites may not embed our answers.
const SAME_ORIGIN: HeaderName = HeaderName::from_static("cross-origin-resource-policy");
const NOTHING_IS_LOADED: HeaderValue = HeaderValue::from_static("default-src 'none'; frame-ancestors 'none'");

/// Why something was not done, or is not there.
#[derive(Serialize)]
pub struct Refusal {
    #[serde(skip)]
    pub status: StatusCode,
    /// For people.
    pub error: Cow<'static, str>,
    /// A word for programs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<&'static str>,
    /// Who has control, where that is why.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub holder: Option<String>,
}

impl Refusal {
    pub fn new(status: StatusCode, error: impl Into<Cow<'static, str>>) -> Self {
        Self { status, error: error.into(), reason: None, holder: None }
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let mut response = (self.status, Json(&self)).into_response();
        if self.status == StatusCode::UNAUTHORIZED {
            response.headers_mut().insert(WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response
    }
}
