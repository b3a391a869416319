//! What a gimbal says of its family, how often it is asked, and how long that counts.

use gimbald::wire::dialect::CharArray;

use super::*;

/// A scripted gimbal beats once a second and says nothing else.
fn beat(world: &mut World, places: Places, duration: Duration) {
    world.run_with(duration, &[(SECOND, places.gimbal, GIMBAL, gimbal_heartbeat())]);
}

/// How often the gimbal was asked for parameters that only a Gremsy has, both of them each time.
fn questions(world: &mut World, places: Places) -> usize {
    let asked: Vec<PARAM_REQUEST_READ_DATA> = of(&world.take(places.gimbal));
    let names: Vec<&str> = asked.iter().map(|asked| asked.param_id.to_str().expect("a name")).collect();
    assert!(names.chunks(2).all(|pair| pair == ["STIFF_TILT", "PITCH_P"]), "{names:?}");
    names.len() / 2
}

/// "One that gives no sign of being a v2 device is asked for parameters that only a Gremsy has": three times, and every ten
/// seconds once it is taken for a v1 gimbal, also when it was lost and is back.
#[test]
fn a_gimbal_that_answers_nothing_is_asked_a_few_times_whether_it_is_a_gremsy() {
    let (mut world, places) = World::empty(three_links());
    beat(&mut world, places, V1_BY_ITS_SILENCE_AFTER - SECOND);
    assert_eq!((questions(&mut world, places), family(&world).as_str()), (3, "mavlink_v2"));
    beat(&mut world, places, 2 * SECOND);
    assert_eq!((questions(&mut world, places), family(&world).as_str()), (0, "mavlink_v1"));
    beat(&mut world, places, 30 * SECOND);
    assert_eq!(questions(&mut world, places), 3);

    world.run_for(20 * SECOND);
    assert_eq!(world.snapshot().gimbals[0].state, "lost");
    world.forget();
    beat(&mut world, places, 31 * SECOND);
    assert_eq!((questions(&mut world, places), family(&world).as_str()), (3, "mavlink_v1"));
}

/// One that was lost is judged again, "for another may have come in its place": a Gremsy that says so is one still, whether it
/// says it before or after it beats.
#[test]
fn a_gremsy_that_comes_back_and_says_so_once_is_one_for_good() {
    for says_first in [true, false] {
        let (mut world, places) = World::empty(three_links());
        beat(&mut world, places, SECOND);
        world.send(places.gimbal, GIMBAL, &parameter("STIFF_TILT"));
        assert_eq!(family(&world), "gremsy");
        world.run_for(30 * SECOND);
        assert_eq!(world.snapshot().gimbals[0].state, "lost");

        if !says_first {
            beat(&mut world, places, SECOND);
        }
        world.send(places.gimbal, GIMBAL, &parameter("STIFF_TILT"));
        for _ in 0..60 {
            beat(&mut world, places, SECOND);
            assert_eq!(family(&world), "gremsy", "before it beats: {says_first}");
        }
    }
}

/// "What a v2 device says of itself outweighs the name of a parameter": who names no maker has not said that another made it.
#[test]
fn a_gremsy_that_names_no_maker_is_one_still() {
    let (mut world, places) = World::empty(three_links());
    beat(&mut world, places, SECOND);
    world.send(places.gimbal, GIMBAL, &parameter("STIFF_TILT"));
    for (vendor, expected) in [("", "gremsy"), ("Gremsy", "gremsy"), ("Acme", "mavlink_v2")] {
        let information = GIMBAL_DEVICE_INFORMATION_DATA {
            vendor_name: CharArray::from(vendor),
            ..device_information(world.now, usual_capabilities())
        };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
        assert_eq!(family(&world), expected, "{vendor:?}");
    }
}

/// Protocol notes 1.7: a v2 device has the id 0 in what it says of itself. What a v1 gimbal says of another, behind it, makes
/// no v2 device of it.
#[test]
fn what_a_v1_gimbal_says_of_another_is_no_sign_of_v2() {
    for (gimbal_device_id, expected) in [(1, "mavlink_v1"), (6, "mavlink_v1"), (0, "mavlink_v2")] {
        let (mut world, places) = World::empty(three_links());
        beat(&mut world, places, V1_BY_ITS_SILENCE_AFTER + SECOND);
        assert_eq!(family(&world), "mavlink_v1");
        let information =
            GIMBAL_DEVICE_INFORMATION_DATA { gimbal_device_id, ..device_information(world.now, usual_capabilities()) };
        world.send(places.gimbal, GIMBAL, &MavMessage::GIMBAL_DEVICE_INFORMATION(information));
        assert_eq!(family(&world), expected, "device {gimbal_device_id}");
    }
}
