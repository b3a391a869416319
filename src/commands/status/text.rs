//! A snapshot as text that fits a terminal.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::bridge::snapshot::{
    EventSnapshot, GimbalSnapshot, LinkSnapshot, SetpointSnapshot, Snapshot, VehicleSnapshot,
};
use crate::http::readiness::Readiness;

/// So many events fit a terminal beside the rest.
const SHOWN_EVENTS: usize = 8;

/// The whole snapshot, for a person.
pub fn report(snapshot: &Snapshot) -> String {
    let mut out = Lines::default();
    let system = match snapshot.system_id {
        Some(id) => format!("system {id}"),
        None => "system id not settled yet".to_owned(),
    };
    let readiness = Readiness::of(snapshot);
    let ready = if readiness.ready { "ready" } else { "NOT READY" };
    out.line(0, &format!("gimbald {}  {system}  up {}  {ready}", snapshot.version, duration(snapshot.uptime_s)));
    for reason in &readiness.reasons {
        out.line(1, reason);
    }
    if !snapshot.conflicts.is_empty() {
        out.heading("conflicts");
        for conflict in &snapshot.conflicts {
            out.line(1, conflict);
        }
    }
    out.heading("links");
    links(&mut out, &snapshot.links);
    vehicle(&mut out, &snapshot.vehicle);
    if snapshot.gimbals.is_empty() {
        out.heading("gimbals");
        out.line(1, "none yet");
    }
    for each in &snapshot.gimbals {
        gimbal(&mut out, each);
    }
    if !snapshot.events.is_empty() {
        out.heading("events");
        events(&mut out, &snapshot.events);
    }
    out.0
}

/// One gimbal, for a person.
pub fn gimbal_report(gimbal: &GimbalSnapshot) -> String {
    let mut out = Lines::default();
    self::gimbal(&mut out, gimbal);
    super::details::details(&mut out, &gimbal.details);
    out.0.trim_start().to_owned()
}

fn links(out: &mut Lines, links: &[LinkSnapshot]) {
    if links.is_empty() {
        return out.line(1, "none is configured");
    }
    let mut rows = vec![["NAME", "ROLE", "STATE", "RECEIVED", "SENT", "DROPPED", "ENDPOINT"].map(str::to_owned)];
    rows.extend(links.iter().map(|link| {
        [
            link.name.clone(),
            link.role.clone(),
            link.state.clone(),
            format!("{} ({})", link.rx_frames, size(link.rx_bytes)),
            format!("{} ({})", link.tx_frames, size(link.tx_bytes)),
            link.dropped_frames.to_string(),
            link.endpoint.clone(),
        ]
    }));
    let mut rows = aligned(&rows).into_iter();
    if let Some(titles) = rows.next() {
        out.line(1, &titles);
    }
    for (link, row) in links.iter().zip(rows) {
        out.line(1, &row);
        for peer in &link.peers {
            let who = if peer.components.is_empty() { "nobody yet".to_owned() } else { peer.components.join(" ") };
            out.line(2, &format!("heard    {who} at {}, {}", peer.address, age(peer.age_ms)));
        }
        if !link.dropped.is_empty() {
            out.line(2, &format!("dropped  {}", counts(&link.dropped)));
        }
        if link.crc_errors > 0 || link.resync_bytes > 0 {
            out.line(2, &format!("noise    {} broken frames, {}", link.crc_errors, size(link.resync_bytes)));
        }
    }
}

fn vehicle(out: &mut Lines, vehicle: &VehicleSnapshot) {
    let heard = if vehicle.alive { "alive" } else { "not heard" };
    let system = vehicle.system_id.map(|id| format!("  system {id}"));
    let autopilot = vehicle.autopilot.as_ref().map(|name| format!("  {name}"));
    out.heading(&format!("vehicle  {heard}{}{}", autopilot.unwrap_or_default(), system.unwrap_or_default()));
    out.fact(
        "attitude",
        &format!(
            "roll {}  pitch {}  heading {}  {}",
            degrees(vehicle.roll_deg),
            degrees(vehicle.pitch_deg),
            degrees(vehicle.heading_deg),
            age(vehicle.attitude_age_ms)
        ),
    );
    out.fact(
        "position",
        &format!(
            "{}  {}  {}",
            place(vehicle.latitude_deg, vehicle.longitude_deg),
            altitude(vehicle.altitude_amsl_m),
            age(vehicle.position_age_ms)
        ),
    );
    let told = match vehicle.state_for_gimbal.as_deref() {
        Some("synthesized") => "get its state from us",
        Some(_) => "get its state",
        None => "",
    };
    out.fact_unless_empty("gimbals", told);
    out.fact_unless_empty("stale", &vehicle.stale.join(" "));
}

