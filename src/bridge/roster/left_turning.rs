//! Which gimbals may be turning and are not there to be stopped: those of an earlier run, and those whose place another
//! has taken.
//!
//! A line is kept of each for the next start, its fields between tabs: the name, which device it was, and the family whose
//! words stop it where only we know. A name without a device, of a gimbal that was not heard, or of an older version, means
//! whoever has that name; a device is stopped whatever it is called by then, and when it is not heard, who has its name.

use std::fmt;
use std::time::Duration;

use super::{Gimbal, Roster};
use crate::gimbals::settings::Family;
use crate::timestamp::Timestamp;
use crate::wire::MavId;

const BETWEEN_FIELDS: char = '\t';

/// So many are waited for at most; there is room for fewer gimbals.
const MAX_LEFT: usize = 64;

/// One that was left turning and is not heard for so long while another has its name may be that one.
const RENAMED_AFTER: Duration = Duration::from_secs(5);

/// A gimbal that may be turning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LeftTurning {
    pub name: String,
    pub device: Option<MavId>,
    /// Whose words stop it, where that was found out.
    pub stops_as: Option<Family>,
}

impl LeftTurning {
    pub fn of(gimbal: &Gimbal) -> Self {
        let name = gimbal.manager.settings().name.clone();
        Self { name, device: gimbal.adopted, stops_as: gimbal.driver.stops_as() }
    }

    /// `None` without a name. What is not understood behind it is left out.
    pub fn read(line: &str) -> Option<Self> {
        let mut fields = line.split(BETWEEN_FIELDS);
        let name = fields.next().filter(|name| !name.is_empty())?.to_owned();
        let mut left = Self { name, device: None, stops_as: None };
        let mut is_understood = true;
        for field in fields {
            match read_id(field) {
                Some(device) => left.device = Some(device),
                None if field == Family::Gremsy.name() => left.stops_as = Some(Family::Gremsy),
                None => is_understood = false,
            }
        }
        if !is_understood {
            tracing::warn!(gimbal = left.name, "not all is understood of a gimbal that was left turning");
        }
        Some(left)
    }

    fn is(&self, name: &str, device: MavId) -> bool {
        self.device.map_or_else(|| self.name == name, |left| left == device)
    }
}

impl fmt::Display for LeftTurning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        if let Some(device) = self.device {
            write!(f, "{BETWEEN_FIELDS}{device}")?;
        }
        match self.stops_as {
            Some(family) => write!(f, "{BETWEEN_FIELDS}{}", family.name()),
            None => Ok(()),
        }
    }
}

/// `1/154`.
pub(super) fn read_id(text: &str) -> Option<MavId> {
    let (system, component) = text.split_once('/')?;
    Some(MavId::new(system.parse().ok()?, component.parse().ok()?))
}

/// Those that are waited for.
#[derive(Debug, Default)]
pub struct Awaited {
    gimbals: Vec<LeftTurning>,
    /// Grows with each change.
    revision: u32,
}

impl Awaited {
    /// As an earlier run kept them.
    pub fn read(lines: &[String]) -> Self {
        // The latest are the last.
        let lines = &lines[lines.len().saturating_sub(MAX_LEFT)..];
        let gimbals = lines.iter().filter_map(|line| LeftTurning::read(line)).collect();
        Self { gimbals, revision: 0 }
    }

    pub fn iter(&self) -> impl Iterator<Item = &LeftTurning> {
        self.gimbals.iter()
    }

    pub const fn revision(&self) -> u32 {
        self.revision
    }

    fn push(&mut self, left: LeftTurning) {
        if !self.gimbals.contains(&left) {
            if self.gimbals.len() >= MAX_LEFT {
                self.gimbals.remove(0);
            }
            self.gimbals.push(left);
            self.revision += 1;
        }
    }

    fn take(&mut self, wanted: impl Fn(&LeftTurning) -> bool) -> Option<LeftTurning> {
        let at = self.gimbals.iter().position(wanted)?;
        self.revision += 1;
        Some(self.gimbals.remove(at))
    }
}

impl Gimbal {
    /// It was left turning by an earlier run, or under another id.
    pub(super) fn stop_when_heard(&mut self, stops_as: Option<Family>) {
        if let Some(family) = stops_as {
            self.driver.stop_as(family);
        }
        self.manager.stop_when_heard();
    }

    /// To a plain v1 gimbal the word that stops a Gremsy is an angle: only who is known to be one is told it for another. A
    /// v2 device it cannot be, and has no rotation that could have been left.
    fn may_be_stopped_as(&self, family: Option<Family>) -> bool {
        match family {
            Some(family) => self.driver.family() == family,
            None => self.driver.family() != Family::MavlinkV1,
        }
    }

    /// Whether it was not stopped yet in the stead of `device`; from now on it was.
    fn is_not_stopped_for(&mut self, device: Option<MavId>) -> bool {
        let is_new = !self.stopped_for.contains(&device);
        if is_new {
            if self.stopped_for.len() >= MAX_LEFT {
                self.stopped_for.remove(0);
            }
            self.stopped_for.push(device);
        }
        is_new
    }
}

