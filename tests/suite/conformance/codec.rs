//! Protocol checklist 1 to 13: codec and framing.
//!
//! What the items say of forwarding is shown where frames are routed; here it means that the decoder hands a frame on
//! with the bytes it came with.

use std::fmt::Debug;
use std::slice::from_ref;

use gimbald::timestamp::Timestamp;
use gimbald::wire::decoder::Patience;
use gimbald::wire::dialect::*;
use gimbald::wire::{
    DatagramFrames, Frame, MavId, StreamDecoder, Target, Version, WireCounters, encode_to_vec, target::message_shape,
};

use crate::support::wire::{Random, decode_datagram, decode_stream, frame_v2, hex};

const MANAGER: MavId = MavId::new(1, 191);
const DEVICE: MavId = MavId::new(1, 154);
const AUTOPILOT: MavId = MavId::new(1, 1);
const GCS: MavId = MavId::new(255, 190);
const NAN: f32 = f32::NAN;

/// "When the 16 golden vectors are fed byte-wise to the parser, each decodes to the listed fields; when the fields are
/// encoded, the bytes are identical."
#[test]
fn item_01_golden_vectors_decode_to_their_fields_and_encode_to_their_bytes() {
    golden("fd0900000001bf000000000000001208000403aec6", MANAGER, 0, Target::Everyone, manager_heartbeat());
    golden(
        "fd0b00000101bf190100e80300002c0000009affbe3ebe",
        MANAGER,
        1,
        Target::Everyone,
        GIMBAL_MANAGER_STATUS_DATA {
            time_boot_ms: 1000,
            flags: 44,
            gimbal_device_id: 154,
            primary_control_sysid: 255,
            primary_control_compid: 190,
            secondary_control_sysid: 0,
            secondary_control_compid: 0,
        },
    );
    golden(
        "fd2100000201bf180100e8030000f73f0000000000bf0000003f0000c0bf0000003f000000c0000000409a4816",
        MANAGER,
        2,
        Target::Everyone,
        GIMBAL_MANAGER_INFORMATION_DATA {
            time_boot_ms: 1000,
            cap_flags: 0x3ff7,
            roll_min: -0.5,
            roll_max: 0.5,
            pitch_min: -1.5,
            pitch_max: 0.5,
            yaw_min: -2.0,
            yaw_max: 2.0,
            gimbal_device_id: 154,
        },
    );
    golden(
        "fd2000000301bf1c01000000803f0000000000000000000000000000c07f0000c07f0000c07f2c00019ad0b8",
        MANAGER,
        3,
        Target::Component(DEVICE),
        set_attitude([1.0, 0.0, 0.0, 0.0], [NAN; 3]),
    );
    golden(
        "fd2000000401bf1c01000000c07f0000c07f0000c07f0000c07f0000c07f0000803e000000002c00019a9391",
        MANAGER,
        4,
        Target::Component(DEVICE),
        set_attitude([NAN; 4], [NAN, 0.25, 0.0]),
    );
    golden(
        "fd25000005019a1d0100881300000000803f0000000000000000000000000000c07f0000c07f0000c07f000000000cb75e",
        DEVICE,
        5,
        Target::Everyone,
        attitude_status(12, 0.0, 0.0),
    );
    golden(
        "fd30000006019a1d0100881300000000803f0000000000000000000000000000c07f0000c07f0000c07f000000002c0000000000003f\
         0000c07f1fe0",
        DEVICE,
        6,
        Target::Everyone,
        attitude_status(44, 0.5, NAN),
    );
    golden(
        "fd16000007ffbe1f01002c000000000000bf0000c07f0000c07f0000c07f01bf2272",
        GCS,
        7,
        Target::Component(MANAGER),
        GIMBAL_MANAGER_SET_PITCHYAW_DATA {
            flags: 44,
            pitch: -0.5,
            yaw: NAN,
            pitch_rate: NAN,
            yaw_rate: NAN,
            target_system: 1,
            target_component: 191,
            gimbal_device_id: 0,
        },
    );
    golden(
        "fd20000008ffbe4c000000007f4300003e43000080bf000080bf0000c07f0000c07f00001a43e90301bf6cfd",
        GCS,
        8,
        Target::Component(MANAGER),
        command_long(MANAGER, 1001, [255.0, 190.0, -1.0, -1.0, NAN, NAN, 154.0]),
    );
    golden(
        "fd0a00000901bf4d0000e90300ff00000000ffbe5ce7",
        MANAGER,
        9,
        Target::Component(GCS),
        COMMAND_ACK_DATA {
            command: 1001,
            result: 0,
            progress: 255,
            result_param2: 0,
            target_system: 255,
            target_component: 190,
        },
    );
    golden(
        "fd1e00000a01bf4c000000808d430000000000000000000000000000000000000000000000000002ed94",
        MANAGER,
        10,
        Target::Everyone,
        command_long(MavId::new(0, 0), 512, [283.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    );
    golden(
        "fd2000000bffbe4b000000001a430000000000000000000000004c52401c44f417050000f443c30001bf084a",
        GCS,
        11,
        Target::Component(MANAGER),
        COMMAND_INT_DATA {
            param1: 154.0,
            param2: 0.0,
            param3: 0.0,
            param4: 0.0,
            x: 473_977_420,
            y: 85_455_940,
            z: 488.0,
            command: 195,
            target_system: 1,
            target_component: 191,
            frame: 0,
            current: 0,
            autocontinue: 0,
        },
    );
    golden(
        "fd3900000d01011e010040420f00000000000000803f000000000000000000000000000000000000c07f0000c07f0000c07f00000000\
         0000c07f0000000001acc52737af0a",
        AUTOPILOT,
        13,
        Target::Everyone,
        AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
            time_boot_us: 1_000_000,
            q: [1.0, 0.0, 0.0, 0.0],
            q_estimated_delay_us: 0,
            vx: NAN,
            vy: NAN,
            vz: NAN,
            v_estimated_delay_us: 0,
            feed_forward_angular_velocity_z: NAN,
            estimator_status: 0,
            target_system: 0,
            target_component: 0,
            landed_state: 1,
            angular_velocity_z: 1e-5,
        },
    );
    golden(
        "fd0700000e01bf6bea002c0008009a0302333b",
        MANAGER,
        14,
        Target::Everyone,
        STORM32_GIMBAL_MANAGER_STATUS_DATA {
            device_flags: 44,
            manager_flags: 8,
            gimbal_id: 154,
            supervisor: 3,
            profile: 2,
        },
    );
}

/// GV-2: "HEARTBEAT v1 — same contents as a MAVLink 1 frame".
#[test]
fn item_01_the_golden_vector_of_mavlink_1_is_decoded() {
    let bytes = hex("fe090001bf00000000001208000403058c");

    let frame = only_frame(&bytes);

    assert_eq!(frame.version(), Version::V1);
    assert_eq!((frame.source(), frame.sequence(), frame.message_id()), (MANAGER, 0, 0));
    assert_eq!(frame.decode::<HEARTBEAT_DATA>(), Some(manager_heartbeat()));
}

/// GV-14: "HEARTBEAT v2 signed — 1/191 seq 12; as GV-1, key 00 01 .. 1f, link id 3, timestamp 0x123456789A".
#[test]
fn item_01_the_signed_golden_vector_keeps_its_signature() {
    let bytes = hex("fd0901000c01bf000000000000001208000403ef46039a78563412005c26c1f0d854");

    let frame = only_frame(&bytes);

    assert!(frame.is_signed());
    assert_eq!((frame.source(), frame.sequence(), frame.message_id()), (MANAGER, 12, 0));
    assert_eq!(frame.decode::<HEARTBEAT_DATA>(), Some(manager_heartbeat()));
    assert_eq!(frame.bytes()[21..], hex("039a78563412005c26c1f0d854"));
    assert_eq!(decode_stream(bytes.chunks(1)).frames, [bytes]);
}

/// The golden frames of the gimbal notes: what gimbals and their managers say to each other, frame by frame.
#[test]
fn item_01_golden_frames_of_gimbals_decode_to_their_fields_and_encode_to_their_bytes() {
    golden(
        "fd090000 00019a 000000 00000000 1a08000403 1acf",
        DEVICE,
        0,
        Target::Everyone,
        HEARTBEAT_DATA { mavtype: 26, ..manager_heartbeat() },
    );
    for (source, sequence, to, command, params, digits) in [
        (
            MANAGER,
            1,
            DEVICE,
            205,
            [-30.0, 0.0, 45.0, 0.0, 0.0, 1.0, 2.0],
            "fd2000000101bf4c00000000f0c1000000000000344200000000000000000000803f00000040cd00019a654e",
        ),
        (
            AUTOPILOT,
            1,
            DEVICE,
            205,
            [30.0, 0.0, -45.0, 0.0, 0.0, 0.0, 2.0],
            "fd200000010101 4c00000000f041 00000000000034c2 000000000000000000000000 00000040 cd00019adc4e",
        ),
        (
            MANAGER,
            2,
            DEVICE,
            31_010,
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            "fd2000000201bf4c0000 000000000000000000000000000000000000000000000000 0000803f 2279019a6fea",
        ),
        (
            MANAGER,
            3,
            DEVICE,
            31_011,
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0],
            "fd2000000301bf4c0000 000000000000000000000000000000000000000000000000 00000040 2379019a50d5",
        ),
        (
            MANAGER,
            4,
            DEVICE,
            31_011,
            [0.0, 0.0, 0.0, 0.0, 0.0, 3.0, 4.0],
            "fd2000000401bf4c0000 0000000000000000000000000000000000000000 00004040 00008040 2379019aa833",
        ),
        (
            MANAGER,
            5,
            DEVICE,
            511,
            [285.0, 20_000.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            "fd2000000501bf4c0000 00808e43 00409c46 0000000000000000000000000000000000000000 ff01019ae8ef",
        ),
        (
            MANAGER,
            6,
            DEVICE,
            512,
            [283.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            "fd2000000601bf4c0000 00808d43 000000000000000000000000000000000000000000000000 0002019a6c62",
        ),
        (
            MANAGER,
            20,
            AUTOPILOT,
            183,
            [9.0, 1700.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            "fd2000001401bf4c0000 00001041 0080d444 0000000000000000000000000000000000000000 b7000101025c",
        ),
        (
            GCS,
            28,
            MANAGER,
            1000,
            [-45.0, 30.0, NAN, NAN, 44.0, 0.0, 154.0],
            "fd2000001cffbe4c0000 000034c2 0000f041 0000c07f 0000c07f 00003042 00000000 00001a43 e80301bf84fc",
        ),
    ] {
        golden(digits, source, sequence, Target::Component(to), command_long(to, command, params));
    }
    let q = [0.892_399, 0.099_046, -0.369_644, 0.239_118];
    let bytes = hex("fd2000000701bf1c0100 4474643f81d8ca3df441bdbe40db743e 0000c07f0000c07f0000c07f 2c00019ae7fc");
    let angle = only_frame(&bytes).decode::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>().expect("it is 284");
    assert!(angle.q.iter().zip(q).all(|(decoded, listed)| (decoded - listed).abs() < 1e-6));
    golden(
        "fd2000000701bf1c0100 4474643f81d8ca3df441bdbe40db743e 0000c07f0000c07f0000c07f 2c00019ae7fc",
        MANAGER,
        7,
        Target::Component(DEVICE),
        set_attitude(angle.q, [NAN; 3]),
    );
    golden(
        "fd30000017019a1d0100 e8030000 4474643f81d8ca3df441bdbe40db743e 00000000000000000000000000000000 2c000000 \
         db0fc93f 0000c07f c807",
        DEVICE,
        23,
        Target::Everyone,
        GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            time_boot_ms: 1000,
            q: angle.q,
            angular_velocity_x: 0.0,
            angular_velocity_y: 0.0,
            angular_velocity_z: 0.0,
            ..attitude_status(44, 90f32.to_radians(), NAN)
        },
    );
    golden(
        "fd2000000801bf1c0100 0000c07f0000c07f0000c07f0000c07f 00000000c2b8323ec2b8b2be 2c00019af34e",
        MANAGER,
        8,
        Target::Component(DEVICE),
        set_attitude([NAN; 4], [0.0, 10f32.to_radians(), -20f32.to_radians()]),
    );
    for (sequence, command, result, digits) in [
        (24, 205, 0, "fd0a000018019a4d0000 cd000000 00000000 01bf 906d"),
        (25, 31_011, 2, "fd0a000019019a4d0000 23790200 00000000 01bf be78"),
    ] {
        let ack = COMMAND_ACK_DATA {
            command,
            result,
            progress: 0,
            result_param2: 0,
            target_system: 1,
            target_component: 191,
        };
        golden(digits, DEVICE, sequence, Target::Component(MANAGER), ack);
    }
    golden(
        "fd17000009 01bf 170000 00003442 019a 52435f4c494d5f4d41585f54494c5400 04 6aa1",
        MANAGER,
        9,
        Target::Component(DEVICE),
        PARAM_SET_DATA {
            param_value: 45.0,
            target_system: 1,
            target_component: 154,
            param_id: "RC_LIM_MAX_TILT".into(),
            param_type: 4,
        },
    );
    golden(
        "fd0e00000d019a9e0000 6ceeffff00000000b80b0000 01bf abe6",
        DEVICE,
        13,
        Target::Component(MANAGER),
        MOUNT_STATUS_DATA {
            pointing_a: -4500,
            pointing_b: 0,
            pointing_c: 3000,
            target_system: 1,
            target_component: 191,
            mount_mode: 0,
        },
    );
    golden(
        "fd1400000e019a090100 e8030000 00000000 000034c2 0000f041 0000f042 6ba7",
        DEVICE,
        14,
        Target::Everyone,
        MOUNT_ORIENTATION_DATA { time_boot_ms: 1000, roll: 0.0, pitch: -45.0, yaw: 30.0, yaw_absolute: 120.0 },
    );
    golden(
        "fd0e00001affbe9d0000 6ceeffff00000000b80b0000 01bf ce12",
        GCS,
        26,
        Target::Component(MANAGER),
        MOUNT_CONTROL_DATA {
            input_a: -4500,
            input_b: 0,
            input_c: 3000,
            target_system: 1,
            target_component: 191,
            save_position: 0,
        },
    );
    for (sequence, req_stream_id, req_message_rate, digits) in
        [(21, 10, 10, "fd06000015019a420000 0a0001010a01 dd1b"), (22, 6, 2, "fd06000016019a420000 020001010601 656e")]
    {
        let request = REQUEST_DATA_STREAM_DATA {
            req_message_rate,
            target_system: 1,
            target_component: 1,
            req_stream_id,
            start_stop: 1,
        };
        golden(digits, DEVICE, sequence, Target::Component(AUTOPILOT), request);
    }
}

/// "When a v2 frame has its trailing zero payload bytes present (untruncated), it decodes identically to the truncated
/// form."
#[test]
fn item_02_an_untruncated_payload_decodes_as_the_truncated_one() {
    let truncated = hex("fd0b00000101bf190100e80300002c0000009affbe3ebe");
    let mut payload = only_frame(&truncated).payload().to_vec();
    payload.resize(13, 0);
    let untruncated = frame_v2(281, 48, 1, &payload, None);

    let content = only_frame(&untruncated).decode::<GIMBAL_MANAGER_STATUS_DATA>();

    assert_eq!(content.as_ref().map(|status| status.primary_control_compid), Some(190));
    assert_eq!(content, only_frame(&truncated).decode::<GIMBAL_MANAGER_STATUS_DATA>());
}

/// "When a payload is all zero, the encoder emits exactly one payload byte."
#[test]
fn item_03_an_all_zero_payload_is_one_byte_long() {
    let bytes = encode_to_vec(
        DEVICE,
        0,
        &MOUNT_ORIENTATION_DATA { time_boot_ms: 0, roll: 0.0, pitch: 0.0, yaw: 0.0, yaw_absolute: 0.0 },
    );

    assert_eq!(bytes[..11], [0xfd, 1, 0, 0, 0, 1, 154, 9, 1, 0, 0]);
    assert_eq!(bytes.len(), 13);
    assert_eq!(only_frame(&bytes).payload(), [0]);
}

/// "When 285 arrives with 40, 44, 48, 49 or 53 payload bytes, it decodes; missing extension fields read 0; surplus
/// bytes are ignored and still forwarded."
#[test]
#[rustfmt::skip]
fn item_04_attitude_status_of_any_age_is_decoded() {
    let mut payload = [0u8; 53];
    payload[4..8].copy_from_slice(&1f32.to_le_bytes());
    payload[36..40].copy_from_slice(&[44, 0, 1, 191]);
    payload[40..44].copy_from_slice(&0.5f32.to_le_bytes());
    payload[44..48].copy_from_slice(&0.25f32.to_le_bytes());
    payload[48..].copy_from_slice(&[6, 0xde, 0xad, 0xbe, 0xef]);
    for (len, delta_yaw, delta_yaw_velocity, gimbal_device_id) in [
        (40,      0.0,                0.0,                0),
        (44,      0.5,                0.0,                0),
        (48,      0.5,               0.25,                0),
        (49,      0.5,               0.25,                6),
        (53,      0.5,               0.25,                6),
    ] {
        let bytes = frame_v2(285, 137, 0, &payload[..len], None);

        let frame = only_frame(&bytes);

        let content = frame.decode::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();
        let expected = GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
            time_boot_ms: 0,
            q: [1.0, 0.0, 0.0, 0.0],
            angular_velocity_x: 0.0,
            angular_velocity_y: 0.0,
            angular_velocity_z: 0.0,
            failure_flags: 0,
            flags: 44,
            target_system: 1,
            target_component: 191,
            delta_yaw,
            delta_yaw_velocity,
            gimbal_device_id,
        };
        assert_eq!(content, Some(expected), "{len} payload bytes");
        assert_eq!(frame.target(), Target::Component(MANAGER), "{len} payload bytes");
        assert_eq!(decode_stream([&bytes[..]]).frames, from_ref(&bytes), "{len} payload bytes");
    }
}

/// "When 283 arrives with 144 bytes, effective caps = cap_flags; with 149 bytes and cap_flags2 = 0x21FF7, effective
/// caps = 0x21FF7." Here: an absent `cap_flags2` reads 0.
#[test]
fn item_05_device_information_of_either_length_is_decoded() {
    let mut payload = [0u8; 149];
    payload[44..46].copy_from_slice(&0x1ff7u16.to_le_bytes());
    payload[143] = b'x';
    payload[144] = 0;
    payload[145..149].copy_from_slice(&0x21ff7u32.to_le_bytes());
    for (len, cap_flags2) in [(144, 0), (149, 0x21ff7)] {
        let bytes = frame_v2(283, 74, 0, &payload[..len], None);

        let content = only_frame(&bytes).decode::<GIMBAL_DEVICE_INFORMATION_DATA>().expect("it is 283");

        assert_eq!((content.cap_flags, content.cap_flags2), (0x1ff7, cap_flags2), "{len} payload bytes");
    }
}

/// "When a frame has an incompat bit other than 0x01, it is discarded, counted, and parsing resumes at the next magic
/// inside its bytes."
#[test]
fn item_06_an_unknown_incompat_bit_discards_the_frame() {
    for bit in 1..8 {
        for also_signed in [0, 1] {
            let inner = encode_to_vec(DEVICE, 1, &manager_heartbeat());
            let mut discarded = frame_v2(385, 147, 0, &inner, None);
            discarded[2] |= 1 << bit | also_signed;
            let behind = encode_to_vec(DEVICE, 2, &manager_heartbeat());
            let bytes = [&discarded[..], &behind].concat();

            for decoded in [decode_stream([&bytes[..]]), decode_datagram(&bytes)] {
                assert_eq!(decoded.frames, [inner.clone(), behind.clone()], "bit {bit}");
                let counters = WireCounters {
                    frames: 2,
                    crc_errors: 0,
                    incompatible_frames: 1,
                    resync_bytes: (discarded.len() - inner.len()) as u64,
                };
                assert_eq!(decoded.counters, counters, "bit {bit}");
            }
        }
    }
}

/// "When a compat bit is unknown, the frame is processed normally and forwarded unchanged."
#[test]
fn item_07_unknown_compat_bits_do_not_matter() {
    for bit in 0..8 {
        let mut bytes = encode_to_vec(MANAGER, 0, &manager_heartbeat());
        bytes[3] = 1 << bit;
        let crc = crate::support::wire::checksum(&bytes[1..19], 50);
        bytes[19..].copy_from_slice(&crc.to_le_bytes());

        assert_eq!(only_frame(&bytes).decode::<HEARTBEAT_DATA>(), Some(manager_heartbeat()), "bit {bit}");
        assert_eq!(decode_stream([&bytes[..]]).frames, from_ref(&bytes), "bit {bit}");
    }
}

/// "When one bit of a known message's payload is flipped, the frame is neither processed nor forwarded, and the
/// crc-error counter of that link rises by one."
#[test]
fn item_08_one_flipped_payload_bit_costs_the_frame_and_is_counted() {
    let bytes = encode_to_vec(MANAGER, 3, &set_attitude([1.0, 0.0, 0.0, 0.0], [NAN; 3]));
    let frame = only_frame(&bytes);
    for bit in 0..8 * frame.payload().len() {
        let mut damaged = bytes.clone();
        damaged[10 + bit / 8] ^= 1 << (bit % 8);

        for decoded in [decode_stream([&damaged[..]]), decode_datagram(&damaged)] {
            assert_eq!(decoded.frames, Vec::<Vec<u8>>::new(), "bit {bit}");
            let counters =
                WireCounters { frames: 0, crc_errors: 1, incompatible_frames: 0, resync_bytes: damaged.len() as u64 };
            assert_eq!(decoded.counters, counters, "bit {bit}");
        }
    }
}

/// "When a valid frame follows directly after a corrupted one in the same read, the valid one is processed."
#[test]
fn item_09_a_valid_frame_behind_a_corrupted_one_is_processed() {
    let valid = encode_to_vec(DEVICE, 4, &manager_heartbeat());
    let whole = encode_to_vec(MANAGER, 3, &set_attitude([1.0, 0.0, 0.0, 0.0], [NAN; 3]));
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        bytes.extend_from_slice(&valid);

        assert_eq!(decode_stream([&bytes[..]]).frames, from_ref(&valid), "bit {bit}");
        assert_eq!(decode_datagram(&bytes).frames, from_ref(&valid), "bit {bit}");
    }
}

