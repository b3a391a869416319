//! The real daemon on a pseudo-terminal whose far end reads at the pace of 115200 baud.
//!
//! A measurement of half a minute in real time, for a machine with nothing else to do:
//!
//! ```text
//! cargo test --release --test suite -- --ignored --nocapture a_real_line
//! ```

use std::fs::File;
use std::io::Read;
use std::net::{SocketAddr, UdpSocket};
use std::os::unix::fs::symlink;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::{Duration, Instant};

use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::{FrameBuffer, StreamDecoder};
use nix::pty::{OpenptyResult, openpty};
use nix::sys::termios::{SetArg, cfmakeraw, tcgetattr, tcsetattr};
use nix::unistd::ttyname;

use crate::support::line::{Passage, RECEIVER, SENDER, control_waits, percentile, traffic};
use crate::support::world::heartbeat;

const DURATION: Duration = Duration::from_secs(30);
const BYTES_PER_SECOND: u64 = 11_520;
/// What a UART takes at a time.
const FIFO: usize = 16;

/// "age of control frames at the gimbal, beyond their own wire time and what is left of the frame on the wire, with 400
/// broadcasts/s of 20 to 100 bytes offered to a line that drains 11,520 B/s: p99 under 15 ms; no broken frame on the
/// line"; and nothing of that is felt on the other links.
#[test]
#[ignore = "a measurement of half a minute in real time"]
fn a_real_line_carries_control_in_time() {
    let OpenptyResult { master, slave } = openpty(None, None).expect("a pseudo-terminal");
    let mut raw = tcgetattr(&slave).expect("it is a terminal");
    cfmakeraw(&mut raw);
    tcsetattr(&slave, SetArg::TCSANOW, &raw).expect("it can be made transparent");
    let directory = tempfile::tempdir().expect("a directory");
    let device = directory.path().join("line");
    symlink(ttyname(&slave).expect("it has a name"), &device).expect("the path is free");
    let port = free_port();
    let config = directory.path().join("gimbald.toml");
    let text = format!(
        "[vehicle]\nsystem_id = 1\n[http]\nlisten = \"127.0.0.1:0\"\n\
         [[link]]\nname = \"line\"\nrole = \"peer\"\nendpoint = \"serial:{}:115200\"\n\
         [[link]]\nname = \"ground\"\nrole = \"ground\"\nendpoint = \"udpin:127.0.0.1:{port}\"\n",
        device.display()
    );
    std::fs::write(&config, text).expect("it can be written");
    let process = Daemon::start(&config, directory.path());
    let daemon = SocketAddr::from(([127, 0, 0, 1], port));

    let start = now();
    let clock = move || Timestamp::ZERO + now().duration_since(start);
    let mut far_end = File::from(master);
    let mut buffer = FrameBuffer::default();
    // The far end makes itself known once the daemon has the port open.
    thread::sleep(Duration::from_millis(500));
    let hello = buffer.encode_any(RECEIVER, 0, &heartbeat(18, 8)).bytes().to_vec();
    std::io::Write::write_all(&mut far_end, &hello).expect("the line takes it");

    let stop = Arc::new(AtomicBool::new(false));
    drop(slave);
    let line = thread::spawn(move || read_at_line_speed(far_end, clock));
    let listener = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    let listener_id = gimbald::wire::MavId::new(254, 190);
    let hello = buffer.encode_any(listener_id, 0, &heartbeat(6, 8)).bytes().to_vec();
    listener.send_to(&hello, daemon).expect("sent");
    let (received, others) = mpsc::channel();
    let listening = thread::spawn({
        let stop = Arc::clone(&stop);
        move || {
            listener.set_read_timeout(Some(Duration::from_millis(100))).expect("it takes the time");
            let mut datagram = [0; 2048];
            while !stop.load(Ordering::Relaxed) {
                if let Ok(len) = listener.recv(&mut datagram) {
                    received.send((clock(), datagram[..len].to_vec())).expect("the test waits for it");
                }
            }
        }
    });

    let sender = UdpSocket::bind("127.0.0.1:0").expect("a socket");
    thread::sleep(Duration::from_millis(200));
    let mut offers = traffic(1, DURATION);
    let begin = clock();
    for offer in &mut offers {
        let due = begin + offer.at.since(Timestamp::ZERO);
        while clock() < due {
            thread::sleep(due.since(clock()).min(Duration::from_millis(1)));
        }
        offer.at = clock();
        sender.send_to(&offer.bytes, daemon).expect("sent");
    }
    thread::sleep(Duration::from_secs(2));
    stop.store(true, Ordering::Relaxed);
    drop(process);
    let (passages, broken) = line.join().expect("the far end read on");
    listening.join().expect("the listener listened");

    let waits = control_waits(&offers, &passages);
    let (p50, p99, worst) = (percentile(&waits, 0.5), percentile(&waits, 0.99), waits[waits.len() - 1]);
    let until = begin + DURATION;
    let carried: usize =
        passages.iter().filter(|frame| frame.end <= until && frame.start >= begin).map(|frame| frame.bytes.len()).sum();
    let filled = carried as f64 / (DURATION.as_secs() * BYTES_PER_SECOND) as f64;
    println!("control beyond the frame in progress: p50 {p50:?}, p99 {p99:?}, max {worst:?}; line filled {filled:.3}");

    let others: Vec<(Timestamp, Vec<u8>)> =
        others.iter().filter(|(_, bytes)| bytes[5..7] == [SENDER.system, SENDER.component]).collect();
    let telemetry: Vec<_> = offers.iter().filter(|offer| !offer.is_control).collect();
    let mut delays: Vec<Duration> = others.iter().zip(&telemetry).map(|((at, _), offer)| at.since(offer.at)).collect();
    delays.sort();
    let (p50_udp, p99_udp, worst_udp) = (percentile(&delays, 0.5), percentile(&delays, 0.99), delays[delays.len() - 1]);
    println!(
        "UDP to UDP meanwhile: {} of {}, p50 {p50_udp:?}, p99 {p99_udp:?}, max {worst_udp:?}",
        others.len(),
        telemetry.len()
    );

    assert_eq!(broken, 0, "bytes that belong to no frame");
    assert_eq!(waits.len(), offers.iter().filter(|offer| offer.is_control).count(), "every control frame arrives");
    assert!(p99 < Duration::from_millis(15), "{p99:?}");
    assert!(filled > 0.9, "{filled}");
    assert!(
        others.iter().map(|(_, bytes)| bytes).eq(telemetry.iter().map(|offer| &offer.bytes)),
        "the other link loses nothing"
    );
}