impl Roster {
    /// Gimbals that may be turning, and are not in the roster.
    pub fn awaited(&self) -> &Awaited {
        &self.left_turning
    }

    /// Whoever has an entry of that name is stopped when one is heard.
    pub(super) fn stop_entries_left_turning(&mut self) {
        for gimbal in &mut self.gimbals {
            let name = &gimbal.manager.settings().name;
            if let Some(left) = self.left_turning.take(|left| left.device.is_none() && left.name == *name) {
                gimbal.stop_when_heard(left.stops_as);
            }
        }
    }

    /// The gimbal there has a device now.
    pub(super) fn stop_if_left_turning(&mut self, at: usize, device: MavId) {
        let gimbal = &mut self.gimbals[at];
        let name = &gimbal.manager.settings().name;
        if let Some(left) = self.left_turning.take(|left| left.is(name, device)) {
            gimbal.stop_when_heard(left.stops_as);
        }
    }

    /// Another device takes the place of this gimbal's: it is stopped when it is heard, whatever it is called then.
    pub(super) fn await_if_turning(&mut self, at: usize) {
        let gimbal = &self.gimbals[at];
        if gimbal.may_be_turning() && gimbal.adopted.is_some() {
            let left = LeftTurning::of(gimbal);
            self.left_turning.push(left);
        }
    }

    /// Once a second: who came to the link of a gimbal that may be turning and fell silent may be that one under another
    /// id. It is stopped, unless somebody steers it.
    pub fn stop_successors(&mut self, now: Timestamp) {
        for at in 0..self.gimbals.len() {
            let former = &self.gimbals[at];
            if !(former.is_lost() && former.may_be_turning()) {
                continue;
            }
            let (device, link, heard, stops_as) = (former.adopted, former.link, former.heard, former.driver.stops_as());
            for gimbal in &mut self.gimbals {
                let is_successor = gimbal.adopted.is_some() && gimbal.link == link && gimbal.adopted_at > heard;
                let may_be_it = is_successor && gimbal.may_be_stopped_as(stops_as);
                if may_be_it && !gimbal.is_lost() && gimbal.is_not_stopped_for(device) {
                    if let Some(family) = stops_as {
                        gimbal.driver.stop_as(family);
                    }
                    gimbal.manager.stop_unless_steered(now);
                }
            }
        }
        self.stop_namesakes(now);
    }

    /// A device that an earlier run left turning, and that is not heard for a while, may be the one that has its name now,
    /// under another id. It is waited for all the same.
    fn stop_namesakes(&mut self, now: Timestamp) {
        for gimbal in &mut self.gimbals {
            let name = &gimbal.manager.settings().name;
            let Some(left) = self.left_turning.iter().find(|left| left.name == *name && left.device.is_some()) else {
                continue;
            };
            let is_there = !gimbal.is_lost() && gimbal.has_device_for(now, RENAMED_AFTER);
            if is_there && gimbal.may_be_stopped_as(left.stops_as) && gimbal.is_not_stopped_for(left.device) {
                if let Some(family) = left.stops_as {
                    gimbal.driver.stop_as(family);
                }
                gimbal.manager.stop_unless_steered(now);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_read_as_it_was_written() {
        for line in ["camera", "camera\t1/154", "the one below\t42/171\tgremsy", "camera\tgremsy"] {
            assert_eq!(LeftTurning::read(line).map(|left| left.to_string()).as_deref(), Some(line));
        }
    }

    #[test]
    fn what_is_not_understood_is_left_out() {
        let camera = Some(LeftTurning { name: "camera".to_owned(), device: None, stops_as: None });
        for line in ["camera", "camera\t", "camera\t1/", "camera\t1/1540", "camera\t\u{7f}/\0"] {
            assert_eq!(LeftTurning::read(line), camera, "{line:?}");
        }
        assert_eq!(LeftTurning::read(""), None);
        assert_eq!(LeftTurning::read("\t1/154"), None);
    }

    #[test]
    fn a_device_is_it_whatever_it_is_called() {
        let device = MavId::new(1, 154);
        let left = LeftTurning { name: "camera".to_owned(), device: Some(device), stops_as: None };
        assert!(left.is("gimbal-154", device));
        assert!(!left.is("camera", MavId::new(1, 171)), "another has that name");
        assert!(LeftTurning { device: None, ..left }.is("camera", MavId::new(1, 171)));
    }

    #[test]
    fn no_more_are_waited_for_than_there_is_room() {
        let lines: Vec<String> = (0..100).map(|number| format!("gimbal-{number}")).collect();
        let mut awaited = Awaited::read(&lines);
        let names: Vec<&str> = awaited.iter().map(|left| left.name.as_str()).collect();
        // Those that turned when it was written are the last.
        assert_eq!((names.len(), names[0], names[MAX_LEFT - 1]), (MAX_LEFT, "gimbal-36", "gimbal-99"));
        awaited.push(LeftTurning { name: "camera".to_owned(), device: None, stops_as: None });
        assert_eq!(awaited.iter().count(), MAX_LEFT);
        assert!(awaited.take(|left| left.name == "camera").is_some());
        assert_eq!(awaited.revision(), 2);
    }
}
