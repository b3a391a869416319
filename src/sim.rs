//! Simulated peers: a vehicle, the parts that simulated gimbals share, and faults to put between them and the line.
//!
//! Each peer is a plain value: bytes and the time go in, bytes come out. The gimbals themselves stand beside their
//! drivers, in `gimbals/<family>/sim.rs`. Only `host` and `pty` touch the outside: they run a peer on a real link.

pub mod command;
pub mod component;
pub mod faults;
pub mod heading;
pub mod host;
pub mod outbox;
pub mod parameters;
pub mod peer;
pub mod plant;
pub mod pty;
pub mod random;
pub mod streams;
pub mod system_id;
pub mod vehicle;
