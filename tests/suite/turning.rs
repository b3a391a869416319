//! "A gimbal that turns after its operator is gone is our worst bug": whatever becomes of its cable, its id and the daemon
//! while it turns, it stands soon after it can be reached.

mod about;
mod away;
mod killed;
mod moved;
mod renamed;
mod schedules;

use std::time::Duration;

use gimbald::bridge::settings::Settings;
use gimbald::geometry::Angle;
use gimbald::gimbals::gremsy::sim as gremsy;
use gimbald::gimbals::gremsy::version::FirmwareVersion;
use gimbald::gimbals::mavlink_v2::sim as v2;
use gimbald::sim::plant::PlantSettings;
use gimbald::sim::vehicle::{Vehicle, VehicleSettings};
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;
use gimbald::wire::dialect::MavMessage;

use crate::support::cable::Cable;
use crate::support::hub::Watched;
use crate::support::interception::Intercepted;
use crate::support::script::{ACCEPTED, NAN, command_long, ground_heartbeat, set_attitude, set_pitchyaw};
use crate::support::world::{GCS, GIMBAL, MANAGER, Place, Places, World, three_links};

const SECOND: Duration = Duration::from_secs(1);

/// Which gimbal turns; each goes on for ever at the last rate that it heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    V2Device,
    GremsyV1,
    GremsyV2,
    /// A v1 Gremsy whose firmware of 2021 answers no `GIMBAL_DEVICE_INFORMATION`, so that its parameters have to tell what it is.
    OldGremsy,
}

const KINDS: [Kind; 3] = [Kind::V2Device, Kind::GremsyV1, Kind::GremsyV2];

/// What it turns about, slowly enough that its end stops are far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum About {
    Roll,
    Pitch,
    Yaw,
}

impl About {
    /// Of roll, pitch and yaw in a pose.
    const fn index(self) -> usize {
        match self {
            Self::Roll => 0,
            Self::Pitch => 1,
            Self::Yaw => 2,
        }
    }

    const fn rate_dps(self) -> f32 {
        match self {
            Self::Roll => 1.5,
            Self::Pitch => -2.0,
            Self::Yaw => 5.0,
        }
    }

    fn demand(self) -> MavMessage {
        let rate = self.rate_dps().to_radians();
        match self {
            Self::Roll => set_attitude([NAN; 4], [rate, 0.0, 0.0], 44),
            Self::Pitch => set_pitchyaw(NAN, NAN, rate, 0.0, 44),
            Self::Yaw => set_pitchyaw(NAN, NAN, 0.0, rate, 44),
        }
    }
}

/// A gimbal that can be looked at.
#[derive(Clone)]
enum Gimbal {
    V2Device(Watched<v2::Device>),
    Gremsy(Watched<gremsy::Device>),
}

impl Gimbal {
    /// Roll, pitch and yaw of its joints in degrees.
    fn pose_deg(&self) -> [f64; 3] {
        let pose = match self {
            Self::V2Device(device) => device.look().plant().pose(),
            Self::Gremsy(device) => device.look().plant().pose(),
        };
        [pose.roll, pose.pitch, pose.yaw].map(Angle::degrees)
    }

    fn yaw_deg(&self) -> f64 {
        self.pose_deg()[About::Yaw.index()]
    }

    /// A gimbal at the end of a cable there.
    fn install(world: &mut World, place: Place, kind: Kind, component_id: u8) -> (Self, Cable) {
        let cable = Cable::default();
        let now = world.now;
        let gremsy = |settings: gremsy::DeviceSettings| {
            let plant = PlantSettings { noise: Angle::ZERO, ..settings.plant.clone() };
            gremsy::Device::new(now, gremsy::DeviceSettings { component_id, plant, ..settings })
        };
        let [v1_gremsy, v2_gremsy] = [gremsy::Generation::V1, gremsy::Generation::V2].map(gremsy::DeviceSettings::of);
        let gimbal = match kind {
            Kind::V2Device => {
                let settings = v2::DeviceSettings::default();
                let plant = PlantSettings { noise: Angle::ZERO, ..settings.plant.clone() };
                let settings = v2::DeviceSettings { component_id, rate_expiry: None, plant, ..settings };
                Self::V2Device(Watched::new(v2::Device::new(now, settings)))
            }
            Kind::GremsyV1 => Self::Gremsy(Watched::new(gremsy(v1_gremsy))),
            Kind::GremsyV2 => Self::Gremsy(Watched::new(gremsy(v2_gremsy))),
            Kind::OldGremsy => {
                let firmware = FirmwareVersion::official(7, 5, 6);
                Self::Gremsy(Watched::new(gremsy(gremsy::DeviceSettings { firmware, ..v1_gremsy })))
            }
        };
        gimbal.plug_in(world, place, &cable);
        (gimbal, cable)
    }

