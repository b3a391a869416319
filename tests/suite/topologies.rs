//! The three usual topologies, and a gimbal on a link of its own: found by listening, never by a setting.
//!
//! "companion-centric: gimbal ══ gimbald ── autopilot, ground ── gimbald; chain: gimbal ══ autopilot ══ gimbald ── ground;
//! autopilot-centric: gimbal ══ autopilot ══ gimbald, ground ── autopilot".

use std::collections::BTreeMap;
use std::time::Duration;

use gimbald::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::sim::peer::Peer;
use gimbald::sim::vehicle::{Autopilot, Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{COMMAND_LONG_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA, GIMBAL_MANAGER_STATUS_DATA};

use crate::support::ground_station::GroundStation;
use crate::support::hub::{Hub, Watched};
use crate::support::script::request_message;
use crate::support::world::{Arrival, GCS, Place, World, link};

const SECOND: Duration = Duration::from_secs(1);
const SYSTEM: u8 = 7;
const VEHICLE: MavId = MavId::new(SYSTEM, 1);
const DEVICE: MavId = MavId::new(SYSTEM, 154);
const OUR_MANAGER: MavId = MavId::new(SYSTEM, 191);

/// What is where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Topology {
    CompanionCentric,
    Chain,
    AutopilotCentric,
    /// The gimbal on another UDP link.
    Apart,
}

const ALL: [Topology; 4] = [Topology::CompanionCentric, Topology::Chain, Topology::AutopilotCentric, Topology::Apart];

/// A vehicle, its gimbal, the core and a ground station, put together in one of the ways.
struct Rig {
    world: World,
    /// Where the daemon's lines end, by link.
    places: BTreeMap<&'static str, Place>,
    /// The link at whose end the gimbal is, and the station.
    gimbal_on: &'static str,
    ground_on: &'static str,
    device: Watched<Device>,
    ground: Watched<GroundStation>,
}

impl Rig {
    fn new(topology: Topology) -> Self {
        Self::with(topology, &[])
    }

    /// `limits`: link, message id, and the least time between two.
    fn with(topology: Topology, limits: &[(&str, u32, Duration)]) -> Self {
        let serial = Transport::Serial { baud: 921_600 };
        let mut links = vec![link("autopilot", Role::Autopilot, Transport::Datagrams)];
        match topology {
            Topology::CompanionCentric => links.push(link("gimbal", Role::Gimbal, serial)),
            Topology::Apart => links.push(link("payload", Role::Peer, Transport::Datagrams)),
            Topology::Chain | Topology::AutopilotCentric => links[0].transport = serial,
        }
        if topology != Topology::AutopilotCentric {
            links.push(link("ground", Role::Ground, Transport::Datagrams));
        }
        for LinkSettings { name, max_rates, .. } in &mut links {
            let of_link = limits.iter().filter(|(link, ..)| name == link);
            max_rates.extend(of_link.map(|(_, id, interval)| (*id, *interval)));
        }
        let names: Vec<&'static str> = links
            .iter()
            .filter_map(|link| ["autopilot", "gimbal", "payload", "ground"].into_iter().find(|name| link.name == *name))
            .collect();
        let (world, places) = World::new(Settings { system_id: SystemId::Auto, links, ..Settings::default() });
        let places: BTreeMap<_, _> = names.into_iter().zip(places).collect();

        let device = Watched::new(Device::new(Timestamp::ZERO, DeviceSettings::default()));
        let ground = Watched::new(GroundStation::new(Timestamp::ZERO));
        let (gimbal_on, ground_on) = match topology {
            Topology::CompanionCentric => ("gimbal", "ground"),
            Topology::Chain => ("autopilot", "ground"),
            Topology::AutopilotCentric => ("autopilot", "autopilot"),
            Topology::Apart => ("payload", "ground"),
        };
        let mut rig = Self { world, places, gimbal_on, ground_on, device, ground };
        rig.move_in();
        rig
    }

    fn move_in(&mut self) {
        let settings =
            VehicleSettings { system_id: SYSTEM, autopilot: Autopilot::ArduPilot, ..VehicleSettings::default() };
        let vehicle = Vehicle::new(Timestamp::ZERO, settings);
        let mut behind_autopilot: Vec<Box<dyn Peer>> = vec![Box::new(vehicle)];
        for (on, peer) in [
            (self.gimbal_on, Box::new(self.device.clone()) as Box<dyn Peer>),
            (self.ground_on, Box::new(self.ground.clone())),
        ] {
            match on {
                "autopilot" => behind_autopilot.push(peer),
                elsewhere => self.world.install(self.places[elsewhere], Hub::new(vec![peer])),
            }
        }
        self.world.install(self.places["autopilot"], Hub::new(behind_autopilot));
    }

