//! D21: "286: forwarded; asked for (511) where absent; made by us (from S/19x, to the gimbal's link only) when the request
//! was refused or ignored three times; `synthesize_286 = "auto" | "off"`".

mod lines;

use std::collections::BTreeSet;
use std::time::Duration;

use gimbald::bridge::settings::{Role, Settings, Transport};
use gimbald::geometry::{Attitude, EarthFrame};
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings, SystemId};
use gimbald::manager::settings::ControlSettings;
use gimbald::sim::vehicle::{Autopilot, StateForGimbals, Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::{ATTITUDE_DATA, AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA, COMMAND_LONG_DATA, MavMessage};

use crate::support::script::{autopilot_state, set_interval};
use crate::support::world::{AUTOPILOT, Arrival, GCS, MANAGER, Place, Places, World, link, three_links};

type State = AUTOPILOT_STATE_FOR_GIMBAL_DEVICE_DATA;

const SECOND: Duration = Duration::from_secs(1);
const STATE: u32 = 286;

/// Everything the gimbal hears of the state, from whom and when.
fn states(world: &mut World, place: Place) -> Vec<(Timestamp, MavId, State)> {
    let heard = world.take(place);
    heard
        .iter()
        .filter(|arrival| arrival.id() == STATE)
        .map(|arrival| (arrival.at, arrival.source(), arrival.decode()))
        .collect()
}

/// A vehicle of these settings and a gimbal, both known for a few seconds.
fn flight(settings: Settings, vehicle: VehicleSettings) -> (World, Places) {
    let (mut world, places) = World::empty(settings);
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, vehicle));
    world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));
    (world, places)
}

fn vehicle(autopilot: Autopilot, state_for_gimbals: StateForGimbals) -> VehicleSettings {
    VehicleSettings { autopilot, state_for_gimbals, ..VehicleSettings::default() }
}

fn told_by(world: &World) -> Option<String> {
    world.snapshot().vehicle.state_for_gimbal
}

#[track_caller]
fn assert_near(found: f64, expected: f64, within: f64) {
    assert!((found - expected).abs() <= within, "{found}, not {expected} ± {within}");
}

/// What the autopilot tells others, told to gimbals: as it is at that time.
#[track_caller]
fn assert_truth(autopilot: Autopilot, at: Timestamp, state: &State) {
    let truth = Vehicle::new(Timestamp::ZERO, vehicle(autopilot, StateForGimbals::Told)).motion(at);
    let attitude: Attitude<EarthFrame> = Attitude::from_wxyz(state.q).expect("well formed").expect("set");
    let error = attitude.angle_to(Attitude::from_aircraft_angles(truth.attitude)).degrees();
    assert!(error < 0.02, "{error}° off at {at}");
    for (axis, speed) in [state.vx, state.vy, state.vz].into_iter().enumerate() {
        // As old as it says, on a circle that bends the course by 7° a second.
        assert_near(f64::from(speed), truth.velocity_mps[axis], 0.1);
    }
    let rate = truth.heading_rate.radians_per_second();
    assert_near(f64::from(state.angular_velocity_z), rate, 1e-5);
    assert_near(f64::from(state.feed_forward_angular_velocity_z), rate, 1e-5);
    assert_eq!((state.estimator_status, state.landed_state), (895, 2));
    assert_eq!((state.target_system, state.target_component), (1, 0));
    let late = u32::try_from(at.as_micros()).expect("a short test").abs_diff(state.time_boot_us as u32);
    assert!(late <= 1_000, "{} at {at}", state.time_boot_us);
    assert!((1..=1_000).contains(&state.q_estimated_delay_us), "{state:?}");
    assert!((1..=101_000).contains(&state.v_estimated_delay_us), "{state:?}");
}

