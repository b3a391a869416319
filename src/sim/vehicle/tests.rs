use super::telemetry::{EKF_STATUS_REPORT, ESTIMATOR_STATUS};
use super::*;
use crate::geometry::{Attitude, EarthFrame, Position};
use crate::sim::peer::Peer;
use crate::wire::dialect::*;
use crate::wire::ids::{command, message};
use crate::wire::{DatagramFrames, encode_to_vec};

mod manager_client;
mod mount;

const GCS: MavId = MavId::new(255, 190);

/// A vehicle in simulated time, and what it said since it was last asked.
struct Flight {
    vehicle: Vehicle,
    now: Timestamp,
    sent: Vec<(Timestamp, Vec<u8>)>,
}

impl Flight {
    fn new(autopilot: Autopilot) -> Self {
        Self::with(VehicleSettings { autopilot, ..VehicleSettings::default() })
    }

    fn with(settings: VehicleSettings) -> Self {
        Self { vehicle: Vehicle::new(Timestamp::ZERO, settings), now: Timestamp::ZERO, sent: Vec::new() }
    }

    fn run_for(&mut self, millis: u64) {
        let until = self.now + Duration::from_millis(millis);
        while self.now <= until {
            self.vehicle.handle_timeout(self.now);
            self.drain();
            self.now = self.vehicle.poll_timeout().expect("it always beats");
        }
        self.now = until;
    }

    fn drain(&mut self) {
        self.sent.extend(std::iter::from_fn(|| self.vehicle.poll_output()).map(|bytes| (self.now, bytes)));
    }

    /// Sends `message` between two streamed messages; the answers alone.
    fn ask<M: MessageData>(&mut self, message: &M) -> Vec<Vec<u8>> {
        self.run_for(1);
        self.sent.clear();
        self.vehicle.handle_received(self.now, &encode_to_vec(GCS, 0, message));
        self.drain();
        std::mem::take(&mut self.sent).into_iter().map(|(_, bytes)| bytes).collect()
    }

    /// A message of somebody, between two streamed ones.
    fn hear<M: MessageData>(&mut self, source: MavId, message: &M) {
        self.run_for(1);
        self.vehicle.handle_received(self.now, &encode_to_vec(source, 0, message));
        self.drain();
    }

    fn count(&self, id: u32) -> usize {
        self.sent.iter().filter(|(_, bytes)| id_of(bytes) == id).count()
    }

    fn all<M: MessageData>(&self) -> Vec<(Timestamp, M)> {
        self.sent.iter().filter_map(|(at, bytes)| Some((*at, read(bytes)?))).collect()
    }
}

fn id_of(bytes: &[u8]) -> u32 {
    DatagramFrames::new(bytes).next_frame().expect("it sends frames").message_id()
}

fn read<M: MessageData>(bytes: &[u8]) -> Option<M> {
    DatagramFrames::new(bytes).next_frame().expect("it sends frames").decode()
}

fn names(answers: &[Vec<u8>]) -> Vec<&'static str> {
    answers.iter().map(|bytes| DatagramFrames::new(bytes).next_frame().expect("a frame").name()).collect()
}

fn long(number: u16, params: [f32; 3]) -> COMMAND_LONG_DATA {
    COMMAND_LONG_DATA {
        target_system: 1,
        target_component: 1,
        command: number,
        confirmation: 0,
        param1: params[0],
        param2: params[1],
        param3: params[2],
        param4: 0.0,
        param5: 0.0,
        param6: 0.0,
        param7: 0.0,
    }
}

/// Command and result of the first answer, which is for who asked.
#[track_caller]
fn ack(answers: &[Vec<u8>]) -> (u16, u8) {
    let ack: COMMAND_ACK_DATA = answers.first().and_then(|bytes| read(bytes)).expect("an acknowledgement first");
    assert_eq!((ack.target_system, ack.target_component), (255, 190));
    (ack.command, ack.result)
}

