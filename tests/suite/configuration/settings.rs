//! What becomes of a right file: each key is where it belongs, and what is not said has its default.

use std::time::Duration;

use gimbald::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use gimbald::config::settings::{Directories, HttpSettings};
use gimbald::geometry::Angle;
use gimbald::gimbals::gremsy::config::GremsySettings;
use gimbald::gimbals::gremsy::driver::Generation;
use gimbald::gimbals::mavlink_v1::config::{V1RadioControl, V1Settings};
use gimbald::gimbals::settings::{DeviceYawFrame, Family, GimbalSettings, Takeover};
use gimbald::gimbals::signs::{Sign, Signs};
use gimbald::manager::settings::{AltitudeReference, ControlSettings, Firewall};

use super::*;

#[test]
fn every_key_arrives_where_it_belongs() {
    let link = |name: &str, role, endpoint: &str, transport, speaks_first, max_rates: &[(u32, u64)]| LinkSettings {
        name: name.to_owned(),
        role,
        endpoint: endpoint.to_owned(),
        transport,
        speaks_first,
        max_rates: max_rates.iter().map(|(id, millis)| (*id, Duration::from_millis(*millis))).collect(),
    };
    let (serial, tcp, broadcast) = ("serial:/dev/ttyUSB0:57600", "tcpin:127.0.0.1:5760", "udpbcast:10.0.0.255:14550");
    let expected = DaemonSettings {
        core: Settings {
            system_id: SystemId::Fixed(7),
            stored_system_id: None,
            left_turning: Vec::new(),
            kept_ids: Vec::new(),
            links: vec![
                link("nose", Role::Gimbal, serial, Transport::Serial { baud: 57_600 }, false, &[]),
                link("autopilot", Role::Autopilot, tcp, Transport::Stream, false, &[]),
                link("ground", Role::Ground, broadcast, Transport::Datagrams, true, &[(281, 2000), (285, 250)]),
            ],
            gimbals: vec![GimbalSettings {
                name: "nose-cam".to_owned(),
                family: Family::Auto,
                link: Some(2),
                component_id: Some(171),
                manager_component_id: Some(200),
                takeover: Takeover::Ask,
                setpoint_rate_hz: 30,
                device_yaw_frame: DeviceYawFrame::Earth,
                v1: V1Settings {
                    sign: Signs::REVERSED,
                    report_sign: Signs::REVERSED,
                    configures: true,
                    radio_control: V1RadioControl::Mode,
                },
                v1_status: true,
                gremsy: GremsySettings {
                    generation: Some(Generation::V1),
                    retract_allowed: true,
                    stow_pitch: Angle::from_degrees(-45.0),
                    stow_yaw: Angle::from_degrees(90.0),
                    report_sign: Some(Signs::REVERSED),
                },
                manual_pitch_rate_dps: 12.5,
                manual_yaw_rate_dps: 45.0,
            }],
            control: ControlSettings {
                open_when_unclaimed: false,
                lease_timeout: Duration::from_secs(3),
                rate_timeout: Duration::from_millis(500),
                command_rate_timeout: Duration::ZERO,
                firewall: Firewall::Warn,
                snoop_autopilot: true,
                accept_centidegrees: true,
                px4_release_quirk: true,
                synthesize_286: false,
                roi_altitude: AltitudeReference::Amsl,
            },
            present_device: true,
        },
        endpoints: vec![serial.parse().expect(serial), tcp.parse().expect(tcp), broadcast.parse().expect(broadcast)],
        http: Some(HttpSettings {
            listen: "[::1]:9090".parse().expect("an address"),
            token: Some("0123456789abcdef".parse().expect("a token")),
        }),
        directories: Directories { state: Some("/var/lib/gimbald".into()), runtime: Some("/run/gimbald".into()) },
    };
    let (_folder, token) = token_file();
    let text = EVERY_KEY.replace("/nowhere/token", &token.to_string_lossy());
    assert_eq!(
        load(&text, &[("STATE_DIRECTORY", "/var/lib/gimbald:/var/lib/other"), ("RUNTIME_DIRECTORY", "/run/gimbald")]),
        Ok(expected)
    );
}

#[test]
fn what_is_not_said_has_its_default() {
    let loaded = load(LINK, &[("STATE_DIRECTORY", "")]).expect("a right file");

    assert_eq!(loaded.core.system_id, SystemId::Auto);
    assert_eq!(loaded.core.gimbals, []);
    assert_eq!(loaded.core.control, ControlSettings::default());
    assert!(!loaded.core.present_device);
    let listen = "127.0.0.1:8080".parse().expect("an address");
    assert_eq!(loaded.http, Some(HttpSettings { listen, token: None }));
    assert_eq!(loaded.directories, Directories::default());

    let loaded = load(&format!("{LINK}[[gimbal]]\nname = \"camera\"\n"), &[]).expect("a right file");
    assert_eq!(loaded.core.gimbals, [GimbalSettings::found("camera".to_owned())]);
}

/// A link whose other end waits to be spoken to must send the first byte.
#[test]
fn links_that_call_speak_first() {
    for (endpoint, transport, speaks_first) in [
        ("serial:/dev/ttyUSB0:57600", Transport::Serial { baud: 57_600 }, false),
        ("udpin:0.0.0.0:1", Transport::Datagrams, false),
        ("udpout:10.0.0.1:1", Transport::Datagrams, true),
        ("udpbcast:10.0.0.255:1", Transport::Datagrams, true),
        ("tcpin:0.0.0.0:1", Transport::Stream, false),
        ("tcpout:10.0.0.1:1", Transport::Stream, true),
    ] {
        let loaded = load(&LINK.replace("udpin:0.0.0.0:14550", endpoint), &[]).expect(endpoint);
        let link = &loaded.core.links[0];
        assert_eq!((link.transport, link.speaks_first), (transport, speaks_first), "{endpoint}");
    }
}

/// A table of signs names the axes that differ from its words.
#[test]
fn each_axis_of_a_gimbal_has_a_sign_of_its_own() {
    let signs = |given: &str| {
        let text = format!("{LINK}[[gimbal]]\nname = \"camera\"\nv1_sign = {given}\n");
        load(&text, &[]).map(|loaded| loaded.core.gimbals[0].v1.sign)
    };
    let opposite = Sign::Opposite;
    for (given, expected) in [
        ("\"normal\"", Signs::NORMAL),
        ("\"reversed\"", Signs::REVERSED),
        ("{}", Signs::NORMAL),
        ("{ pitch = -1 }", Signs { pitch: opposite, ..Signs::NORMAL }),
        ("{ roll = -1, yaw = 1 }", Signs { roll: opposite, ..Signs::NORMAL }),
        ("{ pitch = -1.0, yaw = -1 }", Signs::REVERSED),
    ] {
        assert_eq!(signs(given), Ok(expected), "{given}");
    }
}
