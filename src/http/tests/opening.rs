//! The port and the thread of the window.

use super::*;

/// "The listening port taken or address not there yet: log a WARN with the remedy once and retry, never fatal."
#[test]
fn a_port_that_is_taken_is_tried_again() {
    let journal = Journal::default();
    let writer = journal.clone();
    let subscriber = tracing_subscriber::fmt().with_ansi(false).with_writer(move || writer.clone()).finish();
    let _guard = tracing::subscriber::set_default(subscriber);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    runtime.block_on(async {
        let occupant = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = occupant.local_addr().expect("its address");
        let (core, _requests, _snapshots) = core();
        let retry = Duration::from_millis(20);
        let settings = HttpSettings { listen: address, token: None };
        tokio::spawn(run(settings, core, Limits { retry, ..Limits::default() }));
        let in_time = async {
            while !journal.text().contains("trying again") {
                tokio::time::sleep(retry).await;
            }
            tokio::time::sleep(3 * retry).await;
            drop(occupant);
            while !journal.text().contains("can be opened") {
                tokio::time::sleep(retry).await;
            }
        };
        tokio::time::timeout(PATIENCE, in_time).await.expect("it opens once the port is free");
        TcpStream::connect(address).expect("it listens");
    });
    let text = journal.text();
    let warnings: Vec<_> = text.lines().filter(|line| line.contains(" WARN ")).collect();
    assert_eq!(warnings.len(), 1, "{text}");
    assert!(warnings[0].contains("set another [http] listen"), "{text}");
}

#[test]
fn the_thread_ends_with_the_core() {
    let (core, requests, snapshots) = core();
    let settings = HttpSettings { listen: LOOPBACK.parse().expect("an address"), token: None };
    let thread = spawn(settings, core).expect("a thread");
    assert!(!thread.is_finished());
    drop((requests, snapshots));
    let start = now();
    while !thread.is_finished() {
        assert!(start.elapsed() < PATIENCE, "the thread outlives the core");
        std::thread::yield_now();
    }
    thread.join().expect("no panic");
}
