//! How the process ends, stands still, and starts again.

use std::net::UdpSocket;
use std::os::unix::net::UnixDatagram;
use std::process::Command;
use std::time::Duration;

use gimbald::wire::dialect::{GIMBAL_DEVICE_SET_ATTITUDE_DATA, HEARTBEAT_DATA};
use gimbald::wire::ids::{GimbalFlags, mav_state};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

use super::{one_link, set_pitchyaw, simulated_gimbal, three_links};
use crate::gimbald::gimbald;
use crate::support::daemon::{Heard, Site, Station, link, wait_for};
use crate::support::world::{AUTOPILOT, GCS, MANAGER, heartbeat};

fn state_of(heard: &Heard) -> Option<u8> {
    heard.decode::<HEARTBEAT_DATA>().filter(|_| heard.source == MANAGER).map(|heartbeat| heartbeat.system_status)
}

/// "On change of owner, loss of lease, stop and SIGTERM zero is sent at once"; then the managers say goodbye.
/// Protocol checklist 179: "When stopped by SIGTERM during a rate set-point, a zero-rate 284 is sent before exit, then one
/// POWEROFF heartbeat."
#[test]
fn sigterm_stops_the_gimbal_and_says_goodbye() {
    stops_the_gimbal_and_says_goodbye(Signal::SIGTERM);
}

/// The same of the signal of a terminal that is closed, or to which the line is cut.
#[test]
fn sighup_stops_the_gimbal_and_says_goodbye() {
    stops_the_gimbal_and_says_goodbye(Signal::SIGHUP);
}

fn stops_the_gimbal_and_says_goodbye(signal: Signal) {
    let site = Site::new();
    let gimbal = simulated_gimbal();
    let _cable = gimbal.plug_in(&site.path("gimbal"));
    let mut daemon = site.start(&three_links(), &[]);
    daemon.wait_for_gimbal();
    let mut ground = Station::new(GCS, site.port(14_550));
    ground.send(&heartbeat(6, 8));
    ground.send(&set_pitchyaw(f32::NAN, f32::NAN, 0.0, 0.5));
    let turning = |heard: &Heard| {
        heard.decode().is_some_and(|sent: GIMBAL_DEVICE_SET_ATTITUDE_DATA| sent.angular_velocity_z == 0.5)
    };
    wait_for("the rate", || gimbal.take_heard().iter().any(turning).then_some(()));
    ground.hear_now();

    let clock = ground.clock;
    let asked = clock.now();
    daemon.signal(signal);
    let code = daemon.wait();

    assert_eq!(code, Some(0), "{signal}");
    assert!(clock.now().since(asked) < Duration::from_secs(1));
    let is_goodbye = |heard: &Heard| state_of(heard) == Some(mav_state::POWEROFF);
    let mut heard = Vec::new();
    wait_for("the goodbye", || {
        heard.extend(gimbal.take_heard());
        heard.iter().any(is_goodbye).then_some(())
    });
    let last_setpoint = heard.iter().rev().find_map(Heard::decode);
    let stop: GIMBAL_DEVICE_SET_ATTITUDE_DATA = last_setpoint.expect("a setpoint before the goodbye");
    assert_eq!((stop.angular_velocity_y, stop.angular_velocity_z), (0.0, 0.0));
    assert!(heard.last().is_some_and(is_goodbye), "the goodbye is the last word: {heard:?}");
    assert_eq!(heard.iter().filter(|heard| is_goodbye(heard)).count(), 1);
    assert_eq!(ground.hear_now().iter().filter(|heard| is_goodbye(heard)).count(), 1);
    assert_eq!(
        GimbalFlags::from_bits_retain(stop.flags) & (GimbalFlags::RETRACT | GimbalFlags::NEUTRAL),
        GimbalFlags::empty()
    );
}

/// `nohup(1)`: "run a command immune to hangups".
#[test]
fn what_ignores_hangups_outlives_its_terminal() {
    let ground = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    ground.set_read_timeout(Some(Duration::from_secs(5))).expect("a time-out");
    let endpoint = format!("udpout:{}", ground.local_addr().expect("it is bound"));
    let mut peer = Command::new("sh")
        .args(["-c", "trap '' HUP; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_gimbald"), "sim", "vehicle", "--endpoint"])
        .arg(endpoint)
        .spawn()
        .expect("a shell");
    let pid = Pid::from_raw(peer.id() as i32);
    let hear = || ground.recv(&mut [0; 300]).expect("it goes on speaking");
    hear();
    kill(pid, Signal::SIGHUP).expect("it runs");
    for _ in 0..30 {
        hear();
    }
    assert_eq!(peer.try_wait().expect("our child"), None);

    kill(pid, Signal::SIGTERM).expect("it runs");
    assert_eq!(peer.wait().expect("our child").code(), Some(0));
}

