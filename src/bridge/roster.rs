//! Which gimbals there are, and which manager component each one has.
//!
//! One component per gimbal: device 154 has manager 191, 171 has 192, 172 has 193, 173 has 194; other gimbals take the
//! free ones in the order of the configuration.
//!
//! Which device belongs to which of them is decided in [`adoption`], which ids those without an entry are given in [`ids`],
//! who is to be stopped in [`left_turning`].

mod adoption;
mod ids;
mod left_turning;

pub use adoption::{Hearing, NotAdopted, Place, Renamed};
pub use left_turning::LeftTurning;

use std::time::Duration;

use super::LinkIndex;
use super::settings::Settings;
use crate::channel::{ChannelId, ChannelSet};
use crate::gimbals::families;
use crate::gimbals::settings::{Family, GimbalSettings};
use crate::gimbals::{DriverOutput, GimbalDriver};
use crate::manager::settings::ControlSettings;
use crate::manager::voice;
use crate::manager::{GimbalManager, ManagerOutput};
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::ids::{component, mav_type};
use ids::KeptIds;
use left_turning::Awaited;

/// A gimbal with its manager and driver.
#[derive(Debug)]
pub struct Gimbal {
    pub manager: GimbalManager,
    pub driver: Box<dyn GimbalDriver>,
    /// The component that the driver talks to, from the first sign of it on.
    pub adopted: Option<MavId>,
    /// Where that one is; others under its id elsewhere are not it. `None` while its channel is closed.
    pub channel: Option<ChannelId>,
    /// The link of that channel, also after it was closed.
    link: LinkIndex,
    adopted_at: Timestamp,
    /// When it was last heard there.
    heard: Timestamp,
    /// Where its id was heard besides since then.
    elsewhere: Option<LinkIndex>,
    /// When it turned out that two speak under its id.
    has_twin: Option<Timestamp>,
    /// The devices that may be this one, and were turning.
    stopped_for: Vec<Option<MavId>>,
    /// The manager's component id.
    pub component: u8,
    /// It has an entry in the configuration, and is missed when it is not there.
    pub configured: bool,
}

impl Gimbal {
    /// `number`: the device id that is kept for it in case that it is no v2 device.
    fn new(
        settings: GimbalSettings,
        rules: &ControlSettings,
        component: u8,
        configured: bool,
        number: Option<u8>,
    ) -> Self {
        let driver = families::driver(settings.family, &settings);
        Self {
            manager: GimbalManager::new(settings, rules.clone(), number),
            driver,
            adopted: None,
            channel: None,
            link: 0,
            adopted_at: Timestamp::ZERO,
            heard: Timestamp::ZERO,
            elsewhere: None,
            has_twin: None,
            stopped_for: Vec::new(),
            component,
            configured,
        }
    }

    /// What it was told and what it said is forgotten, and it is looked for as in the beginning.
    fn start_over(&mut self, rules: &ControlSettings, open: ChannelSet, now: Timestamp) {
        let settings = self.manager.settings().clone();
        *self = Self::new(settings, rules, self.component, self.configured, self.manager.kept_number());
        for channel in open {
            self.manager.open_channel(now, channel);
        }
    }

    /// What it speaks, as far as that is known.
    pub fn family(&self) -> Family {
        self.driver.family()
    }

    /// `MAV_TYPE` of its manager: "the MAV_TYPE is correctly set to MAV_TYPE_GIMBAL" on the ids of gimbals, where it
    /// speaks for one.
    pub fn mav_type(&self) -> u8 {
        match self.component {
            component::GIMBAL | component::GIMBAL2..=component::GIMBAL6 => mav_type::GIMBAL,
            _ => mav_type::ONBOARD_CONTROLLER,
        }
    }

    /// Whether it is told of: a place that waits for a gimbal is not, unless the configuration names it.
    pub fn is_shown(&self) -> bool {
        self.configured || self.manager.device().is_some()
    }

    /// Whether it has had its device for so long.
    pub fn has_device_for(&self, now: Timestamp, duration: Duration) -> bool {
        self.adopted.is_some() && now.since(self.adopted_at) >= duration
    }

    /// Whether its manager sends heartbeats: 191 always does, others from when their gimbal is known.
    pub fn beats(&self) -> bool {
        self.component == component::ONBOARD_COMPUTER || self.manager.device().is_some()
    }

    /// Whether it may be turning as it was told.
    pub fn may_be_turning(&self) -> bool {
        self.manager.may_be_turning() || self.driver.may_be_turning()
    }

    pub fn poll_timeout(&self) -> Option<Timestamp> {
        [self.manager.poll_timeout(), self.driver.poll_timeout()].into_iter().flatten().min()
    }

    pub fn poll_output(&mut self) -> Option<GimbalOutput> {
        if let Some(output) = self.driver.poll_output() {
            return Some(GimbalOutput::Driver(output));
        }
        self.manager.poll_output().map(GimbalOutput::Manager)
    }
}

