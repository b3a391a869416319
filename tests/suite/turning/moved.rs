//! It is plugged in at another line of gimbals while it turns.

use gimbald::bridge::LinkIndex;
use gimbald::bridge::settings::{Role, Transport};
use gimbald::gimbals::settings::GimbalSettings;
use gimbald::wire::dialect::GIMBAL_DEVICE_SET_ATTITUDE_DATA;

use super::*;
use crate::support::world::link;

const LINK: LinkIndex = 1;
const OTHER_LINK: LinkIndex = 3;

/// Two lines of gimbals, and what the configuration says of the gimbal on the first, if it names one: which link that is on.
fn two_lines(entry: Option<Option<LinkIndex>>) -> Settings {
    let mut settings = three_links();
    settings.links.push(link("other", Role::Gimbal, Transport::Datagrams));
    let camera = |link| GimbalSettings { link, ..GimbalSettings::found("camera".to_owned()) };
    Settings { gimbals: entry.map(camera).into_iter().collect(), ..settings }
}

/// "Whoever has that id is stopped at the first sign of it", wherever that is: also where its entry names another link, so that
/// nobody steers it there.
#[test]
fn a_gimbal_that_is_plugged_in_elsewhere_is_stopped() {
    for kind in KINDS {
        for entry in [None, Some(None), Some(Some(LINK))] {
            for away in [SECOND * 4 / 5, 8 * SECOND] {
                let what = format!("{kind:?}, entry {entry:?}, away for {away:?}");
                let mut flight = Flight::turning_with(kind, two_lines(entry));
                let other = flight.world.open(OTHER_LINK);
                flight.world.remove(flight.places.gimbal);
                flight.run_for(away);
                flight.gimbal.plug_in(&mut flight.world, other, &flight.cable);
                flight.run_for(3 * SECOND);
                flight.assert_rests(&what);
            }
        }
    }
}

/// And two of one id whose lines are swapped while one of them turns: that the other one is heard where the first was stops
/// nothing.
#[test]
fn of_two_that_are_swapped_the_one_that_turns_is_stopped() {
    for kind in KINDS {
        for entry in [None, Some(Some(LINK))] {
            let what = format!("{kind:?}, entry {entry:?}");
            let mut flight = Flight::begin_with(kind, two_lines(entry));
            let other = flight.world.open(OTHER_LINK);
            let (twin, twin_cable) = Gimbal::install(&mut flight.world, other, kind, GIMBAL.component);
            flight.run_for(3 * SECOND);
            flight.turn_for(3 * SECOND);
            assert_eq!(flight.world.stored_turning.len(), 1, "{what}");
            let twin_yaw_deg = twin.yaw_deg();

            for place in [flight.places.gimbal, other] {
                flight.world.remove(place);
            }
            flight.run_for(SECOND * 4 / 5);
            flight.gimbal.plug_in(&mut flight.world, other, &flight.cable);
            twin.plug_in(&mut flight.world, flight.places.gimbal, &twin_cable);
            flight.run_for(4 * SECOND);
            flight.assert_rests(&what);
            assert!((twin.yaw_deg() - twin_yaw_deg).abs() < 0.5, "{what}: the other one is not moved");
            flight.run_for(15 * SECOND);
            assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{what}");
        }
    }
}

/// D9: "Nothing is sent before the first accepted demand": to another one of its id nothing at all, unless it may be the one
/// that turns.
#[test]
fn another_one_of_its_id_is_told_nothing_while_nothing_turns() {
    let mut flight = Flight::begin_with(Kind::V2Device, two_lines(None));
    let other = flight.world.open(OTHER_LINK);
    Gimbal::install(&mut flight.world, other, Kind::V2Device, GIMBAL.component);
    flight.world.send(flight.places.ground, GCS, &command_long(MANAGER, 1000, &[-5.0, 9.0, NAN, NAN, 44.0]));
    flight.run_for(5 * SECOND);
    assert!(!flight.world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(flight.places.gimbal).is_empty());
    assert_eq!(flight.world.take_messages::<GIMBAL_DEVICE_SET_ATTITUDE_DATA>(other), []);
}
