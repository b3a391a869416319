//! The course of a simulated vehicle: a level circle, flown to the right.

use crate::geometry::{AircraftAngles, Angle, AngularRate, Position};
use crate::timestamp::Timestamp;

/// Centre of the circle on the ground, which is home as well; altitude above mean sea level.
pub const HOME: Position = Position { latitude_deg: 47.397_742_0, longitude_deg: 8.545_594_0, altitude_m: 488.0 };

pub const HEIGHT_M: f64 = 50.0;
pub const RADIUS_M: f64 = 40.0;
pub const SPEED_MPS: f64 = 5.0;

const GRAVITY: f64 = 9.806_65;

/// Where the vehicle is and how it moves, all of one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pub position: Position,
    /// North, East, Down from home in metres.
    pub offset_m: [f64; 3],
    /// North, East, Down in metres per second.
    pub velocity_mps: [f64; 3],
    /// Yaw is the heading, and grows with every turn.
    pub attitude: AircraftAngles,
    /// About the body's axes: forward, right, down.
    pub body_rates: [AngularRate; 3],
    pub heading_rate: AngularRate,
}

/// The motion `time` after the start; it begins North of home, heading East.
pub fn motion_at(time: Timestamp) -> Motion {
    let turn_rate = SPEED_MPS / RADIUS_M;
    let phase = turn_rate * time.as_secs_f64();
    let (sin, cos) = phase.sin_cos();
    let [north, east] = [RADIUS_M * cos, RADIUS_M * sin];
    // In a coordinated turn the lift carries the weight and bends the course.
    let bank = (SPEED_MPS * turn_rate / GRAVITY).atan();
    Motion {
        position: HOME.moved(north, east, HEIGHT_M),
        offset_m: [north, east, -HEIGHT_M],
        velocity_mps: [-SPEED_MPS * sin, SPEED_MPS * cos, 0.0],
        attitude: AircraftAngles {
            roll: Angle::from_radians(bank),
            pitch: Angle::ZERO,
            yaw: Angle::from_radians(phase) + Angle::from_degrees(90.0),
        },
        body_rates: [0.0, turn_rate * bank.sin(), turn_rate * bank.cos()].map(AngularRate::from_radians_per_second),
        heading_rate: AngularRate::from_radians_per_second(turn_rate),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Attitude;

    #[test]
    fn position_velocity_heading_and_rates_belong_together() {
        let step = 0.01;
        let at = |seconds: f64| motion_at(Timestamp::from_micros((seconds * 1e6).round() as u64));
        for second in 0..60 {
            let time = f64::from(second) + 1.0;
            let (before, here, after) = (at(time - step), at(time), at(time + step));

            for axis in 0..3 {
                let derivative = (after.offset_m[axis] - before.offset_m[axis]) / (2.0 * step);
                assert!((derivative - here.velocity_mps[axis]).abs() < 1e-4, "axis {axis} at {time}");
            }
            // A tenth of a metre is too near to take aim at, so look from a second before to a second after.
            let (before, after) = (at(time - 1.0), at(time + 1.0));
            let aim = before.position.aim_at(after.position).expect("ten metres apart");
            let along_track = (aim.azimuth.expect("level") - here.attitude.yaw).wrapped();
            assert!(along_track.abs() < Angle::from_degrees(0.01), "{along_track:?} at {time}");

            let turned = (after.attitude.yaw - before.attitude.yaw).radians() / 2.0;
            assert!((turned - here.heading_rate.radians_per_second()).abs() < 1e-9);
            let home = HOME.aim_at(here.position).expect("not at home");
            assert!((home.distance_m - RADIUS_M.hypot(HEIGHT_M)).abs() < 0.01, "{home:?}");
        }
    }

    /// In a coordinated turn the sum of weight and centrifugal force lies along the body's down axis.
    #[test]
    fn the_bank_is_that_of_a_coordinated_turn() {
        let motion = motion_at(Timestamp::from_secs(7));
        assert!((motion.attitude.roll.degrees() - 3.646).abs() < 0.001, "{:?}", motion.attitude);
        assert_eq!(motion.attitude.pitch, Angle::ZERO);
    }

    /// The body rates turn the attitude just as it turns.
    #[test]
    fn body_rates_are_those_of_the_attitude() {
        let step = 0.001;
        let (here, later) = (motion_at(Timestamp::from_secs(3)), motion_at(Timestamp::from_millis(3001)));
        let q = |motion: &Motion| {
            Attitude::<crate::geometry::EarthFrame>::from_aircraft_angles(motion.attitude).to_wxyz().map(f64::from)
        };
        let ([w, x, y, z], [lw, lx, ly, lz]) = (q(&here), q(&later));
        // The vector part of conj(here) * later is half the turn about each body axis.
        let turn =
            [w * lx - x * lw - y * lz + z * ly, w * ly + x * lz - y * lw - z * lx, w * lz - x * ly + y * lx - z * lw];
        for (axis, half) in turn.iter().enumerate() {
            let rate = here.body_rates[axis].radians_per_second();
            assert!((2.0 * half / step - rate).abs() < 1e-3, "axis {axis}: {} is not {rate}", 2.0 * half / step);
        }
    }
}