/// "The adopted id is kept in the state directory and used at once on restart."
#[test]
fn after_a_crash_the_system_id_is_there_at_once() {
    let site = Site::new();
    let links =
        [link("autopilot", "autopilot", "udpin:{ip}:14540"), link("ground", "ground", "udpin:{ip}:14550")].concat();
    let variables = [("STATE_DIRECTORY", "{dir}")];
    let mut daemon = site.start(&links, &variables);
    daemon.wait_until_up();
    let mut autopilot = Station::new(gimbald::wire::MavId::new(42, AUTOPILOT.component), site.port(14_540));
    wait_for("the system id to be stored", || {
        autopilot.send(&heartbeat(2, 12));
        autopilot.hear_for(Duration::from_millis(100));
        std::fs::read_to_string(site.path("system-id")).ok().filter(|stored| stored == "42\n")
    });

    daemon.signal(Signal::SIGKILL);
    assert_eq!(daemon.wait(), None);
    let daemon = site.start(&links, &variables);

    let first = daemon.status();
    assert_eq!(first.system_id, Some(42), "after {} s, and no autopilot was heard", first.uptime_s);
    assert!(!first.vehicle.alive);
}

/// Protocol checklist 20: "When the main worker is artificially blocked for 5 s, heartbeats stop too."
#[test]
fn a_process_that_stands_still_does_not_beat() {
    let site = Site::new();
    // SIGSTOP blocks every thread at once; a heartbeat from a process of its own would go on.
    let daemon = site.start(&one_link(), &[]);
    daemon.wait_until_up();
    let mut ground = Station::new(GCS, site.port(14_550));
    ground.send(&heartbeat(6, 8));
    let beat = |heard: &Heard| state_of(heard);
    ground.wait_for("a heartbeat", beat);
    ground.wait_for("another", beat);

    daemon.signal(Signal::SIGSTOP);
    ground.hear_for(Duration::from_millis(50));
    let silent = ground.hear_for(Duration::from_millis(2_500));
    daemon.signal(Signal::SIGCONT);
    let resumed = ground.clock.now();
    ground.wait_for("a heartbeat after the pause", beat);

    assert_eq!(silent.iter().map(|heard| heard.id).collect::<Vec<u32>>(), Vec::<u32>::new());
    assert!(ground.clock.now().since(resumed) < Duration::from_millis(1_100));
    // What was missed is not made up for.
    let caught_up = ground.hear_for(Duration::from_millis(500)).iter().filter_map(beat).count();
    assert!(caught_up <= 1, "{caught_up} heartbeats in half a second");
}

/// `sd_notify(3)`: READY=1, WATCHDOG=1 "every half of the time", STOPPING=1.
#[test]
fn the_service_manager_is_told() {
    let site = Site::new();
    let listener = UnixDatagram::bind(site.path("notify")).expect("a free path");
    listener.set_read_timeout(Some(Duration::from_secs(5))).expect("a time-out");
    let clock = gimbald::daemon::clock::Clock::start();
    let mut daemon = site.start(&one_link(), &[("NOTIFY_SOCKET", "{dir}/notify"), ("WATCHDOG_USEC", "400000")]);
    let told = || {
        let mut buffer = [0; 512];
        let length = listener.recv(&mut buffer).expect("it goes on telling");
        (clock.now(), String::from_utf8_lossy(&buffer[..length]).trim().to_owned())
    };

    let (mut fed, mut seen) = (Vec::new(), Vec::new());
    while fed.len() < 7 {
        let (at, text) = told();
        if text == "WATCHDOG=1" { fed.push(at) } else { seen.push(text) }
    }
    daemon.signal(Signal::SIGTERM);
    let mut last = told().1;
    while last == "WATCHDOG=1" {
        last = told().1;
    }

    assert_eq!(seen[0], "READY=1");
    assert_eq!(seen.iter().filter(|text| *text == "READY=1").count(), 1);
    assert!(seen[1..].iter().all(|text| text.starts_with("STATUS=")), "{seen:?}");
    // The service manager waits for 400 ms; half of that is the pace, and never more than the whole.
    assert!(fed.windows(2).all(|pair| pair[1].since(pair[0]) < Duration::from_millis(400)), "{fed:?}");
    let span = fed[6].since(fed[0]);
    assert!((Duration::from_millis(1_100)..Duration::from_millis(1_600)).contains(&span), "{span:?}");
    assert_eq!(last, "STOPPING=1");
    assert_eq!(daemon.wait(), Some(0));
}

/// "Exit codes follow sysexits: 0, also for `--help` and `--version`; 64 usage; 69 unavailable; 78 configuration, a
/// missing file included."
#[test]
fn exit_codes_follow_sysexits() {
    let site = Site::new();
    let folder = site.folder.path();
    std::fs::write(folder.join("wrong.toml"), "[http]\n").expect("a writable folder");
    let nobody = format!("http://{}", site.port(1));
    for (arguments, code) in [
        (&["--help"][..], 0),
        (&["--version"], 0),
        (&["run", "--help"], 0),
        (&["run", "--colour"], 64),
        (&["status", "--url", "gimbald"], 64),
        (&["scan", "wrong.toml"], 64),
        (&["scan", "nowhere"], 69),
        (&["status", "--url", &nobody], 69),
        (&["run", "--config", "nowhere.toml"], 78),
        (&["run", "--config", "wrong.toml"], 78),
        (&["check", "--config", "nowhere.toml"], 78),
    ] {
        let outcome = gimbald(folder, arguments, &[]);
        assert_eq!(outcome.code, Some(code), "{arguments:?}: {}", outcome.errors);
        assert_eq!(outcome.errors.is_empty(), code == 0, "{arguments:?}: {}", outcome.errors);
    }
}
