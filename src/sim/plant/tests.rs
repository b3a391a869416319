use super::*;
use crate::geometry::{AxisLimits, GimbalAngles};

fn degrees(value: f64) -> Angle {
    Angle::from_degrees(value)
}

fn rate(value: f64) -> AngularRate {
    AngularRate::from_degrees_per_second(value)
}

fn to(value: f64) -> Drive {
    Drive::To { angle: degrees(value), speed: None }
}

fn plant() -> Plant {
    let limits = Limits {
        roll: AxisLimits::new(degrees(-45.0), degrees(45.0)),
        pitch: AxisLimits::new(degrees(-90.0), degrees(30.0)),
        yaw: None,
    };
    let settings = PlantSettings { limits, noise: Angle::ZERO, ..PlantSettings::default() };
    Plant::new(Timestamp::ZERO, settings)
}

/// Plant checklist: "≤ 2 % overshoot with α_max ≥ 4·ω_max", no faster than ω_max.
#[test]
fn a_joint_goes_to_its_angle_within_rate_and_overshoot() {
    let mut plant = plant();
    plant.set_pitch(to(-60.0));

    let (mut lowest, mut fastest) = (0.0_f64, 0.0_f64);
    for millis in (5..3000).step_by(5) {
        plant.advance(Timestamp::from_millis(millis));
        lowest = lowest.min(plant.pose().pitch.degrees());
        fastest = fastest.max(plant.pose().pitch_rate.degrees_per_second().abs());
    }

    assert!(lowest > -61.2, "{lowest}");
    assert!((99.0..=100.001).contains(&fastest), "{fastest}");
    assert!((plant.pose().pitch.degrees() + 60.0).abs() < 0.001);
}

#[test]
fn the_motion_does_not_depend_on_how_often_it_is_looked_at() {
    let mut often = plant();
    let mut once = plant();
    for plant in [&mut often, &mut once] {
        plant.set_pitch(to(-60.0));
        plant.set_yaw(YawHold::Vehicle, Drive::Turn(rate(20.0)));
    }
    for millis in 1..=777 {
        often.advance(Timestamp::from_millis(millis));
    }
    once.advance(Timestamp::from_millis(777));

    assert_eq!(often.pose(), once.pose());
}

#[test]
fn a_still_plant_catches_up_on_a_day_in_one_step() {
    let mut plant = plant();
    plant.advance(Timestamp::from_secs(1));
    assert!(plant.is_at_rest());

    plant.advance(Timestamp::from_secs(86_400));

    assert_eq!(plant.stepped, Timestamp::from_secs(86_400));
    assert_eq!(plant.pose(), Pose::default());
}

#[test]
fn speed_bounds_the_way_to_an_angle() {
    let mut plant = plant();
    plant.set_pitch(Drive::To { angle: degrees(-40.0), speed: Some(rate(-10.0)) });

    plant.advance(Timestamp::from_secs(2));

    assert!((plant.pose().pitch.degrees() + 20.0).abs() < 0.2, "{:?}", plant.pose());
}

/// Plant checklist: "AT_x_LIMIT while the target is beyond the limit and |θ − limit| < 0.2°".
#[test]
fn a_limit_shows_only_while_it_is_in_the_way() {
    let mut plant = plant();
    plant.set_pitch(to(60.0));
    plant.advance(Timestamp::from_millis(100));
    assert!(!plant.at_limit().pitch);

    plant.advance(Timestamp::from_secs(2));
    assert_eq!(plant.at_limit(), AtLimit { pitch: true, ..AtLimit::default() });
    assert!((plant.pose().pitch.degrees() - 30.0).abs() < 0.001);

    plant.set_pitch(to(30.0));
    plant.advance(Timestamp::from_secs(3));
    assert!(!plant.at_limit().pitch);

    plant.set_pitch(Drive::Turn(rate(10.0)));
    plant.advance(Timestamp::from_secs(4));
    assert!(plant.at_limit().pitch);
    assert!(plant.pose().pitch.degrees() <= 30.0);

    plant.set_pitch(Drive::Turn(rate(-10.0)));
    plant.advance(Timestamp::from_secs(5));
    assert!(!plant.at_limit().pitch);
}

