use std::future::poll_fn;
use std::net::{SocketAddr, UdpSocket};
use std::time::Duration;

use super::super::window::CoreHandle;
use super::*;
use crate::bridge::settings::{LinkSettings, Role, Settings, SystemId, Transport};
use crate::endpoint::Endpoint;
use crate::gimbals::settings::GimbalSettings;
use crate::manager::asked::{Asked, NotDone};
use crate::wire::dialect::STATUSTEXT_DATA;
use crate::wire::{MavId, encode_to_vec};

const PATIENCE: Duration = Duration::from_secs(10);

/// Runs the daemon between `autopilot` and `ground`, speaking first to both, until `test` is done with it.
fn with_daemon(autopilot: SocketAddr, ground: SocketAddr, test: impl FnOnce(CoreHandle) + Send) {
    let endpoints = [(autopilot, Role::Autopilot), (ground, Role::Ground)];
    let links = endpoints.map(|(address, role)| LinkSettings {
        name: role.name().to_owned(),
        role,
        endpoint: Endpoint::UdpOut(address).to_string(),
        transport: Transport::Datagrams,
        speaks_first: true,
        max_rates: Default::default(),
    });
    let settings = Settings {
        system_id: SystemId::Fixed(1),
        links: links.into(),
        gimbals: vec![GimbalSettings::found("camera".to_owned())],
        ..Settings::default()
    };
    let (requests, received_requests) = mpsc::channel(16);
    let (published, snapshots) = watch::channel(Arc::new(Snapshot::default()));
    let window = Window { requests: received_requests, snapshots: published };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build().expect("a runtime");
    std::thread::scope(|scope| {
        let client = scope.spawn(move || test(CoreHandle { requests, snapshots }));
        runtime.block_on(async {
            let clock = Clock::start();
            let mut event_loop = EventLoop::new(
                Bridge::new(clock.now(), settings),
                endpoints.iter().map(|(address, _)| crate::links::link(&Endpoint::UdpOut(*address))).collect(),
                endpoints.iter().map(|(_, role)| role.name().to_owned()).collect(),
                clock,
                DeadlineTimer::new().expect("a timer"),
                Shutdown::new().expect("signals can be caught"),
                ServiceManager::new(),
                Kept {
                    system_id: SystemIdFile::new(None),
                    gimbal_ids: StateFile::new(None, "gimbal-ids"),
                    turning: TurningFile::new(None),
                },
                window,
            );
            poll_fn(|cx| {
                assert!(event_loop.poll(cx).is_pending(), "nobody ends it");
                // The core's own timers and what the client sends are the only reasons to wake.
                if client.is_finished() { Poll::Ready(()) } else { Poll::Pending }
            })
            .await;
        });
    });
}

fn socket() -> (UdpSocket, SocketAddr) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    socket.set_read_timeout(Some(PATIENCE)).expect("a socket takes it");
    let address = socket.local_addr().expect("it is bound");
    (socket, address)
}

fn text(sequence: u8) -> Vec<u8> {
    let text = STATUSTEXT_DATA { severity: 6, text: [b'g'; 50].into(), id: 1, chunk_seq: 0 };
    encode_to_vec(MavId::new(1, 1), sequence, &text)
}

/// Receives until `expected` comes; the daemon also speaks for itself.
fn expect(socket: &UdpSocket, expected: &[u8]) -> SocketAddr {
    let mut buffer = [0; 512];
    loop {
        let (length, from) = socket.recv_from(&mut buffer).expect("it arrives in time");
        if &buffer[..length] == expected {
            return from;
        }
    }
}

/// "forwards bytes unchanged".
#[test]
fn a_frame_from_one_link_leaves_on_the_other() {
    let ((autopilot, autopilot_address), (ground, ground_address)) = (socket(), socket());
    with_daemon(autopilot_address, ground_address, move |handle| {
        // The daemon speaks first; that tells where it is.
        let (_, daemon) = autopilot.recv_from(&mut [0; 512]).expect("the daemon says something in time");
        for sequence in 0..100 {
            autopilot.send_to(&text(sequence), daemon).expect("sent");
            expect(&ground, &text(sequence));
        }
        drop(handle);
    });
}

/// "on Refresh the loop publishes a fresh snapshot"; nothing is published unasked.
#[test]
fn a_snapshot_is_published_when_it_is_asked_for() {
    let ((_autopilot, autopilot_address), (_ground, ground_address)) = (socket(), socket());
    with_daemon(autopilot_address, ground_address, |mut handle| {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().expect("a runtime");
        runtime.block_on(async {
            assert!(!handle.snapshots.has_changed().expect("the daemon runs"));
            handle.requests.send(CoreRequest::Refresh).await.expect("the daemon runs");
            tokio::time::timeout(PATIENCE, handle.snapshots.changed())
                .await
                .expect("it is published in time")
                .expect("the daemon runs");
            assert_eq!(handle.snapshots.borrow_and_update().links.len(), 2);
        });
    });
}

/// What is asked is answered; what nobody waits for any more is not done: who has given up was told that it was not.
#[test]
fn what_is_asked_is_answered_and_only_then_done() {
    let ((_autopilot, autopilot_address), (_ground, ground_address)) = (socket(), socket());
    with_daemon(autopilot_address, ground_address, |mut handle| {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().expect("a runtime");
        runtime.block_on(async {
            let ask = |gimbal: &str| {
                let (answer, answered) = tokio::sync::oneshot::channel();
                (CoreRequest::Ask { gimbal: gimbal.to_owned(), asked: Asked::TakeControl, answer }, answered)
            };
            let (unknown, answered) = ask("lamp");
            handle.requests.send(unknown).await.expect("the daemon runs");
            let answer = tokio::time::timeout(PATIENCE, answered).await.expect("in time");
            assert_eq!(answer, Ok(Err(NotDone::UnknownGimbal)));

            let (given_up, answered) = ask("camera");
            drop(answered);
            handle.requests.send(given_up).await.expect("the daemon runs");
            handle.requests.send(CoreRequest::Refresh).await.expect("the daemon runs");
            handle.snapshots.changed().await.expect("the daemon runs");
            assert_eq!(handle.snapshots.borrow_and_update().gimbals[0].primary, None);

            let (taken, answered) = ask("camera");
            handle.requests.send(taken).await.expect("the daemon runs");
            assert_eq!(tokio::time::timeout(PATIENCE, answered).await.expect("in time"), Ok(Ok(())));
            handle.requests.send(CoreRequest::Refresh).await.expect("the daemon runs");
            handle.snapshots.changed().await.expect("the daemon runs");
            assert_eq!(handle.snapshots.borrow_and_update().gimbals[0].primary.as_deref(), Some("http"));
        });
    });
}