const PX4: Autopilot = Autopilot::Px4;
const ARDUPILOT: Autopilot = Autopilot::ArduPilot;

#[test]
fn it_beats_as_an_autopilot() {
    for (autopilot, number, base_mode, custom_mode) in [(PX4, 12, 157, 0x0304_0000), (ARDUPILOT, 3, 153, 7)] {
        let mut flight = Flight::with(VehicleSettings { autopilot, system_id: 42, ..VehicleSettings::default() });
        flight.run_for(3500);
        let beats = flight.all::<HEARTBEAT_DATA>();
        let times: Vec<_> = beats.iter().map(|(at, _)| *at).collect();
        assert_eq!(times, [0, 1, 2, 3].map(Timestamp::from_secs));
        let expected = HEARTBEAT_DATA {
            custom_mode,
            mavtype: 2,
            autopilot: number,
            base_mode,
            system_status: 4,
            mavlink_version: 3,
        };
        assert_eq!(beats[0].1, expected);
        assert_eq!(flight.vehicle.id(), MavId::new(42, 1));
    }
}

#[test]
fn telemetry_comes_at_its_rates() {
    for (autopilot, own, other, state) in
        [(PX4, ESTIMATOR_STATUS, EKF_STATUS_REPORT, 200), (ARDUPILOT, EKF_STATUS_REPORT, ESTIMATOR_STATUS, 0)]
    {
        let mut flight = Flight::new(autopilot);
        flight.run_for(9_999);
        for (id, count) in [
            (message::ATTITUDE, 500),
            (message::ATTITUDE_QUATERNION, 250),
            (message::GLOBAL_POSITION_INT, 100),
            (message::SYS_STATUS, 10),
            (message::SYSTEM_TIME, 10),
            (own, 20),
            (other, 0),
            (message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE, state),
        ] {
            assert_eq!(flight.count(id), count, "{autopilot:?}: message {id}");
        }
        for id in [24, 32, 42, 65, 74, 147, 242, 245] {
            assert!(flight.count(id) > 0, "message {id}");
        }
    }
}

/// What one moment's messages say of position, velocity, heading and attitude agrees.
#[test]
fn messages_agree_with_each_other_and_with_the_course() {
    let mut flight = Flight::new(PX4);
    flight.run_for(60_000);
    let attitudes = flight.all::<ATTITUDE_DATA>();
    let states = flight.all::<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA>();
    let positions = flight.all::<GLOBAL_POSITION_INT_DATA>();
    assert_eq!(positions.len(), 601);
    for (at, position) in &positions {
        let (_, attitude) = attitudes.iter().find(|(time, _)| time == at).expect("sent at the same time");
        let (_, state) = states.iter().find(|(time, _)| time == at).expect("sent at the same time");
        let heading = f64::from(attitude.yaw).to_degrees();
        let track = f64::from(position.vy).atan2(f64::from(position.vx)).to_degrees();
        let difference = |a: f64, b: f64| ((a - b + 540.0).rem_euclid(360.0) - 180.0).abs();
        assert!(difference(heading, track) < 0.2, "{heading} {track}");
        assert!(difference(heading, f64::from(position.hdg) / 100.0) < 0.01);
        let angles = Attitude::<EarthFrame>::from_wxyz(state.q).expect("valid").expect("known").aircraft_angles();
        assert!(difference(heading, angles.yaw.degrees()) < 0.001);
        assert!((angles.roll.radians() - f64::from(attitude.roll)).abs() < 1e-5);
        assert!((f64::from(state.vx) * 100.0 - f64::from(position.vx)).abs() < 0.6);
        assert_eq!((position.alt, position.relative_alt), (538_000, 50_000));
    }
    let place = |position: &GLOBAL_POSITION_INT_DATA| Position {
        latitude_deg: f64::from(position.lat) * 1e-7,
        longitude_deg: f64::from(position.lon) * 1e-7,
        altitude_m: f64::from(position.alt) * 1e-3,
    };
    for second in positions.chunks_exact(10).collect::<Vec<_>>().windows(2) {
        let aim = place(&second[0][0].1).aim_at(place(&second[1][0].1)).expect("five metres apart");
        assert!((aim.distance_m - SPEED_MPS).abs() < 0.03, "{aim:?}");
    }
}

