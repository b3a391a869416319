//! How long a client waits: from a demand to the setpoint at the gimbal's end, and from a command to its answer.
//!
//! The daemon and a relay that parses nothing are processes of their own. They get the same demands over the same kind
//! of sockets in turn, alone and among 5000 foreign messages a second, so that whatever else the machine does hits
//! both; the figure is the median of the ratios within the rounds. `cargo bench --bench turnaround`.

#![expect(clippy::disallowed_methods, reason = "time is what is measured here")]

mod demand;
mod ends;
mod gimbal_end;
mod load;
#[path = "../router/process.rs"]
mod process;
#[path = "../router/relay.rs"]
mod relay;

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use demand::{Demand, Effect};
use ends::{Contender, Ends, Ports};
use gimbal_end::{GimbalEnd, Transport};
use load::{Load, Vehicle};
use process::Forwarder;

const ROUNDS: usize = 9;
const SAMPLES: usize = 120;
/// What is measured, each by demands of its own: whoever waits for one thing is not woken by the other.
const KINDS: [(&str, Demand, Effect); 3] = [
    ("287 to 284", Demand::SetPitchyaw, Effect::Setpoint),
    ("command 1000 to 284", Demand::Command, Effect::Setpoint),
    ("command 1000 to COMMAND_ACK", Demand::Command, Effect::Answer),
];
/// First argument of the process that is the relay.
const RELAY: &str = "relay";

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, command, routes @ ..] = &arguments[..]
        && command == RELAY
    {
        return relay::run(routes.iter().map(String::as_str));
    }
    println!("microseconds, median of {ROUNDS} rounds of {SAMPLES}; ratios are medians of the rounds' ratios");
    for transport in [Transport::Udp, Transport::Serial] {
        measure(transport);
    }
}

fn measure(transport: Transport) {
    let directory = tempfile::tempdir().expect("a directory for the configuration");
    let mut contenders = [start_daemon(transport, directory.path()), start_relay(transport)];
    let _vehicles = contenders.each_ref().map(|contender| Vehicle::start(contender.ends()));
    contenders.iter_mut().for_each(Contender::wait_until_it_answers);

    for with_load in [false, true] {
        let mut rounds = [const { Vec::new() }; 2];
        let mut foreign = [0.0; 2];
        let mut cpu = [Duration::ZERO; 2];
        let mut lasted = [Duration::ZERO; 2];
        for round in 0..ROUNDS {
            for turn in 0..2 {
                let which = (round + turn) % 2;
                let load = with_load.then(|| Load::start(contenders[which].ends()));
                contenders[which].serve_for(Duration::from_millis(50));
                let (before, started) = (contenders[which].cpu_time(), Instant::now());
                let samples = KINDS.map(|(_, demand, effect)| {
                    // On a busy machine a turn takes long enough for the other one's gimbal to be lost.
                    contenders[1 - which].serve_for(Duration::from_millis(1));
                    contenders[which].turn_around(demand, effect, SAMPLES)
                });
                cpu[which] += contenders[which].cpu_time() - before;
                lasted[which] += started.elapsed();
                if let Some(load) = load {
                    foreign[which] += load.end() / ROUNDS as f64;
                }
                rounds[which].push(samples);
            }
        }
        let among = if with_load {
            format!("among {:.0} foreign messages a second, of the relay {:.0}", foreign[0], foreign[1])
        } else {
            "alone".to_owned()
        };
        println!("\ngimbal on {transport}, {among}");
        println!("{:34} {:>15} {:>15} {:>15}", "", "daemon p50 p99", "relay p50 p99", "ratio p50 p99");
        let [daemon, relay] = &rounds;
        for (kind, (name, ..)) in KINDS.iter().enumerate() {
            print(name, daemon, relay, kind);
        }
        let share = [0, 1].map(|which| cpu[which].as_secs_f64() * 1e3 / lasted[which].as_secs_f64());
        println!("CPU time: daemon {:.1} ms, relay {:.1} ms a second", share[0], share[1]);
    }
    let lost = contenders.each_ref().map(Contender::lost);
    if lost != [0; 2] {
        println!("lost: {} demands by the daemon, {} by the relay", lost[0], lost[1]);
    }
}

