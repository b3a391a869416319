//! Which of its two protocols a Gremsy speaks.
//!
//! The second one is there from firmware 7.7.3 on, and is used where the gimbal then sends
//! `GIMBAL_DEVICE_ATTITUDE_STATUS` (285) when it is asked to. Once decided it stays so until the gimbal is lost, for the two are
//! never mixed.

use std::time::Duration;

use crate::gimbals::gremsy::version::FirmwareVersion;
use crate::timestamp::Timestamp;

/// 285 comes within so long after it was asked for, or the gimbal does not know it.
const PATIENCE: Duration = Duration::from_secs(2);

/// A gimbal that never says that it is ready is not waited for longer than this.
const LONGEST_START: Duration = Duration::from_secs(15);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Generation {
    /// Mount commands, with modes of the vendor's own.
    V1,
    /// The Gimbal Protocol v2, with flags of the vendor's own.
    V2,
}

impl Generation {
    pub const fn name(self) -> &'static str {
        match self {
            Self::V1 => "v1",
            Self::V2 => "v2",
        }
    }
}

/// What is known of a gimbal that has not been decided on.
#[derive(Clone, Copy, Debug, Default)]
pub struct Evidence {
    pub version: Option<FirmwareVersion>,
    /// It was asked for 283 as often as it is, and its parameters were read, so no version comes any more.
    pub is_read: bool,
    /// Since when everything in it is in place.
    pub aligned_since: Option<Timestamp>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Ask for 285 ten times a second.
    Probe,
    Decided(Generation),
}

#[derive(Clone, Copy, Debug)]
pub struct Search {
    configured: Option<Generation>,
    decided: Option<Generation>,
    begun: Timestamp,
    /// It has sent 285.
    tells_attitude: bool,
    probed: Option<Timestamp>,
    refused: bool,
}

impl Search {
    pub const fn new(configured: Option<Generation>, now: Timestamp) -> Self {
        Self { configured, decided: None, begun: now, tells_attitude: false, probed: None, refused: false }
    }

    pub const fn decided(&self) -> Option<Generation> {
        self.decided
    }

    /// 285 came.
    pub fn handle_attitude_status(&mut self) {
        self.tells_attitude = true;
    }

    /// The answer to asking for 285.
    pub fn handle_refusal(&mut self) {
        self.refused = true;
    }

    pub fn judge(&mut self, now: Timestamp, evidence: Evidence) -> Option<Step> {
        if self.decided.is_some() {
            return None;
        }
        let found = self.configured.or_else(|| self.found(now, evidence));
        if found.is_some() {
            self.decided = found;
            return found.map(Step::Decided);
        }
        let may_speak_v2 = evidence.version.is_some_and(FirmwareVersion::may_speak_v2);
        // One that starts may not listen yet, so it is asked once more when it is ready.
        let is_due = match (self.probed, evidence.aligned_since) {
            (None, _) => true,
            (Some(probed), Some(aligned)) => probed < aligned,
            (Some(_), None) => false,
        };
        if may_speak_v2 && is_due {
            self.probed = Some(now);
            return Some(Step::Probe);
        }
        None
    }

    /// When to [`judge`](Self::judge) although nothing has happened.
    pub fn poll_timeout(&self, evidence: Evidence) -> Option<Timestamp> {
        let probed = self.probed.filter(|_| self.decided.is_none())?;
        Some(self.deadline(probed, evidence))
    }

    fn found(&self, now: Timestamp, evidence: Evidence) -> Option<Generation> {
        match evidence.version {
            Some(version) if !version.may_speak_v2() => Some(Generation::V1),
            Some(_) if self.tells_attitude => Some(Generation::V2),
            Some(_) if self.refused => Some(Generation::V1),
            Some(_) => {
                let probed = self.probed?;
                let is_asked = evidence.aligned_since.is_none_or(|aligned| aligned <= probed);
                (is_asked && self.deadline(probed, evidence) <= now).then_some(Generation::V1)
            }
            None if evidence.is_read && self.tells_attitude => Some(Generation::V2),
            None if evidence.is_read => Some(Generation::V1),
            None => None,
        }
    }

