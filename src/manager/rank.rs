//! Who ranks above whom when control is contended (`takeover = "priority"`).
//!
//! Whether a component is a ground station it says itself, in its heartbeat.

use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::mav_type;

/// So many ground stations are remembered; of more, those heard last.
const MAX_GROUND_STATIONS: usize = 32;

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
    ground_stations: Vec<(MavId, Timestamp)>,
}

impl Ranks {
    pub fn set_own_system(&mut self, system: Option<u8>) {
        self.own_system = system;
    }

    /// `id` says in its heartbeat what it is (`MAV_TYPE`).
    pub fn handle_heartbeat(&mut self, now: Timestamp, id: MavId, kind: u8) {
        let known = self.ground_stations.iter().position(|(station, _)| *station == id);
        match (kind == mav_type::GCS, known) {
            (true, Some(at)) => self.ground_stations[at].1 = now,
            (true, None) => {
                if self.ground_stations.len() >= MAX_GROUND_STATIONS {
                    let oldest = self.ground_stations.iter().enumerate().min_by_key(|(_, (_, heard))| *heard);
                    if let Some(oldest) = oldest.map(|(at, _)| at) {
                        self.ground_stations.swap_remove(oldest);
                    }
                }
                self.ground_stations.push((id, now));
            }
            (false, Some(at)) => {
                self.ground_stations.swap_remove(at);
            }
            (false, None) => {}
        }
    }

    /// Whether `id` said last that it is a ground station.
    pub fn is_ground_station(&self, id: MavId) -> bool {
        self.ground_stations.iter().any(|(station, _)| *station == id)
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

        ranks.handle_heartbeat(Timestamp::ZERO, STATION, mav_type::GCS);
        ranks.handle_heartbeat(Timestamp::ZERO, COMPANION, mav_type::ONBOARD_CONTROLLER);

        let order = [STATION, AUTOPILOT, COMPANION, MavId::new(8, 1)].map(|id| rank(&ranks, id));
        assert_eq!(order, [Rank::GroundStation, Rank::Autopilot, Rank::OnBoard, Rank::Stranger]);
        assert!(order.is_sorted_by(|higher, lower| higher > lower));
        ranks.handle_heartbeat(Timestamp::ZERO, STATION, mav_type::ONBOARD_CONTROLLER);
        assert_eq!(rank(&ranks, STATION), Rank::Stranger, "it is something else");
    }

    #[test]
    fn however_many_call_themselves_ground_stations_the_table_is_bounded() {
        let mut ranks = Ranks::default();
        for number in 0..1_000 {
            let id = MavId::new(number as u8, (number / 256) as u8);
            ranks.handle_heartbeat(Timestamp::from_millis(number), id, mav_type::GCS);
        }
        assert_eq!(ranks.ground_stations.len(), MAX_GROUND_STATIONS);
        assert_eq!(ranks.of(MavId::new((999 % 256) as u8, 3), None), Rank::GroundStation, "the latest is known");
        assert_eq!(ranks.of(MavId::new(0, 0), None), Rank::Stranger, "the first is forgotten");
    }
}
