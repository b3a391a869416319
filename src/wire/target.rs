//! Whom a message is meant for, read from its payload without decoding it.

use super::ids::MavId;
use super::table::MESSAGES;

/// What is known of one message: enough to check and to route it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MessageShape {
    pub id: u32,
    pub name: &'static str,
    pub crc_extra: u8,
    /// Payload length without extension fields.
    pub base_len: u8,
    /// Payload length with every extension field known to us.
    pub max_len: u8,
    pub system_offset: Option<u8>,
    pub component_offset: Option<u8>,
}

/// The shape of message `id`, `None` for one that the definitions do not hold.
pub fn message_shape(id: u32) -> Option<&'static MessageShape> {
    let low = usize::try_from(id).ok()?;
    if low < LOW_IDS {
        return match LOW_INDEX[low] {
            UNKNOWN => None,
            index => Some(&MESSAGES[usize::from(index)]),
        };
    }
    MESSAGES.binary_search_by_key(&id, |shape| shape.id).ok().map(|index| &MESSAGES[index])
}

/// Every known message, sorted by id.
pub fn known_messages() -> &'static [MessageShape] {
    MESSAGES
}

/// Whom a message addresses (`target_system`, `target_component`).
///
/// A truncated or missing field reads 0, and 0 means everybody (MAVLink developer guide, Routing).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    Everyone,
    /// All components of one system.
    System(u8),
    Component(MavId),
}

impl Target {
    pub const fn new(system: u8, component: u8) -> Self {
        match (system, component) {
            (0, _) => Self::Everyone,
            (system, 0) => Self::System(system),
            (system, component) => Self::Component(MavId::new(system, component)),
        }
    }

    /// Reads the target out of a payload of the given shape.
    pub(super) fn read(shape: &MessageShape, payload: &[u8]) -> Self {
        let field = |offset: Option<u8>| offset.and_then(|at| payload.get(usize::from(at))).copied().unwrap_or(0);
        Self::new(field(shape.system_offset), field(shape.component_offset))
    }

    pub const fn system(self) -> u8 {
        match self {
            Self::Everyone => 0,
            Self::System(system) => system,
            Self::Component(id) => id.system,
        }
    }

    pub const fn component(self) -> u8 {
        match self {
            Self::Everyone | Self::System(_) => 0,
            Self::Component(id) => id.component,
        }
    }

    /// "…processed locally if it has no target, or the target system is ours and the component is ours or 0."
    pub fn includes(self, id: MavId) -> bool {
        match self {
            Self::Everyone => true,
            Self::System(system) => system == id.system,
            Self::Component(target) => target == id,
        }
    }
}

const LOW_IDS: usize = 512;
const UNKNOWN: u16 = u16::MAX;

/// Position in the table of the messages below [`LOW_IDS`], which are nearly all there are on a link.
static LOW_INDEX: [u16; LOW_IDS] = low_index();

const fn low_index() -> [u16; LOW_IDS] {
    let mut index = [UNKNOWN; LOW_IDS];
    let mut at = 0;
    while at < MESSAGES.len() {
        if (MESSAGES[at].id as usize) < LOW_IDS {
            index[MESSAGES[at].id as usize] = at as u16;
        }
        at += 1;
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_sorted_so_that_it_can_be_searched() {
        assert!(MESSAGES.windows(2).all(|pair| pair[0].id < pair[1].id));
        assert!(MESSAGES.iter().all(|shape| message_shape(shape.id) == Some(shape)));
        assert_eq!(message_shape(8_000), None);
        assert_eq!(message_shape(3), None);
    }

    /// "target_system/target_component themselves may be truncated away" (protocol notes 0.3).
    #[test]
    fn a_truncated_target_means_everyone() {
        let command_long = message_shape(76).expect("COMMAND_LONG is known");
        assert_eq!(Target::read(command_long, &[0; 30]), Target::Everyone);
        let mut payload = [0; 33];
        payload[30] = 1;
        assert_eq!(Target::read(command_long, &payload[..31]), Target::System(1));
        payload[31] = 191;
        assert_eq!(Target::read(command_long, &payload), Target::Component(MavId::new(1, 191)));
    }
}
