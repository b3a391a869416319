//! Where to look from one place on Earth to see another, on the WGS-84 ellipsoid.

use nalgebra::Vector3;

use super::angle::Angle;

/// A place on Earth.
///
/// Altitudes of two places that are compared count from the same datum. Above mean sea level does as well as above the
/// ellipsoid: the geoid lies within 110 m of it, which changes a horizontal distance by less than 20 parts in a million.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Position {
    pub latitude_deg: f64,
    pub longitude_deg: f64,
    pub altitude_m: f64,
}

/// A direction and distance, measured in the horizontal plane of where one looks from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// From North, within (−180°, 180°]; `None` when the target is straight above or below.
    pub azimuth: Option<Angle>,
    /// Above the horizon, within ±90°.
    pub elevation: Angle,
    /// Along the line of sight.
    pub distance_m: f64,
}

/// Nearer than this, the direction is that of the positions' errors.
const TOO_NEAR_M: f64 = 0.5;

impl Position {
    /// How to look from here at `target`; `None` when they are the same place within half a metre, or when a
    /// coordinate is not finite.
    pub fn aim_at(self, target: Self) -> Option<Aim> {
        let line = self.offset_to(target);
        let horizontal = line.north_m.hypot(line.east_m);
        let distance_m = horizontal.hypot(line.up_m);
        // Written so that NaN is refused as well.
        if !(distance_m >= TOO_NEAR_M && distance_m.is_finite()) {
            return None;
        }
        Some(Aim {
            azimuth: (horizontal >= TOO_NEAR_M).then(|| Angle::from_radians(line.east_m.atan2(line.north_m)).wrapped()),
            elevation: Angle::from_radians(line.up_m.atan2(horizontal)),
            distance_m,
        })
    }

    /// The place so many metres away in the tangent plane of this one.
    ///
    /// The plane leaves the ground as Earth curves: 10 km to the North, `up_m` of 0 ends 7.8 m higher.
    pub fn moved(self, north_m: f64, east_m: f64, up_m: f64) -> Self {
        let axes = Axes::at(self);
        from_ecef(to_ecef(self) + axes.north * north_m + axes.east * east_m + axes.up * up_m)
    }

    fn offset_to(self, target: Self) -> Offset {
        let axes = Axes::at(self);
        let line = to_ecef(target) - to_ecef(self);
        Offset { north_m: axes.north.dot(&line), east_m: axes.east.dot(&line), up_m: axes.up.dot(&line) }
    }
}

struct Offset {
    north_m: f64,
    east_m: f64,
    up_m: f64,
}

/// Semi-major axis and flattening of WGS-84 (NGA.STND.0036).
const EQUATOR_RADIUS_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;
const POLE_RADIUS_M: f64 = EQUATOR_RADIUS_M * (1.0 - FLATTENING);
/// Squares of the first and second eccentricity.
const ECCENTRICITY_2: f64 = FLATTENING * (2.0 - FLATTENING);
const SECOND_ECCENTRICITY_2: f64 = ECCENTRICITY_2 / (1.0 - ECCENTRICITY_2);

/// The local axes at a place, in Earth-centred coordinates.
struct Axes {
    north: Vector3<f64>,
    east: Vector3<f64>,
    up: Vector3<f64>,
}

impl Axes {
    fn at(position: Position) -> Self {
        let (sin_lat, cos_lat) = position.latitude_deg.to_radians().sin_cos();
        let (sin_lon, cos_lon) = position.longitude_deg.to_radians().sin_cos();
        Self {
            north: Vector3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat),
            east: Vector3::new(-sin_lon, cos_lon, 0.0),
            up: Vector3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat),
        }
    }
}

/// Earth-centred, Earth-fixed coordinates in metres.
fn to_ecef(position: Position) -> Vector3<f64> {
    let (sin_lat, cos_lat) = position.latitude_deg.to_radians().sin_cos();
    let (sin_lon, cos_lon) = position.longitude_deg.to_radians().sin_cos();
    let normal = EQUATOR_RADIUS_M / (1.0 - ECCENTRICITY_2 * sin_lat * sin_lat).sqrt();
    let across = (normal + position.altitude_m) * cos_lat;
    let along = (normal * (1.0 - ECCENTRICITY_2) + position.altitude_m) * sin_lat;
    Vector3::new(across * cos_lon, across * sin_lon, along)
}

/// Bowring's method, whose first step errs by less than 10 µm wherever something flies.
fn from_ecef(ecef: Vector3<f64>) -> Position {
    let across = ecef.x.hypot(ecef.y);
    let (sin, cos) = (ecef.z * EQUATOR_RADIUS_M).atan2(across * POLE_RADIUS_M).sin_cos();
    let latitude = (ecef.z + SECOND_ECCENTRICITY_2 * POLE_RADIUS_M * sin.powi(3))
        .atan2(across - ECCENTRICITY_2 * EQUATOR_RADIUS_M * cos.powi(3));
    let (sin_lat, cos_lat) = latitude.sin_cos();
    let surface = EQUATOR_RADIUS_M * (1.0 - ECCENTRICITY_2 * sin_lat * sin_lat).sqrt();
    Position {
        latitude_deg: latitude.to_degrees(),
        longitude_deg: ecef.y.atan2(ecef.x).to_degrees(),
        altitude_m: across * cos_lat + ecef.z * sin_lat - surface,
    }
}

