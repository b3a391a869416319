//! What is installed beside the binary is right, as the tools that will read it say.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use gimbald::config::schema;

use crate::gimbald::gimbald;

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn shipped(path: &str) -> String {
    fs::read_to_string(repository().join(path)).expect(path)
}

#[test]
fn every_shipped_configuration_passes_check() {
    let mut files = vec![PathBuf::from("config/gimbald.toml")];
    for entry in fs::read_dir(repository().join("config/examples")).expect("config/examples") {
        files.push(Path::new("config/examples").join(entry.expect("a readable folder").file_name()));
    }
    assert_eq!(files.len(), 4, "{files:?}");
    for file in files {
        let path = file.to_str().expect("UTF-8");
        let outcome = gimbald(repository(), &["check", "--config", path], &[]);

        assert_eq!((outcome.code, outcome.errors.as_str()), (Some(0), ""), "{path}");
        assert!(outcome.output.starts_with(&format!("{path}: ok; links: ")), "{}", outcome.output);
    }
}

/// `# key = value` in the shipped file is a key with its default (or an example), so that turning every such line on
/// must be right too.
#[test]
fn the_commented_lines_of_the_shipped_configuration_are_right_as_well() {
    let text = shipped("config/gimbald.toml");
    let all: Vec<&str> = text
        .lines()
        .map(|line| match line.strip_prefix("# ") {
            Some(rest) if rest.starts_with("[[") || rest.split_once(" = ").is_some_and(|(key, _)| is_key(key)) => rest,
            _ => line,
        })
        .collect();
    let folder = tempfile::tempdir().expect("a temporary folder");
    // A token that is missing is refused.
    let token = folder.path().join("http-token");
    fs::write(&token, "0123456789abcdef").expect("a writable folder");
    fs::set_permissions(&token, fs::Permissions::from_mode(0o600)).expect("our own file");
    let all = all.join("\n").replace("/etc/gimbald/http-token", &token.to_string_lossy());
    fs::write(folder.path().join("all.toml"), all).expect("a writable folder");

    let outcome = gimbald(folder.path(), &["check", "--config", "all.toml"], &[]);

    assert_eq!(
        (outcome.code, outcome.errors.as_str(), outcome.output.as_str()),
        (
            Some(0),
            "",
            "all.toml: ok; links: gimbal (serial:/dev/serial0:115200), autopilot (udpin:0.0.0.0:14540), ground \
             (udpin:0.0.0.0:14550); gimbals: camera; page: http://127.0.0.1:8080\n"
        )
    );
}

fn is_key(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
}

#[test]
fn the_shipped_configuration_shows_every_key() {
    let text = shipped("config/gimbald.toml");
    let mut section = String::new();
    let mut shown = Vec::new();
    for line in text.lines().map(|line| line.trim_start_matches("# ")) {
        if let Some(header) = line.strip_prefix('[') {
            section = header.trim_matches(['[', ']']).to_owned();
        } else if let Some((key, _)) = line.split_once(" = ") {
            shown.push((section.clone(), key.to_owned()));
        }
    }
    for (section, keys) in schema::keys() {
        for key in keys {
            assert!(shown.contains(&(section.to_owned(), key.to_owned())), "[{section}] {key}");
        }
    }
}

#[test]
fn the_configuration_page_explains_every_key_and_variable() {
    let text = shipped("docs/configuration.md");
    for (section, keys) in schema::keys() {
        let heading = if matches!(section, "link" | "gimbal") { "[[" } else { "[" };
        let start = text.find(&format!("## `{heading}{section}")).unwrap_or_else(|| panic!("a heading for {section}"));
        let rest = &text[start + 3..];
        let chapter = rest.split("\n## ").next().unwrap_or_default();
        for key in keys {
            assert!(chapter.contains(&format!("\n| `{key}` |")), "[{section}] {key}");
        }
    }
    for code in ["| 0 |", "| 64 |", "| 69 |", "| 78 |", "GIMBALD__HTTP__LISTEN", "GIMBALD__LINK__GROUND__ENDPOINT"] {
        assert!(text.contains(code), "{code}");
    }
}

/// Every block of TOML on the page can be copied into a file.
#[test]
fn the_examples_of_the_configuration_page_are_right() {
    let text = shipped("docs/configuration.md");
    let examples: Vec<&str> =
        text.split("```toml\n").skip(1).map(|block| block.split("```").next().unwrap_or_default()).collect();
    assert!(!examples.is_empty());
    let folder = tempfile::tempdir().expect("a temporary folder");
    for example in examples {
        fs::write(folder.path().join("example.toml"), example).expect("a writable folder");

        let outcome = gimbald(folder.path(), &["check", "--config", "example.toml"], &[]);

        assert_eq!((outcome.code, outcome.errors.as_str()), (Some(0), ""), "{example}");
    }
}

