//! Which of a machine's named timers fires next.

use crate::timestamp::Timestamp;

/// The running timers of one machine; `T` names them, and each name runs at most once.
#[derive(Clone, Debug)]
pub struct TimerTable<T> {
    running: Vec<(T, Timestamp)>,
}

impl<T> Default for TimerTable<T> {
    fn default() -> Self {
        Self { running: Vec::new() }
    }
}

impl<T: Copy + Eq> TimerTable<T> {
    /// Starts `timer`, or moves it when it is running already.
    pub fn set(&mut self, timer: T, at: Timestamp) {
        match self.running.iter_mut().find(|(name, _)| *name == timer) {
            Some(entry) => entry.1 = at,
            None => self.running.push((timer, at)),
        }
    }

    /// Starts `timer` only if it is not running or would fire later.
    pub fn set_no_later(&mut self, timer: T, at: Timestamp) {
        if self.at(timer).is_none_or(|running| at < running) {
            self.set(timer, at);
        }
    }

    pub fn cancel(&mut self, timer: T) {
        self.running.retain(|(name, _)| *name != timer);
    }

    pub fn at(&self, timer: T) -> Option<Timestamp> {
        self.running.iter().find(|(name, _)| *name == timer).map(|(_, at)| *at)
    }

    /// The timer that fires next, and when.
    pub fn next(&self) -> Option<(Timestamp, T)> {
        self.running.iter().min_by_key(|(_, at)| *at).map(|(name, at)| (*at, *name))
    }

    /// Takes the earliest timer that is due at `now`; it runs no longer.
    pub fn pop_due(&mut self, now: Timestamp) -> Option<T> {
        let (at, timer) = self.next()?;
        if at > now {
            return None;
        }
        self.cancel(timer);
        Some(timer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timers_fire_in_the_order_of_their_time_and_once() {
        let mut timers = TimerTable::default();
        timers.set('b', Timestamp::from_millis(20));
        timers.set('a', Timestamp::from_millis(10));
        timers.set('a', Timestamp::from_millis(30));

        assert_eq!(timers.next(), Some((Timestamp::from_millis(20), 'b')));
        assert_eq!(timers.pop_due(Timestamp::from_millis(19)), None);
        assert_eq!(timers.pop_due(Timestamp::from_millis(30)), Some('b'));
        assert_eq!(timers.pop_due(Timestamp::from_millis(30)), Some('a'));
        assert_eq!(timers.pop_due(Timestamp::from_millis(30)), None);
    }
}
