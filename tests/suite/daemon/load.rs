//! One that says too much, and one that does not listen.

use std::os::unix::fs::symlink;
use std::sync::mpsc::{TryRecvError, channel};
use std::thread::sleep;
use std::time::Duration;

use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::dialect::{COMMAND_ACK_DATA, COMMAND_LONG_DATA, HEARTBEAT_DATA};
use gimbald::wire::ids::{command as numbers, message};
use gimbald::wire::{FrameBuffer, MavId, StreamDecoder};

use super::{attitude, command, set_pitchyaw, simulated_gimbal, three_links};
use crate::support::daemon::{Daemon, Heard, Line, Site, Station, link};
use crate::support::world::{AUTOPILOT, GCS, MANAGER, heartbeat};

/// "Two masters and a flood": what others say does not slow down what we owe.
/// Client checklist E131: "5000 foreign messages/s on the link: heartbeat, 281, ACK limits … still hold."
#[test]
fn a_flood_does_not_change_the_pace() {
    const FLOOD_PER_MS: usize = 5;
    let site = Site::new();
    let gimbal = simulated_gimbal();
    let _cable = gimbal.plug_in(&site.path("gimbal"));
    let daemon = site.start(&three_links(), &[]);
    daemon.wait_for_gimbal();
    let mut ground = Station::new(GCS, site.port(14_550));
    let mut second = Station::new(MavId::new(254, 190), site.port(14_550));
    ground.send(&heartbeat(6, 8));
    second.send(&heartbeat(6, 8));
    ground.wait_for("281", |heard| (heard.id == message::GIMBAL_MANAGER_STATUS).then_some(()));
    let mut foreign = Station::new(MavId::new(99, 1), site.port(14_550));
    let (stop, stopped) = channel::<()>();
    let flood = std::thread::spawn(move || {
        let mut sent = 0;
        while stopped.try_recv() == Err(TryRecvError::Empty) {
            // As many as are due by the clock, however late we wake up.
            while sent < foreign.clock.now().as_micros() as usize * FLOOD_PER_MS / 1_000 {
                foreign.send(&attitude(sent as u32));
                sent += 1;
            }
            sleep(Duration::from_millis(1));
            foreign.hear_now();
        }
        sent
    });

    let start = ground.clock.now();
    let mut heard = Vec::new();
    let mut asked = Vec::new();
    for _ in 0..30 {
        asked.push(ground.clock.now());
        ground.send(&command(numbers::REQUEST_MESSAGE, 280.0, MANAGER));
        second.send(&set_pitchyaw(-0.2, 0.0, f32::NAN, f32::NAN));
        second.hear_now();
        heard.extend(ground.hear_for(Duration::from_millis(100)));
    }
    let lasted = ground.clock.now().since(start);
    stop.send(()).expect("it still floods");
    let flooded = flood.join().expect("no panic");

    assert!(flooded >= 14_000, "{flooded} frames");
    let ours = |id: u32| heard.iter().filter(move |heard| heard.source == MANAGER && heard.id == id);
    let beats = ours(message::HEARTBEAT).count() as f64;
    let statuses = ours(message::GIMBAL_MANAGER_STATUS).count() as f64;
    assert!((beats - lasted.as_secs_f64()).abs() <= 1.1, "{beats} heartbeats in {lasted:?}");
    assert!((statuses - 5.0 * lasted.as_secs_f64()).abs() <= 2.0, "{statuses} 281s in {lasted:?}");
    let acks: Vec<&Heard> = ours(message::COMMAND_ACK).collect();
    assert!(
        acks.iter()
            .all(|ack| ack.decode::<COMMAND_ACK_DATA>().is_some_and(|ack| ack.command == 512 && ack.result == 0))
    );
    assert_eq!(acks.len(), asked.len());
    let mut waits: Vec<Duration> = acks.iter().zip(&asked).map(|(ack, asked)| ack.at.since(*asked)).collect();
    waits.sort();
    assert!(waits[waits.len() / 2] < Duration::from_millis(20), "{waits:?}");
}

/// Protocol checklist 155: "When a link's output queue is full, stream frames are dropped before COMMAND_*".
#[test]
fn on_a_full_line_commands_come_before_streams() {
    /// Lives at the far end of the slow line.
    const REMOTE: MavId = MavId::new(1, 50);
    let site = Site::new();
    let config = format!("{}{}", link("radio", "peer", "serial:{dir}/radio:19200"), super::one_link());
    let line = Line::open();
    symlink(&line.device, site.path("radio")).expect("the path is free");
    let daemon = site.start(&config, &[]);
    daemon.wait_until_up();
    line.write(FrameBuffer::default().encode_any(REMOTE, 0, &heartbeat(18, 8)).bytes());
    daemon.wait_until("the far end to be known", |status| {
        status.links[0].peers.iter().any(|peer| peer.components == [REMOTE.to_string()])
    });
    let mut ground = Station::new(GCS, site.port(14_550));

    // 400 broadcasts of 40 bytes a second are eight times what the line can carry; ten commands a second are a fifth of it.
    let mut decoder = StreamDecoder::new(Patience::Serial { baud: 19_200 });
    let (mut broadcasts, mut commands) = (Vec::new(), Vec::new());
    for step in 0..1_000 {
        let due = Timestamp::from_micros(2_500 * u64::from(step));
        sleep(due.since(ground.clock.now()));
        ground.send(&attitude(step));
        if step % 40 == 0 {
            let number = (step / 40) as f32;
            ground.send(&command(numbers::SET_MESSAGE_INTERVAL, number, REMOTE));
        }
        decoder.push(ground.clock.now(), &line.read());
        while let Some(frame) = decoder.next_frame() {
            if let Some(command) = frame.decode::<COMMAND_LONG_DATA>() {
                commands.push((command.param1, ground.clock.now()));
            }
            if frame.message_id() == message::ATTITUDE {
                broadcasts.push(frame.sequence());
            }
        }
    }

    let numbers: Vec<f32> = commands.iter().map(|(number, _)| *number).collect();
    assert_eq!(numbers, (0..25).map(|number| number as f32).collect::<Vec<f32>>());
    let mut ages: Vec<Duration> =
        commands.iter().map(|(number, at)| at.since(Timestamp::from_micros((*number * 100_000.0) as u64))).collect();
    ages.sort();
    // Its own 43 bytes and what is left of the frame before it take 42 ms on this line.
    assert!(ages[ages.len() / 2] < Duration::from_millis(60), "{ages:?}");
    let status = daemon.status();
    assert!(broadcasts.len() < 110, "{} broadcasts fit the line", broadcasts.len());
    assert!(status.links[0].dropped_frames as usize + broadcasts.len() > 900, "{:?}", status.links[0]);
}

