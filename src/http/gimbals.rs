//! Reading what is known of a gimbal, by its name.

use axum::Json;
use axum::extract::rejection::PathRejection;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::{Value, json};

use super::fresh::FreshSnapshots;
use super::routes::{Refusal, STATUS_DEADLINE, Window};
use crate::bridge::snapshot::{GimbalSnapshot, Snapshot};

/// What of a gimbal can be read by itself, and what that is.
pub const PARTS: [(&str, &str); 6] = [
    ("attitude", "Where it looks; assumed where it does not tell"),
    ("setpoint", "What it is told, null before the first demand"),
    ("control", "Who is in control"),
    ("details", "What only its family knows of it"),
    ("faults", "What is known to be wrong with it or its firmware"),
    ("parameters", "Its parameters by name, as far as they were read"),
];

/// The names.
pub async fn names(State(window): State<Window>) -> Response {
    match window.snapshots.within(STATUS_DEADLINE).await {
        Some(snapshot) => Json(json!({"gimbals": names_in(&snapshot)})).into_response(),
        None => no_answer(),
    }
}

/// All of one gimbal.
pub async fn gimbal(State(window): State<Window>, name: Result<Path<String>, PathRejection>) -> Response {
    let Ok(Path(name)) = name else { return malformed() };
    find(&window.snapshots, &name, |gimbal| Json(gimbal).into_response()).await
}

/// One of [`PARTS`].
pub async fn part(window: Window, part: &'static str, name: Result<Path<String>, PathRejection>) -> Response {
    let Ok(Path(name)) = name else { return malformed() };
    find(&window.snapshots, &name, |gimbal| Json(part_of(gimbal, part)).into_response()).await
}

/// One parameter.
pub async fn parameter(State(window): State<Window>, path: Result<Path<(String, String)>, PathRejection>) -> Response {
    let Ok(Path((name, parameter))) = path else { return malformed() };
    find(&window.snapshots, &name, |gimbal| match gimbal.details.parameters.get(&parameter) {
        Some(value) => Json(json!({"name": parameter, "value": value})).into_response(),
        None => not_read(&parameter).into_response(),
    })
    .await
}

/// The answer about a parameter that the gimbal does not have, as far as is known.
pub fn not_read(parameter: &str) -> Refusal {
    Refusal::new(StatusCode::NOT_FOUND, format!("no parameter {parameter:?} was read from the gimbal"))
}

/// Whether a gimbal's parameters are known, and this is none of them.
pub async fn is_unread(snapshots: &FreshSnapshots, gimbal: &str, parameter: &str) -> bool {
    let Some(snapshot) = snapshots.within(STATUS_DEADLINE).await else { return false };
    let gimbal = snapshot.gimbals.iter().find(|known| known.name == gimbal);
    let parameters = gimbal.map(|gimbal| &gimbal.details.parameters);
    parameters.is_some_and(|known| !known.is_empty() && !known.contains_key(parameter))
}

fn part_of(gimbal: &GimbalSnapshot, part: &str) -> Value {
    match part {
        "attitude" => as_json(&gimbal.attitude),
        "setpoint" => as_json(&gimbal.setpoint),
        "details" => as_json(&gimbal.details),
        "faults" => as_json(&gimbal.details.faults),
        "parameters" => as_json(&gimbal.details.parameters),
        _ => json!({
            "primary": gimbal.primary,
            "secondary": gimbal.secondary,
            "primary_age_ms": gimbal.primary_age_ms,
            "secondary_age_ms": gimbal.secondary_age_ms,
            "lender": gimbal.lender,
            "takeover": gimbal.takeover,
        }),
    }
}

fn as_json(part: &impl Serialize) -> Value {
    serde_json::to_value(part).expect("a snapshot is plain data")
}

async fn find(snapshots: &FreshSnapshots, name: &str, show: impl FnOnce(&GimbalSnapshot) -> Response) -> Response {
    let Some(snapshot) = snapshots.within(STATUS_DEADLINE).await else { return no_answer() };
    match snapshot.gimbals.iter().find(|gimbal| gimbal.name == name) {
        Some(gimbal) => show(gimbal),
        None => not_among(name, &names_in(&snapshot)),
    }
}

/// The answer about a name that no gimbal has.
pub async fn unknown_gimbal(snapshots: &FreshSnapshots, name: &str) -> Response {
    match snapshots.within(STATUS_DEADLINE).await {
        Some(snapshot) => not_among(name, &names_in(&snapshot)),
        None => no_answer(),
    }
}

fn not_among(name: &str, known: &[&str]) -> Response {
    let there =
        if known.is_empty() { "there is none yet".to_owned() } else { format!("there are: {}", known.join(", ")) };
    Refusal::new(StatusCode::NOT_FOUND, format!("no gimbal is called {name:?}; {there}")).into_response()
}

fn names_in(snapshot: &Snapshot) -> Vec<&str> {
    snapshot.gimbals.iter().map(|gimbal| gimbal.name.as_str()).collect()
}

fn malformed() -> Response {
    Refusal::new(StatusCode::BAD_REQUEST, "the path is not UTF-8").into_response()
}

fn no_answer() -> Response {
    Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the core did not answer within 500 ms").into_response()
}
