//! Frames under our own ids.

use super::*;
use crate::support::world::heartbeat as heartbeat_of;

/// Protocol checklist 23, as decided in D20: "only frames identical to ones that we sent are dropped", and counted as
/// loop.
#[test]
fn item_23_what_we_sent_ourselves_is_dropped_when_it_comes_back() {
    let mut rig = Rig::new();
    let peer = rig.place("peer");
    rig.world.run_for(Duration::from_millis(1_500));
    let ours = rig.world.take(peer).into_iter().find(|arrival| arrival.id() == HEARTBEAT).expect("we beat").bytes;

    assert_eq!(rig.deliver("radio", &ours), [""; 0]);
    assert_eq!(rig.deliver("peer", &ours), [""; 0]);
    assert_eq!((rig.dropped("radio", "loop"), rig.dropped("peer", "loop")), (1, 1));
    assert_eq!(rig.world.snapshot().conflicts, [""; 0]);
}

/// D20: "a frame with our source ids that we did not just send is not a loop: it is a conflict (mavros 2 beats as 191
/// by default), shown with the key to change, and forwarded". Its source is not learned.
#[test]
fn item_23_another_under_our_id_is_a_conflict_and_is_forwarded() {
    let mut rig = Rig::new();
    let peer = rig.place("peer");
    rig.world.send(peer, MANAGER, &heartbeat_of(6, 8));
    for to in ["autopilot", "gimbal", "ground", "radio"] {
        assert_eq!(rig.world.take(rig.place(to)).len(), 1, "at {to}");
    }
    assert_eq!(rig.deliver("peer", &broadcast(MANAGER, ATTITUDE)), ["autopilot", "ground", "radio"]);
    // What is addressed to that id is for us.
    assert_eq!(rig.deliver("ground", &addressed(GROUND, MISSION_REQUEST_LIST, (1, 191))), [""; 0]);
    let conflicts = rig.world.snapshot().conflicts;
    assert!(conflicts.len() == 1 && conflicts[0].contains("manager_component_id"), "{conflicts:?}");
    assert_eq!(rig.dropped("peer", "loop"), 0);
}
