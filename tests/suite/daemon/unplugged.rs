//! A serial device that goes away in flight and comes back.

use std::time::Duration;

use gimbald::wire::dialect::{ATTITUDE_DATA, HEARTBEAT_DATA};
use gimbald::wire::ids::message;

use super::{attitude, set_pitchyaw, simulated_gimbal, three_links};
use crate::support::daemon::{Heard, Site, Station, wait_for};
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER, heartbeat};

const PACE: Duration = Duration::from_millis(50);

/// Protocol checklist 177: "When the gimbal serial device disappears and returns, the daemon reopens it and rediscovers
/// within 5 s without restart", of which one second is enough; "UDP traffic unaffected; CPU under 1 % while it is
/// gone"; "no change of link state moves the camera by itself".
#[test]
fn a_gimbal_that_is_unplugged_costs_nothing_and_comes_back() {
    let site = Site::new();
    let path = site.path("gimbal");
    let gimbal = simulated_gimbal();
    let cable = gimbal.plug_in(&path);
    let daemon = site.start(&three_links(), &[]);
    daemon.wait_for_gimbal();
    let mut autopilot = Station::new(AUTOPILOT, site.port(14_540));
    let mut ground = Station::new(GCS, site.port(14_550));
    // The client streams one angle; telemetry flows past it all the time.
    let mut sent = 0;
    let mut stream = |ground: &mut Station, for_how_long: Duration| -> Vec<Heard> {
        let mut heard = Vec::new();
        let end = ground.clock.now() + for_how_long;
        while ground.clock.now() < end {
            if sent % 10 == 0 {
                ground.send(&heartbeat(6, 8));
                autopilot.send(&heartbeat(2, 12));
            }
            ground.send(&set_pitchyaw(-0.5, 0.0, f32::NAN, f32::NAN));
            autopilot.send(&attitude(sent));
            sent += 1;
            heard.extend(ground.hear_for(PACE));
        }
        heard
    };
    let pitch = || gimbal.with(|device, _| device.plant().pose().pitch.degrees());
    wait_for("the gimbal to look down", || {
        stream(&mut ground, PACE);
        ((pitch() - (-0.5_f64).to_degrees()).abs() < 0.1).then_some(())
    });

    cable.pull();
    stream(&mut ground, Duration::from_millis(200));
    let pitch_before = pitch();
    let gone = stream(&mut ground, Duration::from_millis(2_500));
    // What the traffic costs is no cost of the missing device.
    let before = daemon.processor_time();
    let quiet = ground.hear_for(Duration::from_secs(2));
    let used = daemon.processor_time() - before;
    let down = daemon.status();
    gimbal.take_heard();
    let returned = ground.clock.now();
    let _cable = gimbal.plug_in(&path);
    let back = stream(&mut ground, Duration::from_secs(1));

    assert_eq!(
        (down.links[1].state.as_str(), down.links[0].state.as_str(), down.links[2].state.as_str()),
        ("down", "up", "up")
    );
    assert!(
        down.links[1].reason.as_deref().is_some_and(|reason| reason.contains("no such file")),
        "{:?}",
        down.links[1]
    );
    // UDP: the telemetry of each step arrives, and so do heartbeats.
    let numbers: Vec<u32> =
        gone.iter().filter_map(Heard::decode).map(|sent: ATTITUDE_DATA| sent.time_boot_ms).collect();
    assert!(numbers.len() >= 40 && numbers.windows(2).all(|pair| pair[1] == pair[0] + 1), "{numbers:?}");
    let beats =
        gone.iter().filter(|heard| heard.source == MANAGER && heard.decode::<HEARTBEAT_DATA>().is_some()).count();
    assert!((2..=3).contains(&beats), "{beats}");
    assert!(used <= Duration::from_millis(20), "{used:?} of 2 s");
    assert!(quiet.iter().any(|heard| heard.source == MANAGER), "it lives");
    // The picture: alive, and 285 at the client.
    let first = back.iter().find(|heard| heard.source == GIMBAL && heard.id == message::GIMBAL_DEVICE_ATTITUDE_STATUS);
    let took = first.expect("285 within a second").at.since(returned);
    assert!(took < Duration::from_secs(1), "{took:?}");
    assert_eq!(daemon.status().gimbals[0].state, "alive");
    // Nothing that was meant for another moment reaches the gimbal, and it stands still.
    assert!((pitch() - pitch_before).abs() < 0.1, "{pitch_before} {}", pitch());
    let setpoints = gimbal.take_heard().iter().filter(|heard| heard.id == message::GIMBAL_DEVICE_SET_ATTITUDE).count();
    assert!(setpoints <= 45, "{setpoints} setpoints in a second at 20 Hz and as many demands");
}
