//! What the bridge must be told before it starts; built by `config`, checked there.

use std::collections::BTreeMap;
use std::time::Duration;

use crate::gimbals::settings::GimbalSettings;
use crate::manager::settings::ControlSettings;

/// The whole configuration of the core.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    pub system_id: SystemId,
    /// The system id adopted in an earlier run, used at once until the autopilot says otherwise.
    pub stored_system_id: Option<u8>,
    /// The gimbals that an earlier run had told to turn and not to stop, a line of each as it was to be kept: it had no time
    /// for that. Each is told to stop when it is heard.
    pub left_turning: Vec<String>,
    /// The ids that an earlier run gave to gimbals without an entry, a line of each as it was to be kept. Each gets them again.
    pub kept_ids: Vec<String>,
    pub links: Vec<LinkSettings>,
    pub gimbals: Vec<GimbalSettings>,
    pub control: ControlSettings,
    /// Gimbals are presented to the autopilot as gimbal devices of its own (D18).
    pub present_device: bool,
}

/// Where our system id comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SystemId {
    /// The autopilot's; [`FALLBACK_SYSTEM_ID`] when there is none.
    #[default]
    Auto,
    Fixed(u8),
}

/// Our system id when no autopilot was heard for ten seconds.
pub const FALLBACK_SYSTEM_ID: u8 = 1;

#[derive(Clone, Debug, PartialEq)]
pub struct LinkSettings {
    pub name: String,
    pub role: Role,
    /// As configured, to show it.
    pub endpoint: String,
    pub transport: Transport,
    /// We must send the first byte, or the other side never learns of us.
    pub speaks_first: bool,
    /// Least time between two messages of one id from one source towards this link.
    pub max_rates: BTreeMap<u32, Duration>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    Gimbal,
    Autopilot,
    Ground,
    Peer,
}

impl Role {
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gimbal => "gimbal",
            Self::Autopilot => "autopilot",
            Self::Ground => "ground",
            Self::Peer => "peer",
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// Each read is one datagram.
    Datagrams,
    /// Reads may cut frames anywhere.
    Stream,
    /// A stream whose output is paced to the baud rate (10 bits a byte).
    Serial { baud: u32 },
}
