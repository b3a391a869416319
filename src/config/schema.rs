//! Every section and key of the configuration file, and what each value must be by itself.
//!
//! A function for each section reads its keys; that reading is the one list of keys there is.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use crate::bridge::settings::{Role, SystemId};
use crate::endpoint::{Endpoint, EndpointError};
use crate::gimbals::gremsy::driver::Generation;
use crate::gimbals::mavlink_v1::config::V1RadioControl;
use crate::gimbals::settings::{DeviceYawFrame, Family, Takeover};
use crate::gimbals::signs::Signs;
use crate::manager::settings::{AltitudeReference, Firewall};

use super::document::{Raw, Table, Value};
use super::problem::{Place, Problem};
use super::reader::{Expected, Located, Section, bare, flag, is_name, number, text, whole, word};
use super::signs::{signs, signs_or_auto};
use super::suggestion;

const ROLES: &[(&str, Role)] = &[
    (Role::Gimbal.name(), Role::Gimbal),
    (Role::Autopilot.name(), Role::Autopilot),
    (Role::Ground.name(), Role::Ground),
    (Role::Peer.name(), Role::Peer),
];
const FAMILIES: &[(&str, Family)] = &[
    (Family::Auto.name(), Family::Auto),
    (Family::MavlinkV2.name(), Family::MavlinkV2),
    (Family::MavlinkV1.name(), Family::MavlinkV1),
    (Family::Gremsy.name(), Family::Gremsy),
];
const TAKEOVERS: &[(&str, Takeover)] = &[
    (Takeover::Open.name(), Takeover::Open),
    (Takeover::Ask.name(), Takeover::Ask),
    (Takeover::Priority.name(), Takeover::Priority),
    (Takeover::Exclusive.name(), Takeover::Exclusive),
];
const YAW_FRAMES: &[(&str, DeviceYawFrame)] =
    &[("auto", DeviceYawFrame::Auto), ("vehicle", DeviceYawFrame::Vehicle), ("earth", DeviceYawFrame::Earth)];
const V1_RADIO_CONTROLS: &[(&str, V1RadioControl)] = &[
    (V1RadioControl::None.name(), V1RadioControl::None),
    (V1RadioControl::Silence.name(), V1RadioControl::Silence),
    (V1RadioControl::Mode.name(), V1RadioControl::Mode),
];
const GENERATIONS: &[(&str, Option<Generation>)] =
    &[("auto", None), (Generation::V1.name(), Some(Generation::V1)), (Generation::V2.name(), Some(Generation::V2))];
const UNCLAIMED: &[(&str, bool)] = &[("open", true), ("closed", false)];
const FIREWALLS: &[(&str, Firewall)] = &[("on", Firewall::On), ("warn", Firewall::Warn)];
const SYNTHESIS: &[(&str, bool)] = &[("auto", true), ("off", false)];
const ALTITUDES: &[(&str, AltitudeReference)] =
    &[("auto", AltitudeReference::Auto), ("amsl", AltitudeReference::Amsl), ("relative", AltitudeReference::Relative)];
const ENDPOINT_KINDS: [&str; 6] = ["serial", "udpin", "udpout", "udpbcast", "tcpin", "tcpout"];

/// Message ids are 24 bits wide.
const LAST_MESSAGE_ID: u32 = 0xFF_FFFF;

/// The file as written, each value right by itself. What was missing or wrong is `None`.
#[derive(Debug, Default)]
pub(super) struct Configuration {
    pub vehicle: Vehicle,
    pub links: Vec<Link>,
    pub gimbals: Vec<Gimbal>,
    pub autopilot: Autopilot,
    pub control: Control,
    pub roi: Roi,
    pub http: Http,
}

#[derive(Debug, Default)]
pub(super) struct Vehicle {
    pub system_id: Option<Located<SystemId>>,
}

#[derive(Debug)]
pub(super) struct Link {
    /// The `[[link]]` line.
    pub place: Place,
    pub name: Option<Located<String>>,
    pub role: Option<Located<Role>>,
    pub endpoint: Option<Located<Endpoint>>,
    /// Message id and the least time between two.
    pub max_rates: Vec<(u32, Duration)>,
}

