//! Which ports a running daemon holds, and what it says of the gimbals on them.

use std::fmt;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::ports::Port;
use super::say;
use crate::bridge::snapshot::{GimbalSnapshot, LinkSnapshot};
use crate::commands::client::{ClientError, Target, printable_text};
use crate::commands::status;
use crate::endpoint::Endpoint;

/// The daemon's serial links, whose ports it opens again whenever they are free.
pub async fn by_daemon(daemon: &Target, errors: &mut impl Write) -> Vec<Held> {
    match status::snapshot(daemon).await {
        Ok(snapshot) => snapshot.links.iter().filter_map(|link| Held::of_link(link, &snapshot.gimbals)).collect(),
        Err(ClientError::Unreachable { .. }) => Vec::new(),
        Err(error) => {
            say(errors, format_args!("which ports a running gimbald has cannot be asked ({error}); locks tell"));
            Vec::new()
        }
    }
}

/// A port of the running daemon, and what that knows of it.
#[derive(Debug)]
pub struct Held {
    pub device: PathBuf,
    path: String,
    baud: u32,
    /// `up` or `down`.
    state: String,
    /// Somebody was heard there.
    pub is_understood: bool,
    pub gimbals: Vec<GimbalSnapshot>,
}

impl Held {
    fn of_link(link: &LinkSnapshot, gimbals: &[GimbalSnapshot]) -> Option<Self> {
        let Ok(Endpoint::Serial { path, baud }) = link.endpoint.parse() else { return None };
        // A path that leads nowhere leads to none of the ports that are there.
        let device = Port::at(Path::new(&path)).ok()?.device;
        let heard: Vec<&String> = link.peers.iter().flat_map(|peer| &peer.components).collect();
        let is_there = |gimbal: &&GimbalSnapshot| gimbal.device.as_ref().is_some_and(|device| heard.contains(&device));
        let gimbals = gimbals.iter().filter(is_there).cloned().collect();
        Some(Self { device, path, baud, state: link.state.clone(), is_understood: !heard.is_empty(), gimbals })
    }

    /// What there is to do where the daemon understands nothing: nobody but it can try the port while it runs.
    pub fn advice(&self) -> Option<String> {
        (!self.is_understood).then(|| {
            format!(
                "nothing that it understands was heard there at {} baud; to try the other rates, stop the service \
                 (sudo systemctl stop gimbald) and scan again",
                self.baud
            )
        })
    }
}

impl fmt::Display for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} baud, {}", self.path, self.baud, printable_text(&self.state))?;
        for gimbal in &self.gimbals {
            let generation = gimbal.details.generation.iter();
            let product = [&gimbal.vendor, &gimbal.model].into_iter().flatten();
            let firmware = gimbal.firmware.iter().map(|version| format!("firmware {version}"));
            let family = [gimbal.family.as_str()].into_iter().chain(generation.map(String::as_str)).collect::<Vec<_>>();
            let told = product.cloned().chain(firmware).chain([gimbal.condition().to_owned()]);
            let told = [family.join(" ")].into_iter().chain(told).collect::<Vec<_>>().join(", ");
            let device = gimbal.device.as_deref().unwrap_or_default();
            write!(f, "\n  {}: {}", printable_text(device), printable_text(&told))?;
        }
        Ok(())
    }
}
