//! A forwarder in a process of its own, and the CPU time it used.

use std::ffi::OsStr;
use std::fs;
use std::path::Path;
use std::process::{Child, Command};
use std::time::Duration;

/// Ends with this value.
pub struct Forwarder {
    child: Child,
}

impl Forwarder {
    pub fn start(program: &Path, arguments: &[&OsStr]) -> Self {
        let child = Command::new(program).args(arguments).spawn().expect("the forwarder can be started");
        Self { child }
    }

    /// What all threads used up to now, to the nanosecond: the first number of each `schedstat`.
    pub fn cpu_time(&self) -> Duration {
        let tasks = fs::read_dir(format!("/proc/{}/task", self.child.id())).expect("the forwarder runs");
        let nanoseconds = tasks.map(|task| {
            let path = task.expect("its threads can be listed").path().join("schedstat");
            let text = fs::read_to_string(path).expect("the kernel keeps statistics of the scheduler");
            text.split(' ').next().and_then(|number| number.parse().ok()).unwrap_or(0)
        });
        Duration::from_nanos(nanoseconds.sum())
    }
}

impl Drop for Forwarder {
    fn drop(&mut self) {
        self.child.kill().expect("the forwarder runs");
        self.child.wait().expect("it was not waited for before");
    }
}
