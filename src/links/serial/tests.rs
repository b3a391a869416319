use std::fs::File;
use std::io::Write;
use std::os::fd::AsFd;
use std::os::unix::fs::symlink;
use std::path::PathBuf;

use nix::fcntl::{FcntlArg, OFlag, fcntl};
use nix::pty::{OpenptyResult, openpty};
use nix::unistd::ttyname;

use super::super::harness::{Rig, Seen, noise, read_available, write_aside};
use super::*;

/// The library speaks of a lock.
#[test]
fn a_port_that_somebody_holds_is_said_to_be_held() {
    let OpenptyResult { master: _master, slave } = openpty(None, None).expect("a pseudo-terminal");
    let path = ttyname(slave.as_fd()).expect("it has a name");
    let path = path.to_str().expect("UTF-8");
    let _holder = serial_port::open(path, 115_200).expect("it is free");

    let error = serial_port::open(path, 115_200).map(|_| ()).expect_err("it is held");

    assert_eq!(why_closed(path, &error.into()), "another program holds it; gimbald scan names it");
    let gone = io::Error::new(io::ErrorKind::NotFound, "No such file or directory");
    assert_eq!(why_closed("/nowhere/gimbal", &gone), "no such file or directory");
}

/// A path may lead elsewhere after the configuration was checked.
#[test]
fn a_terminal_without_a_line_is_not_opened() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("gimbal");
    symlink("/dev/ptmx", &path).expect("the path is free");
    let mut rig = rig(&path);

    let reason = "it is what makes pseudo-terminals, where no gimbal can be";
    assert_eq!(rig.next(), Seen::Down(format!("cannot open {}: {reason}", path.display())));
}

/// A pseudo-terminal that can be pulled and plugged in again behind a path that stays.
struct Cable {
    directory: tempfile::TempDir,
    device: Option<File>,
}

impl Cable {
    fn unplugged() -> Self {
        Self { directory: tempfile::tempdir().expect("a directory"), device: None }
    }

    fn plugged() -> Self {
        let mut cable = Self::unplugged();
        cable.plug();
        cable
    }

    fn path(&self) -> PathBuf {
        self.directory.path().join("by-id:gimbal")
    }

    fn plug(&mut self) -> &mut File {
        let OpenptyResult { master, slave } = openpty(None, None).expect("a pseudo-terminal");
        fcntl(master.as_fd(), FcntlArg::F_SETFL(OFlag::O_NONBLOCK)).expect("it takes the flag");
        symlink(ttyname(slave.as_fd()).expect("it has a name"), self.path()).expect("the path is free");
        self.device.insert(master.into())
    }

    fn pull(&mut self) {
        self.device = None;
        std::fs::remove_file(self.path()).expect("it was there");
    }

    fn device(&mut self) -> &mut File {
        self.device.as_mut().expect("it is plugged")
    }
}

fn rig(path: &Path) -> Rig<SerialLink> {
    Rig::new(SerialLink::new(path.to_str().expect("plain letters").to_owned(), 115_200))
}

#[track_caller]
fn expect_up(rig: &mut Rig<SerialLink>, path: &Path) {
    assert_eq!(rig.next(), Seen::Up);
    assert_eq!(rig.next(), Seen::Appeared(PEER, path.display().to_string()));
}

#[test]
fn bytes_go_both_ways_unchanged() {
    let mut cable = Cable::plugged();
    let mut rig = rig(&cable.path());
    expect_up(&mut rig, &cable.path());
    let all: Vec<u8> = (0..=255).collect();

    cable.device().write_all(&all).expect("sent");
    assert_eq!(rig.receive(PEER, 256), all);
    rig.send(PEER, &all);
    let mut arrived = Vec::new();
    rig.until(|_| {
        read_available(cable.device(), &mut arrived);
        (arrived.len() >= 256).then_some(())
    });
    assert_eq!(arrived, all);
}

/// "a missing device at start is not fatal", and it is looked for every 250 ms.
#[test]
fn a_device_that_is_missing_at_start_is_waited_for() {
    let mut cable = Cable::unplugged();
    let mut rig = rig(&cable.path());
    for _ in 0..3 {
        let reason = format!("cannot open {}: no such file or directory", cable.path().display());
        assert_eq!(rig.next(), Seen::Down(reason));
        assert_eq!(rig.link.poll_timeout(), Some(rig.now + Duration::from_millis(250)));
        rig.expect_silence();
        rig.pass(Duration::from_millis(250));
    }
    rig.next();

    cable.plug();
    rig.pass(Duration::from_millis(250));
    expect_up(&mut rig, &cable.path());
}

