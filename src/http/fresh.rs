//! Snapshots that are younger than the question.
//!
//! However many ask, the core computes at most one snapshot every [`INTERVAL`]; those who ask while one is under way
//! share the next.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, oneshot};
use tokio::time::{MissedTickBehavior, interval, timeout};

use crate::bridge::snapshot::Snapshot;
use crate::daemon::window::{CoreHandle, CoreRequest};

/// Least time between two questions to the core.
const INTERVAL: Duration = Duration::from_millis(50);

/// How long one question to the core may take; no asker waits longer.
const CORE_DEADLINE: Duration = Duration::from_secs(1);

/// Askers that may wait for the next snapshot.
const WAITING: usize = 32;

type Ask = oneshot::Sender<Arc<Snapshot>>;

/// Where to ask for a snapshot.
#[derive(Clone)]
pub struct FreshSnapshots {
    asks: mpsc::Sender<Ask>,
}

impl FreshSnapshots {
    /// The second half does the asking: it must be run, and ends when all of the first are dropped.
    pub fn of(core: CoreHandle) -> (Self, Collector) {
        let (asks, waiting) = mpsc::channel(WAITING);
        let collector = Collector { core, asks: waiting, unanswered: false };
        (Self { asks }, collector)
    }

    /// A snapshot computed after this call; `None` when the core did not answer in time.
    pub async fn within(&self, deadline: Duration) -> Option<Arc<Snapshot>> {
        let (ask, answer) = oneshot::channel();
        let asked = async {
            self.asks.send(ask).await.ok()?; // a collector that is gone answers nobody
            answer.await.ok() // dropped unanswered: the core did not answer the collector
        };
        timeout(deadline, asked).await.ok().flatten() // too late is the same as no answer
    }
}

/// Asks the core on behalf of everybody who waits.
pub struct Collector {
    core: CoreHandle,
    asks: mpsc::Receiver<Ask>,
    /// A request lies with the core; a core that is stuck does not find a heap of them when it comes back.
    unanswered: bool,
}

impl Collector {
    pub async fn run(mut self) {
        let mut pace = interval(INTERVAL);
        pace.set_missed_tick_behavior(MissedTickBehavior::Delay);
        while let Some(first) = self.asks.recv().await {
            pace.tick().await;
            let mut waiting = vec![first];
            while let Ok(ask) = self.asks.try_recv() {
                waiting.push(ask);
            }
            if let Some(snapshot) = self.ask_core().await {
                for ask in waiting {
                    drop(ask.send(Arc::clone(&snapshot))); // an asker that gave up has gone
                }
            }
        }
    }