/// "asked for (511) where absent; made by us … when the request was refused or ignored three times": at once after a
/// refusal, after 2 s after the third request without an answer, and after three requests that were accepted and brought
/// nothing. "at 20 to 50 Hz", from the manager, to the gimbal's link only.
#[test]
#[rustfmt::skip]
fn the_state_is_made_when_the_autopilot_will_not_tell_it() {
    for (autopilot, behaviour, from_s, to_s) in [
        (Autopilot::Px4,       StateForGimbals::Denied,    2,  4),
        (Autopilot::ArduPilot, StateForGimbals::Denied,    2,  4),
        (Autopilot::Px4,       StateForGimbals::Ignored,   4,  6),
        (Autopilot::ArduPilot, StateForGimbals::Ignored,   4,  6),
        (Autopilot::ArduPilot, StateForGimbals::Promised, 14, 16),
    ] {
        let (mut world, places) = flight(three_links(), vehicle(autopilot, behaviour));

        world.run_for(20 * SECOND);

        let what = format!("{autopilot:?} {behaviour:?}");
        let told = states(&mut world, places.gimbal);
        let first = told.first().expect(&what).0;
        assert!(first >= Timestamp::from_secs(from_s) && first <= Timestamp::from_secs(to_s), "{what} from {first}");
        assert!(told.iter().all(|(_, source, _)| *source == MANAGER), "{what}");
        let settled = first + SECOND;
        for pair in told.windows(2).filter(|pair| pair[0].0 >= settled) {
            let interval = pair[1].0 - pair[0].0;
            assert!(interval >= Duration::from_millis(20) && interval <= Duration::from_millis(50), "{what}: {interval:?}");
            assert!(pair[1].2.time_boot_us > pair[0].2.time_boot_us, "{what}");
            assert_truth(autopilot, pair[1].0, &pair[1].2);
        }
        for elsewhere in [places.autopilot, places.ground] {
            assert_eq!(states(&mut world, elsewhere), [], "{what}");
        }
        assert_eq!(told_by(&world).as_deref(), Some("synthesized"), "{what}");
    }
}

/// "forwarded": where the autopilot tells it, unasked or when asked, nothing is made.
#[test]
fn a_state_that_the_autopilot_tells_is_only_forwarded() {
    for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
        let (mut world, places) = flight(three_links(), vehicle(autopilot, StateForGimbals::Told));

        world.run_for(20 * SECOND);

        let told = states(&mut world, places.gimbal);
        assert!(told.len() > 200, "{autopilot:?}: {}", told.len());
        assert!(told.iter().all(|(_, source, _)| *source == AUTOPILOT), "{autopilot:?}");
        assert_eq!(told_by(&world).as_deref(), Some("autopilot"), "{autopilot:?}");
    }
}

/// "Combine attitude … needs autopilot attitude at 50–100 Hz"; "286 (or ATTITUDE) at 50 Hz is sufficient" (gimbals 1.5, 1.7): a
/// gimbal that leans on it gets it so often where the autopilot sends it as it is asked to, any other one as often as it likes.
#[test]
fn a_gimbal_that_leans_on_the_attitude_gets_it_fifty_times_a_second() {
    use gimbald::gimbals::gremsy::sim;
    for autopilot in [Autopilot::Px4, Autopilot::ArduPilot] {
        let leaning = [sim::Generation::V1, sim::Generation::V2].map(Some);
        for generation in leaning.into_iter().chain([None]) {
            let (mut world, places) = flight(three_links(), vehicle(autopilot, StateForGimbals::Told));
            if let Some(generation) = generation {
                world.remove(places.gimbal);
                let gremsy = sim::Device::new(Timestamp::ZERO, sim::DeviceSettings::of(generation));
                world.install(places.gimbal, gremsy);
            }
            world.run_for(30 * SECOND);
            world.forget();
            world.run_for(4 * SECOND);

            let told = states(&mut world, places.gimbal);
            assert!(told.iter().all(|(_, source, _)| *source == AUTOPILOT), "{autopilot:?} {generation:?}");
            let expected = if generation.is_some() { 196..=204 } else { 78..=102 };
            assert!(expected.contains(&told.len()), "{autopilot:?} {generation:?}: {}", told.len());
        }
    }
}

/// `synthesize_286 = "off"`: it is still asked for, and never made.
#[test]
fn nothing_is_made_where_the_user_does_not_want_it() {
    let control = ControlSettings { synthesize_286: false, ..ControlSettings::default() };
    let settings = Settings { control, ..three_links() };
    let (mut world, places) = flight(settings, vehicle(Autopilot::Px4, StateForGimbals::Denied));

    world.run_for(20 * SECOND);

    assert_eq!(states(&mut world, places.gimbal), []);
    assert_eq!(requests(&world.take(places.autopilot)).first().map(|(id, _)| *id), Some(STATE));
    assert_eq!(told_by(&world), None);
}