/// "serial device gone and back: noticed and recovered under 1 s after it returns".
#[test]
fn a_device_that_was_pulled_comes_back() {
    let mut cable = Cable::plugged();
    let mut rig = rig(&cable.path());
    expect_up(&mut rig, &cable.path());
    for _ in 0..5 {
        cable.pull();
        let Seen::Down(reason) = rig.next() else { panic!("it is noticed without time passing") };
        assert!(reason.starts_with(&format!("lost {}: ", cable.path().display())), "{reason}");

        cable.plug();
        rig.pass(Duration::from_millis(250));
        expect_up(&mut rig, &cable.path());
        cable.device().write_all(b"back").expect("sent");
        assert_eq!(rig.receive(PEER, 4), b"back");
    }
}

#[test]
fn what_came_before_the_link_was_open_is_not_delivered() {
    let mut cable = Cable::plugged();
    let keeps_it_open = File::options().read(true).write(true).open(cable.path()).expect("it is there");
    cable.device().write_all(b"stale\n").expect("sent");

    let mut rig = rig(&cable.path());
    expect_up(&mut rig, &cable.path());
    cable.device().write_all(b"fresh").expect("sent");

    assert_eq!(rig.receive(PEER, 5), b"fresh");
    drop(keeps_it_open);
}

#[test]
fn a_device_that_another_process_holds_is_waited_for() {
    let cable = Cable::plugged();
    let mut holder = rig(&cable.path());
    expect_up(&mut holder, &cable.path());

    let mut second = rig(&cable.path());
    let Seen::Down(reason) = second.next() else { panic!("it is held by the first") };
    assert!(reason.starts_with(&format!("cannot open {}: ", cable.path().display())), "{reason}");
    drop(holder);
    second.pass(Duration::from_millis(250));
    expect_up(&mut second, &cable.path());
}

/// "whole frames only": a line that takes a part of a frame gets the rest of it before anything else.
#[test]
fn a_frame_that_was_begun_is_finished_and_others_are_dropped_whole() {
    let mut cable = Cable::plugged();
    let mut rig = rig(&cable.path());
    expect_up(&mut rig, &cable.path());
    let frame = |number: u32| number.to_le_bytes().repeat(70);

    let mut sent = 0;
    while !rig.link.has_unsent() {
        rig.send(PEER, &frame(sent));
        sent += 1;
    }
    while sent < 200 {
        rig.send(PEER, &frame(sent));
        sent += 1;
    }
    let Seen::SendFailed(PEER, full, "the line takes nothing") = rig.next() else { panic!("some were dropped") };
    rig.pass(Duration::from_secs(1));
    let late = match rig.poll_once() {
        Some(Seen::SendFailed(PEER, late, "the line takes nothing")) => late,
        other => panic!("what waited a second is dropped: {other:?}"),
    };
    let mut arrived = Vec::new();
    rig.until(|rig| {
        rig.pass(RETRY_INTERVAL);
        read_available(cable.device(), &mut arrived);
        (!rig.link.has_unsent()).then_some(())
    });
    rig.send(PEER, &frame(sent));
    let expected = (sent + 1 - full - late) as usize;
    rig.until(|_| {
        read_available(cable.device(), &mut arrived);
        (arrived.len() >= expected * 280).then_some(())
    });

    let frames: Vec<_> = arrived.chunks(280).map(<[u8]>::to_vec).collect();
    let numbers = (0..expected as u32 - 1).chain([sent]);
    assert_eq!(frames, numbers.map(frame).collect::<Vec<_>>());
}

#[test]
fn ten_megabytes_pass_without_growth() {
    let mut cable = Cable::plugged();
    let mut rig = rig(&cable.path());
    expect_up(&mut rig, &cable.path());
    let device = cable.device.take().expect("it is plugged");
    fcntl(device.as_fd(), FcntlArg::F_SETFL(OFlag::empty())).expect("it takes the flag");
    let bytes = noise(10_000_000);
    let writer = write_aside(device, bytes.clone());

    assert!(rig.receive(PEER, bytes.len()) == bytes, "what arrives is what was sent");
    writer.join().expect("all was written");
}
