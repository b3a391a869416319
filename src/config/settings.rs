//! The configuration after it was checked, as the daemon uses it.

use std::net::SocketAddr;
use std::path::PathBuf;

use crate::bridge;
use crate::endpoint::Endpoint;

/// Everything that a running daemon is told before it starts.
#[derive(Clone, Debug, PartialEq)]
pub struct DaemonSettings {
    pub core: bridge::settings::Settings,
    /// In the order of the core's links.
    pub endpoints: Vec<Endpoint>,
    /// No page and no status without it.
    pub http: Option<HttpSettings>,
    /// Where the adopted system id is kept.
    pub state_directory: Option<PathBuf>,
}

/// The `[http]` part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HttpSettings {
    pub listen: SocketAddr,
    /// Holds the token that permits control; without it the window is read-only.
    pub token_file: Option<PathBuf>,
}
