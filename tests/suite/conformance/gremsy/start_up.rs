//! From the first heartbeat on until it can be steered, and again after a restart.

use gimbald::bridge::settings::SystemId;
use gimbald::gimbals::gremsy::packet::{self, MessageRate};
use gimbald::gimbals::operation::{Motors, Restart, YawMode};
use gimbald::sim::faults::{Faults, FaultyPeer};
use gimbald::wire::dialect::{HEARTBEAT_DATA, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA};
use gimbald::wire::ids::message;
use gimbald::wire::{DatagramFrames, MavId};

use super::*;
use crate::support::interception::{Intercepted, Interceptor, Passage};
use crate::support::script::{FAILED, of};
use crate::support::world::{GIMBAL, heartbeat};

/// Gimbal statement 1: "No byte is transmitted by the simulated Gremsy before it received a HEARTBEAT; within 1.2 s after
/// one, a HEARTBEAT with type 26 from compid 154 arrives." The core speaks first, so it is woken.
#[test]
fn statement_1_a_silent_gimbal_is_woken() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = without_gimbal(GremsySettings::default());
        world.install(places.gimbal, Device::new(Timestamp::ZERO, device(generation)));
        // Deaf for two seconds after power-on; the next heartbeat wakes it.
        run(&mut world, places, Duration::from_millis(3_200));
        let snapshot = world.snapshot();
        let heard = &snapshot.links[1];
        assert_eq!(heard.peers[0].components, ["1/154"], "{generation:?}");
    }
}

/// Gimbal statement 2: "The driver sends its own HEARTBEAT (type 18, autopilot 8, state 4) before any other message and
/// every 1.0 ± 0.1 s."
#[test]
fn statement_2_our_heartbeat_comes_first_and_every_second() {
    let (mut world, places) = switched_on(device(Generation::V1), GremsySettings::default());
    run(&mut world, places, 10 * SECOND);

    let ours: Vec<_> = world.arrivals(places.gimbal).iter().filter(|arrival| arrival.source() == MANAGER).collect();
    let beats: Vec<_> = ours.iter().filter(|arrival| arrival.id() == message::HEARTBEAT).collect();
    assert_eq!(ours[0].id(), message::HEARTBEAT);
    for beat in &beats {
        let HEARTBEAT_DATA { mavtype, autopilot, system_status, .. } = beat.decode();
        // STANDBY until there is a gimbal to manage.
        let expected = if beat.at < Timestamp::from_secs(4) { system_status } else { 4 };
        assert_eq!((mavtype, autopilot, system_status), (18, 8, expected));
        assert!(matches!(system_status, 3 | 4));
    }
    // One more where something has changed, and never a pause.
    assert!(beats.windows(2).all(|pair| pair[1].at - pair[0].at <= SECOND), "{}", beats.len());
    assert!((10..=12).contains(&beats.len()), "{}", beats.len());
}

/// Gimbal statement 3: "Heartbeats from compids 1, 100, 191 never bind as gimbal; 154 and 171–175 do." Whoever beats as a gimbal
/// is one, under whatever component the protocol notes (1.7), which win, leave to gimbals.
#[test]
#[rustfmt::skip]
fn statement_3_which_components_are_gimbals() {
    for (component, kind, binds) in [
        (1,         2,    false),
        (100,       30,   false),
        (191,       18,   false),
        (1,         26,   false),
        (191,       26,   false),
        (100,       26,   true),
        (154,       26,   true),
        (171,       26,   true),
        (172,       26,   true),
        (173,       26,   true),
        (174,       26,   true),
        (175,       26,   true),
    ] {
        let (mut world, places) = without_gimbal(GremsySettings::default());
        world.send(places.gimbal, MavId::new(1, component), &heartbeat(kind, 8));
        run(&mut world, places, 2 * SECOND);
        let asked: Vec<COMMAND_LONG_DATA> = from_manager(&mut world, places);
        let asked = asked.iter().any(|command| command.target_component == component);
        assert_eq!(asked, binds, "component {component}");
    }
}