#[test]
fn it_says_who_it_is() {
    for (autopilot, capabilities) in [(PX4, 57_372), (ARDUPILOT, 188_430)] {
        for request in [
            long(command::REQUEST_MESSAGE, [148.0, 0.0, 0.0]),
            long(command::REQUEST_AUTOPILOT_CAPABILITIES, [1.0, 0.0, 0.0]),
        ] {
            let answers = Flight::new(autopilot).ask(&request);
            assert_eq!(ack(&answers), (request.command, 0));
            assert_eq!(names(&answers), ["COMMAND_ACK", "AUTOPILOT_VERSION"]);
            let version: AUTOPILOT_VERSION_DATA = read(&answers[1]).expect("its version");
            assert_eq!(version.capabilities, capabilities);
        }
        let old = AUTOPILOT_VERSION_REQUEST_DATA { target_system: 1, target_component: 1 };
        assert_eq!(names(&Flight::new(autopilot).ask(&old)), ["AUTOPILOT_VERSION"]);
        let answers = Flight::new(autopilot).ask(&long(command::REQUEST_PROTOCOL_VERSION, [1.0, 0.0, 0.0]));
        assert_eq!(names(&answers), ["COMMAND_ACK", "PROTOCOL_VERSION"]);
        let answers = Flight::new(autopilot).ask(&long(command::REQUEST_MESSAGE, [242.0, 0.0, 0.0]));
        assert_eq!(names(&answers), ["COMMAND_ACK", "HOME_POSITION"]);
    }
}

/// Observed: ArduPilot without a mount accepts 280, 281 and 285 and sends nothing, and fails 283; PX4 denies.
#[test]
fn gimbal_messages_are_not_its_business() {
    for (autopilot, id, result) in [(PX4, 280, 2), (PX4, 283, 2), (ARDUPILOT, 280, 0), (ARDUPILOT, 283, 4)] {
        let mut flight = Flight::new(autopilot);
        let answers = flight.ask(&long(command::REQUEST_MESSAGE, [id as f32, 0.0, 0.0]));
        assert_eq!((ack(&answers), answers.len()), ((512, result), 1), "{autopilot:?} {id}");
    }
    let mut flight = Flight::new(PX4);
    let mut broadcast = long(command::REQUEST_MESSAGE, [283.0, 0.0, 0.0]);
    (broadcast.target_system, broadcast.target_component) = (0, 0);
    assert!(flight.ask(&broadcast).is_empty());
}

/// "streamed at 20 Hz by PX4 to 0/0; by ArduPilot only when asked by 511, to S/0".
#[test]
fn the_state_for_gimbals_is_streamed_or_asked_for() {
    let state = message::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE;
    let mut flight = Flight::new(ARDUPILOT);
    assert_eq!(ack(&flight.ask(&long(command::SET_MESSAGE_INTERVAL, [286.0, 40_000.0, 0.0]))), (511, 0));
    flight.run_for(1000);
    let sent = flight.all::<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA>();
    assert_eq!(sent.len(), 25);
    let (_, last) = sent.last().expect("25");
    assert_eq!((last.target_system, last.target_component, last.landed_state), (1, 0, 0));
    assert_eq!(last.angular_velocity_z, 0.125);

    let mut flight = Flight::new(PX4);
    flight.run_for(100);
    let (_, first) = flight.all::<AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA>().remove(0);
    assert_eq!((first.target_system, first.target_component, first.landed_state), (0, 0, 2));
    assert_eq!(first.angular_velocity_z, 0.0);

    let mut silent =
        Flight::with(VehicleSettings { state_for_gimbals: StateForGimbals::Denied, ..VehicleSettings::default() });
    assert_eq!(ack(&silent.ask(&long(command::SET_MESSAGE_INTERVAL, [286.0, 40_000.0, 0.0]))), (511, 2));
    silent.run_for(2000);
    assert_eq!(silent.count(state), 0);
}