/// Protocol checklist 155: "… and the other links are not delayed by more than 5 ms."
///
/// Two daemons get the same frames at the same moments, and at one of them a line takes nothing. Each quarter of a
/// second is judged by itself and the middle one counts, so that it does not matter what else the machine does for a
/// while; the line is full all the time.
#[test]
fn a_line_that_takes_nothing_does_not_delay_the_others() {
    let listening = Relayed::new(true);
    let stalled = Relayed::new(false);
    let mut relayed = [listening, stalled];
    for number in 0..1_200 {
        let due = relayed[0].autopilot.clock.now() + Duration::from_micros(2_500);
        for one in &mut relayed {
            one.send(number);
        }
        while relayed[0].autopilot.clock.now() < due {
            for one in &mut relayed {
                one.hear();
            }
            sleep(Duration::from_micros(100));
        }
    }
    let [listening, stalled] = relayed.map(Relayed::end);

    let (usual, beside) = (usual_p99(&listening), usual_p99(&stalled));
    assert!(beside < usual + Duration::from_millis(5), "p99 {beside:?} beside a stalled line, {usual:?} without");
}

/// The middle one of the 99th percentiles of every hundred frames.
fn usual_p99(delays: &[Duration]) -> Duration {
    let mut percentiles: Vec<Duration> = delays
        .chunks_exact(100)
        .map(|hundred| {
            let mut hundred = hundred.to_vec();
            hundred.sort();
            hundred[98]
        })
        .collect();
    percentiles.sort();
    percentiles[percentiles.len() / 2]
}

/// A daemon between an autopilot and a ground station, with a line besides.
struct Relayed {
    daemon: Daemon,
    autopilot: Station,
    ground: Station,
    line: Line,
    reads: bool,
    sent_at: Vec<Timestamp>,
    delays: Vec<Duration>,
    _site: Site,
}

impl Relayed {
    fn new(reads: bool) -> Self {
        let site = Site::new();
        let line = Line::open();
        symlink(&line.device, site.path("radio")).expect("the path is free");
        let config = [
            "[vehicle]\nsystem_id = 1\n".to_owned(),
            link("autopilot", "autopilot", "udpin:{ip}:14540"),
            link("ground", "ground", "udpin:{ip}:14550"),
            link("radio", "ground", "serial:{dir}/radio:921600"),
        ];
        let daemon = site.start(&config.concat(), &[]);
        daemon.wait_until_up();
        let mut autopilot = Station::new(AUTOPILOT, site.port(14_540));
        let mut ground = Station::new(GCS, site.port(14_550));
        autopilot.send(&heartbeat(2, 12));
        ground.send(&heartbeat(6, 8));
        daemon.wait_until("both to be known", |status| {
            status.links[..2].iter().all(|link| link.peers.iter().any(|peer| !peer.components.is_empty()))
        });
        if !reads {
            // Fills the line until it takes nothing more.
            daemon.wait_until("the line to be full", |status| {
                for _ in 0..100 {
                    ground.send(&attitude(0));
                }
                status.links[2].dropped.contains_key("the line takes nothing")
            });
        }
        ground.hear_now();
        Self { daemon, autopilot, ground, line, reads, sent_at: Vec::new(), delays: Vec::new(), _site: site }
    }

    fn send(&mut self, number: u32) {
        self.sent_at.push(self.ground.clock.now());
        self.autopilot.send(&attitude(number));
    }

    fn hear(&mut self) {
        if self.reads {
            self.line.read();
        }
        for heard in self.ground.hear_now() {
            if let Some(number) = heard.decode::<gimbald::wire::dialect::ATTITUDE_DATA>().map(|sent| sent.time_boot_ms)
            {
                self.delays.push(heard.at.since(self.sent_at[number as usize]));
            }
        }
    }

    /// The delays of all frames, in their order.
    fn end(self) -> Vec<Duration> {
        for heard in self.ground.hear_for(Duration::from_millis(200)) {
            assert!(heard.decode::<HEARTBEAT_DATA>().is_some() || heard.source == AUTOPILOT || heard.source == MANAGER);
        }
        assert!(self.delays.len() * 100 >= self.sent_at.len() * 99, "{} of {}", self.delays.len(), self.sent_at.len());
        let stalls = self.daemon.status().links[2].dropped.get("the line takes nothing").copied().unwrap_or(0);
        assert_eq!(stalls > 1_000, !self.reads, "{stalls} frames found the line full");
        self.delays
    }
}