/// A round's samples of each kind.
type Round = [Vec<Duration>; KINDS.len()];

fn print(name: &str, daemon: &[Round], relay: &[Round], kind: usize) {
    let figures = |rounds: &[Round], share: f64| -> Vec<f64> {
        rounds.iter().map(|round| percentile(&round[kind], share).as_secs_f64() * 1e6).collect()
    };
    let mut columns = Vec::new();
    for share in [0.5, 0.99] {
        let (daemon, relay) = (figures(daemon, share), figures(relay, share));
        let ratios = daemon.iter().zip(&relay).map(|(daemon, relay)| daemon / relay).collect();
        columns.push([median(daemon), median(relay), median(ratios)]);
    }
    let [half, most] = &columns[..] else { unreachable!("two shares") };
    println!(
        "{name:34} {:7.0} {:7.0} {:7.0} {:7.0} {:7.2} {:7.2}",
        half[0], most[0], half[1], most[1], half[2], most[2]
    );
}

fn median(mut figures: Vec<f64>) -> f64 {
    figures.sort_by(f64::total_cmp);
    figures[figures.len() / 2]
}

fn percentile(samples: &[Duration], share: f64) -> Duration {
    assert!(!samples.is_empty(), "every demand of a round was lost");
    let mut sorted = samples.to_vec();
    sorted.sort_unstable();
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

fn start_daemon(transport: Transport, directory: &Path) -> Contender {
    let [from_gimbal, from_autopilot, from_ground] = ends::free_ports();
    let gimbal = GimbalEnd::open(transport, from_gimbal);
    let configuration = directory.join("gimbald.toml");
    let endpoint = match gimbal.device() {
        Some(path) => format!("serial:{path}:{}", gimbal_end::BAUD),
        None => format!("udpin:{from_gimbal}"),
    };
    let text = format!(
        "[vehicle]\nsystem_id = 1\n\n\
         [[link]]\nname = \"gimbal\"\nrole = \"gimbal\"\nendpoint = \"{endpoint}\"\n\n\
         [[link]]\nname = \"autopilot\"\nrole = \"autopilot\"\nendpoint = \"udpin:{from_autopilot}\"\n\n\
         [[link]]\nname = \"ground\"\nrole = \"ground\"\nendpoint = \"udpin:{from_ground}\"\n\n\
         [http]\nlisten = \"{}\"\n",
        ends::free_tcp()
    );
    fs::write(&configuration, text).expect("the configuration can be written");
    let forwarder = Forwarder::start(
        env!("CARGO_BIN_EXE_gimbald").as_ref(),
        &["--log".as_ref(), "warn".as_ref(), "run".as_ref(), "--config".as_ref(), configuration.as_ref()],
    );
    let ports = Ports { to_gimbal: from_ground, to_ground: from_ground, from_ground, from_autopilot };
    Contender::daemon(forwarder, Ends::new(gimbal, ports))
}

/// One route for what a gimbal is to get, one for what is to come back, and two for the foreign messages.
fn start_relay(transport: Transport) -> Contender {
    let [to_gimbal, to_ground, from_ground, from_autopilot] = ends::free_ports();
    let gimbal = GimbalEnd::open(transport, to_gimbal);
    let ends = Ends::new(gimbal, Ports { to_gimbal, to_ground, from_ground, from_autopilot });
    let gimbal = ends.gimbal.device().unwrap_or_else(|| ends.gimbal.address().to_string());
    let (ground, autopilot) = (ends.ground_address().to_string(), ends.autopilot_address().to_string());
    let routes = [
        relay::route(to_gimbal, &gimbal),
        relay::route(to_ground, &ground),
        relay::route(from_ground, &autopilot),
        relay::route(from_autopilot, &ground),
    ];
    let program = std::env::current_exe().expect("we know what we are");
    let mut arguments = vec![RELAY.as_ref()];
    arguments.extend(routes.iter().map(AsRef::<std::ffi::OsStr>::as_ref));
    Contender::relay(Forwarder::start(&program, &arguments), ends)
}
