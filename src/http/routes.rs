//! What the window answers.

use std::net::SocketAddr;
use std::time::Duration;

use axum::extract::{Request, State};
use axum::http::header::{ALLOW, CACHE_CONTROL, CONTENT_SECURITY_POLICY, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS};
use axum::http::{HeaderName, HeaderValue, StatusCode};
use axum::middleware::{Next, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use serde::Serialize;

use super::fresh::FreshSnapshots;
use super::hosts::Listening;
use super::page::page;
use super::readiness::Readiness;

const STATUS_DEADLINE: Duration = Duration::from_millis(500);
const HEALTH_DEADLINE: Duration = Duration::from_secs(1);

/// The routes of a window that listens on `listen`.
pub fn router(snapshots: FreshSnapshots, listen: SocketAddr) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/api/v1/status", get(status))
        .route("/healthz", get(healthz))
        .route("/readyz", get(readyz))
        .fallback(unknown_path)
        .method_not_allowed_fallback(read_only)
        .layer(from_fn_with_state(Listening(listen), guard))
        .with_state(snapshots)
}

async fn status(State(snapshots): State<FreshSnapshots>) -> Response {
    match snapshots.within(STATUS_DEADLINE).await {
        Some(snapshot) => Json(snapshot.as_ref()).into_response(),
        None => refusal(StatusCode::SERVICE_UNAVAILABLE, "the core did not answer within 500 ms"),
    }
}

/// The process is alive, and its loop turns.
async fn healthz(State(snapshots): State<FreshSnapshots>) -> Response {
    match snapshots.within(HEALTH_DEADLINE).await {
        Some(_) => "ok".into_response(),
        None => refusal(StatusCode::SERVICE_UNAVAILABLE, "the core did not answer within 1 s"),
    }
}

async fn readyz(State(snapshots): State<FreshSnapshots>) -> Response {
    let readiness = match snapshots.within(STATUS_DEADLINE).await {
        Some(snapshot) => Readiness::of(&snapshot),
        None => Readiness::unknown("the core did not answer within 500 ms"),
    };
    let status = if readiness.ready { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    (status, Json(readiness)).into_response()
}

async fn unknown_path() -> Response {
    refusal(StatusCode::NOT_FOUND, "no such page; there are /, /api/v1/status, /healthz and /readyz")
}

async fn read_only() -> Response {
    let mut response = refusal(StatusCode::METHOD_NOT_ALLOWED, "this window is read-only: use GET");
    response.headers_mut().insert(ALLOW, HeaderValue::from_static("GET, HEAD"));
    response
}

/// Checks who is asked for, and says how far each answer may be trusted.
async fn guard(State(listening): State<Listening>, request: Request, next: Next) -> Response {
    let (parts, body) = request.into_parts();
    let mut response = match listening.check_host(&parts) {
        Ok(()) => next.run(Request::from_parts(parts, body)).await,
        Err((status, why)) => refusal(status, why),
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

#[derive(Serialize)]
struct Refusal {
    error: &'static str,
}

fn refusal(status: StatusCode, error: &'static str) -> Response {
    (status, Json(Refusal { error })).into_response()
}
