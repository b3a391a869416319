//! What a Gremsy measures.
//!
//! | Id | Message | Content |
//! |---|---|---|
//! | 27 | `RAW_IMU` | acceleration, 8192 to 1 g; turn, 32.8 to 1°/s; the magnetometer's fields mean nothing |
//! | 158 | `MOUNT_STATUS` | not where it looks: the encoders of tilt, roll and pan, as counts or hundredths of a degree |
//! | 265 | `MOUNT_ORIENTATION` | roll and pitch against the horizon, yaw against the vehicle and against the horizon, degrees |

use super::parameters::EncoderType;
use crate::geometry::{Angle, AngularRate, Attitude, GimbalAngles};
use crate::gimbals::report::GimbalAttitude;
use crate::wire::Frame;
use crate::wire::dialect::{MOUNT_ORIENTATION_DATA, MOUNT_STATUS_DATA, RAW_IMU_DATA};

const COUNTS_PER_G: f64 = 8192.0;
const COUNTS_PER_DEGREE_PER_SECOND: f64 = 32.8;
const COUNTS_PER_TURN: f64 = 65_536.0;

/// No gimbal turns further; what is beyond is another unit.
const LARGEST_DEG: f64 = 720.0;

/// The length of `MOUNT_ORIENTATION` without `yaw_absolute`. An angle of exactly 0 is cut off as well, and missed for once.
const ORIENTATION_BASE_LEN: usize = 16;

/// One `RAW_IMU`, as sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawImu {
    /// The gimbal's clock, microseconds.
    pub time_us: u64,
    /// x, y, z.
    pub acceleration: [i16; 3],
    /// About x, y, z.
    pub turn: [i16; 3],
}

impl RawImu {
    /// `None` for another message.
    pub fn read(frame: &Frame<'_>) -> Option<Self> {
        let message: RAW_IMU_DATA = frame.decode()?;
        Some(Self {
            time_us: message.time_usec,
            acceleration: [message.xacc, message.yacc, message.zacc],
            turn: [message.xgyro, message.ygyro, message.zgyro],
        })
    }

    /// In units of gravity.
    pub fn acceleration_g(self) -> [f64; 3] {
        self.acceleration.map(|counts| f64::from(counts) / COUNTS_PER_G)
    }

    pub fn rates(self) -> [AngularRate; 3] {
        self.turn.map(|counts| AngularRate::from_degrees_per_second(f64::from(counts) / COUNTS_PER_DEGREE_PER_SECOND))
    }
}

/// The joints as their encoders have them, tilt, roll and pan, as sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Encoders(pub [i16; 3]);

impl Encoders {
    /// `None` for another message. The fields are wider than what they carry; the vendor's SDK cuts them too.
    pub fn read(frame: &Frame<'_>) -> Option<Self> {
        let message: MOUNT_STATUS_DATA = frame.decode()?;
        Some(Self([message.pointing_a, message.pointing_b, message.pointing_c].map(|wide| wide as i16)))
    }

    /// Angles of the joints, no attitude: the vehicle's own is not in them.
    pub fn angles(self, sent_as: EncoderType) -> [Angle; 3] {
        self.0.map(|number| match sent_as {
            EncoderType::Counts => Angle::from_degrees(f64::from(number) * 360.0 / COUNTS_PER_TURN),
            EncoderType::Angle => Angle::from_degrees(f64::from(number) / 100.0),
        })
    }
}

/// Where a Gremsy says that it looks in v1. All are numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    pub roll: Angle,
    pub pitch: Angle,
    /// Against the vehicle.
    pub yaw: Angle,
    /// Against the horizon; from North only where an autopilot tells the heading. `None` where it is not told.
    pub yaw_absolute: Option<Angle>,
}

/// Axes that a gimbal reports the wrong way round (pitch was seen: mavros pull request 1744).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Negated {
    pub roll: bool,
    pub pitch: bool,
    pub yaw: bool,
}

impl Orientation {
    /// `None` for another message, or numbers that are none.
    pub fn read(frame: &Frame<'_>, negated: Negated) -> Option<Self> {
        let message: MOUNT_ORIENTATION_DATA = frame.decode()?;
        let angle = |degrees: f32, negated: bool| {
            let degrees = f64::from(degrees);
            (degrees.abs() <= LARGEST_DEG).then(|| Angle::from_degrees(if negated { -degrees } else { degrees }))
        };
        Some(Self {
            roll: angle(message.roll, negated.roll)?,
            pitch: angle(message.pitch, negated.pitch)?,
            yaw: angle(message.yaw, negated.yaw)?,
            yaw_absolute: match frame.payload().len() {
                ..=ORIENTATION_BASE_LEN => None,
                _ => Some(angle(message.yaw_absolute, negated.yaw)?),
            },
        })
    }

