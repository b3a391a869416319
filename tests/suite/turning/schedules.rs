//! Whatever happens in whatever order.

use gimbald::bridge::Input;
use proptest::prelude::*;

use super::*;

/// What happens next.
#[derive(Clone, Copy, Debug)]
enum Step {
    Turn,
    Stop,
    Point,
    Release,
    /// Nobody says anything for so many tenths of a second.
    Wait(u32),
    Cut,
    Mend,
    Unplug,
    PlugIn,
    Kill,
    /// Asked to end, and ended in its own time.
    End,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => Just(Step::Turn),
        1 => Just(Step::Stop),
        1 => Just(Step::Point),
        1 => Just(Step::Release),
        4 => (1_u32..90).prop_map(Step::Wait),
        2 => Just(Step::Cut),
        2 => Just(Step::Mend),
        1 => Just(Step::Unplug),
        1 => Just(Step::PlugIn),
        1 => Just(Step::Kill),
        1 => Just(Step::End),
    ]
}

impl Flight {
    fn start_again(&mut self) {
        self.world.kill();
        self.run_for(SECOND / 2);
        let left_turning = self.world.stored_turning.clone();
        self.world.start(Settings { left_turning, ..three_links() });
    }

    fn take(&mut self, step: Step, is_plugged_in: &mut bool) {
        let ground = self.places.ground;
        match step {
            Step::Turn => self.turn_for(SECOND),
            Step::Stop => {
                self.world.send(ground, GCS, &command_long(MANAGER, 1000, &[NAN, NAN, 0.0, 0.0, 44.0]));
            }
            Step::Point => {
                self.world.send(ground, GCS, &command_long(MANAGER, 1000, &[-5.0, 9.0, NAN, NAN, 44.0]));
            }
            Step::Release => {
                self.world.send(ground, GCS, &command_long(MANAGER, 1001, &[-3.0, -3.0, -3.0, -3.0]));
            }
            Step::Wait(tenths) => self.run_for(tenths * SECOND / 10),
            Step::Cut => self.cable.cut(),
            Step::Mend => self.cable.mend(),
            Step::Unplug if *is_plugged_in => {
                *is_plugged_in = false;
                self.world.unplug(self.places.gimbal);
            }
            Step::PlugIn if !*is_plugged_in => {
                *is_plugged_in = true;
                self.world.plug_in(self.places.gimbal);
            }
            Step::Unplug | Step::PlugIn => {}
            Step::Kill => self.start_again(),
            Step::End => {
                self.world.input(Input::Shutdown);
                self.run_for(SECOND);
                self.start_again();
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(30))]

    /// Twenty seconds after nobody asks for anything any more and the gimbal can be reached it is at rest, and nobody is
    /// remembered as turning: rates end, links come back, the daemon was killed, in whatever order.
    #[test]
    fn a_gimbal_that_can_be_reached_is_at_rest_soon(
        kind in prop_oneof![Just(Kind::V2Device), Just(Kind::GremsyV1), Just(Kind::GremsyV2)],
        about in prop_oneof![Just(About::Roll), Just(About::Pitch), Just(About::Yaw)],
        steps in proptest::collection::vec(step(), 1..14),
    ) {
        let mut flight = Flight::begin(kind);
        flight.turn(about, &format!("{kind:?}"));
        let mut is_plugged_in = true;
        for step in &steps {
            flight.take(*step, &mut is_plugged_in);
        }
        flight.cable.mend();
        flight.take(Step::PlugIn, &mut is_plugged_in);
        flight.run_for(20 * SECOND);
        flight.assert_rests(&format!("{kind:?} about {about:?} {steps:?}"));
        prop_assert_eq!(&flight.world.stored_turning, &Vec::<String>::new());
    }
}