#[test]
fn mission_fence_and_rally_are_empty() {
    for mission_type in 0..3 {
        let mut flight = Flight::new(PX4);
        let answers = flight.ask(&MISSION_REQUEST_LIST_DATA { target_system: 1, target_component: 1, mission_type });
        let count =
            MISSION_COUNT_DATA { count: 0, target_system: 255, target_component: 190, mission_type, opaque_id: 0 };
        assert_eq!(answers.iter().map(|bytes| read(bytes)).collect::<Vec<_>>(), [Some(count)]);

        let answers = flight.ask(&MISSION_CLEAR_ALL_DATA { target_system: 1, target_component: 1, mission_type });
        let ack =
            MISSION_ACK_DATA { target_system: 255, target_component: 190, mavtype: 0, mission_type, opaque_id: 0 };
        assert_eq!(answers.iter().map(|bytes| read(bytes)).collect::<Vec<_>>(), [Some(ack)]);
    }
}

#[test]
fn no_file_is_found_and_sessions_can_be_closed() {
    for (opcode, answer, size) in [(4, 129, 1), (2, 128, 0)] {
        let mut payload = [0; 251];
        payload[..4].copy_from_slice(&[9, 0, 0, opcode]);
        let request = FILE_TRANSFER_PROTOCOL_DATA { target_network: 0, target_system: 1, target_component: 1, payload };
        let answers = Flight::new(ARDUPILOT).ask(&request);
        let reply: FILE_TRANSFER_PROTOCOL_DATA = read(&answers[0]).expect("an answer");
        assert_eq!(reply.payload[..6], [10, 0, 0, answer, size, opcode]);
        assert_eq!((reply.target_system, reply.target_component), (255, 190));
        assert_eq!(reply.payload[12], if size == 1 { 10 } else { 0 });
    }
}

#[test]
fn time_and_ping_are_answered_once() {
    let mut flight = Flight::new(PX4);
    flight.run_for(1500);
    let timesync = TIMESYNC_DATA { tc1: 0, ts1: 77, target_system: 0, target_component: 0 };
    let answers = flight.ask(&timesync);
    let expected = TIMESYNC_DATA { tc1: 1_501_000_000, ts1: 77, target_system: 255, target_component: 190 };
    assert_eq!(answers.iter().map(|bytes| read(bytes)).collect::<Vec<_>>(), [Some(expected.clone())]);
    assert!(flight.ask(&TIMESYNC_DATA { target_system: 1, target_component: 1, ..expected }).is_empty());

    let ping = PING_DATA { time_usec: 5, seq: 6, target_system: 0, target_component: 0 };
    let expected = PING_DATA { target_system: 255, target_component: 190, ..ping };
    assert_eq!(flight.ask(&ping).iter().map(|bytes| read(bytes)).collect::<Vec<_>>(), [Some(expected)]);
}

#[test]
fn it_is_armed_and_changes_modes_as_told() {
    for (autopilot, mode, expected) in [(PX4, [157.0, 3.0, 1.0], 0x0103_0000), (ARDUPILOT, [1.0, 5.0, 0.0], 5)] {
        let mut flight = Flight::new(autopilot);
        let answers = flight.ask(&long(176, mode));
        assert_eq!(ack(&answers), (176, 0));
        let beat: HEARTBEAT_DATA = read(&answers[1]).expect("the new mode at once");
        assert_eq!(beat.custom_mode, expected);
        let answers = flight.ask(&long(400, [0.0, 0.0, 0.0]));
        let beat: HEARTBEAT_DATA = read(&answers[1]).expect("the new state at once");
        assert_eq!((ack(&answers), beat.base_mode & 128), ((400, 0), 0));
    }
}

