//! `gimbald demo` and `gimbald sim` as whole processes, with a scripted ground station on a real socket.

mod client;
mod process;

use std::fs;
use std::net::{SocketAddr, UdpSocket};
use std::path::Path;
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime};

use gimbald::bridge::snapshot::{LinkSnapshot, Snapshot};
use gimbald::wire::dialect::{
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_MANAGER_INFORMATION_DATA, GIMBAL_MANAGER_STATUS_DATA, HEARTBEAT_DATA,
    SYSTEM_TIME_DATA,
};
use gimbald::wire::ids::{command, message};

use self::client::{Client, frame, frames_of, status};
use self::process::{Process, free_tcp, free_udp};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER};

const ACCEPTED: u8 = 0;
/// "Command is valid, but cannot be executed at this time … Retrying later should work".
const TEMPORARILY_REJECTED: u8 = 1;
/// Roll and pitch locked to the horizon.
const LEVEL: u16 = 4 | 8;
const YAW_IN_VEHICLE_FRAME: u16 = 32;
const YAW_IN_EARTH_FRAME: u16 = 64;
const DEVICE: f32 = 154.0;
const NAN: f32 = f32::NAN;
const LONGEST_SILENCE: Duration = Duration::from_secs(12);
/// How long a process that was asked to end may take.
const GOODBYE: Duration = Duration::from_secs(3);

/// "`gimbald demo`: the whole system without hardware: simulated vehicle and gimbal as separate peers over a real
/// pseudo-terminal and real UDP, the real daemon between them".
#[test]
fn a_client_of_the_demo_steers_the_gimbal() {
    let (page, second) = (free_tcp(), free_udp());
    let ground = Listener::start();
    let ground_endpoint = format!("udpout:{}", ground.address);
    let (http, second_client, duration) = (page.to_string(), second.to_string(), "9");
    let demo = Process::start(&[
        "demo",
        "--http",
        &http,
        "--ground",
        &ground_endpoint,
        "--client",
        &second_client,
        "--duration",
        duration,
        "--log",
        "warn",
    ]);
    let mut client = Client::new(second);

    meet_manager(&mut client);

    let take = [GCS.system.into(), GCS.component.into(), -1.0, -1.0, 0.0, 0.0, DEVICE];
    assert_eq!(client.command(command::DO_GIMBAL_MANAGER_CONFIGURE, take), ACCEPTED);
    expect_controller(&mut client, (GCS.system, GCS.component));
    point(&mut client, -30.0, 20.0);
    let snapshot = status(page);
    assert_in_order(&snapshot, Some("255/190"), (-30.0, 20.0));
    let links: Vec<_> = snapshot.links.iter().map(|link| (link.name.as_str(), link.role.as_str())).collect();
    let expected = [("gimbal", "gimbal"), ("autopilot", "autopilot"), ("ground", "ground"), ("client", "ground")];
    assert_eq!(links, expected);

    let release = [-3.0, -3.0, -1.0, -1.0, 0.0, 0.0, DEVICE];
    assert_eq!(client.command(command::DO_GIMBAL_MANAGER_CONFIGURE, release), ACCEPTED);
    expect_controller(&mut client, (0, 0));
    assert_eq!(status(page).gimbals[0].primary, None);

    let outcome = demo.end(Duration::from_secs(9) + GOODBYE);
    assert_eq!((outcome.code, outcome.errors.as_str()), (Some(0), ""));
    assert!(outcome.output.contains(&format!("http://{http}")), "{}", outcome.output);
    // "mavproxy.py --master=udpout:…": where a second client connects is part of the demo's instructions.
    assert!(outcome.output.contains(&format!("--master=udpout:{second},")), "{}", outcome.output);
    let control = "gimbald gimbal gimbal-154 point --pitch-deg -30 --token-file ";
    let (_, rest) = outcome.output.split_once(control).unwrap_or_else(|| panic!("{}", outcome.output));
    let (token_file, rest) = rest.split_once(' ').expect("the page is not where it usually is");
    assert!(rest.starts_with(&format!("--url http://{http}\n")), "{rest}");
    assert!(!Path::new(token_file).exists(), "{token_file} ends with the demo");
    let heard = ground.stop();
    for source in [AUTOPILOT, MANAGER] {
        let beats =
            |bytes: &Vec<u8>| (frame(bytes).message_id(), frame(bytes).source()) == (message::HEARTBEAT, source);
        assert!(heard.iter().any(beats), "the ground link hears {source} as well");
    }
}

