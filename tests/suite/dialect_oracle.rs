//! Our table, numbers and message types against the full `storm32` dialect of the `mavlink` crate.

use std::collections::BTreeSet;
use std::fmt::Debug;

use gimbald::wire::dialect::{self, MavMessage as OurMessage};
use gimbald::wire::ids::{
    CapFlags, CommandResult, FailureFlags, GimbalFlags, attitude_target_typemask, command, component, ekf_status,
    estimator_status, mav_autopilot, mav_frame, mav_state, mav_type, message, position_target_typemask,
    protocol_capability,
};
use gimbald::wire::target::{known_messages, message_shape};
use mavlink::dialects::storm32::{self as full, MavMessage as FullMessage};
use mavlink::{MavlinkVersion, Message};
use proptest::prelude::*;

/// Messages that the public definitions have extended since the crate's: id, and the longest payload there and here.
const LONGER_HERE: [(u32, usize, usize); 1] = [(435, 46, 47)];

/// Every message of the crate that our table leaves out, because it belongs to a vendor's dialect that no component on
/// a gimbal's links speaks; such a message is forwarded as an unknown one.
#[rustfmt::skip]
const LEFT_OUT: [u32; 18] = [
    10_001, 10_002, 10_003, 10_004, 10_005, 10_006, 10_007, 10_008, 10_151, 42_000, 42_001, 50_001, 50_002, 50_003,
    50_004, 50_005, 52_000, 52_001,
];

#[test]
fn the_table_holds_the_messages_of_the_full_dialect() {
    let ours: BTreeSet<u32> = known_messages().iter().map(|shape| shape.id).collect();
    let full: BTreeSet<u32> = FullMessage::all_ids().iter().copied().collect();

    assert_eq!(full.difference(&ours).copied().collect::<Vec<_>>(), LEFT_OUT);
    assert_eq!(ours.difference(&full).collect::<Vec<_>>(), Vec::<&u32>::new());
}

#[test]
fn checksums_lengths_and_targets_are_those_of_the_full_dialect() {
    for shape in known_messages() {
        let sample = FullMessage::default_message_from_id(shape.id).expect("the dialects hold the same messages");
        let name = sample.message_name();
        assert_eq!((shape.name, shape.crc_extra), (name, FullMessage::extra_crc(shape.id)), "{}", shape.id);
        let mut payload = [0; 255];
        assert_eq!(usize::from(shape.base_len), sample.ser(MavlinkVersion::V1, &mut payload), "{name}");
        let full_len = full_len(shape.id);
        let longer = LONGER_HERE.iter().find(|(id, _, _)| *id == shape.id);
        let expected = longer.map_or((full_len, full_len), |(_, there, here)| (*there, *here));
        assert_eq!((full_len, usize::from(shape.max_len)), expected, "{name}");
        let system = offset_of(shape.id, FullMessage::target_system_id_mut);
        let component = offset_of(shape.id, FullMessage::target_component_id_mut);
        assert_eq!((shape.system_offset, shape.component_offset), (system, component), "{name}");
    }
}

#[test]
fn the_dialect_holds_only_messages_of_the_table() {
    for id in OurMessage::all_ids() {
        let shape = message_shape(*id).unwrap_or_else(|| panic!("{id} is in the dialect and not in the table"));
        let sample = OurMessage::default_message_from_id(*id).expect("its id was listed");
        let mut payload = [0; 255];
        assert_eq!((shape.name, shape.crc_extra), (sample.message_name(), OurMessage::extra_crc(*id)));
        assert_eq!(usize::from(shape.base_len), sample.ser(MavlinkVersion::V1, &mut payload), "{}", shape.name);
    }
}

