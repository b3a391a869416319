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
    let title = format!("gimbal {}  {}  {}{device}  manager {manager}", gimbal.name, gimbal.state, gimbal.family);
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
    for (name, value, unit) in [
        ("pitch", setpoint.pitch_deg, ""),
        ("yaw", setpoint.yaw_deg, ""),
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
mod tests {
    use super::*;
    use crate::http::canned;

    #[test]
    fn a_full_snapshot_fits_a_terminal() {
        let expected = "\
gimbald 0.1.0  system 1  up 1 h 2 min  NOT READY
  link gimbal is down: no such file or directory
  gimbal lamp is searching

conflicts
  1/191 is also used by 10.0.0.7: set its component id to another value

links
  NAME       ROLE       STATE  RECEIVED         SENT             DROPPED  ENDPOINT
  autopilot  autopilot  up     123456 (4.9 MB)  7890 (315.6 kB)  40       udpin:0.0.0.0:14540
    heard    1/1 at 127.0.0.1:14550, 3 ms ago
    dropped  duplicate 3, queue_full 37
    noise    2 broken frames, 17 B
  gimbal     gimbal     down   0 (0 B)          0 (0 B)          0        serial:/dev/serial0:115200

vehicle  alive  ardupilot  system 1
  attitude  roll 2.5°  pitch -1.3°  heading 87.0°  12 ms ago
  position  47.397742° 8.545594°  488.5 m above mean sea level  95 ms ago
  gimbals   get its state from us

gimbal camera  alive  mavlink_v2  device 1/154  manager 191
  product   Acme Pixy 7.8.1
  attitude  roll 0.3°  pitch -42.5°  yaw 30.0° from the nose, 117.0° from North  18 ms ago
  control   255/190 for 1 min 1 s
  setpoint  angle  pitch -45.0°  yaw 120.0° from North  by 255/190
  autopilot sees it as 1/154, asks for nothing new
  roi       47.400000° 8.550000°  430.0 m above mean sea level
  fault     firmware 7.8.7 reports a wrong yaw from North
  failures  motor_error
  flags     yaw_lock roll_lock
  refused   1/100: not_in_control 12

gimbal lamp  searching  auto  manager 192
  attitude  roll –  pitch –  yaw – from the nose, – from North  never heard
  control   nobody

events
  250 ms ago     camera  1/100 was refused: 255/190 is in control (12 times)
  1 min 1 s ago  camera  255/190 took control from 1/1
";
        assert_eq!(report(&canned::snapshot()), expected);
    }

    #[test]
    fn an_empty_snapshot_says_what_is_missing() {
        let expected = "\
gimbald   system id not settled yet  up 0 s  ready

links
  none is configured

vehicle  not heard
  attitude  roll –  pitch –  heading –  never heard
  position  –  –  never heard

gimbals
  none yet
";
        assert_eq!(report(&Snapshot::default()), expected);
    }

    #[test]
    fn what_is_too_old_to_act_on_is_named() {
        let vehicle = VehicleSnapshot {
            stale: vec!["heading".to_owned(), "position".to_owned()],
            state_for_gimbal: Some("autopilot".to_owned()),
            ..VehicleSnapshot::default()
        };
        let report = report(&Snapshot { vehicle, ..Snapshot::default() });
        assert!(report.contains("\n  gimbals   get its state\n  stale     heading position\n"), "{report}");
    }

    /// A gimbal that tells nothing is where it would be if it did what it is told.
    #[test]
    fn what_is_assumed_is_not_shown_as_told() {
        let mut snapshot = canned::snapshot();
        snapshot.gimbals[0].attitude.assumed = true;
        let report = report(&snapshot);
        let line = "  attitude  roll 0.3°  pitch -42.5°  yaw 30.0° from the nose, 117.0° from North  assumed: it does not tell\n";
        assert!(report.contains(line), "{report}");
    }

    #[test]
    fn ages_and_durations_have_two_units_at_most() {
        for (ms, expected) in [
            (None, "never heard"),
            (Some(0), "0 ms ago"),
            (Some(999), "999 ms ago"),
            (Some(1_250), "1.2 s ago"),
            (Some(59_999), "59.9 s ago"),
            (Some(60_000), "1 min 0 s ago"),
            (Some(3_600_000), "1 h 0 min ago"),
            (Some(90_000_000), "1 d 1 h ago"),
        ] {
            assert_eq!(age(ms), expected);
        }
        assert_eq!(duration(f64::NAN), "0 s");
    }

    #[test]
    fn what_rounds_to_zero_has_no_sign() {
        assert_eq!(degrees(Some(-0.04)), "0.0°");
        assert_eq!(degrees(Some(-0.06)), "-0.1°");
    }
}