    /// The attitude in the frame to which the gimbal holds its yaw: the horizon's when it is locked and tells that one, else
    /// the vehicle's.
    pub fn attitude(self, locked: bool) -> GimbalAttitude {
        let Self { roll, pitch, yaw, yaw_absolute } = self;
        if let Some(yaw_absolute) = yaw_absolute.filter(|_| locked) {
            let angles = GimbalAngles { roll, pitch, yaw: yaw_absolute };
            GimbalAttitude::InEarthFrame(Attitude::from_gimbal_angles(angles))
        } else {
            GimbalAttitude::InVehicleFrame(Attitude::from_gimbal_angles(GimbalAngles { roll, pitch, yaw }))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Yaw;
    use crate::wire::dialect::MessageData;
    use crate::wire::{FrameBuffer, MavId};

    fn with_frame<M: MessageData, R>(message: &M, read: impl Fn(&Frame<'_>) -> R) -> R {
        read(&FrameBuffer::default().encode(MavId::new(1, 154), 0, message))
    }

    fn orientation() -> MOUNT_ORIENTATION_DATA {
        MOUNT_ORIENTATION_DATA { time_boot_ms: 1, roll: 2.0, pitch: -30.0, yaw: 15.0, yaw_absolute: 85.0 }
    }

    fn mount_status(pointing_a: i32, pointing_b: i32, pointing_c: i32) -> MOUNT_STATUS_DATA {
        MOUNT_STATUS_DATA { pointing_a, pointing_b, pointing_c, target_system: 1, target_component: 191, mount_mode: 0 }
    }

    /// Gimbal statement 19: "In LOCK the attitude yaw comes from yaw_absolute, in FOLLOW from yaw."
    #[test]
    fn statement_19_the_yaw_is_that_of_the_mode() {
        let read = |message| with_frame(&message, |frame| Orientation::read(frame, Negated::default()));
        let found = read(orientation()).expect("numbers");
        for (locked, in_earth, yaw) in [(true, true, 85.0), (false, false, 15.0)] {
            let attitude = found.attitude(locked);
            let (frame, found) = match attitude.yaw() {
                Yaw::InEarthFrame(yaw) => (true, yaw),
                Yaw::InVehicleFrame(yaw) => (false, yaw),
            };
            assert!(frame == in_earth && (found.degrees() - yaw).abs() < 1e-9, "{attitude:?}");
            let angles = attitude.angles();
            assert!((angles.roll.degrees() - 2.0).abs() < 1e-9 && (angles.pitch.degrees() + 30.0).abs() < 1e-9);
        }
        // The field is an extension: one that is cut off is no North.
        let without = read(MOUNT_ORIENTATION_DATA { yaw_absolute: 0.0, ..orientation() }).expect("numbers");
        assert_eq!(without, Orientation { yaw_absolute: None, ..found });
        assert_eq!(without.attitude(true), found.attitude(false));
        for broken in [f32::NAN, f32::NEG_INFINITY, -3000.0] {
            assert_eq!(read(MOUNT_ORIENTATION_DATA { pitch: broken, ..orientation() }), None);
        }
    }

    /// "MOUNT_ORIENTATION pitch seen inverted with Gremsy … Keep per-axis sign config on the input side" (gimbals 1.7).
    #[test]
    fn an_axis_that_is_reported_the_wrong_way_round_is_turned() {
        let read = |negated| with_frame(&orientation(), |frame| Orientation::read(frame, negated)).expect("numbers");
        let usual = read(Negated::default());
        let pitch = read(Negated { pitch: true, ..Negated::default() });
        assert_eq!(pitch, Orientation { pitch: -usual.pitch, ..usual });
        let yaw = read(Negated { yaw: true, ..Negated::default() });
        assert_eq!(yaw, Orientation { yaw: -usual.yaw, yaw_absolute: usual.yaw_absolute.map(|yaw| -yaw), ..usual });
    }

    /// Gimbal statement 20: "MOUNT_STATUS never updates the attitude estimate of a Gremsy profile; it updates the encoder
    /// values only."
    #[test]
    fn statement_20_a_mount_status_is_no_attitude() {
        let status = mount_status(-16_384, 0, 16_384);
        assert_eq!(with_frame(&status, |frame| Orientation::read(frame, Negated::default())), None);
        assert_eq!(with_frame(&status, Encoders::read), Some(Encoders([-16_384, 0, 16_384])));
        assert_eq!(with_frame(&orientation(), Encoders::read), None);
    }

    /// Gimbal statement 21: "Raw encoder 16384 with MAV_TS_ENCNT=1 decodes to 90.00°; −16384 to −90.00°."
    #[test]
    fn statement_21_encoders_are_counts_or_angles() {
        let counts = with_frame(&mount_status(16_384, 0, -16_384), Encoders::read).expect("encoders");
        let degrees = |angles: [Angle; 3]| angles.map(|angle| (angle.degrees() * 100.0).round() / 100.0);
        assert_eq!(degrees(counts.angles(EncoderType::Counts)), [90.0, 0.0, -90.0]);

        let angles = with_frame(&mount_status(-9000, 150, 17_999), Encoders::read).expect("encoders");
        assert_eq!(degrees(angles.angles(EncoderType::Angle)), [-90.0, 1.5, 179.99]);
        // "cast to int16": a count that runs on past half a turn comes back from the other side.
        let wide = with_frame(&mount_status(49_152, 0, 0), Encoders::read).expect("encoders");
        assert_eq!(wide, Encoders([-16_384, 0, 0]));
    }

    /// Gimbal statement 22: "RAW_IMU zacc 8192 decodes to 1.000 g; xgyro 328 to 10.0 °/s."
    #[test]
    fn statement_22_the_imu_has_a_scale() {
        let message = RAW_IMU_DATA {
            time_usec: 5_000_000,
            xacc: -4096,
            yacc: 0,
            zacc: 8192,
            xgyro: 328,
            ygyro: 0,
            zgyro: -328,
            xmag: 1,
            ymag: 2,
            zmag: 3,
            id: 0,
            temperature: 0,
        };
        let imu = with_frame(&message, RawImu::read).expect("an IMU");
        assert_eq!((imu.time_us, imu.acceleration_g()), (5_000_000, [-0.5, 0.0, 1.0]));
        for (rate, expected) in imu.rates().iter().zip([10.0, 0.0, -10.0]) {
            assert!((rate.degrees_per_second() - expected).abs() < 1e-9, "{rate:?}");
        }
    }
}
