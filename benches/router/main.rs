//! What forwarding costs: CPU time per 1000 frames of the daemon, beside a relay that parses nothing.
//!
//! Both are processes of their own that get the same load in turn, so that whatever else the machine does hits both;
//! the figure is the median of the ratios within the rounds. `cargo bench --bench forwarding`.

mod process;
mod relay;
mod rig;

use std::fs;

use process::Forwarder;
use rig::Rig;

const ROUNDS: usize = 11;
const FRAMES: u32 = 40_000;
/// First argument of the process that is the relay.
const RELAY: &str = "relay";

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let [_, command, route] = &arguments[..]
        && command == RELAY
    {
        return relay::run([route.as_str()]);
    }
    let directory = tempfile::tempdir().expect("a directory for the configuration");
    let daemon_rig = Rig::new();
    let relay_rig = Rig::new();
    let configuration = directory.path().join("gimbald.toml");
    fs::write(&configuration, toml(&daemon_rig)).expect("the configuration can be written");
    let program = std::env::current_exe().expect("we know what we are");

    let daemon = Forwarder::start(
        env!("CARGO_BIN_EXE_gimbald").as_ref(),
        &["--log".as_ref(), "warn".as_ref(), "run".as_ref(), "--config".as_ref(), configuration.as_ref()],
    );
    let route = relay::route(relay_rig.listen, &relay_rig.peer().to_string());
    let relay = Forwarder::start(&program, &[RELAY.as_ref(), route.as_ref()]);
    daemon_rig.wait_for_forwarder();
    relay_rig.wait_for_forwarder();

    let mut costs = Vec::new();
    for round in 0..ROUNDS {
        let mut cost = [0.0; 2];
        let contenders = [(&daemon, &daemon_rig), (&relay, &relay_rig)];
        for turn in 0..2 {
            let contender = (round + turn) % 2;
            let (forwarder, rig) = contenders[contender];
            let before = forwarder.cpu_time();
            let delivered = rig.closed_loop(FRAMES);
            let spent = forwarder.cpu_time() - before;
            cost[contender] = spent.as_secs_f64() * 1e3 / (f64::from(delivered) / 1e3);
        }
        println!("round {round:2}: daemon {:6.3} ms, relay {:6.3} ms per 1000 frames", cost[0], cost[1]);
        costs.push(cost);
    }
    let median = |figure: fn(&[f64; 2]) -> f64| {
        let mut figures: Vec<f64> = costs.iter().map(figure).collect();
        figures.sort_by(f64::total_cmp);
        figures[figures.len() / 2]
    };
    println!("daemon  {:6.3} ms of CPU per 1000 frames (median)", median(|cost| cost[0]));
    println!("relay   {:6.3} ms of CPU per 1000 frames (median)", median(|cost| cost[1]));
    println!("daemon / relay {:.3} (median of the rounds' ratios)", median(|cost| cost[0] / cost[1]));
}

fn toml(rig: &Rig) -> String {
    format!(
        "[[link]]\nname = \"autopilot\"\nrole = \"autopilot\"\nendpoint = \"udpin:{}\"\n\n\
         [[link]]\nname = \"ground\"\nrole = \"ground\"\nendpoint = \"udpout:{}\"\n",
        rig.listen,
        rig.peer()
    )
}