/// Gimbal statement 4: "A second gimbal with another compid appearing later does not steal the binding."
#[test]
fn statement_4_a_second_gimbal_does_not_steal_the_binding() {
    let (mut world, places) = running(Generation::V1);
    for _ in 0..5 {
        world.send(places.gimbal, MavId::new(1, 171), &heartbeat(26, 8));
        let first = seen(&world);
        let stage = first.details.stage.as_deref();
        assert_eq!((first.device.as_deref(), first.state, stage), (Some("1/154"), "alive".to_owned(), Some("running")));
        run(&mut world, places, SECOND);
    }
    demand(&mut world, places, [-20.0, 0.0, f32::NAN, f32::NAN, 0.0]);
    run(&mut world, places, 3 * SECOND);

    assert_eq!(seen(&world).device.as_deref(), Some("1/154"));
    let (commands, _) = orders(&mut world, places);
    assert!(!commands.is_empty() && commands.iter().all(|command| command.target_component == 154));
    assert_looks(&world, -20.0, 0.0);
}

/// Gimbal statement 6: "Motor-on, FOLLOW, home, 511 and 512 frames equal their golden frames." What the core sends is what
/// these frames are made of (`gimbals::gremsy::packet`), whole.
#[test]
fn statement_6_what_is_sent_is_what_the_golden_frames_hold() {
    let silent = DeviceSettings { has_usual_streams: false, ..device(Generation::V2) };
    let (mut world, places) = switched_on(silent, GremsySettings::default());
    run(&mut world, places, 4 * SECOND);
    let asked = told(&mut world, places, command::REQUEST_MESSAGE);
    assert_eq!(asked[0], packet::request_message(GIMBAL, 283));
    let rates = told(&mut world, places, command::SET_MESSAGE_INTERVAL);
    assert_eq!(rates[0], packet::set_message_rate(GIMBAL, 285, MessageRate::Hertz(10)));

    let (mut world, places) = running(Generation::V1);
    take_control(&mut world);
    for (operation, expected) in [
        (Operation::Motors(Motors::Off), packet::set_motors(GIMBAL, false)),
        (Operation::Motors(Motors::On), packet::set_motors(GIMBAL, true)),
        (Operation::SetYawMode(YawMode::Follow), packet::follow(GIMBAL)),
        (Operation::Reset(ResetMode::PitchAndYaw), packet::reset(GIMBAL, ResetMode::PitchAndYaw)),
    ] {
        world.forget();
        assert_eq!(operate(&mut world, places, operation.clone()), Some(Ok(())), "{operation:?}");
        assert_eq!(orders(&mut world, places), (vec![expected], vec![]), "{operation:?}");
    }
}

/// Gimbal statement 11: "`present` becomes true only after parameters are settled for 1 s and errors_count2 == 0."
#[test]
fn statement_11_it_can_be_steered_when_it_is_ready_and_not_before() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = switched_on(device(generation), GremsySettings::default());
        let (mut stages, mut last) = (Vec::new(), None);
        for _ in 0..80 {
            run(&mut world, places, Duration::from_millis(100));
            let stage = seen(&world).details.stage.expect("a stage");
            let pitchyaw = command_long(MANAGER, 1000, &[0.0; 7]);
            let result = world.result_of(places.ground, GCS, &pitchyaw);
            // TEMPORARILY_REJECTED until it is known.
            assert!(result == Some(1) || result == Some(0) && stage == "running", "{generation:?} {stage} {result:?}");
            last = result;
            if stages.last() != Some(&stage) {
                stages.push(stage);
            }
            let (commands, setpoints) = orders(&mut world, places);
            assert!(
                stages.last().is_some_and(|stage| stage == "running") || commands.is_empty() && setpoints.is_empty()
            );
        }
        assert_eq!(stages, ["searching", "reading_parameters", "aligning", "running"], "{generation:?}");
        assert_eq!(last, Some(0));
    }
}