/// "DENIED then later appears": "stops at once when the real 286 appears; never both". When it ends, the request is
/// refused again, and ours begins again.
#[test]
fn ours_stops_at_once_when_the_real_one_appears() {
    for teller in [AUTOPILOT, MavId::new(1, 99)] {
        let (mut world, places) = flight(three_links(), vehicle(Autopilot::Px4, StateForGimbals::Denied));
        world.run_for(10 * SECOND);
        assert!(!states(&mut world, places.gimbal).is_empty());

        let real = autopilot_state(world.now, MavId::new(0, 0), 0.0);
        let real = MavMessage::AUTOPILOT_STATE_FOR_GIMBAL_DEVICE(real);
        world.run_with(5 * SECOND, &[(SECOND, places.autopilot, teller, real)]);

        let told = states(&mut world, places.gimbal);
        assert_eq!(told.iter().map(|(_, source, _)| *source).collect::<BTreeSet<_>>(), BTreeSet::from([teller]));
        assert_eq!(told.len(), 5);
        assert_eq!(told_by(&world).as_deref(), Some("autopilot"));

        let ended = world.now;
        world.run_for(10 * SECOND);
        let told = states(&mut world, places.gimbal);
        assert!(told.iter().all(|(_, source, _)| *source == MANAGER));
        let begins = told.first().expect("ours again").0;
        assert!(begins - ended >= SECOND && begins - ended <= 5 * SECOND, "{begins} after {ended}");
        assert_eq!(told_by(&world).as_deref(), Some("synthesized"));
    }
}

/// What is asked of the autopilot: what the state is made of, only while it is made, and only what does not come.
#[test]
#[rustfmt::skip]
fn what_the_state_is_made_of_is_asked_for_only_while_it_is_made() {
    // A station has stopped everything that is streamed but the heartbeat.
    let silent = |world: &mut World, places: Places| {
        for id in [30, 31, 32, 33, 83, 193, 230, 245] {
            world.send(places.ground, GCS, &set_interval(AUTOPILOT, id, -1.0));
        }
        world.forget();
    };
    for (autopilot, behaviour, expected) in [
        (Autopilot::Px4, StateForGimbals::Told, vec![(30, 100_000.0), (33, 200_000.0)]),
        (Autopilot::Px4, StateForGimbals::Denied, vec![
            (286, 40_000.0), (31, 20_000.0), (33, 200_000.0), (32, 100_000.0), (245, 1e6), (230, 1e6), (83, 100_000.0),
        ]),
        (Autopilot::ArduPilot, StateForGimbals::Denied, vec![
            (286, 40_000.0), (31, 20_000.0), (33, 200_000.0), (32, 100_000.0), (245, 1e6), (193, 1e6), (83, 100_000.0),
        ]),
    ] {
        let (mut world, places) = flight(three_links(), vehicle(autopilot, behaviour));
        world.run_for(SECOND / 2);
        silent(&mut world, places);

        world.run_for(20 * SECOND);

        let mut asked = requests(&world.take(places.autopilot));
        asked.sort_by(|one, other| one.partial_cmp(other).expect("numbers"));
        asked.dedup();
        // PX4 tells gimbals unasked, and then has an attitude.
        let mut expected: Vec<(u32, f32)> =
            expected.into_iter().filter(|(id, _)| behaviour != StateForGimbals::Told || *id != 30).collect();
        expected.sort_by(|one, other| one.partial_cmp(other).expect("numbers"));
        assert_eq!(asked, expected, "{autopilot:?} {behaviour:?}");
        if behaviour == StateForGimbals::Denied {
            let told = states(&mut world, places.gimbal);
            let (at, _, state) = told.last().expect("it is made of what was asked for");
            assert_truth(autopilot, *at, state);
        }
    }
}