    /// A flight in which the station finds the gimbal, takes control and tilts it.
    fn fly(&mut self) {
        self.world.run_for(10 * SECOND);
        let wanted = (SYSTEM, 191, 154);
        assert_eq!(self.ground.look().gimbals(), [wanted]);
        self.ground.touch().take_acks();
        self.ground.touch().acquire(wanted);
        self.ground.touch().tilt(wanted, -30.0);
        self.world.run_for(4 * SECOND);
    }

    fn at(&self, link: &str) -> &[Arrival] {
        self.world.arrivals(self.places[link])
    }

    fn answers_of_ours(&self) -> Vec<(u16, u8, MavId)> {
        self.ground.touch().take_acks().into_iter().filter(|(.., source)| *source == OUR_MANAGER).collect()
    }

    fn pitch_deg(&self) -> f64 {
        self.device.look().plant().pose().pitch.degrees()
    }
}

/// The gimbal is found, shown, owned and moved in each of them; setpoints go to where it is and nowhere else.
#[test]
fn in_every_topology_the_gimbal_is_found_and_steered() {
    for topology in ALL {
        let mut rig = Rig::new(topology);
        rig.fly();

        assert_eq!(rig.answers_of_ours(), [(1001, 0, OUR_MANAGER), (1000, 0, OUR_MANAGER)], "{topology:?}");
        assert!((rig.pitch_deg() + 30.0).abs() < 0.5, "{topology:?}: {}", rig.pitch_deg());
        assert_eq!(rig.device.look().id(), DEVICE);
        for link in rig.places.keys() {
            let setpoints = rig.at(link).iter().filter(|arrival| arrival.id() == 284).count();
            assert_eq!(setpoints > 50, *link == rig.gimbal_on, "{topology:?}: {setpoints} setpoints on link {link}");
        }
        let snapshot = rig.world.snapshot();
        assert_eq!(snapshot.conflicts, [""; 0], "{topology:?}");
        assert_eq!((snapshot.system_id, snapshot.vehicle.system_id), (Some(SYSTEM), Some(SYSTEM)));
        let gimbal = &snapshot.gimbals[0];
        assert_eq!((gimbal.device.as_deref(), gimbal.primary.as_deref()), (Some("7/154"), Some("255/190")));
    }
}

/// Protocol checklist 23, 24 and 130 hold in each: nothing comes twice, our numbers have no gap, answers go to who asked.
#[test]
fn items_24_and_130_hold_in_every_topology() {
    for topology in ALL {
        let mut rig = Rig::new(topology);
        rig.fly();
        for (link, place) in &rig.places {
            let heard = rig.world.arrivals(*place);
            let ours: Vec<&Arrival> = heard.iter().filter(|arrival| arrival.source() == OUR_MANAGER).collect();
            assert!(ours.windows(2).all(|pair| pair[1].bytes[4] == pair[0].bytes[4].wrapping_add(1)), "{topology:?}");
            let acks = ours.iter().filter(|arrival| arrival.id() == 77).count();
            assert_eq!(acks > 0, *link == rig.ground_on, "{topology:?}: {acks} answers on link {link}");
            // Frames of others: each once, and none where its sender is.
            let mut foreign: Vec<(Timestamp, &[u8])> = heard
                .iter()
                .filter(|arrival| arrival.source() != OUR_MANAGER)
                .map(|arrival| (arrival.at, &arrival.bytes[..]))
                .collect();
            let all = foreign.len();
            foreign.sort();
            foreign.dedup();
            assert_eq!(foreign.len(), all, "{topology:?}: twice on link {link}");
            let senders: Vec<MavId> = heard.iter().map(Arrival::source).collect();
            assert!(!senders.contains(&GCS) || *link != rig.ground_on);
            assert!(!senders.contains(&DEVICE) || *link != rig.gimbal_on);
            assert!(!senders.contains(&VEHICLE) || *link != "autopilot");
        }
    }
}

