//! Asks a running daemon over HTTP.

use std::io;
use std::time::Duration;

use axum::body::{Body, to_bytes};
use axum::http::{Request, StatusCode, Uri, header};
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use serde_json::Value;
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::config::problem::Problems;
use crate::exit_code::ExitCode;
use crate::token::Token;

const API: &str = "/api/v1";

/// How long it may take to be told something, …
pub const READING: Duration = Duration::from_secs(2);

/// … and to have something done by a gimbal, which may take the daemon 23 s to find out.
const ASKING: Duration = Duration::from_secs(25);

/// A status is a few kilobytes; whatever sends more than this is not gimbald.
const ANSWER_BYTES: usize = 1024 * 1024;

#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    #[error("{0:?} is not an address that can be asked: expected http://HOST:PORT, for example http://127.0.0.1:8080")]
    Url(String),
    #[error("{0}")]
    Config(#[source] Problems),
    #[error(
        "no gimbald answers at {url} ({source}): is it running (systemctl status gimbald), \
         and is [http] listen that address? Otherwise name it with --url, or its configuration with --config"
    )]
    Unreachable { url: String, source: io::Error },
    #[error("{url} did not answer within {} s: is it gimbald, and can it be reached?", .within.as_secs())]
    TimedOut { url: String, within: Duration },
    #[error("gimbald at {url} answers {status}: {reason}")]
    Refused {
        url: String,
        status: StatusCode,
        reason: String,
        /// The same as a word for programs, where there is one.
        word: Option<String>,
    },
    #[error("what answers at {url} is not a gimbald of this version: {what}")]
    NotGimbald { url: String, what: String },
    #[error("the answer cannot be shown")]
    Output(#[source] io::Error),
}

impl ClientError {
    /// As in sysexits: 64 for a wrong argument, 78 for a wrong configuration, 77 for what must be allowed first, 69 for a daemon or a gimbal that is not
    /// there or cannot.
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Url(_) => ExitCode::Usage,
            Self::Config(_) => ExitCode::Config,
            Self::Refused { status, .. } => match *status {
                StatusCode::BAD_REQUEST | StatusCode::NOT_FOUND | StatusCode::UNPROCESSABLE_ENTITY => ExitCode::Usage,
                StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN | StatusCode::CONFLICT => ExitCode::NoPermission,
                _ => ExitCode::Unavailable,
            },
            Self::Unreachable { .. } | Self::TimedOut { .. } | Self::NotGimbald { .. } | Self::Output(_) => {
                ExitCode::Unavailable
            }
        }
    }
}

/// Whom to ask.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    pub url: String,
    pub host: String,
    pub port: u16,
    authority: String,
    /// What stands before the paths of the window.
    base: String,
}

impl Target {
    pub fn parse(url: &str) -> Result<Self, ClientError> {
        let wrong = || ClientError::Url(url.to_owned());
        let uri: Uri = url.parse().map_err(|_| wrong())?;
        let authority = uri.authority().ok_or_else(wrong)?;
        if uri.scheme_str() != Some("http") || uri.query().is_some() || authority.host().is_empty() {
            return Err(wrong());
        }
        let port = match authority.as_str().strip_prefix(authority.host()) {
            Some("") => 80,
            Some(port) => {
                let port = port.strip_prefix(':').and_then(|port| port.parse().ok()); // no number, or none that fits
                port.filter(|port| *port != 0).ok_or_else(wrong)?
            }
            None => return Err(wrong()), // a user name stands before the host
        };
        let base = uri.path().trim_end_matches('/');
        let base = base.strip_suffix("/api/v1/status").unwrap_or(base);
        Ok(Self {
            url: url.to_owned(),
            host: authority.host().trim_start_matches('[').trim_end_matches(']').to_owned(),
            port,
            authority: authority.to_string(),
            base: base.to_owned(),
        })
    }

    /// The whole of a path below `/api/v1`.
    pub fn path(&self, rest: &str) -> String {
        format!("{}{API}{rest}", self.base)
    }

    /// Reads what is below `/api/v1` there.
    pub async fn get(&self, rest: &str) -> Result<Vec<u8>, ClientError> {
        let request = Request::get(self.path(rest)).body(Body::empty());
        self.within(READING, request).await
    }

    /// Asks for something there.
    pub async fn post(&self, rest: &str, token: &Token, body: Vec<u8>) -> Result<Vec<u8>, ClientError> {
        let request = Request::post(self.path(rest))
            .header(header::AUTHORIZATION, format!("Bearer {}", token.reveal()))
            .header(header::CONTENT_TYPE, "application/json")
            .header(header::CONTENT_LENGTH, body.len())
            .body(Body::from(body));
        self.within(ASKING, request).await
    }

    pub fn not_gimbald(&self, what: impl ToString) -> ClientError {
        ClientError::NotGimbald { url: self.url.clone(), what: what.to_string() }
    }

    async fn within(
        &self,
        within: Duration,
        request: Result<Request<Body>, axum::http::Error>,
    ) -> Result<Vec<u8>, ClientError> {
        let mut request = request.map_err(|_| ClientError::Url(self.url.clone()))?;
        let host = self.authority.parse().map_err(|_| ClientError::Url(self.url.clone()))?;
        request.headers_mut().insert(header::HOST, host);
        match timeout(within, self.converse(request)).await {
            Ok(result) => result,
            Err(_) => Err(ClientError::TimedOut { url: self.url.clone(), within }),
        }
    }

    async fn converse(&self, request: Request<Body>) -> Result<Vec<u8>, ClientError> {
        let url = || self.url.clone();
        let stream = TcpStream::connect((self.host.as_str(), self.port)).await;
        let stream = stream.map_err(|source| ClientError::Unreachable { url: url(), source })?;
        let (mut sender, connection) =
            http1::handshake(TokioIo::new(stream)).await.map_err(|error| self.not_gimbald(error))?;
        let conversation = async move {
            let answer = sender.send_request(request).await.map_err(|error| self.not_gimbald(error))?;
            let status = answer.status();
            let body = to_bytes(Body::new(answer.into_body()), ANSWER_BYTES).await;
            Ok((status, body.map_err(|error| self.not_gimbald(error))?))
        };
        // What breaks the connection breaks the conversation too, which tells it.
        let (answer, _) = tokio::join!(conversation, connection);
        let (status, body) = answer?;
        if status == StatusCode::OK {
            return Ok(body.to_vec());
        }
        match serde_json::from_slice::<Value>(&body).map(printable) {
            Ok(Value::Object(refusal)) => match refusal.get("error") {
                Some(Value::String(reason)) => {
                    let word = refusal.get("reason").and_then(Value::as_str).map(str::to_owned);
                    Err(ClientError::Refused { url: url(), status, reason: reason.clone(), word })
                }
                Some(_) | None => Err(self.not_gimbald(status)),
            },
            Ok(_) | Err(_) => Err(self.not_gimbald(status)),
        }
    }
}

/// Names come from devices: nothing in them may move the cursor or turn the writing round.
pub fn printable_text(text: &str) -> String {
    text.replace(commands_the_terminal, "\u{fffd}")
}

/// The same for every text in a value.
pub fn printable(value: Value) -> Value {
    match value {
        Value::String(text) => Value::String(printable_text(&text)),
        Value::Array(items) => Value::Array(items.into_iter().map(printable).collect()),
        Value::Object(entries) => {
            entries.into_iter().map(|(key, value)| (printable_text(&key), printable(value))).collect()
        }
        Value::Null | Value::Bool(_) | Value::Number(_) => value,
    }
}

fn commands_the_terminal(char: char) -> bool {
    char.is_control() || matches!(char, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}