/// Whose parameters have one of this name that never arrives.
#[derive(Debug)]
struct Lacking(&'static str);

impl Interceptor for Lacking {
    fn towards_core(&mut self, bytes: &[u8]) -> Passage {
        let value = DatagramFrames::new(bytes).next_frame().and_then(|frame| frame.decode::<PARAM_VALUE_DATA>());
        if value.is_some_and(|value| value.param_id.to_str() == Ok(self.0)) { Passage::Lost } else { Passage::Through }
    }
}

/// Gimbal statement 12: "A parameter missing after 5 reads is marked non-existent and does not block readiness."
#[test]
fn statement_12_a_missing_parameter_does_not_keep_it_from_running() {
    for (device, name) in [
        (device(Generation::V1), "GYRO_LPF"),
        (device(Generation::V1), "RC_TYPE"),
        (device(Generation::V2), "RC_LIM_MIN_TILT"),
        (with_firmware(Generation::V1, 7, 5, 6), "TRAVEL_MAX_PIT"),
    ] {
        let firmware = device.firmware;
        let (mut world, places) = without_gimbal(GremsySettings::default());
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        world.install(places.gimbal, Intercepted::new(Device::new(Timestamp::ZERO, device), Lacking(name)));
        run(&mut world, places, 20 * SECOND);
        assert_eq!(seen(&world).details.stage.as_deref(), Some("running"), "{firmware} without {name}");
        let reads: Vec<PARAM_REQUEST_READ_DATA> = from_manager(&mut world, places);
        let reads: Vec<&str> = reads.iter().map(|read| read.param_id.to_str().expect("a name")).collect();
        assert_eq!(reads, [name; 5], "{firmware}");
        let parameters = seen(&world).details.parameters;
        assert!(parameters.len() > 20 && !parameters.contains_key(name), "{firmware} {parameters:?}");
        // It does not exist, and is not asked for any more.
        world.forget();
        run(&mut world, places, 30 * SECOND);
        let reads: Vec<PARAM_REQUEST_READ_DATA> = from_manager(&mut world, places);
        assert_eq!(reads, [], "{firmware} {name}");
        demand(&mut world, places, [-20.0, 10.0, f32::NAN, f32::NAN, 0.0]);
        run(&mut world, places, 4 * SECOND);
        assert_looks(&world, -20.0, 10.0);
    }
}

/// Firmware with the older table of parameters is asked for nothing of the newer one.
#[test]
fn old_firmware_has_the_older_table() {
    let (mut world, places) = switched_on(with_firmware(Generation::V1, 7, 5, 6), GremsySettings::default());
    run(&mut world, places, 20 * SECOND);
    let seen = seen(&world);
    assert_eq!(seen.details.stage.as_deref(), Some("running"));
    assert_eq!(seen.details.generation.as_deref(), Some("v1"));
    assert!(seen.details.parameters.contains_key("PITCH_P") && !seen.details.parameters.contains_key("STIFF_TILT"));
    assert_eq!(seen.details.version.as_deref(), Some("7.5.6"));
    let lists: Vec<PARAM_REQUEST_LIST_DATA> = from_manager(&mut world, places);
    let reads: Vec<PARAM_REQUEST_READ_DATA> = from_manager(&mut world, places);
    assert_eq!((lists.len(), reads.len()), (1, 0), "all of its table came");
}

/// "Detect generation …: Arrived → v2-capable candidate; version ≥ 7.7.3 and 285 received … → v2; otherwise v1. Allow a
/// config override; never mix both control paths in one session" (gimbals 1.10).
#[test]
#[rustfmt::skip]
fn the_generation_is_found_out_and_only_that_is_spoken() {
    for (device,                                   chosen,                       generation, id) in [
        (device(Generation::V1),                   None,                         "v1",       1),
        (device(Generation::V2),                   None,                         "v2",       154),
        (with_firmware(Generation::V1, 7, 5, 6),   None,                         "v1",       1),
        (with_firmware(Generation::V2, 7, 8, 6),   None,                         "v2",       154),
        (device(Generation::V1),                   Some(super::V1),              "v1",       1),
        (device(Generation::V2),                   Some(super::V2),              "v2",       154),
    ] {
        let firmware = device.firmware;
        let (mut world, places) = running_with(device, GremsySettings { generation: chosen, ..GremsySettings::default() });
        demand(&mut world, places, [-30.0, 45.0, f32::NAN, f32::NAN, 0.0]);
        run(&mut world, places, 4 * SECOND);

        let seen = seen(&world);
        assert_eq!((seen.details.generation.as_deref(), seen.device_id), (Some(generation), Some(id)), "{firmware}");
        let (commands, setpoints) = orders(&mut world, places);
        assert_eq!((commands.is_empty(), setpoints.is_empty()), (generation == "v2", generation == "v1"), "{firmware}");
        assert_looks(&world, -30.0, 45.0);
    }
}

/// Models that send nothing by default are told every rate, and again after a silence.
#[test]
fn streams_are_set_also_where_nothing_comes_by_default() {
    for (generation, id, interval) in [(Generation::V1, 265.0, 50_000.0), (Generation::V2, 285.0, 50_000.0)] {
        let silent = DeviceSettings { has_usual_streams: false, ..device(generation) };
        let (mut world, places) = switched_on(silent, GremsySettings::default());
        run(&mut world, places, 20 * SECOND);
        let rates = told(&mut world, places, command::SET_MESSAGE_INTERVAL);
        assert!(rates.iter().any(|rate| (rate.param1, rate.param2) == (id, interval)), "{rates:?}");
        let seen = seen(&world);
        assert!(seen.attitude.age_ms.is_some_and(|age| age < 100), "{:?}", seen.attitude);
    }
}

/// Gimbal statement 32: "Reboot command followed by 10 s silence does not trigger a permanent loss; driver re-runs start-up
/// and re-sends mode and stream rates."
#[test]
fn statement_32_a_reboot_is_no_loss_and_everything_is_said_again() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = switched_on(device(generation), GremsySettings::default());
        run(&mut world, places, 16 * SECOND);
        assert_eq!(seen(&world).details.stage.as_deref(), Some("running"), "{generation:?}");
        let mut first_rates = stream_rates(&mut world, places);
        // By its answer to that it was found out to speak v1, which it is known to do.
        first_rates.retain(|(id, _)| generation == Generation::V2 || *id != 285.0);
        let streams: &[f32] = if generation == Generation::V1 { &[158.0, 265.0] } else { &[158.0, 285.0] };
        assert!(streams.iter().all(|id| first_rates.iter().any(|(told, _)| told == id)), "{first_rates:?}");
        demand(&mut world, places, [-30.0, 45.0, f32::NAN, f32::NAN, 0.0]);
        run(&mut world, places, 3 * SECOND);
        take_control(&mut world);
        world.forget();

        let rebooted = operate(&mut world, places, Operation::Restart(Restart::Reboot));
        assert_eq!(rebooted, Some(Ok(())), "{generation:?}");
        let states: Vec<String> = (0..14)
            .map(|_| {
                run(&mut world, places, SECOND);
                seen(&world).state
            })
            .collect();
        assert!(states.iter().all(|state| state == "alive"), "{states:?}");

        assert_eq!(seen(&world).details.stage.as_deref(), Some("running"), "{generation:?}");
        assert_eq!(stream_rates(&mut world, places), first_rates, "{generation:?}");
        let lists: Vec<PARAM_REQUEST_LIST_DATA> = from_manager(&mut world, places);
        assert_eq!(lists.len(), 1);
        // Nothing moves it until somebody asks, and then its mode is said first.
        world.forget();
        run(&mut world, places, 2 * SECOND);
        assert_eq!(orders(&mut world, places), (vec![], vec![]));
        point(&mut world, -20.0, 10.0);
        run(&mut world, places, 3 * SECOND);
        assert_looks(&world, -20.0, 10.0);
        let (commands, _) = orders(&mut world, places);
        if generation == Generation::V1 {
            assert_eq!(commands[0], packet::follow(GIMBAL));
        }
    }
}