/// Protocol checklist 23, D20: an autopilot that sends back what it hears of us makes no loop and no conflict.
#[test]
fn item_23_our_own_frames_that_an_autopilot_sends_back_are_dropped() {
    for topology in [Topology::Chain, Topology::AutopilotCentric] {
        let mut rig = Rig::new(topology);
        rig.world.remove(rig.places["autopilot"]);
        let vehicle =
            Vehicle::new(Timestamp::ZERO, VehicleSettings { system_id: SYSTEM, ..VehicleSettings::default() });
        let mut members: Vec<Box<dyn Peer>> = vec![Box::new(vehicle), Box::new(rig.device.clone())];
        if topology == Topology::AutopilotCentric {
            members.push(Box::new(rig.ground.clone()));
        }
        rig.world.install(rig.places["autopilot"], Hub::echoing(members));
        rig.fly();

        let snapshot = rig.world.snapshot();
        assert_eq!(snapshot.conflicts, [""; 0], "{topology:?}");
        let ours = rig.at("autopilot").iter().filter(|arrival| arrival.source() == OUR_MANAGER).count() as u64;
        assert_eq!(snapshot.links[0].dropped.get("loop"), Some(&ours), "{topology:?}: each came back");
        assert!((rig.pitch_deg() + 30.0).abs() < 0.5, "{topology:?}");
    }
}

/// The chain, where the ground is at the end of a narrow radio: "ground's traffic to the autopilot passes, gimbal's
/// 283/285 forwarded, our 280/281 reach the ground and, sparingly, the autopilot".
#[test]
fn in_a_chain_a_narrow_radio_carries_what_it_can() {
    let quarter = Duration::from_millis(250);
    let limits = [("ground", 285, quarter), ("ground", 281, SECOND), ("autopilot", 281, 5 * SECOND)];
    let mut rig = Rig::with(Topology::Chain, &limits);
    rig.fly();
    assert!((rig.pitch_deg() + 30.0).abs() < 0.5);
    rig.world.forget();
    rig.world.run_for(10 * SECOND);

    let count = |link: &str, source: MavId, id: u32| {
        rig.at(link).iter().filter(|arrival| (arrival.source(), arrival.id()) == (source, id)).count()
    };
    assert_eq!(count("ground", DEVICE, 285), 40);
    assert_eq!(count("ground", OUR_MANAGER, 281), 10);
    assert_eq!(count("autopilot", OUR_MANAGER, 281), 2);
    let dropped = rig.world.snapshot().links[1].dropped["max_rate"];
    assert!(dropped >= 100, "{dropped}");

    // A change of control is told within a second, and the state at the end is what is told.
    rig.world.forget();
    rig.ground.touch().release((SYSTEM, 191, 154));
    rig.world.run_for(SECOND);
    let told = rig.at("ground").iter().filter(|arrival| arrival.id() == 281);
    let holders: Vec<u8> =
        told.map(|arrival| arrival.decode::<GIMBAL_MANAGER_STATUS_DATA>().primary_control_sysid).collect();
    assert_eq!(holders.last(), Some(&0), "{holders:?}");

    // What the ground says to the autopilot passes, and is not ours to answer.
    rig.world.forget();
    let request = request_message(VEHICLE, 148);
    let ground = rig.places["ground"];
    let sent = rig.world.send(ground, GCS, &request);
    assert_eq!(rig.at("autopilot").iter().filter(|arrival| arrival.bytes == sent).count(), 1);
    assert!(rig.at("ground").iter().all(|arrival| arrival.source() != OUR_MANAGER));
}

/// In the autopilot-centric topology everything goes over one line, which must not be filled with what the autopilot
/// knows: 286 for the gimbal is the autopilot's to send, and is not asked for.
#[test]
fn behind_the_autopilot_the_gimbal_is_told_its_state_by_the_autopilot() {
    for (topology, asked) in [(Topology::CompanionCentric, true), (Topology::AutopilotCentric, false)] {
        let mut rig = Rig::new(topology);
        rig.fly();
        let requests = rig.at("autopilot").iter().filter(|arrival| arrival.id() == 76).map(Arrival::decode);
        let of_state = requests.filter(|command: &COMMAND_LONG_DATA| (command.command, command.param1) == (511, 286.0));
        assert_eq!(of_state.count() > 0, asked, "{topology:?}");
    }
}

/// A gimbal that is moved in flight, from our own line to another link, is steered there, and clients see no other.
#[test]
fn a_gimbal_that_moves_is_steered_where_it_is() {
    let mut rig = Rig::new(Topology::CompanionCentric);
    rig.fly();
    let before = rig.places["gimbal"];
    rig.world.remove(before);
    let after = rig.world.open(0);
    rig.world.install(after, Hub::new(vec![Box::new(rig.device.clone())]));
    rig.world.run_for(5 * SECOND);
    rig.world.forget();

    rig.ground.touch().tilt((SYSTEM, 191, 154), -10.0);
    rig.world.run_for(3 * SECOND);

    assert!((rig.pitch_deg() + 10.0).abs() < 0.5);
    assert_eq!(rig.world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(before), []);
    assert_eq!(rig.ground.look().gimbals(), [(SYSTEM, 191, 154)]);
    assert_eq!(rig.world.snapshot().conflicts, [""; 0]);
}
