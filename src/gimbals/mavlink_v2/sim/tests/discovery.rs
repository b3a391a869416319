//! How the device is found, and what it answers.

use super::*;

/// gimbal HEARTBEAT (type 26, autopilot 8, ACTIVE), once a second.
#[test]
fn it_beats_once_a_second_as_a_gimbal() {
    let mut bench = Bench::new(|_| {});

    bench.run_until(millis(3500));
    let first = bench.sent.iter().find(|(_, bytes)| bytes[7] == 0).map(|(_, bytes)| bytes.clone());
    let beats = bench.take::<HEARTBEAT_DATA>();

    assert_eq!(beats.iter().map(|(at, _)| *at).collect::<Vec<_>>(), [0, 1000, 2000, 3000].map(millis));
    assert!(beats.iter().all(|(_, beat)| *beat == heartbeat(26, 8)));
    let golden = b"\xFD\x09\x00\x00\x00\x01\x9A\x00\x00\x00\x00\x00\x00\x00\x1A\x08\x00\x04\x03\x1A\xCF";
    assert_eq!(first.as_deref(), Some(&golden[..]));
}

/// ArduPilot asks 1/154, PX4 asks 0/0, others 1/0: "answer both, and answer repeats".
#[test]
fn information_is_answered_directed_and_broadcast() {
    for (system, component) in [(1, 154), (0, 0), (1, 0)] {
        let mut bench = Bench::new(|_| {});
        bench.run_until(millis(10));
        bench.sent.clear();

        for _ in 0..2 {
            bench.hear(AUTOPILOT, &request(message::GIMBAL_DEVICE_INFORMATION, system, component));
            let (_, ack) = bench.first::<COMMAND_ACK_DATA>();
            assert_eq!((ack.command, ack.result), (512, 0), "{system}/{component}");
            assert_eq!((ack.target_system, ack.target_component), (1, 1), "the answer is for who asked");
            assert_eq!(bench.names(), ["COMMAND_ACK", "GIMBAL_DEVICE_INFORMATION"]);
        }
    }
}

#[test]
fn information_says_what_the_device_is() {
    let mut bench = Bench::new(|settings| {
        settings.vendor_name = "Vendor".to_owned();
        settings.plant.limits.pitch = AxisLimits::new(Angle::from_degrees(-90.0), Angle::from_degrees(45.0));
    });
    bench.hear(AUTOPILOT, &request(message::GIMBAL_DEVICE_INFORMATION, 1, 154));

    let (_, information) = bench.take::<GIMBAL_DEVICE_INFORMATION_DATA>().remove(0);
    assert_eq!(information.vendor_name.to_str(), Ok("Vendor"));
    assert_eq!(information.firmware_version, 0x0000_0001);
    assert_eq!((information.gimbal_device_id, information.cap_flags2), (0, 0));
    assert_eq!(information.cap_flags, 8119);
    assert_eq!((information.pitch_min, information.pitch_max), (-90_f32.to_radians(), 45_f32.to_radians()));
    assert_eq!((information.yaw_min, information.yaw_max), (f32::NEG_INFINITY, f32::INFINITY));

    let mut newer = Bench::new(|settings| settings.has_cap_flags2 = true);
    newer.hear(AUTOPILOT, &request(message::GIMBAL_DEVICE_INFORMATION, 1, 154));
    assert_eq!(newer.take::<GIMBAL_DEVICE_INFORMATION_DATA>().remove(0).1.cap_flags2, 8119);
}

#[test]
fn other_commands_are_refused_when_directed_and_ignored_when_broadcast() {
    for (number, params, result) in [
        (command::DO_MOUNT_CONTROL, [0.0, 0.0], 3),
        (command::REQUEST_MESSAGE, [280.0, 0.0], 2),
        (command::SET_MESSAGE_INTERVAL, [0.0, 100_000.0], 2),
        (command::SET_MESSAGE_INTERVAL, [285.0, NAN], 2),
    ] {
        let mut bench = Bench::new(|_| {});
        bench.run_until(millis(10));
        bench.sent.clear();

        bench.hear(GCS, &command(number, params, 1, 154));
        let acks = bench.take::<COMMAND_ACK_DATA>();
        assert_eq!(acks.iter().map(|(_, ack)| (ack.command, ack.result)).collect::<Vec<_>>(), [(number, result)]);

        for (system, component) in [(0, 0), (1, 0), (1, 171), (2, 154)] {
            bench.hear(GCS, &command(number, params, system, component));
            assert!(bench.sent.is_empty(), "{number} to {system}/{component}");
        }
    }
}