/// An attitude that comes too seldom is asked for more often, and until it comes turned on to 20 a second.
#[test]
fn a_slow_attitude_is_asked_for_faster_and_turned_on_meanwhile() {
    for (slow, stopped) in [(30, 31), (31, 30)] {
        let (mut world, places) = flight(three_links(), vehicle(Autopilot::Px4, StateForGimbals::Denied));
        world.run_for(SECOND / 2);
        world.send(places.ground, GCS, &set_interval(AUTOPILOT, stopped, -1.0));
        world.send(places.ground, GCS, &set_interval(AUTOPILOT, slow, 200_000.0));
        world.forget();
        let mut told = Vec::new();
        while !requests(&world.take(places.autopilot)).contains(&(31, 20_000.0)) {
            assert!(world.now < Timestamp::from_secs(20), "it is never asked for");
            world.run_for(Duration::from_millis(10));
            told.extend(states(&mut world, places.gimbal));
        }
        world.forget();
        world.run_for(2 * SECOND);

        let fast = states(&mut world, places.gimbal);
        assert_near(fast.len() as f64, 100.0, 3.0);
        for (at, _, state) in &told {
            assert_truth(Autopilot::Px4, *at, state);
        }
        assert!(told.windows(2).all(|pair| pair[1].0 - pair[0].0 <= Duration::from_millis(50)));
    }
}

/// Who goes on sending it slowly is asked three times, and is told what there is.
#[test]
fn an_attitude_that_stays_slow_is_not_asked_for_for_ever() {
    let (mut world, places) = World::empty(three_links());
    let attitude = |yaw: f32| {
        MavMessage::ATTITUDE(ATTITUDE_DATA {
            yaw,
            time_boot_ms: 0,
            roll: 0.0,
            pitch: 0.0,
            rollspeed: 0.0,
            pitchspeed: 0.0,
            yawspeed: 0.0,
        })
    };
    let peers = [
        (SECOND, places.autopilot, AUTOPILOT, crate::support::script::px4_heartbeat()),
        (SECOND, places.gimbal, MavId::new(1, 154), crate::support::script::gimbal_heartbeat()),
        (SECOND / 5, places.autopilot, AUTOPILOT, attitude(0.5)),
    ];
    world.run_with(60 * SECOND, &peers);
    let asked = requests(&world.take(places.autopilot));
    // It answers nothing: each request is sent three times.
    assert!(asked.iter().filter(|request| **request == (30, 20_000.0)).count() <= 9, "{asked:?}");
    assert!(asked.contains(&(30, 20_000.0)), "the quaternion does not come, so the angles are asked for: {asked:?}");

    world.forget();
    world.run_with(SECOND, &peers);

    let told = states(&mut world, places.gimbal);
    assert_near(told.len() as f64, 20.0, 5.0);
    assert!(requests(&world.take(places.autopilot)).iter().all(|(id, _)| *id != 30));
}

/// "with rates fit for the link": towards the autopilot an attitude takes an eighth of a serial line at most, and towards
/// the gimbal the state a quarter, but for 20 a second.
#[test]
fn a_slow_line_is_asked_for_less_and_told_less() {
    for (baud, attitude_us, interval_ms) in
        [(921_600, 20_000, 20.0), (115_200, 30_555, 24.0), (57_600, 61_111, 48.0), (38_400, 91_666, 50.0)]
    {
        let serial = |name: &str, role| link(name, role, Transport::Serial { baud });
        let ground = link("ground", Role::Ground, Transport::Datagrams);
        let links = vec![serial("autopilot", Role::Autopilot), serial("gimbal", Role::Gimbal), ground];
        let settings = Settings { links, ..three_links() };
        let (mut world, places) = flight(settings, vehicle(Autopilot::Px4, StateForGimbals::Denied));
        world.run_for(SECOND / 2);
        for id in [30, 31] {
            world.send(places.ground, GCS, &set_interval(AUTOPILOT, id, -1.0));
        }
        world.forget();

        world.run_for(20 * SECOND);

        let asked = requests(&world.take(places.autopilot));
        let attitude = asked.iter().find(|(id, _)| *id == 31).expect("an attitude is asked for").1;
        assert_near(f64::from(attitude), f64::from(attitude_us), 1.0);
        let told = states(&mut world, places.gimbal);
        let told: Vec<Timestamp> =
            told.iter().map(|(at, _, _)| *at).filter(|at| *at > Timestamp::from_secs(15)).collect();
        let mean_ms = (*told.last().expect("it is told") - told[0]).as_secs_f64() * 1e3 / (told.len() - 1) as f64;
        assert!(mean_ms >= interval_ms - 0.5 && mean_ms <= 50.5, "{baud}: {mean_ms} ms");
    }
}

