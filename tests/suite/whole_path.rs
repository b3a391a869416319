//! The way through, from a ground station's command to the gimbal's movement, with simulated peers at both ends.

use std::time::Duration;

use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA,
    MavMessage,
};

use crate::support::world::{GCS, MANAGER, World, heartbeat, three_links};

/// Protocol checklist 81: "When command 1000 (-30, 45, NaN, NaN, 44, -, 154) is accepted, the following 284s converge to
/// q for pitch -30°, yaw 45°, roll 0, flags 44, rates NaN."
#[test]
fn a_commanded_angle_moves_the_gimbal() {
    let (mut world, places) = World::with_one_gimbal(three_links());
    world.send(places.ground, GCS, &heartbeat(6, 8));
    world.forget();

    world.send(places.ground, GCS, &pitchyaw(-30.0, 45.0, 44.0));

    let acks: Vec<COMMAND_ACK_DATA> = world.take_messages(places.ground);
    let expected = COMMAND_ACK_DATA {
        command: 1000,
        result: 0,
        progress: 255,
        result_param2: 0,
        target_system: GCS.system,
        target_component: GCS.component,
    };
    assert_eq!(acks, [expected]);
    let setpoints: Vec<GIMBAL_DEVICE_SET_ATTITUDE_DATA> = world.take_messages(places.gimbal);
    assert_eq!(setpoints.len(), 1);
    assert_eq!((setpoints[0].flags, setpoints[0].target_system, setpoints[0].target_component), (44, 1, 154));
    world.run_for(Duration::from_secs(5));
    let attitude = world.snapshot().gimbals[0].attitude.clone();
    let near = |value: Option<f64>, wanted: f64| (value.expect("known") - wanted).abs() < 0.5;
    assert!(near(attitude.pitch_deg, -30.0) && near(attitude.yaw_vehicle_deg, 45.0), "{attitude:?}");
    let statuses: Vec<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA> = world.take_messages(places.ground);
    assert!(statuses.len() >= 45, "the device's attitude reaches the ground: {}", statuses.len());
}

fn pitchyaw(pitch: f32, yaw: f32, flags: f32) -> MavMessage {
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1: pitch,
        param2: yaw,
        param3: f32::NAN,
        param4: f32::NAN,
        param5: flags,
        param6: 0.0,
        param7: 154.0,
        command: 1000,
        target_system: MANAGER.system,
        target_component: MANAGER.component,
        confirmation: 0,
    })
}