/// "`gimbald sim gimbal`: a simulated gimbal on its own; `gimbald sim vehicle`: a simulated autopilot on its own".
#[test]
fn simulated_peers_on_their_own_serve_a_configured_daemon() {
    let (gimbal, autopilot, ground, page) = (free_udp(), free_udp(), free_udp(), free_tcp());
    let directory = tempfile::tempdir().expect("a directory");
    let config = directory.path().join("gimbald.toml");
    let mut text = format!("[http]\nlisten = \"{page}\"\n");
    for (role, address) in [("gimbal", gimbal), ("autopilot", autopilot), ("ground", ground)] {
        text += &format!("[[link]]\nname = \"{role}\"\nrole = \"{role}\"\nendpoint = \"udpin:{address}\"\n");
    }
    fs::write(&config, text).expect("it can be written");
    let (gimbal, autopilot) = (format!("udpout:{gimbal}"), format!("udpout:{autopilot}"));
    let started = unix_time();
    let processes = [
        Process::start(&["run", "--config", config.to_str().expect("plain letters"), "--log", "warn"]),
        Process::start(&["sim", "gimbal", "--endpoint", &gimbal, "--log", "error"]),
        Process::start(&["sim", "vehicle", "--endpoint", &autopilot, "--log", "error"]),
    ];
    let mut client = Client::new(ground);

    meet_manager(&mut client);
    let time = client.wait_for(|source, time: &SYSTEM_TIME_DATA| {
        (source == AUTOPILOT).then(|| Duration::from_micros(time.time_unix_usec))
    });
    assert!(time >= started && time <= unix_time(), "the vehicle knows the time: {started:?}, {time:?}");
    point(&mut client, -45.0, -10.0);
    assert_in_order(&status(page), None, (-45.0, -10.0));

    for process in processes.into_iter().rev() {
        process.terminate();
        let outcome = process.end(GOODBYE);
        assert_eq!((outcome.code, outcome.output.as_str(), outcome.errors.as_str()), (Some(0), "", ""));
    }
}

/// A gimbal manager is found by its status and asked who it is, again as long as it does not know its gimbal yet.
#[track_caller]
fn meet_manager(client: &mut Client) {
    let request = [message::GIMBAL_MANAGER_INFORMATION as f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut results = (0..25).map(|_| {
        expect_controller(client, (0, 0));
        client.command(command::REQUEST_MESSAGE, request)
    });
    assert_eq!(results.find(|result| *result != TEMPORARILY_REJECTED), Some(ACCEPTED));
    client.wait_for(|source, information: &GIMBAL_MANAGER_INFORMATION_DATA| {
        assert_eq!((source, information.gimbal_device_id), (MANAGER, 154));
        assert!(information.pitch_min < -45f32.to_radians() && information.yaw_max > 20f32.to_radians());
        Some(())
    });
    // From its first heartbeat after the system id was settled the vehicle is known to the manager, too.
    client.wait_for(|source, beat: &HEARTBEAT_DATA| {
        (source == AUTOPILOT).then(|| assert_eq!((beat.mavtype, beat.autopilot), (2, 12)))
    });
}

/// `GIMBAL_MANAGER_STATUS` comes to say who is in primary control.
#[track_caller]
fn expect_controller(client: &mut Client, expected: (u8, u8)) {
    client.wait_for(|source, status: &GIMBAL_MANAGER_STATUS_DATA| {
        let controller = (status.primary_control_sysid, status.primary_control_compid);
        (source == MANAGER && status.gimbal_device_id == 154 && controller == expected).then_some(())
    });
}

/// `MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW` in the vehicle's frame is accepted, and the device says that it looks there;
/// both in degrees.
#[track_caller]
fn point(client: &mut Client, pitch: f32, yaw: f32) {
    let pitchyaw = [pitch, yaw, NAN, NAN, f32::from(LEVEL | YAW_IN_VEHICLE_FRAME), 0.0, DEVICE];
    assert_eq!(client.command(command::DO_GIMBAL_MANAGER_PITCHYAW, pitchyaw), ACCEPTED);
    client.wait_for(|source, attitude: &GIMBAL_DEVICE_ATTITUDE_STATUS_DATA| {
        let [w, x, y, z] = attitude.q;
        let is_pitch = (2.0 * (w * y - z * x)).asin().to_degrees();
        let is_yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z)).to_degrees();
        // "delta_yaw: Yaw angle relating the quaternions in earth and body frames".
        let heading = if attitude.flags & YAW_IN_EARTH_FRAME == 0 { 0.0 } else { attitude.delta_yaw.to_degrees() };
        let yaw_error = (is_yaw - heading - yaw + 540.0).rem_euclid(360.0) - 180.0;
        let there = (is_pitch - pitch).abs() < 0.5 && yaw_error.abs() < 0.5;
        (source == GIMBAL && attitude.flags & LEVEL == LEVEL && there).then_some(())
    });
}