/// "One stream per channel that has a managed gimbal of ours which isn't behind the autopilot's link (two gimbals on one
/// link: one stream)".
#[test]
#[rustfmt::skip]
fn each_link_with_gimbals_is_told_once() {
    // By place: the components of the gimbals, and who tells them.
    for (gimbals, expected) in [
        (vec![(1, 154), (3, 171)], vec![(1, 191), (3, 192)]),
        (vec![(1, 154)],           vec![(1, 191)]),
        (vec![(2, 171)],           vec![(2, 192)]),
        (vec![(2, 171), (3, 154)], vec![(2, 192), (3, 191)]),
    ] {
        let mut settings = three_links();
        settings.links.push(link("second", Role::Gimbal, Transport::Datagrams));
        let (mut world, places) = World::new(settings);
        world.install(places[0], Vehicle::new(Timestamp::ZERO, vehicle(Autopilot::Px4, StateForGimbals::Denied)));
        for (place, component_id) in &gimbals {
            let system_id = SystemId::Fixed(1);
            let device = DeviceSettings { component_id: *component_id, system_id, ..DeviceSettings::default() };
            world.install(places[*place], Device::new(Timestamp::ZERO, device));
        }

        world.run_for(10 * SECOND);

        let mut told = Vec::new();
        for (at, place) in places.iter().enumerate() {
            let sources: BTreeSet<u8> = states(&mut world, *place).iter().map(|(_, source, _)| source.component).collect();
            told.extend(sources.into_iter().map(|component| (at, component)));
        }
        assert_eq!(told, expected, "{gimbals:?}");
    }
}

/// Two gimbals on one link hear one stream, which is for the whole system.
#[test]
fn two_gimbals_on_one_link_hear_one_stream() {
    let (mut world, places) = flight(three_links(), vehicle(Autopilot::Px4, StateForGimbals::Denied));
    let second = crate::support::script::gimbal_heartbeat();
    let second = [(SECOND, places.gimbal, MavId::new(1, 171), second)];
    world.run_with(10 * SECOND, &second);
    world.forget();
    assert_eq!(world.snapshot().gimbals.len(), 2);

    world.run_with(SECOND, &second);

    let told = states(&mut world, places.gimbal);
    assert!(told.len() <= 51, "{}", told.len());
    assert_eq!(told.iter().map(|(_, source, _)| *source).collect::<BTreeSet<_>>(), BTreeSet::from([MANAGER]));
}

/// A gimbal behind the autopilot's link hears the autopilot itself.
#[test]
fn a_gimbal_behind_the_autopilot_is_told_nothing() {
    let (mut world, places) = World::empty(three_links());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, vehicle(Autopilot::Px4, StateForGimbals::Denied)));
    let gimbal = [(SECOND, places.autopilot, MavId::new(1, 154), crate::support::script::gimbal_heartbeat())];

    world.run_with(20 * SECOND, &gimbal);

    assert_eq!(world.snapshot().gimbals[0].state, "alive");
    let heard = world.take(places.autopilot);
    assert!(heard.iter().all(|arrival| arrival.id() != STATE));
    assert!(requests(&heard).iter().all(|(id, _)| *id != STATE), "nor is it asked for");
}

/// "gimbal lost": it is told nothing, and again when it is back.
#[test]
fn a_gimbal_that_is_lost_is_told_nothing() {
    let (mut world, places) = flight(three_links(), vehicle(Autopilot::Px4, StateForGimbals::Denied));
    world.run_for(10 * SECOND);
    world.unplug(places.gimbal);
    world.forget();
    world.run_for(5 * SECOND);
    assert_eq!(states(&mut world, places.gimbal), []);
    assert_eq!(told_by(&world), None);

    world.plug_in(places.gimbal);
    let back = world.now;
    world.run_for(3 * SECOND);

    let told = states(&mut world, places.gimbal);
    assert!(told.first().is_some_and(|(at, _, _)| *at - back <= 2 * SECOND), "{:?}", told.first());

    // Nor is one that only falls silent.
    world.send(places.ground, GCS, &set_interval(MavId::new(1, 154), 285, -1.0));
    let (mut world, places) = World::empty(three_links());
    world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, vehicle(Autopilot::Px4, StateForGimbals::Denied)));
    world.run_with(
        10 * SECOND,
        &[(SECOND, places.gimbal, MavId::new(1, 154), crate::support::script::gimbal_heartbeat())],
    );
    world.run_for(SECOND * 5 / 2);
    world.forget();
    world.run_for(5 * SECOND);
    assert_eq!(states(&mut world, places.gimbal), []);
}