#[derive(Debug)]
pub(super) struct Gimbal {
    /// The `[[gimbal]]` line.
    pub place: Place,
    pub name: Option<Located<String>>,
    pub family: Option<Located<Family>>,
    pub link: Option<Located<String>>,
    pub component_id: Option<Located<u8>>,
    pub manager_component_id: Option<Located<u8>>,
    pub takeover: Option<Located<Takeover>>,
    pub setpoint_rate_hz: Option<Located<u8>>,
    pub device_yaw_frame: Option<Located<DeviceYawFrame>>,
    pub v1_sign: Option<Located<Signs>>,
    pub v1_report_sign: Option<Located<Signs>>,
    pub v1_configure: Option<Located<bool>>,
    pub v1_radio_control: Option<Located<V1RadioControl>>,
    pub v1_status: Option<Located<bool>>,
    pub gremsy_report_sign: Option<Located<Option<Signs>>>,
    pub gremsy_generation: Option<Located<Option<Generation>>>,
    pub retract_allowed: Option<Located<bool>>,
    pub stow_pitch_deg: Option<Located<f64>>,
    pub stow_yaw_deg: Option<Located<f64>>,
    pub manual_pitch_rate_dps: Option<Located<f64>>,
    pub manual_yaw_rate_dps: Option<Located<f64>>,
}

#[derive(Debug, Default)]
pub(super) struct Autopilot {
    pub present_device: Option<Located<bool>>,
}

#[derive(Debug, Default)]
pub(super) struct Control {
    pub open_when_unclaimed: Option<Located<bool>>,
    pub lease_timeout: Option<Located<Duration>>,
    pub rate_timeout: Option<Located<Duration>>,
    pub command_rate_timeout: Option<Located<Duration>>,
    pub firewall: Option<Located<Firewall>>,
    pub snoop_autopilot: Option<Located<bool>>,
    pub accept_centidegrees: Option<Located<bool>>,
    pub px4_release_quirk: Option<Located<bool>>,
    pub synthesize_286: Option<Located<bool>>,
}

#[derive(Debug, Default)]
pub(super) struct Roi {
    pub altitude_reference: Option<Located<AltitudeReference>>,
}

#[derive(Debug, Default)]
pub(super) struct Http {
    pub listen: Option<Located<SocketAddr>>,
    pub token_file: Option<Located<PathBuf>>,
}

fn vehicle(section: &mut Section<'_>) -> Vehicle {
    Vehicle { system_id: section.read("system_id", system_id) }
}

fn link(section: &mut Section<'_>, place: Place) -> Link {
    Link {
        place,
        name: section.required("name", "a name of letters, digits, - and _", name),
        role: section.required("role", "gimbal, autopilot, ground or peer", |raw| word(raw, ROLES)),
        endpoint: section.required("endpoint", "an endpoint, for example udpin:0.0.0.0:14550", endpoint),
        max_rates: section.entries("max_rate_hz", "a table such as { 285 = 4 }", max_rate),
    }
}

fn gimbal(section: &mut Section<'_>, place: Place) -> Gimbal {
    Gimbal {
        place,
        name: section.required("name", "a name of letters, digits, - and _", name),
        family: section.read("family", |raw| word(raw, FAMILIES)),
        link: section.read("link", |raw| {
            text(raw).map(str::to_owned).ok_or_else(|| Expected::new("the name of a link as text"))
        }),
        component_id: section.read("component_id", |raw| whole(raw, 7..=255)),
        manager_component_id: section.read("manager_component_id", |raw| whole(raw, 7..=255)),
        takeover: section.read("takeover", |raw| word(raw, TAKEOVERS)),
        setpoint_rate_hz: section.read("setpoint_rate_hz", |raw| whole(raw, 5..=50)),
        device_yaw_frame: section.read("device_yaw_frame", |raw| word(raw, YAW_FRAMES)),
        v1_sign: section.read("v1_sign", signs),
        v1_report_sign: section.read("v1_report_sign", signs),
        v1_configure: section.read("v1_configure", flag),
        v1_radio_control: section.read("v1_radio_control", |raw| word(raw, V1_RADIO_CONTROLS)),
        v1_status: section.read("v1_status", flag),
        gremsy_report_sign: section.read("gremsy_report_sign", signs_or_auto),
        gremsy_generation: section.read("gremsy_generation", |raw| word(raw, GENERATIONS)),
        retract_allowed: section.read("retract_allowed", flag),
        stow_pitch_deg: section.read("stow_pitch_deg", stow_pitch),
        stow_yaw_deg: section.read("stow_yaw_deg", stow_yaw),
        manual_pitch_rate_dps: section.read("manual_pitch_rate_dps", manual_rate),
        manual_yaw_rate_dps: section.read("manual_yaw_rate_dps", manual_rate),
    }
}

fn autopilot(section: &mut Section<'_>) -> Autopilot {
    Autopilot { present_device: section.read("present_device", flag) }
}