/// All links are up and undisturbed; the vehicle flies; the gimbal looks at `pitch` and `yaw` in degrees.
#[track_caller]
fn assert_in_order(snapshot: &Snapshot, primary: Option<&str>, (pitch, yaw): (f64, f64)) {
    assert_eq!(snapshot.version, env!("CARGO_PKG_VERSION"));
    assert_eq!(snapshot.system_id, Some(1));
    assert_eq!(snapshot.conflicts, Vec::<String>::new());
    for link in &snapshot.links {
        let LinkSnapshot { state, reason, crc_errors, resync_bytes, rx_frames, tx_frames, peers, .. } = link;
        assert_eq!((state.as_str(), reason, *crc_errors, *resync_bytes), ("up", &None, 0, 0), "{link:?}");
        // The station behind the link `ground` of the demo only listens.
        assert!(*tx_frames > 0 && (*rx_frames > 0 || link.name == "ground") && peers.len() == 1, "{link:?}");
    }
    let vehicle = &snapshot.vehicle;
    assert_eq!((vehicle.system_id, vehicle.autopilot.as_deref(), vehicle.alive), (Some(1), Some("px4"), true));
    assert!(vehicle.latitude_deg.is_some() && vehicle.heading_deg.is_some(), "{vehicle:?}");
    let [gimbal] = &snapshot.gimbals[..] else { panic!("one gimbal: {:?}", snapshot.gimbals) };
    assert_eq!((gimbal.state.as_str(), gimbal.device.as_deref()), ("alive", Some("1/154")));
    assert_eq!((gimbal.primary.as_deref(), gimbal.secondary.as_deref()), (primary, None));
    let near = |is: Option<f64>, wanted: f64| is.is_some_and(|is| (is - wanted).abs() < 1.0);
    let attitude = &gimbal.attitude;
    assert!(near(attitude.pitch_deg, pitch) && near(attitude.yaw_vehicle_deg, yaw), "{attitude:?}");
}

/// A station that only listens.
struct Listener {
    address: SocketAddr,
    thread: JoinHandle<Vec<Vec<u8>>>,
}

impl Listener {
    fn start() -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        let address = socket.local_addr().expect("it is bound");
        socket.set_read_timeout(Some(LONGEST_SILENCE)).expect("it can be set");
        let thread = thread::spawn(move || {
            let mut heard = Vec::new();
            let mut datagram = [0; 2048];
            loop {
                match socket.recv(&mut datagram).expect("something comes") {
                    // Nobody but `stop` sends this.
                    0 => return heard,
                    length => heard.extend(frames_of(&datagram[..length])),
                }
            }
        });
        Self { address, thread }
    }

    /// The frames that it heard.
    #[track_caller]
    fn stop(self) -> Vec<Vec<u8>> {
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        socket.send_to(&[], self.address).expect("sent");
        self.thread.join().expect("it heard MAVLink 2 and nothing else")
    }
}

/// Since 1970.
#[expect(clippy::disallowed_methods, reason = "a real process is compared with")]
fn unix_time() -> Duration {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("it is later than 1970")
}
