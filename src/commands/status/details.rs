//! What only its family knows of a gimbal, as text.

use super::text::{Lines, age, aligned, degrees};
use crate::gimbals::details::{EncoderDetails, GimbalDetails, ImuDetails};

/// What is known; nothing of what is not.
pub(super) fn details(out: &mut Lines, details: &GimbalDetails) {
    let named = |name: &str, value: Option<String>| value.map(|value| format!("{name} {value}"));
    let on = |value: Option<bool>| value.map(|on| if on { "on" } else { "off" }.to_owned());
    let number = |value: Option<f64>| value.map(|value| value.to_string());
    let fact = |out: &mut Lines, name: &str, parts: Vec<Option<String>>| {
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        out.fact_unless_empty(name, &parts.join("  "));
    };
    fact(
        out,
        "version",
        vec![
            details.version.clone(),
            named("protocol", details.generation.clone()),
            details.stage.as_ref().map(|stage| stage.replace('_', " ")),
        ],
    );
    let not_aligned = Some(details.not_aligned.join(", ").replace('_', " ")).filter(|names| !names.is_empty());
    fact(
        out,
        "state",
        vec![
            details.operation.clone(),
            named("mode", details.mode.clone()),
            named("motors", on(details.motors_on)),
            named("not aligned:", not_aligned),
        ],
    );
    fact(
        out,
        "power",
        vec![
            details.battery_v.map(|volts| format!("{volts:.1} V")),
            details.load_percent.map(|percent| format!("load {percent:.0} %")),
        ],
    );
    if let Some(ImuDetails { acceleration_g: [x, y, z], rates_dps: [roll, pitch, yaw], age_ms, .. }) = details.imu {
        let rates = [roll, pitch, yaw].map(|rate| degrees(Some(rate))).join(" ");
        out.fact("imu", &format!("{x:.3} {y:.3} {z:.3} g  {rates} a second  {}", age(Some(age_ms))));
    }
    if let Some(EncoderDetails { tilt_deg, roll_deg, pan_deg, age_ms, .. }) = details.encoders {
        let [tilt, roll, pan] = [tilt_deg, roll_deg, pan_deg].map(|angle| degrees(Some(angle)));
        out.fact("encoders", &format!("tilt {tilt}  roll {roll}  pan {pan}  {}", age(Some(age_ms))));
    }
    fact(
        out,
        "settings",
        vec![
            named("radio", details.radio_type.clone()),
            named("gyro filter", number(details.gyro_filter)),
            named("output filter", number(details.output_filter)),
            named("gain", number(details.gain)),
            named("encoders in", details.encoder_unit.clone()),
            named("combined attitude", on(details.combined_attitude)),
            named("home on mode change", on(details.home_on_mode_change)),
        ],
    );
    axes(out, details);
    streams(out, details);
}

fn axes(out: &mut Lines, details: &GimbalDetails) {
    let cell = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| value.to_string());
    let is_known = |(_, axis): &(&String, &_)| *axis != &Default::default();
    let mut rows = vec![
        [
            "AXIS",
            "LIMITS",
            "FOLLOW SPEED",
            "SMOOTH",
            "WINDOW",
            "CONTROL SPEED",
            "SMOOTH",
            "REVERSED",
            "STIFFNESS",
            "HOLD",
        ]
        .map(str::to_owned),
    ];
    rows.extend(details.axes.iter().filter(is_known).map(|(name, axis)| {
        [
            name.clone(),
            format!("{} to {}", cell(axis.min_deg), cell(axis.max_deg)),
            cell(axis.follow_speed),
            cell(axis.follow_smoothing),
            cell(axis.follow_window_deg),
            cell(axis.control_speed_dps),
            cell(axis.control_smoothing),
            axis.reversed.map_or("–", |reversed| if reversed { "yes" } else { "no" }).to_owned(),
            cell(axis.stiffness),
            cell(axis.hold_strength),
        ]
    }));
    table(out, &rows);
}

fn streams(out: &mut Lines, details: &GimbalDetails) {
    let hertz = |value: Option<f64>, otherwise: &str| {
        value.map_or_else(|| otherwise.to_owned(), |hertz| format!("{:.0}", hertz))
    };
    let mut rows = vec![["STREAM", "WANTED HZ", "MEASURED HZ"].map(str::to_owned)];
    rows.extend(
        details
            .streams
            .iter()
            .map(|(name, stream)| [name.clone(), hertz(stream.wanted_hz, "default"), hertz(stream.measured_hz, "–")]),
    );
    table(out, &rows);
}

/// Rows below their titles, if there are any.
fn table<const N: usize>(out: &mut Lines, rows: &[[String; N]]) {
    if rows.len() > 1 {
        for line in aligned(rows) {
            out.line(1, &line);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbals::details::{AxisDetails, StreamDetails};

    #[test]
    fn what_is_known_of_a_gimbal_is_shown_and_nothing_else() {
        let mut out = Lines::default();
        details(&mut out, &GimbalDetails::default());
        assert_eq!(out.0, "");

        let axis = AxisDetails {
            follow_speed: Some(60.0),
            control_speed_dps: Some(30.5),
            reversed: Some(true),
            min_deg: Some(-90.0),
            max_deg: Some(45.0),
            ..AxisDetails::default()
        };
        let stream = StreamDetails { wanted_hz: Some(20.0), measured_hz: Some(19.7) };
        let known = GimbalDetails {
            generation: Some("v2".to_owned()),
            version: Some("7.8.9 alpha".to_owned()),
            stage: Some("reading_parameters".to_owned()),
            operation: Some("on, follow".to_owned()),
            motors_on: Some(true),
            not_aligned: vec!["encoder_roll".to_owned()],
            battery_v: Some(14.8),
            load_percent: Some(42.0),
            imu: Some(ImuDetails {
                acceleration_g: [0.0, 0.001, 1.0],
                rates_dps: [-0.03, 0.0, 12.0],
                acceleration_raw: [0; 3],
                rates_raw: [0; 3],
                time_us: 0,
                age_ms: 75,
            }),
            encoders: Some(EncoderDetails { tilt_deg: 90.0, roll_deg: 0.0, pan_deg: -0.02, raw: [0; 3], age_ms: 73 }),
            radio_type: Some("sync".to_owned()),
            gyro_filter: Some(4.0),
            combined_attitude: Some(false),
            axes: [("tilt".to_owned(), axis), ("pan".to_owned(), AxisDetails::default())].into(),
            streams: [("encoders".to_owned(), stream), ("raw_imu".to_owned(), StreamDetails::default())].into(),
            ..GimbalDetails::default()
        };
        details(&mut out, &known);
        let expected = "
  version   7.8.9 alpha  protocol v2  reading parameters
  state     on, follow  motors on  not aligned: encoder roll
  power     14.8 V  load 42 %
  imu       0.000 0.001 1.000 g  0.0° 0.0° 12.0° a second  75 ms ago
  encoders  tilt 90.0°  roll 0.0°  pan 0.0°  73 ms ago
  settings  radio sync  gyro filter 4  combined attitude off
  AXIS  LIMITS     FOLLOW SPEED  SMOOTH  WINDOW  CONTROL SPEED  SMOOTH  REVERSED  STIFFNESS  HOLD
  tilt  -90 to 45  60            –       –       30.5           –       yes       –          –
  STREAM    WANTED HZ  MEASURED HZ
  encoders  20         20
  raw_imu   default    –
";
        assert_eq!(format!("\n{}", out.0), expected);
    }
}