fn control(section: &mut Section<'_>) -> Control {
    Control {
        open_when_unclaimed: section.read("unclaimed", |raw| word(raw, UNCLAIMED)),
        lease_timeout: section.read("lease_timeout_s", timeout),
        rate_timeout: section.read("rate_timeout_s", timeout),
        command_rate_timeout: section.read("command_rate_timeout_s", timeout_or_never),
        firewall: section.read("firewall", |raw| word(raw, FIREWALLS)),
        snoop_autopilot: section.read("snoop_autopilot", flag),
        accept_centidegrees: section.read("accept_centidegrees", flag),
        px4_release_quirk: section.read("px4_release_quirk", flag),
        synthesize_286: section.read("synthesize_286", |raw| word(raw, SYNTHESIS)),
    }
}

fn roi(section: &mut Section<'_>) -> Roi {
    Roi { altitude_reference: section.read("altitude_reference", |raw| word(raw, ALTITUDES)) }
}

fn http(section: &mut Section<'_>) -> Http {
    Http { listen: section.read("listen", listen), token_file: section.read("token_file", absolute_path) }
}

/// Every section with its keys, in the order they are documented.
pub fn keys() -> Vec<(&'static str, Vec<&'static str>)> {
    fn asked<T>(name: &'static str, read: impl FnOnce(&mut Section<'_>) -> T) -> (&'static str, Vec<&'static str>) {
        // What an empty section lacks is no news here.
        let mut problems = Vec::new();
        let mut section = Section::new(name.to_owned(), Place::File, Table::new(), &mut problems);
        read(&mut section);
        (name, section.finish())
    }
    vec![
        asked("vehicle", vehicle),
        asked("link", |section| link(section, Place::File)),
        asked("gimbal", |section| gimbal(section, Place::File)),
        asked("autopilot", autopilot),
        asked("control", control),
        asked("roi", roi),
        asked("http", http),
    ]
}

/// Reads the whole file, variables included, and reports every value that is wrong by itself.
pub(super) fn read(mut root: Table, problems: &mut Vec<Problem>) -> Configuration {
    let configuration = Configuration {
        vehicle: single(&mut root, "vehicle", problems, vehicle).unwrap_or_default(),
        links: several(&mut root, "link", problems, link),
        gimbals: several(&mut root, "gimbal", problems, gimbal),
        autopilot: single(&mut root, "autopilot", problems, autopilot).unwrap_or_default(),
        control: single(&mut root, "control", problems, control).unwrap_or_default(),
        roi: single(&mut root, "roi", problems, roi).unwrap_or_default(),
        http: single(&mut root, "http", problems, http).unwrap_or_default(),
    };
    let sections: Vec<&str> = keys().into_iter().map(|(section, _)| section).collect();
    for (key, Value { place, .. }) in root {
        let hint = suggestion::hint(&key, sections.iter().copied());
        problems.push(Problem {
            place,
            key: bare(&key),
            found: "unknown key".to_owned(),
            expected: format!("one of {}{hint}", sections.join(", ")),
        });
    }
    configuration
}

