//! The daemon is killed while it turns, and what it left behind is read by the next.

use gimbald::bridge::settings::SystemId;
use gimbald::gimbals::gremsy::config::GremsySettings;
use gimbald::gimbals::gremsy::driver::Generation;
use gimbald::gimbals::operation::Operation;
use gimbald::gimbals::settings::{Family, GimbalSettings};
use gimbald::manager::asked::Asked;
use gimbald::wire::dialect::COMMAND_LONG_DATA;

use super::*;
use crate::support::script::{of, px4_heartbeat};

/// `camera` has an entry that names no device; the other one, on a channel of its own on the same link, has none.
struct Two {
    flight: Flight,
    other: Gimbal,
    other_cable: Cable,
    other_place: Place,
    settings: Settings,
}

impl Two {
    /// Both can be steered.
    fn begin(kind: Kind) -> Self {
        let settings = Settings { gimbals: vec![GimbalSettings::found("camera".to_owned())], ..three_links() };
        let mut flight = Flight::begin_with(kind, settings.clone());
        let place = flight.world.open(1);
        let (other, other_cable) = Gimbal::install(&mut flight.world, place, kind, 171);
        flight.run_for(22 * SECOND);
        Self { flight, other, other_cable, other_place: place, settings }
    }

    fn turn(&mut self, manager: u8) {
        let command = command_long(MavId::new(1, manager), 1000, &[NAN, NAN, 0.0, 5.0, 44.0, 0.0, 0.0]);
        let (places, world) = (self.flight.places, &mut self.flight.world);
        assert_eq!(world.result_of(places.ground, GCS, &command), Some(ACCEPTED));
    }

    /// The daemon is killed, and started again half a second later.
    fn kill_and_start(&mut self) {
        self.flight.world.kill();
        self.flight.run_for(SECOND / 2);
        let left_turning = self.flight.world.stored_turning.clone();
        self.flight.world.start(Settings { left_turning, ..self.settings.clone() });
    }
}

/// "The next start tells them to stop at the first sign of them": the device that turned, whatever it is called now; who
/// has its name now is told nothing (D9: "Nothing is sent before the first accepted demand").
#[test]
fn the_device_that_turned_is_stopped_whatever_it_is_called_now() {
    for kind in KINDS {
        let mut two = Two::begin(kind);
        two.turn(191);
        two.flight.run_for(2 * SECOND);
        assert_eq!(two.flight.world.stored_turning.len(), 1, "{kind:?}");
        two.flight.cable.cut();
        two.kill_and_start();
        two.flight.run_for(3 * SECOND);
        two.flight.cable.mend();
        two.flight.run_for(8 * SECOND);

        let gimbals = two.flight.world.snapshot().gimbals;
        let named = |name: &str| gimbals.iter().find(|gimbal| gimbal.name == name).cloned().expect("it is there");
        assert_eq!(named("camera").device.as_deref(), Some("1/171"), "{kind:?}");
        assert_eq!(named("camera").setpoint, None, "{kind:?}: nobody has asked for anything");
        two.flight.assert_rests(&format!("{kind:?}"));
        two.flight.run_for(10 * SECOND);
        assert_eq!(two.flight.world.stored_turning, Vec::<String>::new(), "{kind:?}");
    }
}

/// A gimbal that listens to its system alone is stopped under that id, also where the autopilot has another one by now.
#[test]
fn it_is_stopped_under_the_system_that_told_it_to_turn() {
    for kind in KINDS {
        let mut flight = Flight::turning_with(kind, Settings { system_id: SystemId::Auto, ..three_links() });
        assert_eq!(flight.world.snapshot().system_id, Some(1), "{kind:?}");
        flight.world.kill();
        let left_turning = flight.world.stored_turning.clone();
        flight.world.remove(flight.places.autopilot);
        flight.world.start(Settings { left_turning, system_id: SystemId::Auto, ..three_links() });
        let changed = (SECOND, flight.places.autopilot, MavId::new(2, 1), px4_heartbeat());
        let ground = (SECOND, flight.places.ground, GCS, ground_heartbeat());
        flight.world.run_with(15 * SECOND, &[changed, ground]);
        assert_eq!(flight.world.snapshot().system_id, Some(2), "{kind:?}");
        flight.assert_rests(&format!("{kind:?}"));
        assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{kind:?}");
    }
}