/// Reads as a UART would: a few bytes, then nothing until these have left the wire; until the daemon closes the line.
/// Frames with the times of their first and last bit, and how many bytes belonged to none.
fn read_at_line_speed(mut line: File, clock: impl Fn() -> Timestamp) -> (Vec<Passage>, u64) {
    let byte_time = |count: usize| Duration::from_nanos(count as u64 * 1_000_000_000 / BYTES_PER_SECOND);
    let mut decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
    let (mut passages, mut free_at) = (Vec::new(), clock());
    let (mut begun_at, mut pending) = (None, 0);
    let mut bytes = [0; FIFO];
    loop {
        thread::sleep(free_at.since(clock()));
        let asked = clock();
        let Ok(count @ 1..) = line.read(&mut bytes) else { break };
        let now = clock();
        // Bytes that were there already went out while this thread overslept.
        let waited = now.since(asked) > Duration::from_micros(100);
        let start = if waited { now } else { free_at };
        for (at, byte) in bytes[..count].iter().enumerate() {
            begun_at.get_or_insert(start + byte_time(at));
            pending += 1;
            decoder.push(now, &[*byte]);
            while let Some(frame) = decoder.next_frame() {
                let frame = frame.bytes().to_vec();
                let end = start + byte_time(at + 1);
                passages.push(Passage { start: begun_at.take().unwrap_or(start), end, bytes: frame });
                pending = 0;
            }
        }
        free_at = start + byte_time(count);
    }
    (passages, decoder.counters().resync_bytes + pending)
}

struct Daemon(Child);

impl Daemon {
    fn start(config: &std::path::Path, state: &std::path::Path) -> Self {
        let child = Command::new(env!("CARGO_BIN_EXE_gimbald"))
            .args(["run", "--config"])
            .arg(config)
            .env("STATE_DIRECTORY", state)
            .stdout(Stdio::null())
            .stderr(Stdio::inherit())
            .spawn()
            .expect("cargo built the binary");
        Self(child)
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        self.0.kill().expect("it was running");
        self.0.wait().expect("it ends");
    }
}

fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a free port").port()
}

#[expect(clippy::disallowed_methods, reason = "a measurement in real time")]
fn now() -> Instant {
    Instant::now()
}