    fn plug_in(&self, world: &mut World, place: Place, cable: &Cable) {
        match self.clone() {
            Self::V2Device(peer) => world.install(place, Intercepted::new(peer, cable.clone())),
            Self::Gremsy(peer) => world.install(place, Intercepted::new(peer, cable.clone())),
        }
    }
}

/// The daemon, a vehicle, a ground station and a gimbal.
struct Flight {
    world: World,
    places: Places,
    gimbal: Gimbal,
    cable: Cable,
    about: About,
}

impl Flight {
    /// The gimbal, of which the configuration says nothing, can be steered.
    fn begin(kind: Kind) -> Self {
        Self::begin_with(kind, three_links())
    }

    fn begin_with(kind: Kind, settings: Settings) -> Self {
        let (mut world, places) = World::empty(settings);
        world.install(places.autopilot, Vehicle::new(Timestamp::ZERO, VehicleSettings::default()));
        let (gimbal, cable) = Gimbal::install(&mut world, places.gimbal, kind, GIMBAL.component);
        let mut flight = Self { world, places, gimbal, cable, about: About::Yaw };
        flight.run_for(22 * SECOND);
        flight.world.forget();
        flight
    }

    /// With a ground station that beats.
    fn run_for(&mut self, duration: Duration) {
        self.world.run_with(duration, &[(SECOND, self.places.ground, GCS, ground_heartbeat())]);
    }

    /// And that asks for a rotation again and again.
    fn turn_for(&mut self, duration: Duration) {
        let beat = (SECOND, self.places.ground, GCS, ground_heartbeat());
        self.world.run_with(duration, &[beat, (SECOND / 10, self.places.ground, GCS, self.about.demand())]);
    }

    /// It turns, and the ground station asks for that still.
    fn turning(kind: Kind) -> Self {
        Self::turning_with(kind, three_links())
    }

    fn turning_with(kind: Kind, settings: Settings) -> Self {
        let mut flight = Self::begin_with(kind, settings);
        flight.turn(About::Yaw, &format!("{kind:?}"));
        flight
    }

    /// It turns for three seconds, and goes on.
    fn turn(&mut self, about: About, what: &str) {
        self.about = about;
        self.turn_for(2 * SECOND);
        let before = self.gimbal.pose_deg();
        self.turn_for(SECOND);
        let turned = self.gimbal.pose_deg()[about.index()] - before[about.index()];
        let expected = f64::from(about.rate_dps());
        assert!((0.4..2.6).contains(&(turned / expected)), "{what}: by {turned} in a second about {about:?}");
        assert_eq!(self.world.stored_turning.len(), 1, "{what}");
    }

    fn rate_command(&mut self, yaw_rate: f32) -> Option<u8> {
        let command = command_long(MANAGER, 1000, &[NAN, NAN, 0.0, yaw_rate, 44.0, 0.0, 0.0]);
        self.world.result_of(self.places.ground, GCS, &command)
    }

    /// It turns about nothing for five seconds.
    fn assert_rests(&mut self, what: &str) {
        let gimbal = self.gimbal.clone();
        assert_rests(self, &gimbal, what);
    }
}

fn assert_rests(flight: &mut Flight, gimbal: &Gimbal, what: &str) {
    let before = gimbal.pose_deg();
    flight.run_for(5 * SECOND);
    let after = gimbal.pose_deg();
    let rests = before.iter().zip(after).all(|(before, after)| (after - before).abs() < 0.5);
    assert!(rests, "{what}: it turns on, {before:?} {after:?}");
}