/// And who has its name now, when the device that turned is not heard: it may be that one under another id.
#[test]
fn one_that_has_another_id_at_the_next_start_is_stopped() {
    for kind in KINDS {
        for id in [MavId::new(1, 171), MavId::new(7, 154)] {
            let settings = Settings { gimbals: vec![GimbalSettings::found("camera".to_owned())], ..three_links() };
            let mut flight = Flight::turning_with(kind, settings.clone());
            flight.world.kill();
            flight.cable.rename(id);
            flight.run_for(SECOND / 2);
            let left_turning = flight.world.stored_turning.clone();
            flight.world.start(Settings { left_turning, ..settings });
            flight.run_for(20 * SECOND);
            flight.assert_rests(&format!("{kind:?} {id}"));
        }
    }
}

/// "Kept until they have been told to stop": also one that was not heard in the life between, however that ended.
#[test]
fn who_is_waited_for_is_kept_for_the_next_start_too() {
    for kind in KINDS {
        for by_signal in [false, true] {
            let what = format!("{kind:?}, by signal {by_signal}");
            let mut two = Two::begin(kind);
            two.turn(191);
            two.turn(192);
            two.flight.run_for(2 * SECOND);
            assert_eq!(two.flight.world.stored_turning.len(), 2, "{what}");
            two.other_cable.cut();
            two.kill_and_start();
            two.flight.run_for(20 * SECOND);
            two.flight.assert_rests(&what);
            let family = if kind == Kind::V2Device { "" } else { "\tgremsy" };
            let waited_for = format!("gimbal-171\t1/171{family}");
            assert_eq!(two.flight.world.stored_turning, std::slice::from_ref(&waited_for), "{what}");
            // One that turns now comes last, where a start that finds too many lines looks first.
            two.turn(191);
            two.flight.run_for(SECOND);
            let turning = format!("camera\t1/154{family}");
            assert_eq!(two.flight.world.stored_turning, [waited_for, turning], "{what}");

            if by_signal {
                two.flight.world.input(gimbald::bridge::Input::Shutdown);
                two.flight.world.run_for(SECOND);
            }
            two.kill_and_start();
            two.other_cable.mend();
            two.flight.run_for(8 * SECOND);
            let other = two.other.clone();
            super::assert_rests(&mut two.flight, &other, &what);
            two.flight.run_for(10 * SECOND);
            assert_eq!(two.flight.world.stored_turning, Vec::<String>::new(), "{what}");
        }
    }
}

/// "The next start tells them to stop at the first sign of them": in the words of the family that was configured, also where
/// no entry names it any more, without finding out first what it speaks.
#[test]
fn a_family_that_was_configured_is_kept_for_the_next_start() {
    for kind in [Kind::GremsyV1, Kind::GremsyV2, Kind::OldGremsy] {
        let camera = GimbalSettings { family: Family::Gremsy, ..GimbalSettings::found("camera".to_owned()) };
        let mut flight = Flight::turning_with(kind, Settings { gimbals: vec![camera], ..three_links() });
        assert_eq!(flight.world.stored_turning, ["camera\t1/154\tgremsy"], "{kind:?}");
        flight.world.kill();
        flight.run_for(SECOND / 2);
        let left_turning = flight.world.stored_turning.clone();
        flight.world.start(Settings { left_turning, ..three_links() });
        flight.run_for(SECOND);
        flight.assert_rests(&format!("{kind:?}"));
        flight.run_for(20 * SECOND);
        assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{kind:?}");
    }
}

