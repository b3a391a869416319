//! What a gimbal tells about itself.

use crate::geometry::{Angle, AngularRate, Attitude, EarthFrame, GimbalAngles, VehicleFrame, Yaw};
use crate::gimbals::capabilities::Capabilities;
use crate::wire::MavId;
use crate::wire::ids::{FailureFlags, GimbalFlags};

/// News from a driver.
#[derive(Clone, Debug, PartialEq)]
pub enum Report {
    /// The device is there: heard for the first time, or again after it was lost.
    Alive {
        device: MavId,
    },
    /// It was restarted, and does not do any more what it was told before.
    Restarted,
    /// It speaks otherwise than it was taken to: what was known of it does not hold, and what it was told it may not have
    /// understood.
    AnotherFamily,
    /// Whether it is a v2 device, which tells clients itself what it is and where it looks. One that is none is spoken
    /// for by its manager.
    SpeaksForItself(bool),
    /// Enough is known of the device to steer it, or something of that has changed.
    Known(Identity, Capabilities),
    Attitude(GimbalStatus),
    /// Whether one that is known can be steered at this moment. One whose driver never says so can.
    Readiness(Readiness),
    /// Whether what it is told is held back, and only the latest of it is sent in the end.
    HeldBack(bool),
    /// Nothing that it was told before turns it any more, whatever it may have missed.
    Stands,
    /// Something is wrong with it that the pilot ought to know, in a few words; each is told once.
    Fault(&'static str),
    /// It said where it looks in a way that cannot be believed.
    Malformed {
        /// A word for the counters and the person looking.
        reason: &'static str,
    },
    /// Nothing was heard of it for too long.
    Lost,
    /// The same of one that was told to shut down, and does it: it is silent until it is switched on.
    ShutDown,
}

/// How far a device is on its way to being steered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Readiness {
    /// It can be steered.
    #[default]
    Ready,
    /// It was asked to start again, or to switch itself off, and has neither done nor refused it.
    AskedToRestart,
    /// It is silent because it starts, or is got to know again.
    Starting,
}

/// Who made the device, as it says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    pub vendor: String,
    pub model: String,
    pub custom_name: String,
    /// Major, minor, patch, development.
    pub firmware: Option<[u8; 4]>,
    /// The number of this one device among all, where it has one.
    pub uid: Option<u64>,
}

/// The device's attitude and state (`GIMBAL_DEVICE_ATTITUDE_STATUS` or its equivalent).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GimbalStatus {
    /// The device tells nothing: it is where it would be if it did what it is told.
    pub is_assumed: bool,
    pub attitude: GimbalAttitude,
    /// Roll, pitch and yaw rate where the device knows them.
    pub rates: [Option<AngularRate>; 3],
    /// The device's own estimate of the vehicle's heading, where it is to be trusted.
    pub heading: Option<Angle>,
    pub flags: GimbalFlags,
    pub failures: FailureFlags,
    /// The device takes yaw from North at this moment.
    pub accepts_earth_yaw: bool,
}

/// A gimbal's attitude in the frame in which it was reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GimbalAttitude {
    InVehicleFrame(Attitude<VehicleFrame>),
    InEarthFrame(Attitude<EarthFrame>),
}

impl GimbalAttitude {
    pub fn angles(self) -> GimbalAngles {
        match self {
            Self::InVehicleFrame(attitude) => attitude.gimbal_angles(),
            Self::InEarthFrame(attitude) => attitude.gimbal_angles(),
        }
    }

    pub fn yaw(self) -> Yaw {
        match self {
            Self::InVehicleFrame(attitude) => Yaw::InVehicleFrame(attitude.gimbal_angles().yaw),
            Self::InEarthFrame(attitude) => Yaw::InEarthFrame(attitude.gimbal_angles().yaw),
        }
    }
}
