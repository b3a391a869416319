//! The checked configuration, as the daemon takes it.

use std::collections::BTreeMap;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use crate::bridge::settings::{LinkSettings, Role, Settings, Transport};
use crate::endpoint::Endpoint;
use crate::geometry::Angle;
use crate::gimbals::gremsy::config::GremsySettings;
use crate::gimbals::mavlink_v1::config::V1Settings;
use crate::gimbals::settings::GimbalSettings;
use crate::manager::settings::ControlSettings;
use crate::token::Token;

use super::reader::Located;
use super::schema::{Configuration, Control, Gimbal, Http, Link, Roi};

/// Everything that `gimbald run` must be told.
#[derive(Clone, Debug, PartialEq)]
pub struct DaemonSettings {
    pub core: Settings,
    /// One for each link of `core`, in the same order.
    pub endpoints: Vec<Endpoint>,
    pub http: Option<HttpSettings>,
    pub directories: Directories,
}

/// Where something is kept from one start to the next; nowhere when unset.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Directories {
    /// The adopted system id, and the ids that gimbals were given, for good.
    pub state: Option<PathBuf>,
    /// Which gimbals were told to turn, until the next boot.
    pub runtime: Option<PathBuf>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HttpSettings {
    pub listen: SocketAddr,
    /// Who has it may control gimbals; without one nobody may.
    pub token: Option<Token>,
}

impl HttpSettings {
    /// Where the page is when the configuration does not say.
    pub const DEFAULT_LISTEN: SocketAddr = SocketAddr::new(std::net::IpAddr::V4(Ipv4Addr::LOCALHOST), 8080);
}

/// What those who ask a running daemon something need of its configuration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WindowSettings {
    pub listen: SocketAddr,
    /// Who can read it may control gimbals.
    pub token_file: Option<PathBuf>,
}

/// Turns a configuration without problems into settings; unset keys get their defaults here.
pub(super) fn build(configuration: Configuration, token: Option<Token>, directories: Directories) -> DaemonSettings {
    let Configuration { vehicle, links, gimbals, autopilot, control, roi, http } = configuration;
    let (links, endpoints): (Vec<LinkSettings>, Vec<Endpoint>) = links.into_iter().map(link).unzip();
    let gimbals = gimbals.into_iter().map(|entry| gimbal(entry, &links)).collect();
    DaemonSettings {
        core: Settings {
            system_id: value_or(vehicle.system_id, Settings::default().system_id),
            stored_system_id: None,
            left_turning: Vec::new(),
            kept_ids: Vec::new(),
            links,
            gimbals,
            control: self::control(control, roi),
            present_device: value_or(autopilot.present_device, Settings::default().present_device),
        },
        endpoints,
        http: Some(self::http(http, token)),
        directories,
    }
}

fn value_or<T>(located: Option<Located<T>>, default: T) -> T {
    located.map_or(default, |located| located.value)
}

fn degrees(located: Located<f64>) -> Angle {
    Angle::from_degrees(located.value)
}

fn required<T>(located: Option<Located<T>>) -> T {
    located.expect("a missing required key is a problem, and settings are built when there is none").value
}

fn link(link: Link) -> (LinkSettings, Endpoint) {
    let endpoint = required(link.endpoint);
    let settings = LinkSettings {
        max_rates: link.max_rates.into_iter().collect(),
        ..link_on(required(link.name), required(link.role), &endpoint)
    };
    (settings, endpoint)
}

/// What the core must know of a link on `endpoint`, without limits to its rates.
pub fn link_on(name: String, role: Role, endpoint: &Endpoint) -> LinkSettings {
    let (transport, speaks_first) = match *endpoint {
        Endpoint::Serial { baud, .. } => (Transport::Serial { baud }, false),
        Endpoint::UdpIn(_) => (Transport::Datagrams, false),
        Endpoint::UdpOut(_) | Endpoint::UdpBroadcast(_) => (Transport::Datagrams, true),
        Endpoint::TcpIn(_) => (Transport::Stream, false),
        Endpoint::TcpOut(_) => (Transport::Stream, true),
    };
    LinkSettings { name, role, endpoint: endpoint.to_string(), transport, speaks_first, max_rates: BTreeMap::new() }
}

fn gimbal(gimbal: Gimbal, links: &[LinkSettings]) -> GimbalSettings {
    let default = GimbalSettings::found(required(gimbal.name));
    GimbalSettings {
        family: value_or(gimbal.family, default.family),
        link: gimbal.link.and_then(|wanted| links.iter().position(|link| link.name == wanted.value)),
        component_id: gimbal.component_id.map(|id| id.value),
        manager_component_id: gimbal.manager_component_id.map(|id| id.value),
        takeover: value_or(gimbal.takeover, default.takeover),
        setpoint_rate_hz: value_or(gimbal.setpoint_rate_hz, default.setpoint_rate_hz),
        device_yaw_frame: value_or(gimbal.device_yaw_frame, default.device_yaw_frame),
        v1: V1Settings {
            sign: value_or(gimbal.v1_sign, default.v1.sign),
            report_sign: value_or(gimbal.v1_report_sign, default.v1.report_sign),
            configures: value_or(gimbal.v1_configure, default.v1.configures),
            radio_control: value_or(gimbal.v1_radio_control, default.v1.radio_control),
        },
        v1_status: value_or(gimbal.v1_status, default.v1_status),
        gremsy: GremsySettings {
            generation: value_or(gimbal.gremsy_generation, default.gremsy.generation),
            retract_allowed: value_or(gimbal.retract_allowed, default.gremsy.retract_allowed),
            stow_pitch: gimbal.stow_pitch_deg.map_or(default.gremsy.stow_pitch, degrees),
            stow_yaw: gimbal.stow_yaw_deg.map_or(default.gremsy.stow_yaw, degrees),
            report_sign: gimbal.gremsy_report_sign.and_then(|sign| sign.value),
        },
        manual_pitch_rate_dps: value_or(gimbal.manual_pitch_rate_dps, default.manual_pitch_rate_dps),
        manual_yaw_rate_dps: value_or(gimbal.manual_yaw_rate_dps, default.manual_yaw_rate_dps),
        name: default.name,
    }
}

fn control(control: Control, roi: Roi) -> ControlSettings {
    let default = ControlSettings::default();
    ControlSettings {
        open_when_unclaimed: value_or(control.open_when_unclaimed, default.open_when_unclaimed),
        lease_timeout: value_or(control.lease_timeout, default.lease_timeout),
        rate_timeout: value_or(control.rate_timeout, default.rate_timeout),
        command_rate_timeout: value_or(control.command_rate_timeout, default.command_rate_timeout),
        firewall: value_or(control.firewall, default.firewall),
        snoop_autopilot: value_or(control.snoop_autopilot, default.snoop_autopilot),
        accept_centidegrees: value_or(control.accept_centidegrees, default.accept_centidegrees),
        px4_release_quirk: value_or(control.px4_release_quirk, default.px4_release_quirk),
        synthesize_286: value_or(control.synthesize_286, default.synthesize_286),
        roi_altitude: value_or(roi.altitude_reference, default.roi_altitude),
    }
}

pub(super) fn window(http: Http) -> WindowSettings {
    WindowSettings {
        listen: value_or(http.listen, HttpSettings::DEFAULT_LISTEN),
        token_file: http.token_file.map(|file| file.value),
    }
}

fn http(http: Http, token: Option<Token>) -> HttpSettings {
    HttpSettings { listen: value_or(http.listen, HttpSettings::DEFAULT_LISTEN), token }
}