/// "A v1 Gremsy has to acknowledge a stop … A Gremsy that speaks v2 … is told on while it tells that it turns": also one whose
/// generation is configured, so that it can be spoken to at once. Until then it is kept for the start after this one.
#[test]
fn one_of_a_known_generation_has_to_show_that_it_has_stopped() {
    for (kind, generation) in [(Kind::GremsyV1, Generation::V1), (Kind::GremsyV2, Generation::V2)] {
        let camera = GimbalSettings { family: Family::Gremsy, ..GimbalSettings::found("camera".to_owned()) };
        let gremsy = GremsySettings { generation: Some(generation), ..camera.gremsy };
        let settings = Settings { gimbals: vec![GimbalSettings { gremsy, ..camera }], ..three_links() };
        let mut flight = Flight::turning_with(kind, settings.clone());
        let kept = ["camera\t1/154\tgremsy"];
        assert_eq!(flight.world.stored_turning, kept, "{kind:?}");
        flight.cable.cut_towards_gimbal();
        for _ in 0..2 {
            flight.world.kill();
            let left_turning = flight.world.stored_turning.clone();
            flight.world.start(Settings { left_turning, ..settings.clone() });
            flight.run_for(30 * SECOND);
            assert_eq!(flight.world.stored_turning, kept, "{kind:?}: it turns, as it says");
        }
        flight.cable.mend();
        // It may swing back to where it looked when it was to stop.
        flight.run_for(15 * SECOND);
        flight.assert_rests(&format!("{kind:?}"));
        assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{kind:?}");
    }
}

/// "Whoever has that name is stopped after five seconds, unless somebody steers it": the pilot does, to whose radio control it
/// was left. One that speaks v2 does not tell so itself.
#[test]
fn one_in_the_hands_of_its_radio_control_is_not_stopped_for_another() {
    for kind in [Kind::GremsyV1, Kind::GremsyV2] {
        let mut two = Two::begin(kind);
        two.turn(191);
        two.flight.run_for(2 * SECOND);
        two.flight.cable.cut();
        two.kill_and_start();
        let started = two.flight.world.now;
        let asked = Asked::Operation(Operation::RadioControl);
        let mut handed_over = None;
        while handed_over.is_none() && two.flight.world.now.since(started) < 5 * SECOND {
            two.flight.run_for(SECOND / 10);
            let id = two.flight.world.ask_by_name("camera", &asked);
            two.flight.run_for(SECOND / 10);
            handed_over = two.flight.world.answers.contains(&(id, Ok(()))).then_some(two.flight.world.now);
        }
        assert!(handed_over.is_some(), "{kind:?}: {:?}", two.flight.world.answers);
        two.flight.world.forget();
        two.flight.run_for(15 * SECOND);
        let gimbals = two.flight.world.snapshot().gimbals;
        let camera = gimbals.iter().find(|gimbal| gimbal.name == "camera").expect("it is there");
        assert_eq!((camera.device.as_deref(), &camera.setpoint), (Some("1/171"), &None), "{kind:?}");
        let heard = two.flight.world.take(two.other_place);
        let commands: Vec<COMMAND_LONG_DATA> = of(&heard);
        assert!(commands.iter().all(|told| ![204, 205].contains(&told.command)), "{kind:?}: {commands:?}");
        assert!(heard.iter().all(|arrival| arrival.id() != 284), "{kind:?}");
    }
}

/// A file of an older version has names alone, and what is no such line does no harm.
#[test]
fn names_alone_are_read_as_well() {
    for kind in KINDS {
        for lines in [&["gimbal-154"][..], &["", "\t", "\u{1}\t1/1\t", "gimbal-154\tof old"]] {
            let mut flight = Flight::begin(kind);
            assert_eq!(flight.rate_command(5.0), Some(ACCEPTED));
            flight.run_for(2 * SECOND);
            flight.world.kill();
            let left_turning = lines.iter().map(|line| (*line).to_owned()).collect();
            flight.world.start(Settings { left_turning, ..three_links() });
            flight.run_for(8 * SECOND);
            flight.assert_rests(&format!("{kind:?} {lines:?}"));
        }
    }
}
