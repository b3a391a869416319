//! Where the answers to commands go.

use gimbald::wire::dialect::COMMAND_ACK_DATA;

use super::*;
use crate::support::script::{UNSUPPORTED, ack, command_long, of};

/// Protocol checklist 130: "COMMAND_ACK … goes only to links on which the sender was seen", also for a sender whom no
/// route can be learned for (protocol checklist 150), although others of its system are known elsewhere.
#[test]
fn item_130_who_cannot_be_learned_is_answered_where_it_spoke() {
    for sender in [MavId::new(255, 0), MavId::new(0, 190), MavId::new(0, 0)] {
        let mut rig = Rig::new();
        rig.introduce("radio", MavId::new(255, 191));
        rig.world.forget();
        let ground = rig.place("ground");

        rig.world.send(ground, sender, &command_long(MANAGER, 2000, &[0.0; 7]));

        let answers = rig.world.take(ground);
        assert_eq!(of::<COMMAND_ACK_DATA>(&answers), [ack(sender, 2000, UNSUPPORTED)], "{sender}");
        for elsewhere in ["autopilot", "gimbal", "radio", "peer"] {
            assert_eq!(rig.world.take(rig.place(elsewhere)), [], "{sender} at {elsewhere}");
        }
    }
}

/// A ground station with two links to us is answered on both, and on its new one only once it has left the other.
#[test]
fn item_130_a_sender_seen_on_two_links_is_answered_on_both() {
    let mut rig = Rig::new();
    rig.introduce("ground", GROUND);
    let (ground, radio) = (rig.place("ground"), rig.place("radio"));
    let command = command_long(MANAGER, 2000, &[0.0; 7]);

    rig.world.send(radio, GROUND, &command);
    for place in [ground, radio] {
        assert_eq!(of::<COMMAND_ACK_DATA>(&rig.world.take(place)), [ack(GROUND, 2000, UNSUPPORTED)]);
    }

    rig.run_for(Duration::from_secs(6));
    rig.world.send(radio, GROUND, &command);
    assert_eq!(of::<COMMAND_ACK_DATA>(&rig.world.take(radio)).len(), 1);
    assert_eq!(of::<COMMAND_ACK_DATA>(&rig.world.take(ground)), []);
}
