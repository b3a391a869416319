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
  setpoint  angle  roll 2.0°  pitch -45.0°  yaw 120.0° from North  by 255/190
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
    let line =
        "  attitude  roll 0.3°  pitch -42.5°  yaw 30.0° from the nose, 117.0° from North  assumed: it does not tell\n";
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
