use super::*;
use crate::sim::peer::Peer;
use crate::wire::{DatagramFrames, encode_to_vec};

/// With a fixed system id it speaks first: over UDP the other side may be waiting for that.
#[test]
fn a_gimbal_with_an_id_of_its_own_speaks_first() {
    let settings = DeviceSettings { system_id: SystemId::Fixed(1), ..DeviceSettings::default() };
    let mut gimbal = Device::new(Timestamp::ZERO, settings);
    assert_eq!(gimbal.poll_timeout(), Some(Timestamp::ZERO));

    gimbal.handle_timeout(Timestamp::ZERO);

    let first = gimbal.poll_output().expect("it speaks");
    assert_eq!(DatagramFrames::new(&first).next_frame().expect("a frame").message_id(), message::HEARTBEAT);
}

/// "Wait for a HEARTBEAT. Ignore type 6 (GCS) … Adopt that sysid" (gimbal statement 33).
#[test]
fn statement_33_a_gimbal_takes_the_system_of_a_vehicle_and_not_of_a_ground_station() {
    let heartbeat = |mavtype| HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype,
        autopilot: 3,
        base_mode: 0,
        system_status: 4,
        mavlink_version: 3,
    };
    let mut gimbal = Device::new(Timestamp::ZERO, DeviceSettings::default());
    gimbal.handle_timeout(Timestamp::ZERO);
    gimbal.handle_received(Timestamp::ZERO, &encode_to_vec(MavId::new(255, 190), 0, &heartbeat(6)));
    assert_eq!(gimbal.poll_output(), None);

    gimbal.handle_received(Timestamp::ZERO, &encode_to_vec(MavId::new(7, 1), 0, &heartbeat(2)));

    let first = gimbal.poll_output().expect("it speaks");
    assert_eq!(DatagramFrames::new(&first).next_frame().expect("a frame").source(), MavId::new(7, 154));
}