/// What the gimbal was told of each stream last: the message, and its interval in microseconds.
fn stream_rates(world: &mut World, places: Places) -> Vec<(f32, f32)> {
    let mut rates: Vec<(f32, f32)> = Vec::new();
    for told in told(world, places, command::SET_MESSAGE_INTERVAL) {
        rates.retain(|(id, _)| *id != told.param1);
        rates.push((told.param1, told.param2));
    }
    rates.sort_by(|one, other| one.0.total_cmp(&other.0));
    rates
}

/// It does not come back: then it is lost.
#[test]
fn a_gimbal_that_does_not_come_back_from_a_reboot_is_lost() {
    let (mut world, places) = running(Generation::V1);
    take_control(&mut world);
    assert_eq!(operate(&mut world, places, Operation::Restart(Restart::Shutdown)), Some(Ok(())));
    run(&mut world, places, 3 * SECOND);
    assert_eq!(seen(&world).state, "lost");
}

/// `present` and `get_connection` for a client: it can be steered and 285 comes; when it is gone a demand is FAILED, and 285 ends,
/// or has `COMMS_ERROR` where the manager speaks for it.
#[test]
fn a_client_is_told_that_it_is_gone() {
    use gimbald::wire::dialect::GIMBAL_DEVICE_ATTITUDE_STATUS_DATA;
    use gimbald::wire::ids::FailureFlags;
    for (generation, speaker) in [(Generation::V1, MANAGER), (Generation::V2, GIMBAL)] {
        let (mut world, places) = running(generation);
        let comms_errors = |world: &mut World| -> Vec<bool> {
            world.forget();
            run(world, places, 2 * SECOND);
            let told = world.take(places.ground);
            let told = told.iter().filter(|told| told.id() == message::GIMBAL_DEVICE_ATTITUDE_STATUS);
            let told = told.inspect(|told| assert_eq!(told.source(), speaker, "{generation:?}"));
            told.map(|told| told.decode::<GIMBAL_DEVICE_ATTITUDE_STATUS_DATA>().failure_flags)
                .map(|flags| FailureFlags::from_bits_retain(flags).contains(FailureFlags::COMMS_ERROR))
                .collect()
        };
        let told = comms_errors(&mut world);
        assert!(told.len() >= 18 && !told.contains(&true), "{generation:?} {told:?}");
        world.remove(places.gimbal);
        run(&mut world, places, 6 * SECOND);
        assert_eq!(seen(&world).state, "lost", "{generation:?}");
        let told = comms_errors(&mut world);
        match generation {
            Generation::V1 => assert!(told.len() >= 18 && !told.contains(&false), "{told:?}"),
            Generation::V2 => assert_eq!(told, Vec::<bool>::new()),
        }
        let pitchyaw = command_long(MANAGER, command::DO_GIMBAL_MANAGER_PITCHYAW, &[-10.0, 0.0]);
        assert_eq!(world.result_of(places.ground, GCS, &pitchyaw), Some(FAILED), "{generation:?}");
    }
}