/// What a gimbal's driver or manager wants done.
#[derive(Debug)]
pub enum GimbalOutput {
    Driver(DriverOutput),
    Manager(ManagerOutput),
}

/// All gimbals.
#[derive(Debug)]
pub struct Roster {
    gimbals: Vec<Gimbal>,
    rules: ControlSettings,
    /// Gimbals that were left turning, and that were not there since.
    left_turning: Awaited,
    /// The channels that are open, for the manager of a gimbal that is found later.
    open: ChannelSet,
    /// Devices that are not adopted yet, and when each was first heard.
    waiting: Vec<(MavId, Timestamp)>,
    /// The device id that is kept for each entry whose family is found out, in case that it is no v2 device: whoever learned
    /// an id goes by it for good, so it does not depend on which of them is found first.
    spoken_for: Vec<Option<u8>>,
    /// What gimbals without an entry were given.
    kept_ids: KeptIds,
    /// Components of type gimbal that manage a gimbal without MAVLink.
    self_managed: Vec<MavId>,
}

impl Roster {
    pub fn new(settings: &Settings) -> Self {
        let mut roster = Self {
            gimbals: Vec::new(),
            rules: settings.control.clone(),
            left_turning: Awaited::read(&settings.left_turning),
            open: ChannelSet::EMPTY,
            waiting: Vec::new(),
            spoken_for: Vec::new(),
            kept_ids: KeptIds::read(&settings.kept_ids),
            self_managed: Vec::new(),
        };
        let mut wanted: Vec<Option<u8>> = settings
            .gimbals
            .iter()
            .map(|gimbal| gimbal.manager_component_id.or(gimbal.component_id.and_then(manager_of_device)))
            .collect();
        for at in 0..wanted.len() {
            if wanted[at].is_none() {
                wanted[at] = (component::ONBOARD_COMPUTER..=component::ONBOARD_COMPUTER4)
                    .find(|free| !wanted.contains(&Some(*free)));
            }
        }
        // "1 to 6, its place among the non-v2 gimbals."
        let mut numbers = (1..=voice::LAST_NUMBER).peekable();
        for (gimbal, component) in settings.gimbals.iter().zip(wanted) {
            let component = component.expect("the configuration was refused when a manager component is missing");
            let number = gimbal.family.may_speak_through_manager().then(|| {
                numbers.next().expect("the configuration was refused when there are more than six such gimbals")
            });
            roster.gimbals.push(Gimbal::new(gimbal.clone(), &settings.control, component, true, number));
        }
        let is_open = |gimbal: &GimbalSettings| gimbal.family == Family::Auto;
        roster.spoken_for = settings.gimbals.iter().map(|gimbal| numbers.next_if(|_| is_open(gimbal))).collect();
        roster.ensure_first_manager();
        roster.stop_entries_left_turning();
        roster
    }

    pub fn iter(&self) -> impl Iterator<Item = &Gimbal> + Clone {
        self.gimbals.iter()
    }

    pub fn iter_mut(&mut self) -> impl Iterator<Item = &mut Gimbal> {
        self.gimbals.iter_mut()
    }

    pub fn len(&self) -> usize {
        self.gimbals.len()
    }

    pub fn get_mut(&mut self, at: usize) -> &mut Gimbal {
        &mut self.gimbals[at]
    }

    /// Every manager tells of its gimbal on `channel` from now on.
    pub fn open_channel(&mut self, now: Timestamp, channel: ChannelId) {
        self.open.insert(channel);
        for gimbal in &mut self.gimbals {
            gimbal.manager.open_channel(now, channel);
        }
    }

    /// A gimbal there is lost at once.
    pub fn close_channel(&mut self, channel: ChannelId) {
        self.open.remove(channel);
        for gimbal in &mut self.gimbals {
            gimbal.manager.close_channel(channel);
            if gimbal.channel == Some(channel) {
                gimbal.channel = None;
                gimbal.driver.handle_link_lost();
            }
        }
    }

    /// Whether another than the managed device speaks under its id on `channel`.
    pub fn is_twin(&self, device: MavId, channel: ChannelId) -> bool {
        let gimbal = self.gimbals.iter().find(|gimbal| gimbal.adopted == Some(device));
        gimbal.is_some_and(|gimbal| gimbal.channel.is_some_and(|place| place != channel) && !gimbal.is_lost())
    }

    /// The gimbal whose manager that component of ours is.
    pub fn of_manager(&mut self, component: u8) -> Option<&mut Gimbal> {
        self.gimbals.iter_mut().find(|gimbal| gimbal.component == component)
    }

    /// The channel of a managed device.
    pub fn channel_of(&self, device: MavId) -> Option<ChannelId> {
        self.gimbals.iter().find(|gimbal| gimbal.adopted == Some(device))?.channel
    }

