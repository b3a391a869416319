//! Which ids a gimbal is given: the component of its manager, and the device id that it has when it is no v2 device.
//!
//! An entry of the configuration has its own. A gimbal that is found without one is given what it had before, also by an
//! earlier run: clients that have learned an id go by it for good, and the order in which gimbals are found is chance. A
//! line is kept of each for the next start, its fields between tabs: the device, its manager's component and its device id,
//! with a dash where it has none. An id is of one device at most, so there are never more lines than ids; when none is
//! left for a new gimbal, the one that was found longest ago gives up its own.

use std::fmt;
use std::ops::RangeInclusive;

use super::adoption::GONE_FOR_GOOD;
use super::left_turning::read_id;
use super::{NotAdopted, Roster, manager_of_device};
use crate::manager::voice;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::component;

const BETWEEN_FIELDS: char = '\t';
const NO_ID: &str = "-";

/// The managers of gimbals without an entry.
const MANAGERS: RangeInclusive<u8> = component::ONBOARD_COMPUTER..=component::ONBOARD_COMPUTER4;
const NUMBERS: RangeInclusive<u8> = 1..=voice::LAST_NUMBER;

/// What a device without an entry was given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ids {
    device: MavId,
    /// `None` once another gimbal has it.
    manager: Option<u8>,
    /// `None` for a v2 device, and once another gimbal has it.
    number: Option<u8>,
}

impl Ids {
    /// `None` when it is no line of ours.
    fn read(line: &str) -> Option<Self> {
        let mut fields = line.split(BETWEEN_FIELDS);
        let device = read_id(fields.next()?)?;
        let mut id_within = |ids: RangeInclusive<u8>| match fields.next()? {
            NO_ID => Some(None),
            id => id.parse().ok().filter(|id| ids.contains(id)).map(Some),
        };
        let (manager, number) = (id_within(MANAGERS)?, id_within(NUMBERS)?);
        fields.next().is_none().then_some(Self { device, manager, number })
    }
}

impl fmt::Display for Ids {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let written = |id: Option<u8>| id.map_or_else(|| NO_ID.to_owned(), |id| id.to_string());
        let (manager, number) = (written(self.manager), written(self.number));
        write!(f, "{}{BETWEEN_FIELDS}{manager}{BETWEEN_FIELDS}{number}", self.device)
    }
}

/// The ids that gimbals without an entry were given.
#[derive(Debug, Default)]
pub struct KeptIds {
    /// Who was found longest ago comes first.
    all: Vec<Ids>,
    /// Grows with each change but of the order.
    revision: u32,
}

impl KeptIds {
    /// As an earlier run kept them.
    pub fn read(lines: &[String]) -> Self {
        let mut kept = Self::default();
        let mut is_understood = true;
        for line in lines {
            match Ids::read(line) {
                Some(ids) => {
                    let former = kept.all.iter().copied().find(|known| known.device == ids.device);
                    kept.replace(former, ids);
                }
                None => is_understood = false,
            }
        }
        if !is_understood {
            tracing::warn!("not all is understood of the ids that gimbals had");
        }
        kept.revision = 0;
        kept
    }

    pub fn iter(&self) -> impl Iterator<Item = &Ids> {
        self.all.iter()
    }

    pub const fn revision(&self) -> u32 {
        self.revision
    }

    /// What was `former` is `ids` now; what another had of these is taken from it.
    fn replace(&mut self, former: Option<Ids>, ids: Ids) {
        self.all.retain(|kept| Some(*kept) != former && kept.device != ids.device);
        for kept in &mut self.all {
            kept.manager = kept.manager.filter(|manager| ids.manager != Some(*manager));
            kept.number = kept.number.filter(|number| ids.number != Some(*number));
        }
        self.all.push(ids);
        self.all.retain(|kept| kept.manager.is_some() || kept.number.is_some());
        if former != Some(ids) {
            self.revision += 1;
        }
    }

    fn forget(&mut self, device: MavId) {
        let known = self.all.len();
        self.all.retain(|kept| kept.device != device);
        if self.all.len() != known {
            self.revision += 1;
        }
    }
}