/// A gimbal that is switched off and on is got to know anew, and not moved.
#[test]
fn a_gimbal_that_is_switched_off_and_on_is_got_to_know_anew() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        demand(&mut world, places, [-30.0, 45.0, f32::NAN, f32::NAN, 0.0]);
        run(&mut world, places, 3 * SECOND);
        world.forget();
        world.reboot(places.gimbal);
        run(&mut world, places, 15 * SECOND);
        assert_eq!(seen(&world).details.stage.as_deref(), Some("running"), "{generation:?}");
        assert_eq!(seen(&world).setpoint, None);
        let rates = told(&mut world, places, command::SET_MESSAGE_INTERVAL);
        assert!(!rates.is_empty());
    }
}

/// Without an entry a gimbal that says who made it is driven as a Gremsy.
#[test]
fn without_an_entry_it_is_recognised_by_its_maker() {
    let (mut world, places) = World::empty(Settings { system_id: SystemId::Fixed(1), ..three_links() });
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
    world.install(places.gimbal, Device::new(Timestamp::ZERO, device(Generation::V2)));
    run(&mut world, places, 12 * SECOND);
    let seen = seen(&world);
    assert_eq!(
        (seen.family.as_str(), seen.device_id, seen.details.stage.as_deref()),
        ("gremsy", Some(154), Some("running"))
    );
    demand(&mut world, places, [-30.0, 45.0, f32::NAN, f32::NAN, 0.0]);
    run(&mut world, places, 4 * SECOND);
    assert_looks(&world, -30.0, 45.0);
}