#[cfg(test)]
mod tests {
    use map_3d::Ellipsoid::WGS84;
    use proptest::prelude::*;

    use super::*;

    const FIELD: Position = Position { latitude_deg: 47.397_742, longitude_deg: 8.545_594, altitude_m: 488.0 };

    fn place(latitude_deg: f64, longitude_deg: f64, altitude_m: f64) -> Position {
        Position { latitude_deg, longitude_deg, altitude_m }
    }

    /// East, north and up of a unit vector towards the target, by a library that is not ours.
    fn oracle(from: Position, to: Position) -> Vector3<f64> {
        let (east, north, up) = map_3d::geodetic2enu(
            to.latitude_deg.to_radians(),
            to.longitude_deg.to_radians(),
            to.altitude_m,
            from.latitude_deg.to_radians(),
            from.longitude_deg.to_radians(),
            from.altitude_m,
            WGS84,
        );
        Vector3::new(east, north, up).normalize()
    }

    fn direction(aim: Aim) -> Vector3<f64> {
        let azimuth = aim.azimuth.expect("the target is not straight above or below").radians();
        let (up, across) = aim.elevation.radians().sin_cos();
        Vector3::new(azimuth.sin() * across, azimuth.cos() * across, up)
    }

    fn angle_between_deg(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
        a.cross(&b).norm().atan2(a.dot(&b)).to_degrees()
    }

    /// "ROI +0.001°, +0.001°, 388 m: WGS-84: yaw 34.176°, pitch −36.653°" (protocol notes 2.5), and the other vectors
    /// there.
    #[test]
    #[rustfmt::skip]
    fn the_documented_regions_of_interest_are_where_they_should_be() {
        for (north,  east, altitude, azimuth, elevation) in [
            (0.001,  0.001,   388.0,  34.176,   -36.653),
            (0.001,    0.0,   488.0,     0.0,      -0.0005),
            (-0.0005,  0.0,   488.0,   180.0,      -0.000_25),
        ] {
            let aim = FIELD
                .aim_at(place(FIELD.latitude_deg + north, FIELD.longitude_deg + east, altitude))
                .expect("the target is elsewhere");

            let seen = aim.azimuth.expect("it is not straight below").degrees();
            assert!((seen - azimuth).abs() < 5e-4, "azimuth {seen}°");
            assert!((aim.elevation.degrees() - elevation).abs() < 5e-4, "elevation {}°", aim.elevation.degrees());
        }
    }

    #[test]
    fn straight_below_there_is_an_elevation_but_no_azimuth() {
        let aim = FIELD.aim_at(place(FIELD.latitude_deg, FIELD.longitude_deg, 400.0)).expect("it is 88 m away");

        assert_eq!(aim.azimuth, None);
        assert!((aim.elevation.degrees() + 90.0).abs() < 1e-6);
        assert!((aim.distance_m - 88.0).abs() < 1e-6);
    }

    #[test]
    fn azimuth_needs_half_a_metre() {
        let near = FIELD.aim_at(FIELD.moved(0.49, 0.0, -10.0)).expect("it is 10 m away");
        let far = FIELD.aim_at(FIELD.moved(0.0, -0.51, -10.0)).expect("it is 10 m away");

        assert_eq!(near.azimuth, None);
        assert!((far.azimuth.expect("it is far enough").degrees() + 90.0).abs() < 1e-3);
    }

    #[test]
    fn there_is_no_direction_to_the_same_place_or_to_nowhere() {
        assert_eq!(FIELD.aim_at(FIELD), None);
        assert_eq!(FIELD.aim_at(FIELD.moved(0.2, 0.2, 0.2)), None);
        assert_eq!(FIELD.aim_at(place(f64::NAN, 8.5, 488.0)), None);
        assert_eq!(FIELD.aim_at(place(47.0, 8.5, f64::INFINITY)), None);
        assert_eq!(place(47.0, f64::INFINITY, 0.0).aim_at(FIELD), None);
    }

