//! Who ranks above whom when control is contended (`takeover = "priority"`).
//!
//! Whether a component is a ground station it says itself, in its heartbeat.

use std::collections::BTreeMap;

use crate::wire::MavId;
use crate::wire::ids::mav_type;

/// How much a component's word counts, the least first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rank {
    /// Anybody else, such as a component of a system without an autopilot.
    Stranger,
    /// A component of our own system.
    OnBoard,
    /// The autopilot of our own system.
    Autopilot,
    /// A person's.
    GroundStation,
}

/// What is known of the components around.
#[derive(Clone, Debug, Default)]
pub struct Ranks {
    own_system: Option<u8>,
    /// By system, which components of it are ground stations. There is room for every id: whoever holds control keeps its rank,
    /// however many others call themselves ground stations.
    ground_stations: BTreeMap<u8, [bool; 256]>,
}

impl Ranks {
    pub fn set_own_system(&mut self, system: Option<u8>) {
        self.own_system = system;
    }

    /// `id` says in its heartbeat what it is (`MAV_TYPE`).
    pub fn handle_heartbeat(&mut self, id: MavId, kind: u8) {
        let is_ground_station = kind == mav_type::GCS;
        if is_ground_station || self.is_ground_station(id) {
            let components = self.ground_stations.entry(id.system).or_insert([false; 256]);
            components[usize::from(id.component)] = is_ground_station;
        }
    }

    /// Whether `id` said last that it is a ground station.
    pub fn is_ground_station(&self, id: MavId) -> bool {
        self.ground_stations.get(&id.system).is_some_and(|components| components[usize::from(id.component)])
    }

    /// The rank of `id`, where `autopilot` is our system's.
    pub fn of(&self, id: MavId, autopilot: Option<MavId>) -> Rank {
        if self.is_ground_station(id) {
            Rank::GroundStation
        } else if autopilot == Some(id) {
            Rank::Autopilot
        } else if Some(id.system) == self.own_system {
            Rank::OnBoard
        } else {
            Rank::Stranger
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AUTOPILOT: MavId = MavId::new(7, 1);
    const COMPANION: MavId = MavId::new(7, 192);
    const STATION: MavId = MavId::new(255, 190);

    /// "Ground station (heartbeat `MAV_TYPE` GCS) > our vehicle's autopilot > other components of our system > anybody
    /// else."
    #[test]
    fn a_ground_station_is_known_by_its_heartbeat() {
        let mut ranks = Ranks::default();
        ranks.set_own_system(Some(7));
        let rank = |ranks: &Ranks, id| ranks.of(id, Some(AUTOPILOT));
        assert_eq!(rank(&ranks, STATION), Rank::Stranger);

        ranks.handle_heartbeat(STATION, mav_type::GCS);
        ranks.handle_heartbeat(COMPANION, mav_type::ONBOARD_CONTROLLER);

        let order = [STATION, AUTOPILOT, COMPANION, MavId::new(8, 1)].map(|id| rank(&ranks, id));
        assert_eq!(order, [Rank::GroundStation, Rank::Autopilot, Rank::OnBoard, Rank::Stranger]);
        assert!(order.is_sorted_by(|higher, lower| higher > lower));
        ranks.handle_heartbeat(STATION, mav_type::ONBOARD_CONTROLLER);
        assert_eq!(rank(&ranks, STATION), Rank::Stranger, "it is something else");
    }

    /// "Ground station (heartbeat `MAV_TYPE` GCS) > our vehicle's autopilot": also while a crowd of others calls itself that.
    #[test]
    fn however_many_call_themselves_ground_stations_none_loses_its_rank() {
        let mut ranks = Ranks::default();
        ranks.handle_heartbeat(STATION, mav_type::GCS);
        for number in 0..=u16::MAX {
            let [system, component] = number.to_be_bytes();
            ranks.handle_heartbeat(MavId::new(system, component), mav_type::GCS);
        }
        assert_eq!([STATION, AUTOPILOT].map(|id| ranks.of(id, None)), [Rank::GroundStation; 2]);

        ranks.handle_heartbeat(AUTOPILOT, mav_type::ONBOARD_CONTROLLER);
        assert_eq!([STATION, AUTOPILOT].map(|id| ranks.of(id, None)), [Rank::GroundStation, Rank::Stranger]);
    }
}
