//! Recordings played through the core: who is found, what goes where, and who is in our way.

use std::collections::BTreeMap;

use gimbald::bridge::settings::Settings;
use gimbald::bridge::snapshot::Snapshot;
use gimbald::config;
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings, SystemId};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_LONG_DATA, GIMBAL_MANAGER_STATUS_DATA};
use gimbald::wire::ids::message;
use serde_json::json;

use crate::support::tlog::{self, Record};
use crate::support::world::{AUTOPILOT, Arrival, GCS, GIMBAL, MANAGER, Place, World};

const SET_ATTITUDE: u32 = message::GIMBAL_DEVICE_SET_ATTITUDE;

/// Who plays the gimbal of a replay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gimbal {
    /// Its frames are in the recording.
    Recorded,
    /// They are not, and a simulated one is there in its stead.
    Simulated,
    Absent,
}

/// One recording after it went through the core.
pub struct Replay {
    pub recording: &'static str,
    records: Vec<Record>,
    /// What came out, by link.
    heard: BTreeMap<&'static str, Vec<Arrival>>,
    pub snapshot: Snapshot,
}

/// Plays a recording in: each frame on the link of its source, at its time.
pub fn replay(capture: &str, recording: &'static str, gimbal: Gimbal) -> Replay {
    replay_with(capture, recording, gimbal, false)
}

/// The same, with the gimbal presented to the autopilot or not.
pub fn replay_with(capture: &str, recording: &'static str, gimbal: Gimbal, present_device: bool) -> Replay {
    let folder = tlog::capture(capture);
    let settings = config::load(&folder.join("config.toml"), std::iter::empty())
        .unwrap_or_else(|problems| panic!("{capture}: {problems}"));
    let (mut world, places) = World::new(Settings { present_device, ..settings.core });
    let [autopilot, device, ground]: [Place; 3] = places.try_into().expect("three links");
    if gimbal == Gimbal::Simulated {
        let settings = DeviceSettings { system_id: SystemId::Fixed(1), ..DeviceSettings::default() };
        world.install(device, Device::new(Timestamp::ZERO, settings));
    }
    let records = tlog::read(&folder.join(format!("{recording}.tlog")));
    for record in &records {
        let place = match record.source() {
            AUTOPILOT => autopilot,
            GIMBAL => device,
            GCS => ground,
            other => panic!("{capture}: nobody knows {other}"),
        };
        assert!(place != device || gimbal == Gimbal::Recorded, "{capture}: two gimbals at once");
        world.run_for(record.at - world.now);
        world.send_bytes(place, &record.bytes);
    }
    let snapshot = world.snapshot();
    let heard = [("autopilot", autopilot), ("gimbal", device), ("ground", ground)]
        .map(|(name, place)| (name, world.take(place)));
    Replay { recording, records, heard: BTreeMap::from(heard), snapshot }
}

impl Replay {
    /// What is written down of a replay: the state at its end, then what went where, counted by source and message.
    pub fn lines(&self) -> Vec<String> {
        let gimbals: Vec<_> = self
            .snapshot
            .gimbals
            .iter()
            .map(|gimbal| {
                json!({
                    "device": gimbal.device, "manager": gimbal.manager_component_id, "state": gimbal.state,
                    "model": gimbal.model, "primary": gimbal.primary, "setpoint": gimbal.setpoint.is_some(),
                })
            })
            .collect();
        let dropped: BTreeMap<_, _> =
            self.snapshot.links.iter().map(|link| (link.name.clone(), link.dropped.clone())).collect();
        let state = json!({
            "replay": self.recording, "system_id": self.snapshot.system_id,
            "autopilot": self.snapshot.vehicle.autopilot, "gimbals": gimbals,
            "conflicts": self.snapshot.conflicts, "dropped": dropped,
        });
        let mut lines = vec![state.to_string()];
        for (link, arrivals) in &self.heard {
            let mut counts: BTreeMap<_, u64> = BTreeMap::new();
            for arrival in arrivals {
                *counts.entry((arrival.source(), arrival.id(), arrival.frame().name())).or_default() += 1;
            }
            for ((source, id, name), count) in counts {
                let source = source.to_string();
                let line = json!({
                    "replay": self.recording, "to": link, "from": source, "id": id, "message": name, "count": count,
                });
                lines.push(line.to_string());
            }
        }
        lines
    }