/// Runs a tool of systemd; `None`, said aloud, where systemd is not installed.
fn systemd(tool: &str, arguments: &[&str]) -> Option<(bool, String)> {
    match Command::new(tool).args(arguments).env("LC_ALL", "C").env("SYSTEMD_COLORS", "0").output() {
        Ok(finished) => {
            let text = [finished.stdout, finished.stderr].concat();
            Some((finished.status.success(), String::from_utf8_lossy(&text).into_owned()))
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            eprintln!("NOT CHECKED: {tool} is not installed, so nobody looked at the files for systemd");
            None
        }
        Err(error) => panic!("{tool}: {error}"),
    }
}

/// `systemd-analyze verify` succeeds even when it ignores a key that it does not know, so its output must be empty. It
/// wants the program to exist: the unit is verified with the path of the binary that was just built.
#[test]
fn systemd_understands_every_line_of_the_unit() {
    let unit = shipped("systemd/gimbald.service");
    assert_eq!(unit.matches("ExecStart=/usr/bin/gimbald run\n").count(), 1);
    let verify = |unit: String| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let copy = folder.path().join("gimbald.service");
        fs::write(&copy, unit).expect("a writable folder");
        systemd("systemd-analyze", &["verify", "--man=no", copy.to_str().expect("UTF-8")])
    };
    let built = unit.replace("/usr/bin/gimbald", env!("CARGO_BIN_EXE_gimbald"));

    let Some(verdict) = verify(built.clone()) else { return };

    assert_eq!(verdict, (true, String::new()));
    // And it would have said something.
    let (_, complaint) = verify(built.replace("RestartSec=", "RestartSecs=")).expect("it was there a moment ago");
    assert!(complaint.contains("RestartSecs"), "{complaint}");
}

#[test]
fn the_unit_exposes_little() {
    let path = repository().join("systemd/gimbald.service");
    let path = path.to_str().expect("UTF-8");

    let Some((below, text)) =
        systemd("systemd-analyze", &["security", "--no-pager", "--offline=true", "--threshold=19", path])
    else {
        return;
    };

    assert!(below, "the exposure is to be below 2.0:\n{text}");
}

/// What the daemon relies on and no tool can judge.
#[test]
fn the_unit_says_what_the_daemon_relies_on() {
    let unit = shipped("systemd/gimbald.service");
    for line in [
        "Type=notify",
        "WatchdogSec=5s",
        "Restart=always",
        "RestartPreventExitStatus=64 78",
        "User=gimbald",
        "Group=gimbald",
        "SupplementaryGroups=dialout",
        "StateDirectory=gimbald",
        "RuntimeDirectory=gimbald",
        "RuntimeDirectoryPreserve=yes",
        "CPUSchedulingPolicy=fifo",
        "CPUSchedulingResetOnFork=yes",
        "RestrictAddressFamilies=AF_INET AF_INET6 AF_UNIX",
        "DeviceAllow=char-ttyAMA rw",
        "DeviceAllow=char-ttyS rw",
        "DeviceAllow=char-ttyUSB rw",
        "DeviceAllow=char-ttyACM rw",
        "DeviceAllow=char-ttyTHS rw",
        "DeviceAllow=char-ttymxc rw",
    ] {
        assert!(unit.lines().any(|present| present == line), "{line}");
    }
    for hidden in ["PrivateDevices=yes", "RestrictRealtime=yes", "PrivateNetwork=yes", "IPAddressDeny"] {
        assert!(!unit.contains(hidden), "{hidden} would keep gimbald from its work");
    }
}

#[test]
fn the_user_of_the_unit_can_be_made() {
    let path = repository().join("systemd/sysusers.d/gimbald.conf");
    let path = path.to_str().expect("UTF-8");

    let Some((success, text)) = systemd("systemd-sysusers", &["--dry-run", path]) else { return };

    assert!(success, "{text}");
    let file = shipped("systemd/sysusers.d/gimbald.conf");
    let lines: Vec<&str> = file.lines().collect();
    assert!(lines.contains(&"u gimbald - \"MAVLink gimbal manager\" /var/lib/gimbald"));
    assert!(lines.contains(&"m gimbald dialout"));
}

#[test]
fn the_rule_for_ftdi_adapters_sets_one_millisecond() {
    let rules = shipped("systemd/udev/99-gimbald-ftdi.rules");
    let rules: Vec<&str> = rules.lines().filter(|line| !line.starts_with('#')).collect();
    assert_eq!(rules, [r#"ACTION=="add", SUBSYSTEM=="usb-serial", DRIVERS=="ftdi_sio", ATTR{latency_timer}="1""#]);
}
