//! What is wrong only together: names, references, ports, files.

use std::collections::BTreeMap;
use std::fs;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;

use crate::bridge::settings::Role;
use crate::channel::ChannelId;
use crate::endpoint::Endpoint;
use crate::gimbals::settings::Family;
use crate::links::serial_port;
use crate::token::Token;

use super::environment::spelling;
use super::numbering;
use super::problem::{Place, Problem};
use super::reader::{Located, bare};
use super::schema::{Configuration, Gimbal, Http, Link};
use super::settings::HttpSettings;
use super::suggestion;

/// The most links there may be. As many channels again are left for peers of links that have several.
const MAX_LINKS: usize = ChannelId::COUNT / 2;

/// Gives the token for control over HTTP, where a file of one is named.
pub(super) fn check(configuration: &Configuration, problems: &mut Vec<Problem>) -> Option<Token> {
    let Configuration { links, gimbals, autopilot, http, .. } = configuration;
    // A link section of the wrong kind has been reported.
    if links.is_empty() && !problems.iter().any(|problem| problem.key == "link") {
        problems.push(Problem {
            place: Place::File,
            key: "link".to_owned(),
            found: "missing".to_owned(),
            expected: "at least one [[link]] with name, role and endpoint".to_owned(),
        });
    }
    if let Some(link) = links.get(MAX_LINKS) {
        problems.push(Problem {
            place: link.place.clone(),
            key: "link".to_owned(),
            found: format!("link {} of {}", MAX_LINKS + 1, links.len()),
            expected: format!("at most {MAX_LINKS} links"),
        });
    }
    check_names(links.iter().filter_map(|link| link.name.as_ref()), problems);
    check_names(gimbals.iter().filter_map(|gimbal| gimbal.name.as_ref()), problems);
    let names: Vec<&str> = links.iter().filter_map(|link| link.name.as_ref()).map(|name| name.value.as_str()).collect();
    for link in gimbals.iter().filter_map(|gimbal| gimbal.link.as_ref()) {
        if !names.contains(&link.value.as_str()) {
            let hint = suggestion::hint(&link.value, names.iter().copied());
            let known: Vec<String> = names.iter().map(|name| bare(name)).collect();
            let expected = format!("the name of a link, one of {}{hint}", known.join(", "));
            problems.push(link.problem(format!("found {}", link.shown), expected));
        }
    }
    let presents = autopilot.present_device.as_ref().filter(|present| present.value);
    let has_autopilot = links.iter().any(|link| link.role.as_ref().is_none_or(|role| role.value == Role::Autopilot));
    if let Some(presents) = presents.filter(|_| !has_autopilot) {
        problems.push(presents.problem(format!("found {}", presents.shown), "false, or a link of role autopilot"));
    }
    gimbals.iter().for_each(|gimbal| check_family(gimbal, problems));
    numbering::check(gimbals, presents.is_some(), problems);
    // Every endpoint is compared with every other: not with those that cannot stay.
    check_endpoints(&links[..links.len().min(MAX_LINKS)], http, problems);
    read_token(http, problems)
}

/// A key that the gimbal's family does not know says nothing, whatever was meant by it. Where the family is found out,
/// every key may have its turn.
fn check_family(gimbal: &Gimbal, problems: &mut Vec<Problem>) {
    let Some(family) = gimbal.family.as_ref().filter(|family| family.value != Family::Auto) else { return };
    let of_v1 = [
        without_effect(gimbal.v1_sign.as_ref()),
        without_effect(gimbal.v1_report_sign.as_ref()),
        without_effect(gimbal.v1_configure.as_ref()),
        without_effect(gimbal.v1_radio_control.as_ref()),
    ];
    let of_gremsy = [
        without_effect(gimbal.gremsy_generation.as_ref()),
        without_effect(gimbal.gremsy_report_sign.as_ref()),
        without_effect(gimbal.retract_allowed.as_ref()),
        without_effect(gimbal.stow_pitch_deg.as_ref()),
        without_effect(gimbal.stow_yaw_deg.as_ref()),
    ];
    let of_v1 = of_v1.into_iter().flatten().map(|problem| (problem, Family::MavlinkV1));
    let of_gremsy = of_gremsy.into_iter().flatten().map(|problem| (problem, Family::Gremsy));
    for (problem, of) in of_v1.chain(of_gremsy).filter(|(_, of)| *of != family.value) {
        let found = format!("{}, which has no effect with family = \"{}\"", problem.found, family.value.name());
        let expected = format!("family = \"{}\" or \"auto\", or no such key", of.name());
        problems.push(Problem { found, expected, ..problem });
    }
}

fn without_effect<T>(key: Option<&Located<T>>) -> Option<Problem> {
    key.map(|key| key.problem(format!("found {}", key.shown), ""))
}

/// Names differ in more than a variable can tell.
fn check_names<'a>(names: impl Iterator<Item = &'a Located<String>>, problems: &mut Vec<Problem>) {
    let mut first: BTreeMap<String, &Located<String>> = BTreeMap::new();
    for name in names {
        match first.get(&spelling(&name.value)) {
            Some(earlier) => problems.push(name.problem(
                format!("found {}, the name in {}", name.shown, place(&earlier.place)),
                "a name that differs from all others in more than case and - or _",
            )),
            None => {
                first.insert(spelling(&name.value), name);
            }
        }
    }
}