    /// The open channels on which a gimbal was lost.
    pub fn channels_of_lost(&self) -> ChannelSet {
        let lost = self.gimbals.iter().filter(|gimbal| gimbal.is_lost()).filter_map(|gimbal| gimbal.channel);
        lost.fold(ChannelSet::EMPTY, |set, channel| set.union(channel.into()))
    }

    /// Whether `id` is a managed device.
    pub fn is_device(&self, id: MavId) -> bool {
        self.gimbals.iter().any(|gimbal| gimbal.adopted == Some(id))
    }

    /// Whether `component` is one of our managers.
    pub fn has_manager(&self, component: u8) -> bool {
        self.gimbals.iter().any(|gimbal| gimbal.component == component)
    }

    /// A new gimbal, in the place of one that was only found and is lost for good when no manager is left.
    fn make_place(&mut self, now: Timestamp, device: MavId, ours: u8) -> Result<usize, NotAdopted> {
        let given_up = |gimbal: &Gimbal| !gimbal.configured && gimbal.is_lost_for_good(now);
        let (at, component) = match self.free_manager(now, device)? {
            Some(component) => (self.gimbals.len(), component),
            None => {
                let rests = |gimbal: &Gimbal| given_up(gimbal) && !gimbal.may_be_turning();
                let at = self.gimbals.iter().position(rests).or_else(|| self.gimbals.iter().position(given_up));
                let at = at.ok_or(NotAdopted::NoManagerLeft)?;
                self.await_if_turning(at);
                (at, self.gimbals.remove(at).component)
            }
        };
        let settings = GimbalSettings::found(self.free_name(device, ours));
        let mut gimbal = Gimbal::new(settings, &self.rules, component, false, None);
        for channel in self.open {
            gimbal.manager.open_channel(now, channel);
        }
        self.gimbals.insert(at, gimbal);
        Ok(at)
    }

    /// A name that no gimbal has: by the component, with the system where that is not the vehicle's.
    fn free_name(&self, device: MavId, ours: u8) -> String {
        let full = format!("gimbal-{}-{}", device.system, device.component);
        let plain = if device.system == ours { format!("gimbal-{}", device.component) } else { full.clone() };
        self.first_free_name(plain, &full)
    }

    /// `name`, or a longer one where a gimbal has that: an entry may be called anything.
    fn first_free_name(&self, name: String, longer: &str) -> String {
        let is_free = |name: &String| !self.gimbals.iter().any(|gimbal| gimbal.manager.settings().name == *name);
        let numbered = (2_u32..).map(|number| format!("{longer}-{number}"));
        let mut names = [name, longer.to_owned()].into_iter().chain(numbered);
        names.find(is_free).expect("there are more numbers than gimbals")
    }

    /// 191 answers clients from the start, before any gimbal is there; unless the user gave the managers other ids.
    fn ensure_first_manager(&mut self) {
        let first = component::ONBOARD_COMPUTER;
        let chosen = self.gimbals.iter().any(|gimbal| gimbal.manager.settings().manager_component_id.is_some());
        if !self.has_manager(first) && !chosen {
            let name = self.first_free_name(format!("gimbal-{}", component::GIMBAL), &format!("gimbal-{first}"));
            let settings = GimbalSettings::found(name);
            self.gimbals.push(Gimbal::new(settings, &self.rules, first, false, None));
        }
    }
}

/// The manager component that goes with a v2 device's own.
pub const fn manager_of_device(device: u8) -> Option<u8> {
    match device {
        component::GIMBAL => Some(component::ONBOARD_COMPUTER),
        component::GIMBAL2..=component::GIMBAL4 => Some(device - component::GIMBAL2 + component::ONBOARD_COMPUTER + 1),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// D1: "Device 154 has manager 191, 171 has 192, 172 has 193, 173 has 194".
    #[test]
    fn each_device_has_its_manager() {
        let expected =
            [(154, Some(191)), (171, Some(192)), (172, Some(193)), (173, Some(194)), (174, None), (50, None)];
        for (device, manager) in expected {
            assert_eq!(manager_of_device(device), manager, "device {device}");
        }
    }

    /// D1: "other gimbals take the free ones in file order".
    #[test]
    fn found_devices_take_the_manager_of_their_id() {
        let mut roster = Roster::new(&Settings::default());
        let channel = ChannelId::new(0).expect("below the bound");
        let component = |roster: &mut Roster, device: u8| {
            let device = MavId::new(1, device);
            roster.adopt(Timestamp::ZERO, device, Place { link: 0, channel }, 1).map(|gimbal| gimbal.component)
        };
        assert_eq!(component(&mut roster, 171), Ok(192));
        assert_eq!(component(&mut roster, 154), Ok(191));
    }
}