/// "285 broadcast 4 Hz until first 284, then 10 Hz (or by 511)".
#[test]
fn attitude_comes_at_its_rate() {
    let interval = |bench: &mut Bench| {
        bench.run_for(1000);
        bench.sent.clear();
        bench.run_for(2000);
        let times: Vec<_> = bench.take::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().into_iter().map(|(at, _)| at).collect();
        let gaps: Vec<_> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(gaps.iter().all(|gap| *gap == gaps[0]), "{gaps:?}");
        gaps[0].as_millis()
    };
    let mut bench = Bench::new(|_| {});

    assert_eq!(interval(&mut bench), 250);
    bench.hear(MANAGER, &angles(FOLLOW, 0.0, 0.0));
    assert_eq!(interval(&mut bench), 100);
    bench.hear(MANAGER, &command(command::SET_MESSAGE_INTERVAL, [285.0, 20_000.0], 1, 154));
    assert_eq!(bench.first::<COMMAND_ACK_DATA>().1.result, 0);
    assert_eq!(interval(&mut bench), 20);
    bench.hear(MANAGER, &command(command::SET_MESSAGE_INTERVAL, [285.0, 0.0], 1, 154));
    assert_eq!(interval(&mut bench), 100);

    bench.sent.clear();
    bench.hear(MANAGER, &command(command::GET_MESSAGE_INTERVAL, [285.0, 0.0], 1, 154));
    let expected = MESSAGE_INTERVAL_DATA { message_id: 285, interval_us: 100_000 };
    assert_eq!(bench.take::<MESSAGE_INTERVAL_DATA>().into_iter().map(|(_, message)| message).next(), Some(expected));
}

/// "nothing is transmitted before it received a HEARTBEAT"; one of a ground station tells no system id.
#[test]
fn it_listens_before_it_speaks() {
    let mut patient = Bench::new(|settings| settings.listens_first = None);
    patient.hear(GCS, &heartbeat(6, 8));
    patient.hear(MANAGER, &request(message::GIMBAL_DEVICE_INFORMATION, 0, 0));
    patient.hear(MANAGER, &PARAM_REQUEST_LIST_DATA { target_system: 0, target_component: 0 });
    patient.run_until(Timestamp::from_secs(60));
    assert!(patient.sent.is_empty());

    patient.hear(MANAGER, &heartbeat(18, 8));
    patient.run_for(1100);
    let beats = patient.take::<HEARTBEAT_DATA>();
    assert_eq!(beats[0].0, Timestamp::from_secs(60));
    assert_eq!(beats[1].0, Timestamp::from_secs(61));

    let mut hasty = Bench::new(|settings| settings.listens_first = Some(Duration::from_secs(3)));
    hasty.run_until(millis(3500));
    assert_eq!(hasty.take::<HEARTBEAT_DATA>()[0].0, Timestamp::from_secs(3));
}

#[test]
fn it_takes_the_system_id_of_the_first_autopilot() {
    for (source, mavtype, system) in [
        (MavId::new(33, 1), 0, 33),
        (MavId::new(7, 1), 2, 7),
        (MavId::new(255, 190), 6, 1),
        (MavId::new(9, 191), 18, 1),
        (MavId::new(9, 1), 18, 1),
    ] {
        let mut bench = Bench::new(|_| {});
        bench.hear(source, &heartbeat(mavtype, 0));
        assert_eq!(bench.device.id(), MavId::new(system, 154), "{source} of type {mavtype}");
        bench.hear(MavId::new(99, 1), &heartbeat(2, 3));
        assert_eq!(bench.device.id().system, if system == 1 { 99 } else { system });
    }
    let mut fixed = Bench::new(|settings| settings.system_id = SystemId::Fixed(5));
    fixed.hear(AUTOPILOT, &heartbeat(2, 12));
    assert_eq!(fixed.device.id(), MavId::new(5, 154));
}

#[test]
fn its_parameters_can_be_read() {
    let mut bench = Bench::new(|settings| settings.component_id = 171);
    bench.hear(GCS, &PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 171 });
    bench.run_for(100);

    let values = bench.take::<PARAM_VALUE_DATA>();
    let names: Vec<_> = values.iter().map(|(_, value)| value.param_id).collect();
    assert_eq!(names, ["SIM_COMP_ID", "SIM_RATE_MAX", "SIM_TILT_MAX", "SIM_TILT_MIN"].map(CharArray::from));
    assert_eq!(values[0].1.param_value.to_bits(), 171);
}

#[test]
fn a_stream_cut_anywhere_is_understood() {
    let mut bench = Bench::new(|_| {});
    bench.run_until(millis(10));
    bench.sent.clear();
    for byte in encode_to_vec(GCS, 0, &request(message::GIMBAL_DEVICE_INFORMATION, 1, 154)) {
        bench.device.handle_received(bench.now, &[byte]);
        bench.drain();
    }

    assert_eq!(bench.names(), ["COMMAND_ACK", "GIMBAL_DEVICE_INFORMATION"]);
}