/// Five of a hundred frames are lost, some are doubled: it starts all the same, and goes where it is told.
#[test]
fn on_a_bad_line_it_starts_and_obeys() {
    for generation in [Generation::V1, Generation::V2] {
        for seed in 1..6 {
            let faults = "drop=0.05,duplicate=0.05".parse::<Faults>().expect("faults");
            let (mut world, places) = without_gimbal(GremsySettings::default());
            world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
            let peer = FaultyPeer::new(Device::new(Timestamp::ZERO, device(generation)), Faults { seed, ..faults });
            world.install(places.gimbal, peer);
            run(&mut world, places, 20 * SECOND);
            assert_eq!(seen(&world).details.stage.as_deref(), Some("running"), "{generation:?} {seed}");
            demand(&mut world, places, [-30.0, 45.0, f32::NAN, f32::NAN, 0.0]);
            run(&mut world, places, 5 * SECOND);
            assert_looks(&world, -30.0, 45.0);
        }
    }
}

/// What clients see of a v1 gimbal comes from its manager, of a v2 gimbal from itself.
#[test]
fn clients_see_one_gimbal_with_one_id() {
    use gimbald::wire::dialect::{GIMBAL_DEVICE_ATTITUDE_STATUS_DATA, GIMBAL_MANAGER_STATUS_DATA};
    for (generation, id, speaker) in [(Generation::V1, 1, MANAGER), (Generation::V2, 154, GIMBAL)] {
        let (mut world, places) = switched_on(device(generation), GremsySettings::default());
        run(&mut world, places, 12 * SECOND);
        let heard = world.take(places.ground);
        let statuses: Vec<GIMBAL_MANAGER_STATUS_DATA> = of(&heard);
        assert!(statuses.len() > 20 && statuses.iter().all(|status| status.gimbal_device_id == id), "{generation:?}");
        let attitudes: Vec<_> =
            heard.iter().filter(|arrival| arrival.id() == message::GIMBAL_DEVICE_ATTITUDE_STATUS).collect();
        assert!(attitudes.len() > 50 && attitudes.iter().all(|arrival| arrival.source() == speaker), "{generation:?}");
        let last: GIMBAL_DEVICE_ATTITUDE_STATUS_DATA = attitudes.last().expect("one").decode();
        assert_eq!(last.gimbal_device_id, if id == 154 { 0 } else { id });
    }
}

/// The power fails while it turns: when it is back, hanging as its weight has it, nothing turns it on nor keeps it there.
#[test]
fn a_power_failure_while_it_turns_leaves_nothing_behind() {
    for generation in [Generation::V1, Generation::V2] {
        let (mut world, places) = running(generation);
        demand(&mut world, places, [f32::NAN, f32::NAN, 0.0, 10.0, 0.0]);
        run(&mut world, places, SECOND);
        world.reboot(places.gimbal);
        run(&mut world, places, 15 * SECOND);
        world.forget();
        run(&mut world, places, 5 * SECOND);
        assert_eq!(seen(&world).details.stage.as_deref(), Some("running"), "{generation:?}");
        assert_eq!(seen(&world).setpoint, None, "{generation:?}");
        assert_eq!(orders(&mut world, places), (vec![], vec![]), "{generation:?}");
        assert_looks(&world, 0.0, 0.0);
    }
}
