//! Gimbals without an entry are who they were after a restart.

use std::time::Duration;

use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::MavMessage;
use nix::sys::signal::Signal;

use crate::support::daemon::{Site, Station, link, wait_for};
use crate::support::script::{device_information, gimbal_heartbeat, usual_capabilities};

/// "Our ids must be stable" (notes on peers 2.2), on the real file: found the other way round by the next process, each has its
/// manager again; and a file of something else keeps none from having one.
#[test]
fn after_a_restart_each_gimbal_has_its_manager_again() {
    let site = Site::new();
    let config = ["[vehicle]\nsystem_id = 1\n".to_owned(), link("gimbals", "gimbal", "udpin:{ip}:14600")].concat();
    let variables = [("STATE_DIRECTORY", "{dir}")];
    let to = site.port(14_600);
    let mut a = Station::new(MavId::new(1, 70), to);
    let mut b = Station::new(MavId::new(1, 77), to);
    let file = site.path("gimbal-ids");
    for (damage, b_comes_first, expected) in [
        (None, false, [("1/70", 192), ("1/77", 193)]),
        (None, true, [("1/70", 192), ("1/77", 193)]),
        (Some(&b"1/70\n\xff\0\n1/70\t255\t99\n"[..]), true, [("1/70", 193), ("1/77", 192)]),
        (None, false, [("1/70", 193), ("1/77", 192)]),
    ] {
        if let Some(bytes) = damage {
            std::fs::write(&file, bytes).expect("a writable folder");
        }
        let mut daemon = site.start(&config, &variables);
        daemon.wait_until_up();
        let mut stations = [&mut a, &mut b];
        if b_comes_first {
            stations.reverse();
        }
        for station in stations {
            let device = station.id.to_string();
            wait_for("it to be found", || {
                station.send(&gimbal_heartbeat());
                let information = device_information(Timestamp::ZERO, usual_capabilities());
                station.send(&MavMessage::GIMBAL_DEVICE_INFORMATION(information));
                station.hear_for(Duration::from_millis(50));
                let is_it = |known: Option<&str>| known == Some(device.as_str());
                daemon.status().gimbals.iter().any(|gimbal| is_it(gimbal.device.as_deref())).then_some(())
            });
        }
        let managers = daemon.status().gimbals.into_iter();
        let mut managers: Vec<_> =
            managers.filter_map(|gimbal| Some((gimbal.device?, gimbal.manager_component_id))).collect();
        managers.sort();
        assert_eq!(managers, expected.map(|(device, manager)| (device.to_owned(), manager)));
        wait_for("the ids to be stored", || {
            let text = std::fs::read_to_string(&file).ok()?;
            let mut lines: Vec<&str> = text.lines().collect();
            lines.sort();
            let wanted = expected.map(|(device, manager)| format!("{device}\t{manager}\t-"));
            (lines == wanted).then_some(())
        });
        daemon.signal(Signal::SIGTERM);
        daemon.wait();
    }
}
