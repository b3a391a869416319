//! Whom the device obeys.

use std::time::Duration;

use crate::timestamp::Timestamp;
use crate::wire::MavId;

/// Without a word of its manager for so long, a device says that it has none, and takes the next one.
pub const PATIENCE: Duration = Duration::from_secs(2);

#[derive(Clone, Copy, Debug)]
struct Manager {
    id: MavId,
    /// It announced itself in a manager status, and is not merely the first to have sent a setpoint.
    announced: bool,
    heard: Timestamp,
}

/// The one manager whose setpoints count: the first valid source, or whoever announces itself for the device.
#[derive(Clone, Copy, Debug, Default)]
pub struct ManagerLatch(Option<Manager>);

impl ManagerLatch {
    /// The manager that was heard within the last two seconds.
    pub fn manager(&self, now: Timestamp) -> Option<MavId> {
        self.current(now).map(|manager| manager.id)
    }

    /// Takes a manager status for this device.
    pub fn handle_announcement(&mut self, now: Timestamp, id: MavId) {
        let held = self.current(now).is_some_and(|manager| manager.announced && manager.id != id);
        if !held {
            self.0 = Some(Manager { id, announced: true, heard: now });
        }
    }

    /// Takes a valid setpoint; false when somebody else is the manager.
    pub fn admit(&mut self, now: Timestamp, id: MavId) -> bool {
        match self.current(now) {
            Some(manager) if manager.id != id => false,
            manager => {
                let announced = manager.is_some_and(|manager| manager.announced);
                self.0 = Some(Manager { id, announced, heard: now });
                true
            }
        }
    }

    fn current(&self, now: Timestamp) -> Option<Manager> {
        self.0.filter(|manager| now.since(manager.heard) < PATIENCE)
    }
}