    /// No frame was lost on the way in, and each was counted on the link it came on.
    pub fn assert_everything_was_read(&self) {
        let simulated = self.snapshot.links[1].rx_frames - self.recorded_from("gimbal");
        let read: u64 = self.snapshot.links.iter().map(|link| link.rx_frames).sum();
        assert_eq!(read - simulated, self.records.len() as u64);
        for link in &self.snapshot.links {
            assert_eq!((link.crc_errors, link.resync_bytes), (0, 0), "{}", link.name);
        }
        for (link, source) in [(0, "autopilot"), (2, "ground")] {
            assert_eq!(self.snapshot.links[link].rx_frames, self.recorded_from(source), "{source}");
        }
    }

    /// The autopilot's system id is ours, and is used for everything we say.
    pub fn assert_the_system_id_is_adopted(&self) {
        assert_eq!((self.snapshot.system_id, self.snapshot.vehicle.system_id), (Some(1), Some(1)));
        for arrivals in self.heard.values() {
            let first = arrivals.iter().find(|arrival| arrival.source() == MANAGER).expect("we were heard");
            assert_eq!(first.id(), message::HEARTBEAT);
            assert!(first.at >= Timestamp::from_secs(3), "the window is over");
        }
    }

    /// What the autopilot tells gimbals arrives there as it was sent, each once and in order, from when our system id is
    /// settled; what we tell in its stead is told only where it tells nothing.
    pub fn assert_gimbals_hear_the_autopilot(&self) {
        let settled = self.heard["gimbal"].first().expect("our heartbeat").at;
        let of_interest = |frame: &[u8]| frame[0] == 0xfd && frame[7..10] == [0x1e, 1, 0];
        let sent: Vec<&Vec<u8>> = self
            .records
            .iter()
            .filter(|record| record.at >= settled && of_interest(&record.bytes))
            .map(|record| &record.bytes)
            .collect();
        let (ours, heard): (Vec<&Arrival>, Vec<&Arrival>) = self.heard["gimbal"]
            .iter()
            .filter(|arrival| of_interest(&arrival.bytes))
            .partition(|arrival| arrival.source() == MANAGER);
        let heard: Vec<&Vec<u8>> = heard.into_iter().map(|arrival| &arrival.bytes).collect();
        assert!(sent == heard, "{} sent, {} heard", sent.len(), heard.len());
        assert!(sent.is_empty() || ours.is_empty(), "{} sent, and {} of ours", sent.len(), ours.len());
    }

    /// Nobody's orders reach the gimbal once it is managed: not the autopilot's past us, and none of ours that nobody
    /// asked for.
    pub fn assert_the_gimbal_is_left_alone(&self) {
        let heard = &self.heard["gimbal"];
        assert!(heard.iter().all(|arrival| arrival.id() != SET_ATTITUDE || arrival.source() != MANAGER));
        let managed = heard.iter().skip_while(|arrival| arrival.id() != message::GIMBAL_MANAGER_STATUS);
        for arrival in managed {
            assert_ne!(arrival.id(), SET_ATTITUDE, "from {}", arrival.source());
            if arrival.id() == message::COMMAND_LONG {
                let command = arrival.decode::<COMMAND_LONG_DATA>().command;
                assert!(![204, 205, 220].contains(&command), "{command} from {}", arrival.source());
            }
        }
    }

    /// Every status of ours names the device that was found, and nobody in control.
    pub fn assert_our_manager_is_consistent(&self) {
        for arrival in self.heard.values().flatten() {
            if arrival.id() == message::GIMBAL_MANAGER_STATUS && arrival.source() == MANAGER {
                let told: GIMBAL_MANAGER_STATUS_DATA = arrival.decode();
                let holders = [
                    told.primary_control_sysid,
                    told.primary_control_compid,
                    told.secondary_control_sysid,
                    told.secondary_control_compid,
                ];
                assert_eq!((told.gimbal_device_id, holders), (154, [0; 4]));
            }
        }
    }

    /// What came out on a link, from that source and with one of these ids.
    pub fn heard_on(&self, link: &str, source: MavId, ids: &[u32]) -> usize {
        self.heard[link].iter().filter(|arrival| arrival.source() == source && ids.contains(&arrival.id())).count()
    }

    /// What the autopilot said with one of these ids after our system id was settled.
    pub fn said_by_autopilot(&self, ids: &[u32]) -> usize {
        let settled = self.heard["autopilot"].first().expect("our heartbeat").at;
        let said = self.records.iter().filter(|record| record.at >= settled && record.source() == AUTOPILOT);
        said.filter(|record| ids.contains(&u32::from_le_bytes([record.bytes[7], record.bytes[8], record.bytes[9], 0])))
            .count()
    }

    fn recorded_from(&self, link: &str) -> u64 {
        let source = match link {
            "autopilot" => AUTOPILOT,
            "gimbal" => GIMBAL,
            _ => GCS,
        };
        self.records.iter().filter(|record| record.source() == source).count() as u64
    }
}