    async fn ask_core(&mut self) -> Option<Arc<Snapshot>> {
        if self.core.snapshots.has_changed().ok()? {
            // The answer to a request that nobody waits for any more.
            self.core.snapshots.mark_unchanged();
            self.unanswered = false;
        }
        if !self.unanswered {
            match self.core.requests.try_send(CoreRequest::Refresh) {
                // When the queue is full, a request lies with the core already.
                Ok(()) | Err(mpsc::error::TrySendError::Full(_)) => self.unanswered = true,
                Err(mpsc::error::TrySendError::Closed(_)) => return None,
            }
        }
        match timeout(CORE_DEADLINE, self.core.snapshots.changed()).await {
            Ok(Ok(())) => {
                self.unanswered = false;
                Some(Arc::clone(&self.core.snapshots.borrow_and_update()))
            }
            Ok(Err(_)) | Err(_) => None, // the core is gone, or stuck
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::time::Instant;

    use tokio::sync::watch;

    use super::*;

    struct Core {
        requests: mpsc::Receiver<CoreRequest>,
        snapshots: watch::Sender<Arc<Snapshot>>,
    }

    impl Core {
        /// Answers one request; the uptime tells which.
        async fn answer(&mut self, uptime_s: f64) {
            assert!(matches!(self.requests.recv().await, Some(CoreRequest::Refresh)));
            self.snapshots.send_replace(Arc::new(Snapshot { uptime_s, ..Snapshot::default() }));
        }
    }

    fn core() -> (CoreHandle, Core) {
        let (requests, received) = mpsc::channel(4);
        let (published, snapshots) = watch::channel(Arc::default());
        (CoreHandle { requests, snapshots }, Core { requests: received, snapshots: published })
    }

    #[expect(clippy::disallowed_methods, reason = "how fast the core may be asked shows in real time only")]
    fn now() -> Instant {
        Instant::now()
    }

    fn block_on<F: Future>(future: F) -> F::Output {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let within = async { timeout(Duration::from_secs(20), future).await.expect("the test hangs") };
        runtime.block_on(within)
    }

    /// "Nothing is computed unless asked", and what was computed before the question does not answer it.
    #[test]
    fn each_question_gets_a_snapshot_of_its_own_time() {
        block_on(async {
            let (handle, mut core) = core();
            let (fresh, collector) = FreshSnapshots::of(handle);
            tokio::spawn(collector.run());
            for uptime_s in [1.0, 2.0, 3.0] {
                let (snapshot, ()) = tokio::join!(fresh.within(CORE_DEADLINE), core.answer(uptime_s));
                assert_eq!(snapshot.map(|snapshot| snapshot.uptime_s), Some(uptime_s));
            }
            assert!(core.requests.try_recv().is_err(), "the core was asked more often than we were");
        });
    }

    /// "Coalesce concurrent requests so that a flood of requests costs at most 20 snapshots a second."
    #[test]
    fn a_flood_costs_at_most_twenty_snapshots_a_second() {
        static ANSWERS: AtomicU32 = AtomicU32::new(0);
        block_on(async {
            let (handle, mut core) = core();
            let (fresh, collector) = FreshSnapshots::of(handle);
            tokio::spawn(collector.run());
            for _ in 0..30 {
                let fresh = fresh.clone();
                tokio::spawn(async move {
                    loop {
                        fresh.within(Duration::from_secs(10)).await.expect("the core answers");
                        ANSWERS.fetch_add(1, Ordering::Relaxed);
                    }
                });
            }
            let start = now();
            for number in 0..=10 {
                core.answer(f64::from(number)).await;
            }
            assert!(start.elapsed() >= 10 * INTERVAL, "eleven snapshots within {:?}", start.elapsed());
            assert!(ANSWERS.load(Ordering::Relaxed) >= 5 * 30, "every asker shares each snapshot");
        });
    }

    /// A core that hangs finds one request when it comes back, and its late answer does not pass as the next one.
    #[test]
    fn a_core_that_hangs_is_asked_once() {
        block_on(async {
            let (handle, mut core) = core();
            let (fresh, collector) = FreshSnapshots::of(handle);
            tokio::spawn(collector.run());
            for _ in 0..3 {
                assert_eq!(fresh.within(Duration::from_millis(10)).await, None);
            }
            assert_eq!(fresh.within(CORE_DEADLINE * 3).await, None, "the collector gives up before its askers");
            core.answer(1.0).await;
            assert!(core.requests.try_recv().is_err(), "one request only");

            let (snapshot, ()) = tokio::join!(fresh.within(CORE_DEADLINE), core.answer(2.0));

            assert_eq!(snapshot.map(|snapshot| snapshot.uptime_s), Some(2.0));
        });
    }

    #[test]
    fn a_core_that_is_gone_is_noticed_at_once() {
        block_on(async {
            let (handle, core) = core();
            let (fresh, collector) = FreshSnapshots::of(handle);
            tokio::spawn(collector.run());
            drop(core);
            let start = now();
            assert_eq!(fresh.within(Duration::from_secs(15)).await, None);
            assert!(start.elapsed() < CORE_DEADLINE);
        });
    }
}