/// "When a v1 HEARTBEAT (GV-2) arrives on any link, it is processed and forwarded byte-identically as v1."
#[test]
fn item_10_a_heartbeat_of_mavlink_1_stays_as_it_is() {
    let bytes = hex("fe090001bf00000000001208000403058c");

    assert_eq!(decode_stream(bytes.chunks(1)).frames, from_ref(&bytes));
    assert_eq!(decode_datagram(&bytes).frames, from_ref(&bytes));
    assert_eq!(only_frame(&bytes).name(), "HEARTBEAT");
}

/// "When a 285 carries flag bits 1024..32768, it is still processed (bits ignored) and forwarded unchanged."
#[test]
fn item_11_unknown_flag_bits_do_not_cost_the_message() {
    let sent = attitude_status(44 | 0xfc00, 0.5, 0.25);
    let bytes = encode_to_vec(DEVICE, 6, &sent);

    let content = only_frame(&bytes).decode::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>();

    assert_eq!(format!("{content:?}"), format!("{:?}", Some(sent)));
    assert_eq!(decode_stream([&bytes[..]]).frames, [bytes]);
}

/// "When a COMMAND_ACK carries result 10 or 200, or a 286 carries landed_state 128, the message is not dropped by the
/// decoder."
#[test]
fn item_12_unknown_enum_values_do_not_cost_the_message() {
    for result in [10, 200] {
        let sent = COMMAND_ACK_DATA {
            command: 65_000,
            result,
            progress: 0,
            result_param2: 0,
            target_system: 1,
            target_component: 191,
        };
        let bytes = encode_to_vec(GCS, 0, &sent);
        assert_eq!(only_frame(&bytes).decode::<COMMAND_ACK_DATA>(), Some(sent));
    }
    let sent = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA {
        time_boot_us: 1,
        q: [1.0, 0.0, 0.0, 0.0],
        q_estimated_delay_us: 0,
        vx: 0.0,
        vy: 0.0,
        vz: 0.0,
        v_estimated_delay_us: 0,
        feed_forward_angular_velocity_z: 0.0,
        estimator_status: 0xffff,
        target_system: 0,
        target_component: 0,
        landed_state: 128,
        angular_velocity_z: 0.0,
    };
    let bytes = encode_to_vec(AUTOPILOT, 0, &sent);
    assert_eq!(only_frame(&bytes).decode::<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA>(), Some(sent));
}

