//! Noise on every kind of link.

use std::io::Write;
use std::net::{TcpListener, TcpStream};
use std::os::unix::fs::symlink;
use std::time::Duration;

use gimbald::sim::random::Random;
use gimbald::wire::{FrameBuffer, MavId};

use super::one_link;
use crate::support::daemon::{Daemon, Line, PATIENCE, Site, Station, link, wait_for};
use crate::support::world::{GCS, heartbeat};

const AMOUNT: usize = 10_000_000;
const PIECE: usize = 1_000;
/// More than any buffer of a link, and far less than the noise.
const GROWTH_KIB: u64 = 4_096;

/// Whoever speaks behind the noise.
const SURVIVOR: MavId = MavId::new(7, 1);

fn noise() -> impl Iterator<Item = Vec<u8>> {
    let mut random = Random::new(7);
    (0..AMOUNT / PIECE).map(move |_| (0..PIECE / 8).flat_map(|_| random.next_u64().to_le_bytes()).collect())
}

fn valid_frame(sequence: u8) -> Vec<u8> {
    FrameBuffer::default().encode_any(SURVIVOR, sequence, &heartbeat(2, 12)).bytes().to_vec()
}

/// Sends 10 MB of noise over `write` into the link called `noisy`: the daemon lives, does not grow, and forwards a
/// valid frame behind it.
fn withstands(endpoint: &str, connect: impl FnOnce(&Site, &Daemon) -> Box<dyn FnMut(&[u8])>) {
    let site = Site::new();
    let config = format!("{}{}", link("noisy", "peer", endpoint), one_link());
    let mut daemon = site.start(&config, &[]);
    let mut ground = Station::new(GCS, site.port(14_550));
    let mut write = connect(&site, &daemon);
    daemon.wait_until_up();
    wait_for("the ground station to be known", || {
        ground.send(&heartbeat(6, 8));
        let known = daemon.status().links[1].peers.iter().any(|peer| !peer.components.is_empty());
        known.then_some(())
    });
    let before = daemon.resident_kib();

    for piece in noise() {
        write(&piece);
    }

    let mut sequence = 0;
    wait_for("a valid frame behind the noise", || {
        write(&valid_frame(sequence));
        sequence += 1;
        ground.hear_for(Duration::from_millis(50)).iter().any(|heard| heard.source == SURVIVOR).then_some(())
    });
    assert!(daemon.is_alive());
    let status = daemon.status();
    assert!(status.links[0].resync_bytes > AMOUNT as u64 / 10, "{:?}", status.links[0]);
    let after = daemon.resident_kib();
    assert!(after < before + GROWTH_KIB, "grew from {before} to {after} KiB");
}

#[test]
fn udpin() {
    withstands("udpin:{ip}:14600", |site, _| {
        let station = Station::new(SURVIVOR, site.port(14_600));
        Box::new(move |bytes| station.send_bytes(bytes))
    });
}

#[test]
fn udpout() {
    let site = Site::new();
    let socket = std::net::UdpSocket::bind(site.port(14_601)).expect("nobody else has this address");
    withstands(&format!("udpout:{}", site.port(14_601)), |_, _| {
        socket.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        let (_, daemon) = socket.recv_from(&mut [0; 300]).expect("it speaks first");
        // The daemon may be gone, which shows in the end.
        Box::new(move |bytes| drop(socket.send_to(bytes, daemon)))
    });
}

/// Whoever hears the broadcast answers.
#[test]
fn udpbcast() {
    let site = Site::new();
    let socket = std::net::UdpSocket::bind(site.port(14_604)).expect("nobody else has this address");
    withstands(&format!("udpbcast:{}", site.port(14_604)), |_, _| {
        socket.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        let (_, daemon) = socket.recv_from(&mut [0; 300]).expect("it speaks first");
        // The daemon may be gone, which shows in the end.
        Box::new(move |bytes| drop(socket.send_to(bytes, daemon)))
    });
}

#[test]
fn tcpin() {
    withstands("tcpin:{ip}:14602", |site, daemon| {
        daemon.wait_until_up();
        let mut stream = TcpStream::connect(site.port(14_602)).expect("it listens");
        stream.set_write_timeout(Some(PATIENCE)).expect("a time-out");
        Box::new(move |bytes| stream.write_all(bytes).expect("it reads"))
    });
}

#[test]
fn tcpout() {
    let site = Site::new();
    let listener = TcpListener::bind(site.port(14_603)).expect("nobody else has this address");
    withstands(&format!("tcpout:{}", site.port(14_603)), |_, _| {
        let (mut stream, _) = listener.accept().expect("it connects");
        stream.set_write_timeout(Some(PATIENCE)).expect("a time-out");
        Box::new(move |bytes| stream.write_all(bytes).expect("it reads"))
    });
}

#[test]
fn serial() {
    withstands("serial:{dir}/noisy:921600", |site, _| {
        let line = Line::open();
        symlink(&line.device, site.path("noisy")).expect("the path is free");
        Box::new(move |bytes| {
            let mut rest = bytes;
            wait_for("room on the line", || {
                rest = &rest[line.write(rest)..];
                // What the daemon says would fill the line in the end.
                line.read();
                rest.is_empty().then_some(())
            });
        })
    });
}
