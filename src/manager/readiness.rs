//! Whether a gimbal that is known can be steered at this moment, as its driver says.
//!
//! One that starts again takes 10 to 15 s, and what it is told meanwhile it would do when it is ready, long after it was asked
//! for. So it is not told: whoever asks is refused, and may ask again.

use crate::gimbals::report::Readiness;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ReadinessWatch {
    readiness: Readiness,
    /// That it has started again was told since it was ready.
    restart_is_told: bool,
    /// People were told that it is gone, back or starting, so that it is news when it is ready.
    is_awaited: bool,
}

impl ReadinessWatch {
    pub fn is_ready(&self) -> bool {
        self.readiness == Readiness::Ready
    }

    /// Its driver says how far it is; true where people wait to be told that it is ready.
    pub fn handle(&mut self, readiness: Readiness) -> bool {
        self.readiness = readiness;
        if readiness != Readiness::Ready {
            return false;
        }
        let was = std::mem::take(self);
        was.is_awaited
    }

    /// It has started again; true where that is news.
    pub fn handle_restarted(&mut self) -> bool {
        if self.is_ready() {
            return true;
        }
        self.is_awaited = true;
        !std::mem::replace(&mut self.restart_is_told, true)
    }

    /// It is heard again.
    pub fn handle_alive(&mut self) {
        self.is_awaited |= !self.is_ready();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_restart_is_told_once_and_so_is_its_end() {
        let mut watch = ReadinessWatch::default();
        assert!(watch.is_ready(), "who never says otherwise is");
        assert!(watch.handle_restarted() && watch.handle_restarted(), "of such each is told");

        assert!(!watch.handle(Readiness::Starting));
        assert!(!watch.is_ready());
        assert!(watch.handle_restarted());
        assert!(!watch.handle_restarted(), "another sign of the same one");
        assert!(watch.handle(Readiness::Ready));
        assert!(!watch.handle(Readiness::Ready));
        assert!(watch.is_ready());
    }

    #[test]
    fn a_restart_that_was_refused_has_no_end_to_tell_of() {
        let mut watch = ReadinessWatch::default();
        watch.handle(Readiness::AskedToRestart);
        assert!(!watch.is_ready());
        assert!(!watch.handle(Readiness::Ready));
    }

    #[test]
    fn one_that_is_back_is_ready_some_time_later() {
        let mut watch = ReadinessWatch::default();
        watch.handle(Readiness::Starting);
        watch.handle_alive();
        assert!(watch.handle(Readiness::Ready));
    }
}
