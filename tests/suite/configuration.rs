//! What `gimbald check` says of wrong configurations, word for word.

mod ids;
mod keys;
mod settings;
mod variables;
mod whole_file;

use std::fs;
use std::os::unix::fs::PermissionsExt;

use gimbald::config::settings::DaemonSettings;
use gimbald::config::{self, problem::Problems};

use crate::gimbald::{Outcome, gimbald};

/// A link, so that what is wrong is what the test is about.
const LINK: &str = "[[link]]\nname = \"ground\"\nrole = \"ground\"\nendpoint = \"udpin:0.0.0.0:14550\"\n";

fn check(text: &str, variables: &[(&str, &str)]) -> Outcome {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("c.toml"), text).expect("a writable folder");
    gimbald(folder.path(), &["check", "--config", "c.toml"], variables)
}

fn refused(lines: &[&str]) -> Outcome {
    Outcome { code: Some(78), output: String::new(), errors: lines.iter().map(|line| format!("{line}\n")).collect() }
}

/// `LINK` with `text` behind it (so that `text` begins in line 5) is refused with exactly these lines.
#[track_caller]
fn assert_refused(text: &str, lines: &[&str]) {
    assert_eq!(check(&format!("{LINK}{text}"), &[]), refused(lines), "{text}");
}

/// `config::load` of a file with this text.
fn load(text: &str, variables: &[(&str, &str)]) -> Result<DaemonSettings, Problems> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("c.toml");
    fs::write(&path, text).expect("a writable folder");
    config::load(&path, variables.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())))
}

/// Every key, with another value than its default.
const EVERY_KEY: &str = r#"
[[link]]
name = "nose"
role = "gimbal"
endpoint = "serial:/dev/ttyUSB0:57600"
[[link]]
name = "autopilot"
role = "autopilot"
endpoint = "tcpin:127.0.0.1:5760"
[[link]]
name = "ground"
role = "ground"
endpoint = "udpbcast:10.0.0.255:14550"
max_rate_hz = { 285 = 4, 281 = 0.5 }
[[gimbal]]
name = "nose-cam"
link = "ground"
family = "auto"
component_id = 171
manager_component_id = 200
takeover = "ask"
setpoint_rate_hz = 30
device_yaw_frame = "earth"
v1_sign = { pitch = -1, roll = 1.0, yaw = -1 }
v1_report_sign = "reversed"
v1_configure = true
v1_radio_control = "mode"
v1_status = true
gremsy_generation = "v1"
gremsy_report_sign = "reversed"
retract_allowed = true
stow_pitch_deg = -45
stow_yaw_deg = 90
manual_pitch_rate_dps = 12.5
manual_yaw_rate_dps = 45
[vehicle]
system_id = 7
[autopilot]
present_device = true
[control]
unclaimed = "closed"
lease_timeout_s = 3
rate_timeout_s = 0.5
command_rate_timeout_s = 0
firewall = "warn"
snoop_autopilot = true
accept_centidegrees = true
px4_release_quirk = true
synthesize_286 = "off"
[roi]
altitude_reference = "amsl"
[http]
listen = "[::1]:9090"
token_file = "/nowhere/token"
"#;

/// A file with a token, and the folder it lives in.
fn token_file() -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("token");
    fs::write(&path, "0123456789abcdef\n").expect("a writable folder");
    fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("our own file");
    (folder, path)
}
