//! The autopilot, and foreign messages in both directions.
#![expect(clippy::disallowed_methods, reason = "the load keeps to the real time")]

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use gimbald::geometry::{Attitude, EarthFrame};
use gimbald::wire::dialect::{AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, STATUSTEXT_DATA};
use gimbald::wire::encode_to_vec;

use crate::demand::{self, AUTOPILOT};
use crate::ends::Ends;

/// Of foreign messages, both directions together.
const INTERVAL: Duration = Duration::from_micros(200);
/// Whoever is further behind does not catch up.
const MOST_BEHIND: Duration = Duration::from_millis(5);
const FRAME_LENGTH: usize = 64;

/// A thread that runs until it is dropped.
struct Worker<T> {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<T>>,
}

impl<T: Send + 'static> Worker<T> {
    fn start(body: impl FnOnce(&AtomicBool) -> T + Send + 'static) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&stop);
        Self { stop, thread: Some(std::thread::spawn(move || body(&seen))) }
    }

    fn end(mut self) -> T {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().expect("it ends once").join().expect("it does not panic")
    }
}

impl<T> Drop for Worker<T> {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // Its panic was printed, and the figures say the rest.
            let _ = thread.join();
        }
    }
}

/// An autopilot that beats, tells where it heads ten times a second, and takes whatever it is sent.
pub struct Vehicle {
    _worker: Worker<()>,
}

impl Vehicle {
    pub fn start(ends: &Arc<Ends>) -> Self {
        let ends = Arc::clone(ends);
        let worker = Worker::start(move |stop| {
            ends.autopilot.set_read_timeout(Some(Duration::from_millis(20))).expect("a socket takes it");
            let mut buffer = [0; 512];
            let mut told_at = Instant::now();
            let mut sequence = 0_u8;
            while !stop.load(Ordering::Relaxed) {
                if Instant::now() >= told_at {
                    told_at = Instant::now() + Duration::from_millis(100);
                    sequence = sequence.wrapping_add(1);
                    let frame = if sequence.is_multiple_of(10) {
                        demand::heartbeat(AUTOPILOT, sequence, 2, 12)
                    } else {
                        encode_to_vec(AUTOPILOT, sequence, &state())
                    };
                    ends.autopilot.send_to(&frame, ends.ports.from_autopilot).expect("this machine reaches itself");
                }
                // Nothing within the time is as good as something.
                let _ = ends.autopilot.recv(&mut buffer);
            }
        });
        Self { _worker: worker }
    }
}

/// 5000 foreign messages of 64 bytes a second, every other one of the autopilot for everybody, the others of the ground
/// station for the autopilot.
pub struct Load {
    started: Instant,
    worker: Worker<u32>,
}

impl Load {
    pub fn start(ends: &Arc<Ends>) -> Self {
        let ends = Arc::clone(ends);
        let of_autopilot: Vec<_> = (0..=u8::MAX).map(foreign_of_autopilot).collect();
        let of_ground: Vec<_> = (0..=u8::MAX).map(demand::foreign_of_ground).collect();
        assert!(of_autopilot.iter().chain(&of_ground).all(|frame| frame.len() == FRAME_LENGTH));
        let worker = Worker::start(move |stop| {
            let mut due = Instant::now();
            let mut sent = 0_u32;
            while !stop.load(Ordering::Relaxed) {
                let at = (sent / 2) as usize % of_ground.len();
                if sent.is_multiple_of(2) {
                    let bytes = &of_autopilot[at];
                    ends.autopilot.send_to(bytes, ends.ports.from_autopilot).expect("this machine reaches itself");
                } else {
                    ends.send_from_ground(ends.ports.from_ground, &of_ground[at]);
                }
                sent += 1;
                due = (due + INTERVAL).max(Instant::now() - MOST_BEHIND);
                std::thread::sleep(due.saturating_duration_since(Instant::now()));
            }
            sent
        });
        Self { started: Instant::now(), worker }
    }

    /// How many there were per second.
    pub fn end(self) -> f64 {
        let seconds = self.started.elapsed().as_secs_f64();
        f64::from(self.worker.end()) / seconds
    }
}

fn foreign_of_autopilot(sequence: u8) -> Vec<u8> {
    // An id other than 0 keeps the bytes behind the text.
    let text = STATUSTEXT_DATA { severity: 6, text: [b'a'; 50].into(), id: 1, chunk_seq: 0 };
    encode_to_vec(AUTOPILOT, sequence, &text)
}

fn state() -> AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
    AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        time_boot_us: 0,
        q: Attitude::<EarthFrame>::identity().to_wxyz(),
        q_estimated_delay_us: 0,
        vx: 0.0,
        vy: 0.0,
        vz: 0.0,
        v_estimated_delay_us: 0,
        feed_forward_angular_velocity_z: f32::NAN,
        estimator_status: 831,
        target_system: 0,
        target_component: 0,
        landed_state: 2,
        angular_velocity_z: 0.0,
    }
}