/// "When 100 MB of random bytes are fed to each link, the daemon neither crashes nor grows memory beyond its bound, and
/// afterwards decodes a valid frame."
#[test]
fn item_13_random_bytes_neither_break_the_decoder_nor_make_it_grow() {
    const READ: usize = 4096;
    let mut random = Random::new(13);
    let mut decoder = StreamDecoder::new(Patience::Serial { baud: 115_200 });
    let mut read = [0; READ];
    let mut chance_frames = 0u64;
    let mut capacity = 0;
    for _ in 0..100_000_000 / READ {
        for word in read.chunks_exact_mut(8) {
            word.copy_from_slice(&random.next().to_le_bytes());
        }
        decoder.push(Timestamp::ZERO, &read);
        while decoder.next_frame().is_some() {
            chance_frames += 1;
        }
        capacity = capacity.max(decoder.buffer_capacity());
        for datagram in read.chunks(1472) {
            let mut datagram = DatagramFrames::new(datagram);
            while datagram.next_frame().is_some() {
                chance_frames += 1;
            }
        }
    }
    assert!(capacity <= 4 * READ, "the decoder has room for {capacity} bytes");
    // A start byte, a known id and a matching checksum come together about twice in 100 MB.
    assert!(chance_frames < 20, "{chance_frames} frames in random bytes");

    let valid = encode_to_vec(MANAGER, 0, &manager_heartbeat());
    decoder.push(Timestamp::ZERO, &valid);
    let mut decoded = Vec::new();
    loop {
        while let Some(frame) = decoder.next_frame() {
            decoded.push(frame.bytes().to_vec());
        }
        let Some(at) = decoder.poll_timeout() else { break };
        decoder.handle_timeout(at);
    }
    assert_eq!(decoded, [valid]);
}