#[test]
fn what_it_does_not_know_is_unsupported() {
    let answers = Flight::new(PX4).ask(&long(command::DO_GIMBAL_MANAGER_PITCHYAW, [0.0; 3]));
    assert_eq!((ack(&answers), answers.len()), ((1000, 3), 1));

    let int = COMMAND_INT_DATA {
        target_system: 1,
        target_component: 1,
        frame: 3,
        command: 195,
        current: 0,
        autocontinue: 0,
        param1: 0.0,
        param2: 0.0,
        param3: 0.0,
        param4: 0.0,
        x: 0,
        y: 0,
        z: 0.0,
    };
    assert_eq!(ack(&Flight::new(PX4).ask(&int)), (195, 3));

    for (system, component) in [(1, 0), (0, 0), (1, 191), (2, 1)] {
        let mut other = long(command::DO_GIMBAL_MANAGER_PITCHYAW, [0.0; 3]);
        (other.target_system, other.target_component) = (system, component);
        assert!(Flight::new(PX4).ask(&other).is_empty(), "{system}/{component}");
    }
}

#[test]
fn parameters_are_those_by_which_it_is_known() {
    let list = PARAM_REQUEST_LIST_DATA { target_system: 1, target_component: 1 };
    for (autopilot, count, first, name, value) in [
        (PX4, 18, "_HASH_CHECK", "MAV_SYS_ID", f32::from_bits(7)),
        (ARDUPILOT, 19, "ARMING_CHECK", "SYSID_THISMAV", 7.0),
    ] {
        let mut flight = Flight::with(VehicleSettings { autopilot, system_id: 7, ..VehicleSettings::default() });
        let mut to_seven = list.clone();
        to_seven.target_system = 7;
        let mut values: Vec<PARAM_VALUE_DATA> = flight.ask(&to_seven).iter().filter_map(|bytes| read(bytes)).collect();
        flight.run_for(500);
        values.extend(flight.all().into_iter().map(|(_, value): (_, PARAM_VALUE_DATA)| value));

        assert_eq!(values[0].param_id.to_str(), Ok(first));
        let mut indices: Vec<_> = values.iter().map(|value| value.param_index).filter(|index| *index < 999).collect();
        indices.dedup();
        assert_eq!(indices, (0..count).collect::<Vec<_>>());
        let system = values.iter().find(|value| value.param_id.to_str() == Ok(name)).expect(name);
        assert_eq!((system.param_value.to_bits(), system.param_count), (value.to_bits(), count));
    }
}

/// ArduPilot still listens to REQUEST_DATA_STREAM, PX4 does not.
#[test]
fn data_streams_change_rates_on_ardupilot_only() {
    for (autopilot, rate) in [(ARDUPILOT, 4), (PX4, 50)] {
        let mut flight = Flight::new(autopilot);
        flight.ask(&REQUEST_DATA_STREAM_DATA {
            target_system: 1,
            target_component: 1,
            req_stream_id: 10,
            req_message_rate: 4,
            start_stop: 1,
        });
        flight.run_for(1000);
        assert_eq!(flight.count(message::ATTITUDE), rate, "{autopilot:?}");
    }
}

#[test]
fn the_wall_clock_is_told_only_when_it_is_known() {
    for (unix_time_us, expected) in [(None, 0), (Some(1_700_000_000_000_000), 1_700_000_002_000_000)] {
        let mut flight = Flight::with(VehicleSettings { unix_time_us, ..VehicleSettings::default() });
        flight.run_for(2000);
        assert_eq!(flight.all::<SYSTEM_TIME_DATA>().last().map(|(_, time)| time.time_unix_usec), Some(expected));
    }
}