fn check_endpoints(links: &[Link], http: &Http, problems: &mut Vec<Problem>) {
    let endpoints: Vec<&Located<Endpoint>> = links.iter().filter_map(|link| link.endpoint.as_ref()).collect();
    for (position, endpoint) in endpoints.iter().enumerate() {
        if let Some(earlier) = endpoints[..position].iter().find(|earlier| collide(&earlier.value, &endpoint.value)) {
            let (what, expected) = match endpoint.value {
                Endpoint::UdpIn(_) | Endpoint::TcpIn(_) if leaves(&earlier.value) => ("peer", OTHERS_PORT),
                Endpoint::UdpOut(_) | Endpoint::TcpOut(_) if !leaves(&earlier.value) => ("port", OTHERS_PORT),
                Endpoint::Serial { .. } => ("serial port", "a serial port of its own"),
                Endpoint::UdpIn(_) | Endpoint::TcpIn(_) => ("port", "a port of its own"),
                Endpoint::UdpOut(_) | Endpoint::UdpBroadcast(_) | Endpoint::TcpOut(_) => ("peer", "a peer of its own"),
            };
            let found = format!("found {}, the {what} of the link in {}", endpoint.shown, place(&earlier.place));
            problems.push(endpoint.problem(found, expected));
        }
    }
    for endpoint in &endpoints {
        if let Endpoint::Serial { path, .. } = &endpoint.value
            && let Some(what) = serial_port::leads_to_no_line(path)
        {
            let found = format!("found {}: {what}, where no gimbal can be", endpoint.shown);
            problems.push(endpoint.problem(found, "a serial port such as /dev/ttyUSB0"));
        }
    }
    let listen = http.listen.as_ref().map_or(HttpSettings::DEFAULT_LISTEN, |listen| listen.value);
    for endpoint in endpoints {
        if let Endpoint::TcpIn(address) = endpoint.value
            && same_port(address, listen)
        {
            let found = format!("found {}, the port of http.listen", endpoint.shown);
            problems.push(endpoint.problem(found, "a port of its own"));
        }
    }
}

/// A link to another link of ours would send round and round what it gets.
const OTHERS_PORT: &str = "the port of another program at one end";

/// Whether it speaks to a peer that it names.
fn leaves(endpoint: &Endpoint) -> bool {
    matches!(endpoint, Endpoint::UdpOut(_) | Endpoint::UdpBroadcast(_) | Endpoint::TcpOut(_))
}

/// Two links cannot both work.
fn collide(a: &Endpoint, b: &Endpoint) -> bool {
    match (a, b) {
        (Endpoint::Serial { path: a, .. }, Endpoint::Serial { path: b, .. }) => device(a) == device(b),
        (Endpoint::UdpIn(a), Endpoint::UdpIn(b)) | (Endpoint::TcpIn(a), Endpoint::TcpIn(b)) => same_port(*a, *b),
        (Endpoint::UdpIn(bound), Endpoint::UdpOut(peer))
        | (Endpoint::UdpOut(peer), Endpoint::UdpIn(bound))
        | (Endpoint::TcpIn(bound), Endpoint::TcpOut(peer))
        | (Endpoint::TcpOut(peer), Endpoint::TcpIn(bound)) => leads_to(*peer, *bound),
        (a, b) => a == b,
    }
}

/// The device itself where it is there; `/dev/serial0` and the like are links to others.
fn device(path: &str) -> PathBuf {
    // A device that is not there yet keeps its name.
    fs::canonicalize(path).unwrap_or_else(|_| PathBuf::from(path))
}

/// Whether what is sent to `peer` arrives at a port that this computer has bound.
fn leads_to(peer: SocketAddr, bound: SocketAddr) -> bool {
    let here = peer.ip() == bound.ip() || (bound.ip().is_unspecified() && peer.ip().is_loopback());
    peer.port() == bound.port() && here
}

/// Both cannot be bound; port 0 stands for any free port.
fn same_port(a: SocketAddr, b: SocketAddr) -> bool {
    let any = |address: IpAddr| address.is_unspecified();
    a.port() == b.port() && a.port() != 0 && (a.ip() == b.ip() || any(a.ip()) || any(b.ip()))
}

/// Whoever can read the token can steer the gimbal.
fn read_token(http: &Http, problems: &mut Vec<Problem>) -> Option<Token> {
    let file = http.token_file.as_ref()?;
    match Token::read_guarded(&file.value) {
        Ok(token) => Some(token),
        Err(error) => {
            problems.push(file.problem(format!("found {}, which {error}", file.shown), Token::EXPECTED));
            None
        }
    }
}

fn place(place: &Place) -> String {
    match place {
        Place::File => "the file".to_owned(),
        Place::Line(line) => format!("line {line}"),
        Place::Variable(name) => name.clone(),
    }
}