    #[test]
    #[rustfmt::skip]
    fn poles_and_antimeridian_are_places_like_others() {
        for (from,                         to,                            azimuth, distance) in [
            (place(0.0, 179.999_9, 50.0),   place(0.0, -179.999_9, 50.0),    90.0,    22.264),
            (place(0.0, -179.999_9, 50.0),  place(0.0, 179.999_9, 50.0),    -90.0,    22.264),
            // From the pole itself North is what its longitude says: here along 180°.
            (place(90.0, 0.0, 100.0),       place(89.999, 0.0, 100.0),      180.0,   111.694),
            (place(90.0, 0.0, 100.0),       place(89.999, 90.0, 100.0),      90.0,   111.694),
            (place(89.999_5, 0.0, 100.0),   place(89.999_5, 180.0, 100.0),    0.0,   111.694),
            (place(-90.0, 0.0, 100.0),      place(-89.999, 0.0, 100.0),       0.0,   111.694),
            (place(-89.999_5, 45.0, 100.0), place(-89.999_5, -135.0, 100.0), 180.0,  111.694),
        ] {
            let aim = from.aim_at(to).expect("they are apart");

            let seen = aim.azimuth.expect("it is not straight below").degrees();
            assert!((seen - azimuth).abs() < 1e-6, "azimuth {seen}° from {from:?} to {to:?}");
            assert!((aim.distance_m - distance).abs() < 0.01, "{} m from {from:?} to {to:?}", aim.distance_m);
        }
    }

    #[test]
    fn moving_ten_kilometres_along_the_tangent_ends_above_the_ground() {
        let there = FIELD.moved(10_000.0, 0.0, 0.0);

        assert!((there.altitude_m - FIELD.altitude_m - 7.85).abs() < 0.02, "{} m", there.altitude_m);
        assert!((there.longitude_deg - FIELD.longitude_deg).abs() < 1e-9);
    }

    fn anywhere() -> impl Strategy<Value = Position> {
        let latitude = prop_oneof![4 => -90.0..=90.0_f64, 1 => prop::sample::select(vec![-90.0, 0.0, 90.0, 89.9999])];
        let longitude = prop_oneof![4 => -180.0..=180.0_f64, 1 => prop::sample::select(vec![-180.0, 0.0, 180.0])];
        (latitude, longitude, -400.0..9_000.0_f64).prop_map(|(lat, lon, altitude)| place(lat, lon, altitude))
    }

    proptest! {
        /// "pointing (ROI) against an independent WGS-84 reference …: under 0.02° from 20 m to 20 km, at any latitude".
        /// The two agree a thousand times better than that.
        #[test]
        fn aiming_agrees_with_an_independent_library(
            from in anywhere(), distance in 20.0..20_000.0_f64, azimuth in 0.0..360.0_f64, elevation in -85.0..85.0_f64,
        ) {
            let (across, up) = (distance * elevation.to_radians().cos(), distance * elevation.to_radians().sin());
            let to = from.moved(across * azimuth.to_radians().cos(), across * azimuth.to_radians().sin(), up);

            let aim = from.aim_at(to).expect("they are apart");

            let error = angle_between_deg(direction(aim), oracle(from, to));
            prop_assert!(error < 2e-5, "{error}° from {from:?} to {to:?}");
        }

        /// Positions travel in units of 1e-7 degrees and millimetres; at 20 m this is what is left of the 0.02°.
        #[test]
        fn positions_rounded_as_on_the_wire_are_aimed_at_precisely(
            from in anywhere(), distance in 20.0..20_000.0_f64, azimuth in 0.0..360.0_f64,
        ) {
            let rounded = |position: Position| place(
                (position.latitude_deg * 1e7).round() / 1e7,
                (position.longitude_deg * 1e7).round() / 1e7,
                (position.altitude_m * 1e3).round() / 1e3,
            );
            let from = rounded(from);
            let (north, east) = (distance * azimuth.to_radians().cos(), distance * azimuth.to_radians().sin());
            let to = rounded(from.moved(north, east, -distance / 2.0));

            let aim = from.aim_at(to).expect("they are apart");

            prop_assert!(angle_between_deg(direction(aim), oracle(from, to)) < 2e-5);
        }

        #[test]
        fn aiming_finds_where_one_moved(
            from in anywhere(), north in -2e4..2e4_f64, east in -2e4..2e4_f64, up in -2e3..2e3_f64,
        ) {
            prop_assume!(north.hypot(east) > 1.0);

            let aim = from.aim_at(from.moved(north, east, up)).expect("they are apart");

            let expected = Vector3::new(east, north, up);
            prop_assert!((aim.distance_m - expected.norm()).abs() < 1e-5);
            prop_assert!(angle_between_deg(direction(aim), expected) < 1e-3);
        }

        #[test]
        fn moving_ends_exactly_where_it_was_told_to(
            from in anywhere(), north in -2e4..2e4_f64, east in -2e4..2e4_f64, up in -2e3..2e3_f64,
        ) {
            let there = from.moved(north, east, up);

            prop_assert!((-90.0..=90.0).contains(&there.latitude_deg));
            prop_assert!((-180.0..=180.0).contains(&there.longitude_deg));
            let (seen_east, seen_north, seen_up) = map_3d::geodetic2enu(
                there.latitude_deg.to_radians(),
                there.longitude_deg.to_radians(),
                there.altitude_m,
                from.latitude_deg.to_radians(),
                from.longitude_deg.to_radians(),
                from.altitude_m,
                WGS84,
            );
            prop_assert!((Vector3::new(seen_east, seen_north, seen_up) - Vector3::new(east, north, up)).norm() < 1e-5);
        }
    }
}