#[test]
fn yaw_turns_with_the_vehicle_or_against_it() {
    for (hold, yaw_after) in [(YawHold::Vehicle, 20.0), (YawHold::Horizon, -10.0)] {
        let mut plant = plant();
        plant.set_heading_reference(true);
        plant.set_yaw(hold, to(20.0));
        plant.advance(Timestamp::from_secs(2));
        for step in 0..=100 {
            let heading_rate = if step < 100 { rate(15.0) } else { AngularRate::ZERO };
            let motion =
                PlatformMotion { heading: degrees(0.3 * f64::from(step)), heading_rate, ..PlatformMotion::default() };
            plant.set_platform(Timestamp::from_millis(2000 + 20 * step as u64), motion);
            // On the move the horizon is held just as well, once the turn has been picked up.
            if step > 30 && hold == YawHold::Horizon {
                let earth = plant.pose().yaw + plant.platform_heading(plant.stepped);
                assert!((earth.degrees() - 20.0).abs() < 0.3, "{step}: {earth:?}");
            }
        }
        plant.advance(Timestamp::from_secs(6));

        assert!((plant.pose().yaw.degrees() - yaw_after).abs() < 0.01, "{hold:?} {:?}", plant.pose());
    }
}

/// Plant checklist: "Earth-yaw drift 0.5 °/min without autopilot attitude".
#[test]
fn the_held_direction_drifts_without_a_heading_to_lean_on() {
    for (known, drift) in [(false, -0.5), (true, 0.0)] {
        let mut plant = plant();
        plant.set_heading_reference(known);
        plant.set_yaw(YawHold::Horizon, to(0.0));

        plant.advance(Timestamp::from_secs(60));

        assert!((plant.pose().yaw.degrees() - drift).abs() < 0.01, "{known} {:?}", plant.pose());
    }
}

/// Plant checklist: "residual = 3 % of platform rate, high-passed at 1 Hz, ≤ 0.3°".
#[test]
fn stabilisation_leaves_a_little_of_the_vehicles_motion() {
    let mut plant = plant();
    for step in 0..50 {
        let motion = PlatformMotion { roll_rate: rate(20.0), pitch_rate: rate(200.0), ..PlatformMotion::default() };
        plant.set_platform(Timestamp::from_millis(20 * step), motion);
    }
    plant.advance(Timestamp::from_secs(1));

    assert!((plant.pose().roll.degrees() - 20.0 * 0.03 / std::f64::consts::TAU).abs() < 0.01, "{:?}", plant.pose());
    assert!((plant.pose().pitch.degrees() - 0.3).abs() < 1e-9);

    plant.set_platform(Timestamp::from_secs(1), PlatformMotion::default());
    plant.advance(Timestamp::from_secs(5));
    assert_eq!((plant.pose().roll, plant.pose().pitch), (Angle::ZERO, Angle::ZERO));
}

/// Plant checklist: "Motors off: θ relaxes to gravity rest (pitch −25°, roll 0, yaw keeps) with τ 0.6 s".
#[test]
fn without_motors_the_camera_sinks() {
    let mut plant = plant();
    plant.set_yaw(YawHold::Vehicle, to(40.0));
    plant.advance(Timestamp::from_secs(3));
    plant.release_motors();

    plant.advance(Timestamp::from_millis(3600));
    assert!((plant.pose().pitch.degrees() + 25.0 * (1.0 - (-1.0_f64).exp())).abs() < 0.2, "{:?}", plant.pose());

    plant.advance(Timestamp::from_secs(10));
    assert!((plant.pose().pitch.degrees() + 25.0).abs() < 0.001);
    assert!((plant.pose().yaw.degrees() - 40.0).abs() < 0.001);
}

/// Plant checklist: "white noise 0.02° RMS attitude", "latency 20 ms ± 5 ms".
#[test]
fn measurements_are_late_and_noisy() {
    let settings = PlantSettings { initial: GimbalAngles::default(), ..PlantSettings::default() };
    let mut still = Plant::new(Timestamp::ZERO, settings);
    let squares = (0..5000).map(|_| still.measure(Timestamp::ZERO).pitch.degrees().powi(2)).sum::<f64>();
    assert!(((squares / 5000.0).sqrt() - 0.02).abs() < 0.001);

    let mut moving = plant();
    moving.set_yaw(YawHold::Vehicle, Drive::Turn(rate(50.0)));
    for millis in 1000..1100 {
        let lag = {
            let measured = moving.measure(Timestamp::from_millis(millis)).yaw;
            (moving.pose().yaw - measured).degrees() / 50.0 * 1000.0
        };
        assert!((9.9..=30.1).contains(&lag), "{lag}");
    }
}