fn gimbal(out: &mut Lines, gimbal: &GimbalSnapshot) {
    let device = gimbal.device.as_ref().map(|id| format!("  device {id}")).unwrap_or_default();
    let manager = gimbal.manager_component_id;
    let title = format!("gimbal {}  {}  {}{device}  manager {manager}", gimbal.name, gimbal.condition(), gimbal.family);
    out.heading(&title);
    let product = [&gimbal.vendor, &gimbal.model, &gimbal.firmware];
    let product = product.into_iter().flatten().map(String::as_str).collect::<Vec<_>>().join(" ");
    out.fact_unless_empty("product", &product);
    let attitude = &gimbal.attitude;
    out.fact(
        "attitude",
        &format!(
            "roll {}  pitch {}  yaw {} from the nose, {} from North  {}",
            degrees(attitude.roll_deg),
            degrees(attitude.pitch_deg),
            degrees(attitude.yaw_vehicle_deg),
            degrees(attitude.yaw_earth_deg),
            if attitude.assumed { "assumed: it does not tell".to_owned() } else { age(attitude.age_ms) }
        ),
    );
    let held = |id: &Option<String>, ms: Option<u64>| {
        let since = ms.map(|ms| format!(" for {}", duration(ms as f64 / 1_000.0))).unwrap_or_default();
        id.as_ref().map(|id| format!("{id}{since}"))
    };
    let primary = held(&gimbal.primary, gimbal.primary_age_ms).unwrap_or_else(|| "nobody".to_owned());
    let lender = gimbal.lender.as_ref().map(|id| format!("  borrowed from {id}")).unwrap_or_default();
    let secondary = held(&gimbal.secondary, gimbal.secondary_age_ms);
    let secondary = secondary.map(|held| format!("  secondary {held}")).unwrap_or_default();
    out.fact("control", &format!("{primary}{lender}{secondary}"));
    if let Some(demand) = &gimbal.setpoint {
        out.fact("setpoint", &setpoint(demand));
    }
    if let Some(presented) = &gimbal.presented {
        let stream = match presented.stream.as_str() {
            "silent" => "does not steer it".to_owned(),
            "asks" => format!("asked for something {}", age(presented.asked_age_ms)),
            "overruled" => "is overruled".to_owned(),
            _ => "asks for nothing new".to_owned(),
        };
        out.fact("autopilot", &format!("sees it as {}, {stream}", presented.device));
    }
    if let Some(roi) = &gimbal.roi {
        let place = place(Some(roi.latitude_deg), Some(roi.longitude_deg));
        out.fact("roi", &format!("{place}  {}", altitude(Some(roi.altitude_amsl_m))));
    }
    for fault in &gimbal.details.faults {
        out.fact("fault", fault);
    }
    out.fact_unless_empty("failures", &gimbal.failure_flags.join(" "));
    out.fact_unless_empty("flags", &gimbal.flags.join(" "));
    for (sender, reasons) in &gimbal.rejected {
        out.fact("refused", &format!("{sender}: {}", counts(reasons)));
    }
}

/// The latest, each with its age.
fn events(out: &mut Lines, events: &[EventSnapshot]) {
    let row = |event: &EventSnapshot| {
        let times = if event.count > 1 { format!(" ({} times)", event.count) } else { String::new() };
        [age(Some(event.age_ms)), event.gimbal.clone(), format!("{}{times}", event.text)]
    };
    let rows: Vec<[String; 3]> = events.iter().take(SHOWN_EVENTS).map(row).collect();
    for line in aligned(&rows) {
        out.line(1, &line);
    }
}