/// `[name]`.
fn single<T>(
    root: &mut Table,
    name: &'static str,
    problems: &mut Vec<Problem>,
    read: impl FnOnce(&mut Section<'_>) -> T,
) -> Option<T> {
    let Value { place, raw } = root.remove(name)?;
    let Raw::Table(table) = raw else {
        problems.push(wrong_section(place, name, &raw, format!("a table [{name}]")));
        return None;
    };
    let mut section = Section::new(name.to_owned(), place, table, problems);
    let content = read(&mut section);
    section.finish();
    Some(content)
}

/// `[[name]]`, as often as it is there.
fn several<T>(
    root: &mut Table,
    name: &'static str,
    problems: &mut Vec<Problem>,
    read: impl Fn(&mut Section<'_>, Place) -> T,
) -> Vec<T> {
    let Some(Value { place, raw }) = root.remove(name) else { return Vec::new() };
    let Raw::Array(items) = raw else {
        problems.push(wrong_section(place, name, &raw, format!("one or more tables [[{name}]]")));
        return Vec::new();
    };
    let mut contents = Vec::new();
    for Value { place, raw } in items {
        let Raw::Table(table) = raw else {
            problems.push(wrong_section(place, name, &raw, format!("one or more tables [[{name}]]")));
            continue;
        };
        let path = match table.get("name").map(|value| &value.raw) {
            Some(Raw::Text(given)) if is_name(given) => format!("{name}.{}", bare(given)),
            _ => name.to_owned(),
        };
        let mut section = Section::new(path, place.clone(), table, problems);
        contents.push(read(&mut section, place));
        section.finish();
    }
    contents
}

fn wrong_section(place: Place, name: &str, raw: &Raw, expected: String) -> Problem {
    Problem { place, key: name.to_owned(), found: format!("found {raw}"), expected }
}

fn system_id(raw: &Raw) -> Result<SystemId, Expected> {
    if text(raw) == Some("auto") {
        return Ok(SystemId::Auto);
    }
    whole(raw, 1..=255).map(SystemId::Fixed).map_err(|Expected(range)| Expected(format!("\"auto\" or {range}")))
}

fn name(raw: &Raw) -> Result<String, Expected> {
    text(raw)
        .filter(|given| is_name(given))
        .map(str::to_owned)
        .ok_or_else(|| Expected::new("a name of letters, digits, - and _"))
}

fn endpoint(raw: &Raw) -> Result<Endpoint, Expected> {
    let given = text(raw).ok_or_else(|| Expected::new("an endpoint as text, for example \"udpin:0.0.0.0:14550\""))?;
    given.parse().map_err(|error| match error {
        EndpointError::Kind => {
            let kind = given.split(':').next().unwrap_or_default();
            let kinds = ENDPOINT_KINDS.join(", ");
            Expected(format!("KIND:… with KIND one of {kinds}{}", suggestion::hint(kind, ENDPOINT_KINDS)))
        }
        EndpointError::Serial => Expected::new("serial:PATH:BAUD, for example serial:/dev/ttyUSB0:115200"),
        EndpointError::Baud(_) => Expected::new("a baud rate from 1200 to 4000000 behind the last colon"),
        EndpointError::Address(_) => {
            Expected::new("an IP address and a port behind the first colon, for example 127.0.0.1:14550 or [::1]:14550")
        }
        EndpointError::NoPort => Expected::new("a port from 1 to 65535"),
    })
}

/// An entry of `max_rate_hz` as message id and time between two messages.
fn max_rate(key: &str, raw: &Raw) -> Result<(u32, Duration), Expected> {
    // Only the plain spelling, so that no id can be there twice.
    let id = key.parse().ok().filter(|id: &u32| *id <= LAST_MESSAGE_ID && id.to_string() == key);
    let id = id.ok_or_else(|| Expected(format!("a message id from 0 to {LAST_MESSAGE_ID} as the key")))?;
    match number(raw, &(0.001..=1000.0)) {
        Some(rate) => Ok((id, Duration::from_secs_f64(1.0 / rate))),
        None => Err(Expected::new("a number of messages per second from 0.001 to 1000")),
    }
}

/// The longest time-out that can be configured, in seconds.
const LONGEST_S: f64 = 3600.0;
/// The shortest, which is also the step of the core's reports; what is shorter would round to none.
const SHORTEST_S: f64 = 0.001;

fn timeout(raw: &Raw) -> Result<Duration, Expected> {
    number(raw, &(SHORTEST_S..=LONGEST_S))
        .map(Duration::from_secs_f64)
        .ok_or_else(|| Expected(format!("a number of seconds from {SHORTEST_S} to {LONGEST_S}")))
}

fn timeout_or_never(raw: &Raw) -> Result<Duration, Expected> {
    if number(raw, &(0.0..=0.0)).is_some() {
        return Ok(Duration::ZERO);
    }
    timeout(raw).map_err(|Expected(range)| Expected(format!("{range}, or 0 for never")))
}

fn manual_rate(raw: &Raw) -> Result<f64, Expected> {
    number(raw, &(0.1..=720.0)).ok_or_else(|| Expected::new("a number of degrees per second from 0.1 to 720"))
}

fn stow_pitch(raw: &Raw) -> Result<f64, Expected> {
    number(raw, &(-90.0..=90.0)).ok_or_else(|| Expected::new("a number of degrees from -90 to 90"))
}

fn stow_yaw(raw: &Raw) -> Result<f64, Expected> {
    number(raw, &(-180.0..=180.0)).ok_or_else(|| Expected::new("a number of degrees from -180 to 180"))
}

fn listen(raw: &Raw) -> Result<SocketAddr, Expected> {
    text(raw)
        .and_then(|given| given.parse().ok()) // the reason would only repeat what is expected
        .ok_or_else(|| Expected::new("an IP address and a port as text, for example \"127.0.0.1:8080\""))
}

fn absolute_path(raw: &Raw) -> Result<PathBuf, Expected> {
    text(raw)
        .map(PathBuf::from)
        .filter(|path| path.is_absolute())
        .ok_or_else(|| Expected::new("an absolute path as text, for example \"/etc/gimbald/http-token\""))
}
