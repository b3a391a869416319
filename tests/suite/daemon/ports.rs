//! Ports that are not there, or taken, when the daemon starts.

use std::net::{TcpListener, UdpSocket};
use std::time::Duration;

use serde_json::{Value, json};

use super::{one_link, simulated_gimbal, three_links};
use crate::gimbald::gimbald;
use crate::support::daemon::{Site, Station, wait_for};
use crate::support::world::{GCS, MANAGER, heartbeat};

/// "A link that cannot open (device missing, network not up, port taken, connection refused) is down and retried, never
/// fatal"; `/readyz`: "200 when every configured link is up and every configured gimbal is alive, else 503 with the
/// reasons".
#[test]
fn links_that_cannot_open_are_down_until_they_can() {
    let site = Site::new();
    let taken = UdpSocket::bind(site.port(14_550)).expect("nobody else has this address");
    let daemon = site.start(&three_links(), &[]);
    let missing = format!("cannot open {}: no such file or directory", site.path("gimbal").display());
    let in_use = "address already in use";

    let status = daemon.wait_until("the reasons", |status| {
        status.links.iter().all(|link| link.reason.is_some() || link.state == "up")
    });
    let states: Vec<(&str, &str, Option<&str>)> =
        status.links.iter().map(|link| (link.name.as_str(), link.state.as_str(), link.reason.as_deref())).collect();
    let ground = status.links[2].reason.clone().expect("it is down");
    assert!(ground.contains(in_use) && ground.contains(&site.port(14_550).to_string()), "{ground}");
    assert_eq!(
        states,
        [
            ("autopilot", "up", None),
            ("gimbal", "down", Some(missing.as_str())),
            ("ground", "down", Some(ground.as_str())),
        ]
    );
    let (code, body) = daemon.get("/readyz").expect("an answer");
    let reasons = [format!("link gimbal is down: {missing}"), format!("link ground is down: {ground}")];
    assert_eq!(
        (code, serde_json::from_str::<Value>(&body).expect("JSON")),
        (503, json!({"ready": false, "reasons": reasons}))
    );

    drop(taken);
    let gimbal = simulated_gimbal();
    let _cable = gimbal.plug_in(&site.path("gimbal"));

    let status = daemon.wait_until_up();
    assert!(status.links.iter().all(|link| link.reason.is_none()), "{status:#?}");
    daemon.wait_for_gimbal();
    let (code, body) = daemon.get("/readyz").expect("an answer");
    assert_eq!(
        (code, serde_json::from_str::<Value>(&body).expect("JSON")),
        (200, json!({"ready": true, "reasons": []}))
    );
}

/// "A port that is taken is no error": the frames do not need the page.
#[test]
fn a_page_that_cannot_open_costs_no_frames_and_comes_later() {
    let site = Site::new();
    let taken = TcpListener::bind(site.port(8_080)).expect("nobody else has this address");
    let mut daemon = site.start(&one_link(), &[]);
    let mut ground = Station::new(GCS, site.port(14_550));

    wait_for("a heartbeat without a page", || {
        ground.send(&heartbeat(6, 8));
        ground.hear_for(Duration::from_millis(100)).iter().any(|heard| heard.source == MANAGER).then_some(())
    });
    drop(taken);

    assert_eq!(daemon.wait_until_up().system_id, Some(1));
    assert!(daemon.is_alive());
}

/// "Touches nothing while `run` holds the port."
#[test]
fn scan_leaves_the_port_of_a_running_daemon_alone() {
    let site = Site::new();
    let gimbal = simulated_gimbal();
    let _cable = gimbal.plug_in(&site.path("gimbal"));
    let daemon = site.start(&three_links(), &[]);
    daemon.wait_for_gimbal();
    gimbal.take_heard();

    let outcome = gimbald(site.folder.path(), &["scan", "gimbal"], &[]);

    assert_eq!((outcome.code, outcome.output.as_str()), (Some(69), ""));
    // The far end is open in this test too, and whoever is found first is named.
    let start = format!("{}: in use by ", site.path("gimbal").display());
    assert!(outcome.errors.starts_with(&start), "{}", outcome.errors);
    let remedy = "; if it is the service, name its page with --url or its configuration with --config, and it is asked what is there";
    let remedy = if outcome.errors.contains("in use by gimbald ") { remedy } else { "" };
    let end = format!("){remedy}\ngimbald scan: nothing answered\n");
    assert!(outcome.errors.ends_with(&end), "{}", outcome.errors);
    assert!(gimbal.take_heard().iter().all(|heard| heard.source == MANAGER));
    assert_eq!(daemon.status().links[1].state, "up");
}