    fn deadline(&self, probed: Timestamp, evidence: Evidence) -> Timestamp {
        match evidence.aligned_since {
            Some(_) => probed + PATIENCE,
            None => (probed + PATIENCE).max(self.begun + LONGEST_START),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OLD: FirmwareVersion = FirmwareVersion::official(7, 5, 6);
    const NEW: FirmwareVersion = FirmwareVersion::official(7, 8, 9);

    fn at(millis: u64) -> Timestamp {
        Timestamp::from_millis(millis)
    }

    fn evidence(version: FirmwareVersion, aligned_since: Option<u64>) -> Evidence {
        Evidence { version: Some(version), is_read: false, aligned_since: aligned_since.map(at) }
    }

    /// "version ≥ 7.7.3 and 285 received within 2 s of a 511(285, 100 ms) → v2; otherwise v1" (gimbals 1.10).
    #[test]
    fn a_new_firmware_that_sends_285_speaks_v2() {
        let mut search = Search::new(None, at(0));
        assert_eq!(search.judge(at(100), Evidence::default()), None);
        assert_eq!(search.judge(at(200), evidence(NEW, Some(150))), Some(Step::Probe));
        assert_eq!(search.judge(at(300), evidence(NEW, Some(150))), None);
        search.handle_attitude_status();
        assert_eq!(search.judge(at(400), evidence(NEW, Some(150))), Some(Step::Decided(Generation::V2)));
        assert_eq!(search.judge(at(500), evidence(OLD, Some(150))), None, "it stays so");
        assert_eq!(search.decided(), Some(Generation::V2));
    }

    #[test]
    fn one_that_does_not_speaks_v1() {
        let mut search = Search::new(None, at(0));
        assert_eq!(search.judge(at(200), evidence(NEW, Some(150))), Some(Step::Probe));
        assert_eq!(search.poll_timeout(evidence(NEW, Some(150))), Some(at(2_200)));
        assert_eq!(search.judge(at(2_199), evidence(NEW, Some(150))), None);
        assert_eq!(search.judge(at(2_200), evidence(NEW, Some(150))), Some(Step::Decided(Generation::V1)));

        let mut search = Search::new(None, at(0));
        search.judge(at(200), evidence(NEW, Some(150)));
        search.handle_refusal();
        assert_eq!(search.judge(at(300), evidence(NEW, Some(150))), Some(Step::Decided(Generation::V1)));

        assert_eq!(Search::new(None, at(0)).judge(at(0), evidence(OLD, None)), Some(Step::Decided(Generation::V1)));
    }

    /// While it starts it may not answer, so its time begins when it is ready.
    #[test]
    fn a_gimbal_that_starts_is_asked_again_when_it_is_ready() {
        let mut search = Search::new(None, at(0));
        assert_eq!(search.judge(at(200), evidence(NEW, None)), Some(Step::Probe));
        assert_eq!(search.judge(at(6_000), evidence(NEW, None)), None);
        assert_eq!(search.judge(at(7_000), evidence(NEW, Some(7_000))), Some(Step::Probe));
        assert_eq!(search.judge(at(8_900), evidence(NEW, Some(7_000))), None);
        assert_eq!(search.judge(at(9_000), evidence(NEW, Some(7_000))), Some(Step::Decided(Generation::V1)));

        let mut search = Search::new(None, at(0));
        search.judge(at(200), evidence(NEW, None));
        assert_eq!(search.judge(at(15_000), evidence(NEW, None)), Some(Step::Decided(Generation::V1)));
    }

    #[test]
    fn without_a_version_what_it_sends_decides() {
        let read = Evidence { is_read: true, ..Evidence::default() };
        let mut search = Search::new(None, at(0));
        assert_eq!(search.judge(at(10_000), read), Some(Step::Decided(Generation::V1)));
        let mut search = Search::new(None, at(0));
        search.handle_attitude_status();
        assert_eq!(search.judge(at(9_000), Evidence::default()), None);
        assert_eq!(search.judge(at(10_000), read), Some(Step::Decided(Generation::V2)));
    }

    #[test]
    fn the_configuration_decides_at_once() {
        for generation in [Generation::V1, Generation::V2] {
            let mut search = Search::new(Some(generation), at(0));
            assert_eq!(search.judge(at(0), Evidence::default()), Some(Step::Decided(generation)));
        }
    }
}