/// "autopilot lost, attitude stale": an attitude is told for a second, and turned on for a quarter of it.
#[test]
fn an_old_attitude_is_not_told() {
    let (mut world, places) = flight(three_links(), vehicle(Autopilot::Px4, StateForGimbals::Denied));
    world.run_for(10 * SECOND);
    let last_heard = world.now;
    world.unplug(places.autopilot);
    world.forget();

    world.run_for(10 * SECOND);

    let told = states(&mut world, places.gimbal);
    let (at, _, last) = told.last().expect("it is told for a while");
    assert!(*at - last_heard <= SECOND && *at - last_heard >= SECOND * 9 / 10, "{at}");
    assert_near(f64::from(last.q_estimated_delay_us), (*at - last_heard).as_micros() as f64 - 250_000.0, 45_000.0);
    assert!(told.windows(2).all(|pair| pair[1].0 - pair[0].0 == Duration::from_millis(50)));
    let snapshot = world.snapshot();
    assert_eq!(
        (snapshot.vehicle.state_for_gimbal, snapshot.vehicle.stale),
        (None, vec!["heading".to_owned(), "position".to_owned()])
    );

    world.plug_in(places.autopilot);
    let back = world.now;
    world.run_for(SECOND);
    let told = states(&mut world, places.gimbal);
    assert!(told.first().is_some_and(|(at, _, _)| *at - back <= Duration::from_millis(50)), "it goes on at once");
}

/// "clock wraps handled … time_boot_us: the autopilot's time base, monotonic, unwrapped": over 49.7 days of milliseconds,
/// 71.6 minutes of microseconds, and a restart in flight.
#[test]
fn the_time_told_goes_on_over_wraps_and_starts_anew_with_the_autopilot() {
    for (autopilot, wrap_us) in [(Autopilot::ArduPilot, 1_u64 << 32), (Autopilot::Px4, (1 << 32) * 1_000)] {
        let uptime = Duration::from_micros(wrap_us) - 10 * SECOND;
        let settings = VehicleSettings { uptime, ..vehicle(autopilot, StateForGimbals::Denied) };
        let (mut world, places) = flight(three_links(), settings);

        world.run_for(20 * SECOND);

        let told = states(&mut world, places.gimbal);
        assert!(told.first().is_some_and(|(_, _, state)| state.time_boot_us < wrap_us));
        assert!(told.last().is_some_and(|(_, _, state)| state.time_boot_us > wrap_us));
        for (at, _, state) in &told {
            let clock_us = uptime.as_micros() as u64 + at.as_micros();
            assert!(state.time_boot_us.abs_diff(clock_us) <= 1_000, "{} at {at}", state.time_boot_us);
            assert!((1..=1_000).contains(&state.q_estimated_delay_us), "{state:?}");
        }
        assert!(told.windows(2).all(|pair| pair[1].2.time_boot_us > pair[0].2.time_boot_us));

        world.reboot(places.autopilot);
        let rebooted = world.now;
        world.run_for(5 * SECOND);
        let told = states(&mut world, places.gimbal);
        assert!(told.iter().all(|(_, source, _)| *source == MANAGER), "it is made all the while");
        let anew: Vec<_> = told.iter().skip_while(|(_, _, state)| state.time_boot_us > wrap_us).collect();
        assert!(anew.first().is_some_and(|(at, _, _)| *at - rebooted <= Duration::from_millis(100)));
        for (at, _, state) in anew {
            assert!(
                state.time_boot_us.abs_diff((*at - rebooted).as_micros() as u64) <= 1_000,
                "{} at {at}",
                state.time_boot_us
            );
        }
    }
}

/// What our first manager asked of the autopilot: message id and interval in microseconds.
fn requests(arrivals: &[Arrival]) -> Vec<(u32, f32)> {
    let commands = arrivals.iter().filter(|arrival| arrival.source() == MANAGER && arrival.id() == 76);
    let commands = commands.map(Arrival::decode::<COMMAND_LONG_DATA>).filter(|command| command.command == 511);
    commands.map(|command| (command.param1 as u32, command.param2)).collect()
}
