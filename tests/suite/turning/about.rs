//! It turns about roll or pitch.

use super::*;

/// What becomes of a rotation while nobody wants it any more.
#[derive(Clone, Copy, Debug)]
enum Way {
    NotRepeated,
    /// A stop is accepted while its cable is away.
    Away,
    Unplugged,
    Killed,
    /// It has another id.
    Renamed,
}

const WAYS: [Way; 5] = [Way::NotRepeated, Way::Away, Way::Unplugged, Way::Killed, Way::Renamed];

impl Flight {
    /// Level, to the nose.
    fn go_back(&mut self, what: &str) {
        let command = command_long(MANAGER, 1000, &[0.0, 0.0, NAN, NAN, 44.0, 0.0, 0.0]);
        assert_eq!(self.world.result_of(self.places.ground, GCS, &command), Some(ACCEPTED), "{what}");
        self.run_for(4 * SECOND);
        assert!(self.gimbal.pose_deg().iter().all(|angle| angle.abs() < 1.0), "{what}: {:?}", self.gimbal.pose_deg());
    }

    /// How the rotation ends; the gimbal can be steered again afterwards.
    fn end(&mut self, way: Way) {
        match way {
            Way::NotRepeated => self.run_for(4 * SECOND),
            Way::Away => {
                self.cable.cut();
                assert_eq!(self.rate_command(0.0), Some(ACCEPTED));
                self.run_for(3 * SECOND);
                self.cable.mend();
                self.run_for(3 * SECOND);
            }
            Way::Unplugged => {
                self.world.unplug(self.places.gimbal);
                self.run_for(3 * SECOND);
                self.world.plug_in(self.places.gimbal);
                self.run_for(3 * SECOND);
            }
            Way::Killed => {
                self.world.kill();
                self.run_for(SECOND / 2);
                let left_turning = self.world.stored_turning.clone();
                self.world.start(Settings { left_turning, ..three_links() });
                self.run_for(8 * SECOND);
            }
            Way::Renamed => {
                self.cable.rename(MavId::new(1, 171));
                self.run_for(17 * SECOND);
            }
        }
    }
}

/// "A gimbal that turns after its operator is gone is our worst bug", whatever it turns about.
#[test]
fn whatever_it_turns_about_it_is_stopped() {
    for kind in KINDS {
        for about in [About::Roll, About::Pitch] {
            let mut flight = Flight::begin(kind);
            for way in WAYS {
                let what = format!("{kind:?} about {about:?}, {way:?}");
                flight.go_back(&what);
                flight.turn(about, &what);
                flight.end(way);
                flight.assert_rests(&what);
                flight.run_for(14 * SECOND);
                assert_eq!(flight.world.stored_turning, Vec::<String>::new(), "{what}");
            }
        }
    }
}