fn setpoint(setpoint: &SetpointSnapshot) -> String {
    let mut text = setpoint.mode.clone();
    // Level is how a camera is nearly always told to be.
    let tilted = |roll: Option<f64>| roll.filter(|roll| roll.abs() > 0.05);
    for (name, value, unit) in [
        ("roll", tilted(setpoint.roll_deg), ""),
        ("pitch", setpoint.pitch_deg, ""),
        ("yaw", setpoint.yaw_deg, ""),
        ("roll", tilted(setpoint.roll_rate_dps), "/s"),
        ("pitch", setpoint.pitch_rate_dps, "/s"),
        ("yaw", setpoint.yaw_rate_dps, "/s"),
    ] {
        if value.is_some() {
            text = format!("{text}  {name} {}{unit}", degrees(value));
        }
    }
    match setpoint.yaw_frame.as_deref() {
        Some("earth") => text.push_str(" from North"),
        Some("vehicle") => text.push_str(" from the nose"),
        Some(_) | None => {}
    }
    if let Some(source) = &setpoint.source {
        text = format!("{text}  by {source}");
    }
    if setpoint.stale {
        text.push_str("  held: the vehicle's position or heading is missing");
    }
    text
}

/// Columns as wide as their widest cell; the last is left as it is.
pub(super) fn aligned<const N: usize>(rows: &[[String; N]]) -> Vec<String> {
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let line = |row: &[String; N]| {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

pub(super) fn degrees(value: Option<f64>) -> String {
    // Adding zero takes the sign off a rounded minus zero.
    value.map_or_else(|| "–".to_owned(), |value| format!("{:.1}°", (value * 10.0).round() / 10.0 + 0.0))
}

fn place(latitude_deg: Option<f64>, longitude_deg: Option<f64>) -> String {
    match (latitude_deg, longitude_deg) {
        (Some(latitude), Some(longitude)) => format!("{latitude:.6}° {longitude:.6}°"),
        (Some(_), None) | (None, Some(_) | None) => "–".to_owned(),
    }
}

fn altitude(amsl_m: Option<f64>) -> String {
    amsl_m.map_or_else(|| "–".to_owned(), |metres| format!("{metres:.1} m above mean sea level"))
}

pub(super) fn age(ms: Option<u64>) -> String {
    match ms {
        None => "never heard".to_owned(),
        Some(ms @ 0..1_000) => format!("{ms} ms ago"),
        Some(ms @ 1_000..60_000) => format!("{}.{} s ago", ms / 1_000, ms % 1_000 / 100),
        Some(ms) => format!("{} ago", duration(ms as f64 / 1_000.0)),
    }
}

fn duration(seconds: f64) -> String {
    let seconds = seconds as u64; // saturates; not a number becomes 0
    let (minutes, hours, days) = (seconds / 60, seconds / 3_600, seconds / 86_400);
    match (days, hours, minutes) {
        (0, 0, 0) => format!("{seconds} s"),
        (0, 0, _) => format!("{minutes} min {} s", seconds % 60),
        (0, _, _) => format!("{hours} h {} min", minutes % 60),
        (_, _, _) => format!("{days} d {} h", hours % 24),
    }
}

fn size(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.2} GB", bytes as f64 / 1e9),
    }
}

fn counts(counts: &BTreeMap<String, u64>) -> String {
    counts.iter().map(|(reason, count)| format!("{reason} {count}")).collect::<Vec<_>>().join(", ")
}

#[derive(Default)]
pub(super) struct Lines(pub(super) String);

impl Lines {
    pub(super) fn line(&mut self, depth: usize, text: &str) {
        writeln!(self.0, "{:indent$}{text}", "", indent = 2 * depth).expect("a String takes every text");
    }

    fn heading(&mut self, text: &str) {
        self.0.push('\n');
        self.line(0, text);
    }

    pub(super) fn fact(&mut self, name: &str, text: &str) {
        self.line(1, &format!("{name:<9} {text}"));
    }

    pub(super) fn fact_unless_empty(&mut self, name: &str, text: &str) {
        if !text.is_empty() {
            self.fact(name, text);
        }
    }
}

#[cfg(test)]
mod tests;