impl Roster {
    /// What is kept for the next start.
    pub fn kept_ids(&self) -> &KeptIds {
        &self.kept_ids
    }

    /// What that device had, or one with its component id in another system: it takes the vehicle's system id when it has
    /// found it, and that may have changed.
    fn ids_of(&self, device: MavId) -> Option<Ids> {
        let is_it = |kept: &&Ids| kept.device == device;
        let may_be_it = |kept: &&Ids| kept.device.component == device.component && !self.is_device(kept.device);
        let kept = &self.kept_ids.all;
        kept.iter().find(is_it).or_else(|| kept.iter().rev().find(may_be_it)).copied()
    }

    /// Notes what the gimbal there has, which is its device's from now on. Entries need no memory.
    pub(super) fn note_ids(&mut self, at: usize) {
        let gimbal = &self.gimbals[at];
        let Some(device) = gimbal.adopted else { return };
        if gimbal.configured {
            self.forget_ids(device);
            return;
        }
        let former = self.ids_of(device);
        let number = gimbal.manager.kept_number().or(former.and_then(|ids| ids.number));
        let ids = Ids { device, manager: Some(gimbal.component), number };
        self.kept_ids.replace(former, ids);
    }

    /// That is no gimbal of ours, or has an entry.
    pub(super) fn forget_ids(&mut self, device: MavId) {
        self.kept_ids.forget(device);
    }

    /// Keeps a device id for a gimbal that turned out to be no v2 device: the one that is kept for its entry, the one it had,
    /// or the next that is free. The seventh has none, and so is not told of.
    pub fn keep_number(&mut self, at: usize) {
        if self.gimbals[at].manager.kept_number().is_some() {
            return;
        }
        if let Some(number) = self.free_number(at) {
            self.gimbals[at].manager.keep_number(number);
            self.note_ids(at);
        }
    }

    fn free_number(&self, at: usize) -> Option<u8> {
        let gimbal = &self.gimbals[at];
        let is_free = |number: &u8| self.gimbals.iter().all(|gimbal| gimbal.manager.kept_number() != Some(*number));
        let is_open = |number: &u8| is_free(number) && !self.spoken_for.contains(&Some(*number));
        let was_given = |number: &u8| self.kept_ids.iter().any(|kept| kept.number == Some(*number));
        let of_entry = self.spoken_for.get(at).copied().flatten().filter(is_free);
        let had = gimbal.adopted.filter(|_| !gimbal.configured).and_then(|device| self.ids_of(device)?.number);
        of_entry
            .or(had.filter(is_open))
            .or_else(|| NUMBERS.filter(is_open).find(|number| !was_given(number)))
            .or_else(|| self.kept_ids.iter().filter_map(|kept| kept.number).find(is_open))
            .or_else(|| NUMBERS.clone().find(is_free))
    }

    /// Whether these were two gimbals at one time, in an earlier run perhaps: who changes its id takes its line along.
    pub(super) fn were_two(&self, device: MavId, other: MavId) -> bool {
        let is_kept = |wanted: MavId| self.kept_ids.iter().any(|kept| kept.device == wanted);
        is_kept(device) && is_kept(other)
    }

    /// The manager that may wait for a device: the one it had, or its own by its id.
    pub(super) fn waiting_manager(&self, device: MavId) -> Option<u8> {
        let had = self.ids_of(device).and_then(|ids| ids.manager);
        let is_an_entrys =
            |manager: &u8| self.gimbals.iter().any(|gimbal| gimbal.configured && gimbal.component == *manager);
        let own = manager_of_device(device.component).filter(|manager| !self.was_anothers(*manager, device));
        had.filter(|manager| !is_an_entrys(manager)).or(own)
    }