/// Checks that `digits`, fed byte by byte, are one frame with this content, and that this content is encoded so.
fn golden<M: MessageData + Debug>(digits: &str, source: MavId, sequence: u8, target: Target, content: M) {
    let bytes = hex(digits);
    assert_eq!(decode_stream(bytes.chunks(1)).frames, from_ref(&bytes), "{}", M::NAME);
    let frame = only_frame(&bytes);
    assert_eq!((frame.source(), frame.sequence(), frame.target()), (source, sequence, target), "{}", M::NAME);
    assert_eq!((frame.message_id(), frame.name()), (M::ID, M::NAME));
    assert!(frame.is_known() && !frame.is_signed());
    // Unlike its value, the text of NaN is equal to itself.
    assert_eq!(format!("{:?}", frame.decode::<M>()), format!("{:?}", Some(&content)));
    assert_eq!(encode_to_vec(source, sequence, &content), bytes, "{}", M::NAME);
}

fn only_frame(bytes: &[u8]) -> Frame<'_> {
    let mut datagram = DatagramFrames::new(bytes);
    let frame = datagram.next_frame().expect("there is a frame");
    assert_eq!(frame.bytes(), bytes);
    assert_eq!(datagram.next_frame(), None);
    assert_eq!(frame.is_known(), message_shape(frame.message_id()).is_some());
    frame
}

