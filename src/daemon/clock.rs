//! The only place that reads the time, and the timer that wakes the event loop.

use std::io;
use std::os::fd::{AsFd, AsRawFd, RawFd};
use std::task::{Context, Poll};
use std::time::{Duration, Instant, SystemTime};

use nix::sys::time::TimeSpec;
use nix::sys::timerfd::{ClockId, Expiration, TimerFd, TimerFlags, TimerSetTimeFlags};
use tokio::io::unix::AsyncFd;

use crate::links::input_ready::watch_input;
use crate::timestamp::Timestamp;

/// Tells how long ago the process started.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
}

impl Clock {
    #[expect(clippy::disallowed_methods, reason = "this is where time enters")]
    pub fn start() -> Self {
        Self { start: Instant::now() }
    }

    pub fn now(&self) -> Timestamp {
        Timestamp::ZERO + self.start.elapsed()
    }
}

/// The wall time as the system has it, in microseconds since 1970; `None` when that lies before 1970.
#[expect(clippy::disallowed_methods, reason = "this is where time enters")]
pub fn unix_time_us() -> Option<u64> {
    let since_1970 = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).ok()?;
    u64::try_from(since_1970.as_micros()).ok()
}

/// Wakes at one moment, to the microsecond: a frame on a fast serial line is shorter than the millisecond that the
/// runtime's own timers know.
pub struct DeadlineTimer {
    timer: AsyncFd<Timer>,
    armed: Option<Timestamp>,
}

struct Timer(TimerFd);

impl AsRawFd for Timer {
    fn as_raw_fd(&self) -> RawFd {
        self.0.as_fd().as_raw_fd()
    }
}

impl DeadlineTimer {
    pub fn new() -> io::Result<Self> {
        let timer = TimerFd::new(ClockId::CLOCK_MONOTONIC, TimerFlags::TFD_NONBLOCK | TimerFlags::TFD_CLOEXEC)?;
        Ok(Self { timer: watch_input(Timer(timer))?, armed: None })
    }

    /// Notices that the timer fired.
    pub fn poll(&mut self, cx: &mut Context<'_>) -> io::Result<()> {
        while let Poll::Ready(ready) = self.timer.poll_read_ready(cx) {
            // It is not read: setting it the next time takes its expirations back.
            ready?.clear_ready();
            self.armed = None;
        }
        Ok(())
    }

    /// Wakes at `deadline`, or some time before: a timer that is set to an earlier time is left as it is, because
    /// setting it at each change costs more than a needless wake-up now and then.
    pub fn wake_by(&mut self, deadline: Timestamp, clock: &Clock) -> io::Result<()> {
        if self.armed.is_some_and(|armed| armed <= deadline) {
            return Ok(());
        }
        // Zero would stop the timer.
        let wait = deadline.since(clock.now()).max(Duration::from_micros(1));
        self.timer.get_ref().0.set(Expiration::OneShot(TimeSpec::from_duration(wait)), TimerSetTimeFlags::empty())?;
        self.armed = Some(deadline);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::future::poll_fn;

    use super::*;

    /// When the timer woke, after it was set to wake by each of `deadlines`.
    fn woken_at(deadlines: &[Timestamp], clock: Clock) -> Timestamp {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build().expect("a runtime");
        runtime.block_on(async {
            let mut timer = DeadlineTimer::new().expect("a timer");
            for deadline in deadlines {
                timer.wake_by(*deadline, &clock).expect("it can be set");
            }
            poll_fn(|cx| {
                timer.poll(cx).expect("it can be polled");
                if timer.armed.is_none() { Poll::Ready(()) } else { Poll::Pending }
            })
            .await;
            clock.now()
        })
    }

    #[test]
    fn the_timer_does_not_wake_before_its_deadline() {
        let clock = Clock::start();
        let deadline = clock.now() + Duration::from_micros(2_300);
        assert!(woken_at(&[deadline], clock) >= deadline);
    }

    #[test]
    fn an_earlier_deadline_wins() {
        let clock = Clock::start();
        let far = clock.now() + Duration::from_secs(3_600);
        let near = clock.now() + Duration::from_millis(1);
        assert!(woken_at(&[far, near, far], clock) < far);
    }

    #[test]
    fn a_deadline_in_the_past_wakes_at_once() {
        let clock = Clock::start();
        assert!(woken_at(&[Timestamp::ZERO], clock) >= Timestamp::ZERO);
    }
}