    /// The manager component for a device without an entry; `None` when each has its gimbal. One that is kept for a gimbal
    /// that was not found yet is given up when that one has had the time to be found.
    pub(super) fn free_manager(&mut self, now: Timestamp, device: MavId) -> Result<Option<u8>, NotAdopted> {
        let is_free = |manager: &u8| !self.has_manager(*manager);
        let is_new = |manager: &u8| is_free(manager) && !self.was_anothers(*manager, device);
        let had = self.ids_of(device).and_then(|ids| ids.manager);
        let own = manager_of_device(device.component);
        if let Some(manager) = had.filter(is_free).or(own.filter(is_new)).or_else(|| MANAGERS.clone().find(is_new)) {
            return Ok(Some(manager));
        }
        let of_oldest = || self.kept_ids.iter().filter_map(|kept| kept.manager).find(is_free);
        let Some(manager) = own.filter(is_free).or_else(of_oldest) else { return Ok(None) };
        if now.since(self.waiting_since(now, device)) < GONE_FOR_GOOD {
            return Err(NotAdopted::Waits);
        }
        Ok(Some(manager))
    }

    /// Whether another device had that manager.
    fn was_anothers(&self, manager: u8, device: MavId) -> bool {
        let owner = self.kept_ids.iter().find(|kept| kept.manager == Some(manager));
        owner.is_some_and(|owner| self.ids_of(device) != Some(*owner))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kept(lines: &[&str]) -> KeptIds {
        let lines: Vec<String> = lines.iter().map(|line| (*line).to_owned()).collect();
        KeptIds::read(&lines)
    }

    fn written(kept: &KeptIds) -> Vec<String> {
        kept.iter().map(Ids::to_string).collect()
    }

    #[test]
    fn a_line_is_read_as_it_was_written() {
        let lines = ["1/154\t191\t1", "42/70\t192\t-", "1/77\t-\t6"];
        assert_eq!(written(&kept(&lines)), lines);
    }

    #[test]
    fn what_is_no_line_of_ours_spoils_no_other() {
        let good = "1/70\t192\t2";
        for bad in [
            "",
            "\t",
            "1/154",
            "1/154\t191",
            "1/154\t191\t1\t1",
            "1/154\t190\t1",
            "1/154\t195\t1",
            "1/154\t191\t0",
            "1/154\t191\t7",
            "1/154\t\t1",
            "1/154\t-\t-",
            "1/1540\t191\t1",
            "154\t191\t1",
            "\u{fffd}\0",
        ] {
            assert_eq!(written(&kept(&[bad, good, bad])), [good], "{bad:?}");
        }
    }

    #[test]
    fn an_id_is_of_one_device_and_who_has_none_is_forgotten() {
        let lines = ["1/70\t192\t1", "1/77\t193\t2", "1/80\t192\t2", "1/90\t194\t1", "1/90\t193\t-"];
        assert_eq!(written(&kept(&lines)), ["1/70\t-\t1", "1/80\t192\t2", "1/90\t193\t-"][1..]);
    }

    /// Whatever is in the file, there are no more than ids.
    #[test]
    fn there_are_never_more_lines_than_ids() {
        let lines: Vec<String> = (0..1_000_u32)
            .map(|at| format!("{}/{}\t{}\t{}", 1 + at % 200, 7 + at % 240, 191 + at % 4, 1 + at % 6))
            .collect();
        assert!(KeptIds::read(&lines).all.len() <= 10);
    }

    #[test]
    fn only_a_change_is_kept_anew() {
        let mut ids = kept(&["1/70\t192\t1", "1/77\t193\t2"]);
        let [first, second] = ids.all[..] else { panic!("two were kept") };
        ids.replace(Some(second), second);
        ids.replace(Some(first), first);
        assert_eq!(
            (ids.revision(), written(&ids)[0].as_str()),
            (0, "1/77\t193\t2"),
            "found again, the other way round"
        );
        ids.forget(MavId::new(1, 90));
        assert_eq!(ids.revision(), 0);
        ids.replace(Some(first), Ids { device: MavId::new(7, 70), ..first });
        ids.forget(MavId::new(1, 77));
        assert_eq!((ids.revision(), written(&ids)), (2, vec!["7/70\t192\t1".to_owned()]));
    }
}