fn manager_heartbeat() -> HEARTBEAT_DATA {
    HEARTBEAT_DATA { custom_mode: 0, mavtype: 18, autopilot: 8, base_mode: 0, system_status: 4, mavlink_version: 3 }
}

fn set_attitude(q: [f32; 4], rates: [f32; 3]) -> GIMBAL_DEVICE_SET_ATTITUDE_DATA {
    GIMBAL_DEVICE_SET_ATTITUDE_DATA {
        q,
        angular_velocity_x: rates[0],
        angular_velocity_y: rates[1],
        angular_velocity_z: rates[2],
        flags: 44,
        target_system: 1,
        target_component: 154,
    }
}

fn attitude_status(flags: u16, delta_yaw: f32, delta_yaw_velocity: f32) -> GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
    GIMBAL_DEVICE_ATTITUDE_STATUS_DATA {
        time_boot_ms: 5000,
        q: [1.0, 0.0, 0.0, 0.0],
        angular_velocity_x: NAN,
        angular_velocity_y: NAN,
        angular_velocity_z: NAN,
        failure_flags: 0,
        flags,
        target_system: 0,
        target_component: 0,
        delta_yaw,
        delta_yaw_velocity,
        gimbal_device_id: 0,
    }
}

fn command_long(to: MavId, command: u16, params: [f32; 7]) -> COMMAND_LONG_DATA {
    let [param1, param2, param3, param4, param5, param6, param7] = params;
    COMMAND_LONG_DATA {
        param1,
        param2,
        param3,
        param4,
        param5,
        param6,
        param7,
        command,
        target_system: to.system,
        target_component: to.component,
        confirmation: 0,
    }
}
