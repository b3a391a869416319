//! Whatever is asked of a gimbal over HTTP, in whatever order, among what others do.

use std::time::Duration;

use gimbald::actions::{ACTIONS, Action, Kind};
use gimbald::bridge::Input;
use gimbald::gimbals::mavlink_v2::sim::{Device, DeviceSettings};
use gimbald::gimbals::operation::{Operation, OperationId};
use gimbald::manager::asked::{Asked, NotDone};
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;
use proptest::prelude::*;
use serde_json::{Map, Value, json};

use crate::support::script::{configure, take_control};
use crate::support::world::{GCS, World, three_links};

const SECOND: Duration = Duration::from_secs(1);

/// What happens next, after some time.
#[derive(Clone, Debug)]
enum Happening {
    Asked(&'static Action, Option<String>, String),
    StationTakes,
    StationReleases,
    GimbalUnplugged,
    GimbalPluggedIn,
}

fn value(kind: Kind) -> BoxedStrategy<Value> {
    match kind {
        Kind::Number { min, max } => (min..=max).prop_map(Value::from).boxed(),
        Kind::Word(words) => proptest::sample::select(words).prop_map(Value::from).boxed(),
        Kind::WholeOrWord { min, max, .. } => (min..=max).prop_map(Value::from).boxed(),
        Kind::Flag => any::<bool>().prop_map(Value::from).boxed(),
        Kind::Name { .. } => Just(json!("PWR_PAN")).boxed(),
    }
}

fn order() -> impl Strategy<Value = Happening> {
    proptest::sample::select(ACTIONS.iter().collect::<Vec<_>>()).prop_flat_map(|action| {
        let fields: Vec<_> = action
            .fields
            .iter()
            .map(|field| {
                let given = if field.required { Just(true).boxed() } else { any::<bool>().boxed() };
                (Just(field.name), given, value(field.kind))
            })
            .collect();
        (fields, any::<bool>()).prop_map(move |(fields, confirms)| {
            let in_path = action.path_field().map(|field| field.name);
            let mut body = Map::new();
            let mut path = None;
            for (name, _, value) in fields.into_iter().filter(|(_, given, _)| *given) {
                if in_path == Some(name) {
                    path = value.as_str().map(str::to_owned);
                } else {
                    body.insert(name.to_owned(), value);
                }
            }
            if let Some(word) = action.word().filter(|_| confirms) {
                body.insert("confirm".to_owned(), word.into());
            }
            Happening::Asked(action, path, Value::Object(body).to_string())
        })
    })
}

/// Whether the gimbal itself has to do something first: its parameters are read and told back.
fn waits_for_gimbal(asked: &Asked) -> bool {
    matches!(asked, Asked::Operation(Operation::RefreshParameters | Operation::SetParameter { .. }))
}

fn happening() -> impl Strategy<Value = (u64, Happening)> {
    let pause = prop_oneof![4 => 0_u64..300, 2 => 300_u64..3_000, 1 => 9_000_u64..12_000];
    let happening = prop_oneof![
        12 => order(),
        1 => Just(Happening::StationTakes),
        1 => Just(Happening::StationReleases),
        1 => Just(Happening::GimbalUnplugged),
        2 => Just(Happening::GimbalPluggedIn),
    ];
    (pause, happening)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// "Each is answered by exactly one", at once or in time; nothing moves for who is not in control; and "a gimbal that turns
    /// after its operator is gone is our worst bug": ten seconds after the last word nothing turns, and nobody is in control.
    #[test]
    fn whatever_is_asked_is_answered_and_nothing_turns_on(happenings in proptest::collection::vec(happening(), 1..40)) {
        let (mut world, places) = World::empty(three_links());
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        world.install(places.gimbal, Device::new(Timestamp::ZERO, DeviceSettings::default()));
        world.run_for(3 * SECOND);
        let mut is_plugged_in = true;
        let mut asked_ids = Vec::new();
        for (after_ms, happening) in happenings {
            world.run_for(Duration::from_millis(after_ms));
            match happening {
                Happening::Asked(action, path, body) => {
                    let Ok(asked) = action.read(path.as_deref(), body.as_bytes()) else { continue };
                    let primary = world.snapshot().gimbals[0].primary.clone();
                    let id = OperationId(asked_ids.len() as u64);
                    asked_ids.push(id);
                    world.forget();
                    world.input(Input::Asked { id, gimbal: "gimbal-154", asked: &asked });
                    let answer = world.answers.last().filter(|(answered, _)| *answered == id);
                    let Some((_, answer)) = answer else {
                        prop_assert!(waits_for_gimbal(&asked), "{:?} is answered at once", asked);
                        continue;
                    };
                    let is_steering = !matches!(asked, Asked::TakeControl | Asked::ReleaseControl | Asked::Operation(_));
                    if is_steering && primary.is_some_and(|primary| primary != "http") {
                        prop_assert!(matches!(answer, Err(NotDone::Refused { holder: Some(GCS), .. })), "{:?}", answer);
                        let moved = world.arrivals(places.gimbal).iter().any(|arrival| arrival.id() == 284);
                        prop_assert!(!moved, "who is refused moves nothing");
                    }
                }
                Happening::StationTakes => drop(world.send(places.ground, GCS, &take_control())),
                Happening::StationReleases => {
                    drop(world.send(places.ground, GCS, &configure([-3.0, -3.0], [-3.0, -3.0])));
                }
                Happening::GimbalUnplugged if is_plugged_in => {
                    is_plugged_in = false;
                    world.unplug(places.gimbal);
                }
                Happening::GimbalPluggedIn if !is_plugged_in => {
                    is_plugged_in = true;
                    world.plug_in(places.gimbal);
                }
                Happening::GimbalUnplugged | Happening::GimbalPluggedIn => {}
            }
        }
        world.run_for(10 * SECOND);
        world.forget();
        world.run_for(5 * SECOND);
        prop_assert_eq!(world.snapshot().gimbals[0].primary.clone(), None);
        for arrival in world.arrivals(places.gimbal).iter().filter(|arrival| arrival.id() == 284) {
            let told: GIMBAL_DEVICE_SET_ATTITUDE_DATA = arrival.decode();
            let rates = [told.angular_velocity_x, told.angular_velocity_y, told.angular_velocity_z];
            prop_assert!(rates.iter().all(|rate| rate.is_nan() || *rate == 0.0), "it is told to turn: {:?}", told);
        }

        // What is not answered in 20 s never is.
        world.run_for(5 * SECOND);
        let mut answered: Vec<OperationId> = world.answers.iter().map(|(id, _)| *id).collect();
        answered.sort();
        prop_assert_eq!(answered, asked_ids);
    }

    /// A body is a stranger's: whatever it is, it is read or refused, in few words.
    #[test]
    fn any_body_is_read_or_refused(at in 0..ACTIONS.len(), path in ".{0,20}", body in proptest::collection::vec(any::<u8>(), 0..200)) {
        if let Err(wrong) = ACTIONS[at].read(Some(&path), &body) {
            prop_assert!(wrong.to_string().len() < 1_000, "{}", wrong);
        }
    }
}
