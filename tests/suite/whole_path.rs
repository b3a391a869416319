//! The way through, from a ground station's command to the gimbal's movement, with simulated peers at both ends.

use std::time::Duration;

use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::sim::vehicle::{Autopilot, StateForGimbals, Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_DEVICE_SET_ATTITUDE_DATA,
    MavMessage,
};

use crate::support::hub::Watched;
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

/// "The simulated gimbal must hold its earth yaw": on a vehicle that turns and does not tell gimbals its state, what we
/// make of it keeps the gimbal on its direction, without drift. Where we do not, the gimbal does not know North, and says
/// so.
#[test]
fn a_gimbal_keeps_its_direction_by_the_state_that_is_made_for_it() {
    for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
        for synthesize_286 in [true, false] {
            let mut settings = three_links();
            settings.control.synthesize_286 = synthesize_286;
            let (mut world, places) = World::empty(settings);
            let state_for_gimbals = StateForGimbals::Denied;
            let vehicle = VehicleSettings { autopilot, state_for_gimbals, ..VehicleSettings::default() };
            let truth = Vehicle::new(Timestamp::ZERO, vehicle);
            let device = Watched::new(Device::new(Timestamp::ZERO, DeviceSettings::default()));
            world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, vehicle));
            world.install(places.gimbal, device.clone());
            // The gimbal is really turned with the vehicle, whatever it believes.
            let fly_for = |world: &mut World, seconds: u64| {
                for _ in 0..seconds * 100 {
                    world.disturb(places.gimbal, truth.platform_motion(world.now));
                    world.run_for(Duration::from_millis(10));
                }
            };
            fly_for(&mut world, 10);

            world.send(places.ground, GCS, &pitchyaw(-20.0, 120.0, 92.0));
            fly_for(&mut world, 10);
            world.forget();
            let mut worst: f64 = 0.0;
            for _ in 0..20 {
                fly_for(&mut world, 1);
                worst = worst.max((yaw_from_north_deg(&device, world.now) - 120.0).abs());
            }

            let turned = truth.motion(world.now).heading_rate.degrees_per_second() * 20.0;
            assert!(turned > 140.0, "the vehicle turns, by {turned}°");
            let flags: Vec<u16> = world
                .take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(places.gimbal)
                .iter()
                .map(|told| told.flags)
                .collect();
            let expected = if synthesize_286 { 92 } else { 44 };
            assert!(flags.len() > 300 && flags.iter().all(|flags| *flags == expected), "{autopilot:?}: {flags:?}");
            if synthesize_286 {
                assert!(worst < 0.1, "{autopilot:?}: {worst}°");
            }
        }
    }
}

/// Where it really points.
fn yaw_from_north_deg(device: &Watched<Device>, now: Timestamp) -> f64 {
    let device = device.look();
    (device.plant().platform_heading(now) + device.plant().pose().yaw).wrapped().degrees()
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