/// A field in another place than the definitions have it would carry the right name and the wrong bytes.
#[test]
fn fields_have_the_names_and_the_order_of_the_full_dialect() {
    for id in OurMessage::all_ids() {
        let ours = OurMessage::default_message_from_id(*id).expect("its id was listed");
        assert!(!field_names(&ours).is_empty(), "{}", ours.message_name());
        let full = FullMessage::default_message_from_id(*id).expect("the full dialect holds it");
        assert_eq!(field_names(&ours), field_names(&full), "{}", ours.message_name());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Contents that the full dialect can express are the same bytes there and here; contents that it cannot (unknown
    /// values of enumerations) are kept here all the same.
    #[test]
    fn every_message_of_the_dialect_round_trips(random in prop::collection::vec(any::<u8>(), 255), cut in 1usize..=255) {
        for id in OurMessage::all_ids() {
            let whole = full_len(*id);
            let payload = &random[..cut.min(whole)];
            let mut written = [0; 255];
            let ours = OurMessage::parse(MavlinkVersion::V2, *id, payload).expect("no value is refused");
            let len = ours.ser(MavlinkVersion::V2, &mut written);
            prop_assert_eq!(&written[..len], without_trailing_zeros(payload), "{} by itself", id);

            let accepted = acceptable_to_the_full_dialect(*id, payload);
            let ours = OurMessage::parse(MavlinkVersion::V2, *id, &accepted).expect("no value is refused");
            let full = FullMessage::parse(MavlinkVersion::V2, *id, &accepted).expect("it was made acceptable");
            let len = ours.ser(MavlinkVersion::V2, &mut written);
            let mut full_written = [0; 255];
            let full_len = full.ser(MavlinkVersion::V2, &mut full_written);
            prop_assert_eq!(&written[..len], &full_written[..full_len], "{} against the crate", id);
            prop_assert_eq!(ours.target_system_id(), full.target_system_id());
            prop_assert_eq!(ours.target_component_id(), full.target_component_id());
        }
    }
}

#[test]
#[rustfmt::skip]
#[expect(deprecated, reason = "gimbals in use still speak the commands and frames that newer ones replace")]
fn numbers_are_those_of_the_full_dialect() {
    use full::{MavAutopilot, MavCmd, MavComponent, MavFrame, MavResult, MavState, MavType};
    for (ours, full) in [
        (component::AUTOPILOT1,        MavComponent::MAV_COMP_ID_AUTOPILOT1),
        (component::CAMERA,            MavComponent::MAV_COMP_ID_CAMERA),
        (component::CAMERA6,           MavComponent::MAV_COMP_ID_CAMERA6),
        (component::GIMBAL,            MavComponent::MAV_COMP_ID_GIMBAL),
        (component::GIMBAL2,           MavComponent::MAV_COMP_ID_GIMBAL2),
        (component::GIMBAL3,           MavComponent::MAV_COMP_ID_GIMBAL3),
        (component::GIMBAL4,           MavComponent::MAV_COMP_ID_GIMBAL4),
        (component::GIMBAL5,           MavComponent::MAV_COMP_ID_GIMBAL5),
        (component::GIMBAL6,           MavComponent::MAV_COMP_ID_GIMBAL6),
        (component::MISSIONPLANNER,    MavComponent::MAV_COMP_ID_MISSIONPLANNER),
        (component::ONBOARD_COMPUTER,  MavComponent::MAV_COMP_ID_ONBOARD_COMPUTER),
        (component::ONBOARD_COMPUTER4, MavComponent::MAV_COMP_ID_ONBOARD_COMPUTER4),
    ] {
        assert_eq!(u32::from(ours), full as u32, "{full:?}");
    }
    for (ours, full) in [
        (command::DO_SET_ROI_LOCATION,            MavCmd::MAV_CMD_DO_SET_ROI_LOCATION),
        (command::DO_SET_ROI_WPNEXT_OFFSET,       MavCmd::MAV_CMD_DO_SET_ROI_WPNEXT_OFFSET),
        (command::DO_SET_ROI_NONE,                MavCmd::MAV_CMD_DO_SET_ROI_NONE),
        (command::DO_SET_ROI_SYSID,               MavCmd::MAV_CMD_DO_SET_ROI_SYSID),
        (command::DO_SET_ROI,                     MavCmd::MAV_CMD_DO_SET_ROI),
        (command::DO_MOUNT_CONFIGURE,             MavCmd::MAV_CMD_DO_MOUNT_CONFIGURE),
        (command::DO_MOUNT_CONTROL,               MavCmd::MAV_CMD_DO_MOUNT_CONTROL),
        (command::DO_MOUNT_CONTROL_QUAT,          MavCmd::MAV_CMD_DO_MOUNT_CONTROL_QUAT),
        (command::PREFLIGHT_REBOOT_SHUTDOWN,      MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN),
        (command::GET_MESSAGE_INTERVAL,           MavCmd::MAV_CMD_GET_MESSAGE_INTERVAL),
        (command::SET_MESSAGE_INTERVAL,           MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL),
        (command::REQUEST_MESSAGE,                MavCmd::MAV_CMD_REQUEST_MESSAGE),
        (command::REQUEST_PROTOCOL_VERSION,       MavCmd::MAV_CMD_REQUEST_PROTOCOL_VERSION),
        (command::REQUEST_AUTOPILOT_CAPABILITIES, MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES),
        (command::DO_GIMBAL_MANAGER_PITCHYAW,     MavCmd::MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW),
        (command::DO_GIMBAL_MANAGER_CONFIGURE,    MavCmd::MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE),
    ] {
        assert_eq!(u32::from(ours), full as u32, "{full:?}");
    }
    for (ours, full) in [
        (CommandResult::Accepted,            MavResult::MAV_RESULT_ACCEPTED),
        (CommandResult::TemporarilyRejected, MavResult::MAV_RESULT_TEMPORARILY_REJECTED),
        (CommandResult::Denied,              MavResult::MAV_RESULT_DENIED),
        (CommandResult::Unsupported,         MavResult::MAV_RESULT_UNSUPPORTED),
        (CommandResult::Failed,              MavResult::MAV_RESULT_FAILED),
        (CommandResult::UnsupportedMavFrame, MavResult::MAV_RESULT_COMMAND_UNSUPPORTED_MAV_FRAME),
    ] {
        assert_eq!(ours as u32, full as u32, "{full:?}");
    }
    for (ours, full) in [
        (mav_type::GENERIC,            MavType::MAV_TYPE_GENERIC),
        (mav_type::QUADROTOR,          MavType::MAV_TYPE_QUADROTOR),
        (mav_type::ANTENNA_TRACKER,    MavType::MAV_TYPE_ANTENNA_TRACKER),
        (mav_type::GCS,                MavType::MAV_TYPE_GCS),
        (mav_type::ONBOARD_CONTROLLER, MavType::MAV_TYPE_ONBOARD_CONTROLLER),
        (mav_type::GIMBAL,             MavType::MAV_TYPE_GIMBAL),
        (mav_type::ADSB,               MavType::MAV_TYPE_ADSB),
        (mav_type::CAMERA,             MavType::MAV_TYPE_CAMERA),
    ] {
        assert_eq!(u32::from(ours), full as u32, "{full:?}");
    }
    let not_a_vehicle = [
        MavType::MAV_TYPE_ANTENNA_TRACKER, MavType::MAV_TYPE_GCS, MavType::MAV_TYPE_ONBOARD_CONTROLLER,
        MavType::MAV_TYPE_GIMBAL, MavType::MAV_TYPE_ADSB, MavType::MAV_TYPE_CAMERA,
        MavType::MAV_TYPE_CHARGING_STATION, MavType::MAV_TYPE_FLARM, MavType::MAV_TYPE_SERVO, MavType::MAV_TYPE_ODID,
        MavType::MAV_TYPE_BATTERY, MavType::MAV_TYPE_PARACHUTE, MavType::MAV_TYPE_LOG, MavType::MAV_TYPE_OSD,
        MavType::MAV_TYPE_IMU, MavType::MAV_TYPE_GPS, MavType::MAV_TYPE_WINCH, MavType::MAV_TYPE_ILLUMINATOR,
        MavType::MAV_TYPE_GRIPPER, MavType::MAV_TYPE_RADIO,
    ];
    assert_eq!(mav_type::NOT_A_VEHICLE.map(u32::from), not_a_vehicle.map(|kind| kind as u32));
    for (ours, full) in [
        (mav_autopilot::GENERIC,       MavAutopilot::MAV_AUTOPILOT_GENERIC),
        (mav_autopilot::ARDUPILOTMEGA, MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA),
        (mav_autopilot::INVALID,       MavAutopilot::MAV_AUTOPILOT_INVALID),
        (mav_autopilot::PX4,           MavAutopilot::MAV_AUTOPILOT_PX4),
    ] {
        assert_eq!(u32::from(ours), full as u32, "{full:?}");
    }
    for (ours, full) in [
        (mav_state::BOOT,     MavState::MAV_STATE_BOOT),
        (mav_state::STANDBY,  MavState::MAV_STATE_STANDBY),
        (mav_state::ACTIVE,   MavState::MAV_STATE_ACTIVE),
        (mav_state::CRITICAL, MavState::MAV_STATE_CRITICAL),
        (mav_state::POWEROFF, MavState::MAV_STATE_POWEROFF),
    ] {
        assert_eq!(u32::from(ours), full as u32, "{full:?}");
    }
    for (ours, full) in [
        (mav_frame::GLOBAL,                  MavFrame::MAV_FRAME_GLOBAL),
        (mav_frame::GLOBAL_RELATIVE_ALT,     MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT),
        (mav_frame::GLOBAL_INT,              MavFrame::MAV_FRAME_GLOBAL_INT),
        (mav_frame::GLOBAL_RELATIVE_ALT_INT, MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT),
        (mav_frame::GLOBAL_TERRAIN_ALT,      MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT),
        (mav_frame::GLOBAL_TERRAIN_ALT_INT,  MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT_INT),
    ] {
        assert_eq!(u32::from(ours), full as u32, "{full:?}");
    }
}

#[test]
#[rustfmt::skip]
fn message_ids_are_those_of_the_full_dialect() {
    for (ours, name) in [
        (message::HEARTBEAT,                          "HEARTBEAT"),
        (message::SYS_STATUS,                         "SYS_STATUS"),
        (message::SYSTEM_TIME,                        "SYSTEM_TIME"),
        (message::PARAM_REQUEST_READ,                 "PARAM_REQUEST_READ"),
        (message::PARAM_REQUEST_LIST,                 "PARAM_REQUEST_LIST"),
        (message::PARAM_VALUE,                        "PARAM_VALUE"),
        (message::PARAM_SET,                          "PARAM_SET"),
        (message::ATTITUDE,                           "ATTITUDE"),
        (message::ATTITUDE_QUATERNION,                "ATTITUDE_QUATERNION"),
        (message::LOCAL_POSITION_NED,                 "LOCAL_POSITION_NED"),
        (message::GLOBAL_POSITION_INT,                "GLOBAL_POSITION_INT"),
        (message::MANUAL_CONTROL,                     "MANUAL_CONTROL"),
        (message::COMMAND_INT,                        "COMMAND_INT"),
        (message::COMMAND_LONG,                       "COMMAND_LONG"),
        (message::COMMAND_ACK,                        "COMMAND_ACK"),
        (message::COMMAND_CANCEL,                     "COMMAND_CANCEL"),
        (message::ATTITUDE_TARGET,                    "ATTITUDE_TARGET"),
        (message::POSITION_TARGET_LOCAL_NED,          "POSITION_TARGET_LOCAL_NED"),
        (message::POSITION_TARGET_GLOBAL_INT,         "POSITION_TARGET_GLOBAL_INT"),
        (message::RADIO_STATUS,                       "RADIO_STATUS"),
        (message::TIMESYNC,                           "TIMESYNC"),
        (message::AUTOPILOT_VERSION,                  "AUTOPILOT_VERSION"),
        (message::MOUNT_CONFIGURE,                    "MOUNT_CONFIGURE"),
        (message::MOUNT_CONTROL,                      "MOUNT_CONTROL"),
        (message::RADIO,                              "RADIO"),
        (message::EKF_STATUS_REPORT,                  "EKF_STATUS_REPORT"),
        (message::ESTIMATOR_STATUS,                   "ESTIMATOR_STATUS"),
        (message::EXTENDED_SYS_STATE,                 "EXTENDED_SYS_STATE"),
        (message::MESSAGE_INTERVAL,                   "MESSAGE_INTERVAL"),
        (message::STATUSTEXT,                         "STATUSTEXT"),
        (message::CAMERA_INFORMATION,                 "CAMERA_INFORMATION"),
        (message::GIMBAL_MANAGER_INFORMATION,         "GIMBAL_MANAGER_INFORMATION"),
        (message::GIMBAL_MANAGER_STATUS,              "GIMBAL_MANAGER_STATUS"),
        (message::GIMBAL_MANAGER_SET_ATTITUDE,        "GIMBAL_MANAGER_SET_ATTITUDE"),
        (message::GIMBAL_DEVICE_INFORMATION,          "GIMBAL_DEVICE_INFORMATION"),
        (message::GIMBAL_DEVICE_SET_ATTITUDE,         "GIMBAL_DEVICE_SET_ATTITUDE"),
        (message::GIMBAL_DEVICE_ATTITUDE_STATUS,      "GIMBAL_DEVICE_ATTITUDE_STATUS"),
        (message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE,  "AUTOPILOT_STATE_FOR_GIMBAL_DEVICE"),
        (message::GIMBAL_MANAGER_SET_PITCHYAW,        "GIMBAL_MANAGER_SET_PITCHYAW"),
        (message::GIMBAL_MANAGER_SET_MANUAL_CONTROL,  "GIMBAL_MANAGER_SET_MANUAL_CONTROL"),
        (message::TUNNEL,                             "TUNNEL"),
        (message::COMPONENT_INFORMATION_BASIC,        "COMPONENT_INFORMATION_BASIC"),
        (message::STORM32_GIMBAL_MANAGER_INFORMATION, "STORM32_GIMBAL_MANAGER_INFORMATION"),
        (message::STORM32_GIMBAL_MANAGER_STATUS,      "STORM32_GIMBAL_MANAGER_STATUS"),
    ] {
        assert_eq!(Some(ours), FullMessage::message_id_from_name(name), "{name}");
    }
}

/// "EKF_STATUS_REPORT.flags: … bit for bit with ESTIMATOR_STATUS_FLAGS" for those that mean an estimate.
#[test]
fn the_flags_of_both_estimators_agree_up_to_512() {
    let estimator: Vec<_> =
        full::EstimatorStatusFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    let estimator = unprefixed(&estimator, "ESTIMATOR_");
    let ekf: Vec<_> = full::EkfStatusFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    let ekf = unprefixed(&ekf, "EKF_");
    let low = |flags: &[(&'static str, u16)]| -> BTreeSet<(&'static str, u16)> {
        flags.iter().copied().filter(|(_, bit)| estimator_status::IN_COMMON & bit != 0).collect()
    };
    assert_eq!(low(&estimator), low(&ekf));
    assert_eq!(low(&estimator).iter().map(|(_, bit)| bit).sum::<u16>(), estimator_status::IN_COMMON);
    let bit = |flags: &[(&'static str, u16)], name| flags.iter().find(|(flag, _)| *flag == name).map(|(_, bit)| *bit);
    assert_eq!(bit(&estimator, "GPS_GLITCH"), Some(estimator_status::GPS_GLITCH));
    assert_eq!(bit(&ekf, "GPS_GLITCHING"), Some(ekf_status::GPS_GLITCHING));
    assert_eq!(bit(&ekf, "UNINITIALIZED"), Some(ekf_status::UNINITIALIZED));
}

#[test]
fn type_masks_are_those_of_the_full_dialect() {
    use attitude_target_typemask as ours;
    use full::AttitudeTargetTypemask as Attitude;
    for (ours, full) in [
        (ours::BODY_ROLL_RATE_IGNORE, Attitude::ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE),
        (ours::BODY_PITCH_RATE_IGNORE, Attitude::ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE),
        (ours::BODY_YAW_RATE_IGNORE, Attitude::ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE),
        (ours::ATTITUDE_IGNORE, Attitude::ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE),
    ] {
        assert_eq!(ours, full.bits());
    }
    let position = full::PositionTargetTypemask::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE;
    assert_eq!(position_target_typemask::YAW_RATE_IGNORE, position.bits());
}

/// Every flag that we name is the crate's flag of that name, and the crate has none that we do not name.
#[test]
fn flags_are_those_of_the_full_dialect() {
    let device: Vec<_> = full::GimbalDeviceFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    let ours: Vec<_> = GimbalFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    assert_eq!(unprefixed(&device, "GIMBAL_DEVICE_FLAGS_"), ours);
    let manager: Vec<_> =
        full::GimbalManagerFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    let ours: Vec<_> = ours.into_iter().map(|(name, bits)| (name, u32::from(bits))).collect();
    assert_eq!(unprefixed(&manager, "GIMBAL_MANAGER_FLAGS_"), ours);

    let ours: Vec<_> = CapFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    let device: Vec<_> =
        full::GimbalDeviceCapFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    assert_eq!(unprefixed(&device, "GIMBAL_DEVICE_CAP_FLAGS_"), ours);
    let manager: Vec<_> =
        full::GimbalManagerCapFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    assert_eq!(unprefixed(&manager, "GIMBAL_MANAGER_CAP_FLAGS_"), ours);

    let ours: Vec<_> = FailureFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    let errors: Vec<_> =
        full::GimbalDeviceErrorFlags::all().iter_names().map(|(name, flag)| (name, flag.bits())).collect();
    assert_eq!(unprefixed(&errors, "GIMBAL_DEVICE_ERROR_FLAGS_"), ours);

    use full::MavProtocolCapability as Full;
    for (ours, full) in [
        (protocol_capability::COMMAND_INT, Full::MAV_PROTOCOL_CAPABILITY_COMMAND_INT),
        (protocol_capability::MAVLINK2, Full::MAV_PROTOCOL_CAPABILITY_MAVLINK2),
        (
            protocol_capability::COMPONENT_IMPLEMENTS_GIMBAL_MANAGER,
            Full::MAV_PROTOCOL_CAPABILITY_COMPONENT_IMPLEMENTS_GIMBAL_MANAGER,
        ),
    ] {
        assert_eq!(ours, full.bits(), "{full:?}");
    }
}

/// "HEARTBEAT … version 3": a heartbeat that claims another version is from the wrong definitions.
#[test]
fn a_heartbeat_of_the_dialect_claims_protocol_version_3() {
    assert_eq!(dialect::MINOR_MAVLINK_VERSION, 3);
}

fn unprefixed<Bits: Copy>(flags: &[(&'static str, Bits)], prefix: &str) -> Vec<(&'static str, Bits)> {
    flags
        .iter()
        .map(|(name, bits)| (name.strip_prefix(prefix).unwrap_or_else(|| panic!("{name} is named otherwise")), *bits))
        .collect()
}

/// Payload length of message `id` with every extension the crate knows: how many bytes it writes before it cuts zeros.
fn full_len(id: u32) -> usize {
    let sample = FullMessage::default_message_from_id(id).expect("the full dialect holds it");
    let [first, second] = [0x11, 0xee].map(|filling| {
        let mut payload = [filling; 255];
        sample.ser(MavlinkVersion::V2, &mut payload);
        payload
    });
    first.iter().zip(&second).take_while(|(first, second)| first == second).count()
}

/// Where a field lies in the payload: the byte that differs once it is set.
fn offset_of(id: u32, field: impl Fn(&mut FullMessage) -> Option<&mut u8>) -> Option<u8> {
    let written = |value| {
        let mut message = FullMessage::default_message_from_id(id).expect("the dialect holds it");
        let field = field(&mut message)?;
        *field = value;
        let mut payload = [0; 255];
        message.ser(MavlinkVersion::V2, &mut payload);
        Some(payload)
    };
    let (without, with) = (written(0)?, written(0xaa)?);
    let at = without.iter().zip(&with).position(|(without, with)| without != with)?;
    Some(u8::try_from(at).expect("a payload has at most 255 bytes"))
}

/// `payload` as far as the full dialect accepts it; a byte that makes an enumeration unknown to it stays at its
/// default.
fn acceptable_to_the_full_dialect(id: u32, payload: &[u8]) -> Vec<u8> {
    let mut accepted = vec![0; 255];
    let sample = FullMessage::default_message_from_id(id).expect("the full dialect holds it");
    sample.ser(MavlinkVersion::V2, &mut accepted);
    accepted.truncate(full_len(id));
    for (at, byte) in payload.iter().enumerate() {
        let before = std::mem::replace(&mut accepted[at], *byte);
        if FullMessage::parse(MavlinkVersion::V2, id, &accepted).is_err() {
            accepted[at] = before;
        }
    }
    accepted
}

fn without_trailing_zeros(payload: &[u8]) -> &[u8] {
    let len = payload.iter().rposition(|byte| *byte != 0).map_or(1, |last| last + 1);
    &payload[..len]
}

/// The names of a message's own fields, in order, from how it prints itself.
fn field_names(message: &impl Debug) -> Vec<String> {
    let text = format!("{message:#?}");
    let fields = text.lines().filter(|line| line.starts_with("        ") && !line.starts_with("         "));
    fields.filter_map(|line| line.trim().split_once(": ").map(|(name, _)| name.to_string())).collect()
}
