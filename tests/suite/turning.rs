//! "A gimbal that turns after its operator is gone is our worst bug": whatever becomes of its cable, its id and the daemon
//! while it turns, it stands soon after it can be reached.

mod away;
mod killed;
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

use crate::support::cable::Cable;
use crate::support::hub::Watched;
use crate::support::interception::Intercepted;
use crate::support::script::{ACCEPTED, NAN, command_long, ground_heartbeat, set_pitchyaw};
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

/// A gimbal that can be looked at.
#[derive(Clone)]
enum Gimbal {
    V2Device(Watched<v2::Device>),
    Gremsy(Watched<gremsy::Device>),
}

impl Gimbal {
    fn yaw_deg(&self) -> f64 {
        match self {
            Self::V2Device(device) => device.look().plant().pose().yaw.degrees(),
            Self::Gremsy(device) => device.look().plant().pose().yaw.degrees(),
        }
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
        match gimbal.clone() {
            Self::V2Device(peer) => world.install(place, Intercepted::new(peer, cable.clone())),
            Self::Gremsy(peer) => world.install(place, Intercepted::new(peer, cable.clone())),
        }
        (gimbal, cable)
    }
}

/// The daemon, a vehicle, a ground station and a gimbal.
struct Flight {
    world: World,
    places: Places,
    gimbal: Gimbal,
    cable: Cable,
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
        let mut flight = Self { world, places, gimbal, cable };
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
        let rate = set_pitchyaw(NAN, NAN, 0.0, 5_f32.to_radians(), 44);
        let beat = (SECOND, self.places.ground, GCS, ground_heartbeat());
        self.world.run_with(duration, &[beat, (SECOND / 10, self.places.ground, GCS, rate)]);
    }

    /// It turns, and the ground station asks for that still.
    fn turning(kind: Kind) -> Self {
        Self::turning_with(kind, three_links())
    }

    fn turning_with(kind: Kind, settings: Settings) -> Self {
        let mut flight = Self::begin_with(kind, settings);
        flight.turn_for(2 * SECOND);
        let before = flight.gimbal.yaw_deg();
        flight.turn_for(SECOND);
        assert!(flight.gimbal.yaw_deg() > before + 2.0, "{kind:?} turns");
        assert_eq!(flight.world.stored_turning.len(), 1, "{kind:?}");
        flight
    }

    fn rate_command(&mut self, yaw_rate: f32) -> Option<u8> {
        let command = command_long(MANAGER, 1000, &[NAN, NAN, 0.0, yaw_rate, 44.0, 0.0, 0.0]);
        self.world.result_of(self.places.ground, GCS, &command)
    }

    /// It does not turn for five seconds.
    fn assert_rests(&mut self, what: &str) {
        assert_rests(self, |flight| flight.gimbal.yaw_deg(), what);
    }
}

fn assert_rests(flight: &mut Flight, yaw_deg: impl Fn(&Flight) -> f64, what: &str) {
    let before = yaw_deg(flight);
    flight.run_for(5 * SECOND);
    let after = yaw_deg(flight);
    assert!((after - before).abs() < 0.5, "{what}: it turns on, {before} {after}");
}
