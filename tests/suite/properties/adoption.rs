//! Which device is which gimbal's, whoever speaks where and when.

use std::collections::BTreeMap;
use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, Transport};
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{GIMBAL_DEVICE_SET_ATTITUDE_DATA, MavMessage};
use proptest::prelude::*;

use crate::support::script::{NAN, command_long, device_information, gimbal_heartbeat, usual_capabilities};
use crate::support::world::{GCS, Place, World, link, three_links};

/// The vehicle's first and second device, and two of another system.
const DEVICES: [MavId; 4] = [MavId::new(1, 154), MavId::new(1, 171), MavId::new(42, 154), MavId::new(42, 171)];

const LOST_AFTER: Duration = Duration::from_secs(3);

/// Somebody speaks, after some time.
#[derive(Clone, Debug)]
struct Word {
    after_ms: u64,
    device: usize,
    /// The link of gimbals, or another.
    on_gimbal_link: bool,
    informs: bool,
}

fn word() -> impl Strategy<Value = Word> {
    let pause = prop_oneof![4 => 0_u64..300, 2 => 300_u64..1_500, 1 => 2_500_u64..12_000];
    (pause, 0..DEVICES.len(), any::<bool>(), any::<bool>())
        .prop_map(|(after_ms, device, on_gimbal_link, informs)| Word { after_ms, device, on_gimbal_link, informs })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// A gimbal is one device at one place. It becomes another one only when it was silent there for three seconds, or
    /// takes the vehicle's system id; no device is two gimbals; and each is told what it is told at one place only.
    #[test]
    fn gimbals_never_alternate(words in proptest::collection::vec(word(), 1..80), has_entry in any::<bool>()) {
        let mut settings = Settings { gimbals: Vec::new(), ..three_links() };
        settings.links.push(link("payload", Role::Peer, Transport::Datagrams));
        settings.gimbals.extend(has_entry.then(|| GimbalSettings::found("camera".to_owned())));
        let (mut world, places) = World::new(settings);
        let [_, gimbals, ground, peer]: [Place; 4] = places.try_into().expect("four links");
        let mut heard: BTreeMap<(MavId, bool), Timestamp> = BTreeMap::new();
        let mut known: BTreeMap<u8, Known> = BTreeMap::new();

        for word in words {
            world.run_for(Duration::from_millis(word.after_ms));
            let (device, place) = (DEVICES[word.device], if word.on_gimbal_link { gimbals } else { peer });
            let message = match word.informs {
                true => {
                    let mut information = device_information(world.now, usual_capabilities());
                    information.uid = 10 + word.device as u64;
                    MavMessage::GIMBAL_DEVICE_INFORMATION(information)
                }
                false => gimbal_heartbeat(),
            };
            world.send(place, device, &message);
            heard.insert((device, word.on_gimbal_link), world.now);

            let now = current(&mut world, [gimbals, peer], ground);
            let mut devices: Vec<MavId> = now.values().map(|known| known.device).collect();
            devices.sort();
            devices.dedup();
            prop_assert_eq!(devices.len(), now.len(), "one device is two gimbals: {:?}", now);
            for (manager, after) in now {
                let before = known.insert(manager, after).unwrap_or(after);
                if before.device == after.device && after.on_gimbal_link.is_none() {
                    // Where it is cannot be seen at present; that it was elsewhere would be.
                    known.insert(manager, before);
                }
                let Some(place) = before.on_gimbal_link else { continue };
                let moved = after.on_gimbal_link.is_some_and(|now_on| now_on != place);
                if before.device == after.device && !moved {
                    continue;
                }
                let silent = heard.get(&(before.device, place)).is_none_or(|at| world.now - *at >= LOST_AFTER);
                let same_component = before.device.component == after.device.component;
                let came_home = same_component && (before.device.system, after.device.system) == (42, 1);
                prop_assert!(silent || came_home, "{manager}: {before:?} became {after:?}");
            }
        }
    }
}

/// What a manager has.
#[derive(Clone, Copy, Debug)]
struct Known {
    device: MavId,
    /// Where it is told something; unknown as long as it cannot be steered.
    on_gimbal_link: Option<bool>,
}

/// By manager, the gimbals that are there, and where they are told something.
fn current(world: &mut World, places: [Place; 2], ground: Place) -> BTreeMap<u8, Known> {
    let mut found = BTreeMap::new();
    for gimbal in world.snapshot().gimbals {
        let manager = gimbal.manager_component_id;
        let Some(device) = gimbal.device.and_then(|id| DEVICES.into_iter().find(|device| device.to_string() == id))
        else {
            continue;
        };
        world.forget();
        // Different each time, so that it is told at once.
        let pitch = -1.0 - f32::from((world.now.as_micros() % 20) as u8);
        let command = command_long(MavId::new(1, manager), 1000, &[pitch, 0.0, NAN, NAN, 44.0, 0.0, 0.0]);
        world.send(ground, GCS, &command);
        let mut told = Vec::new();
        for (place, on_gimbal_link) in places.into_iter().zip([true, false]) {
            for setpoint in world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(place) {
                assert_eq!(MavId::new(setpoint.target_system, setpoint.target_component), device);
                told.push(on_gimbal_link);
            }
        }
        assert!(told.len() <= 1, "{manager}: told at {told:?}");
        found.insert(manager, Known { device, on_gimbal_link: told.first().copied() });
    }
    found
}
