//! Getting to know a Gremsy: who it is, its parameters, its generation, its streams, and whether everything is in place.

use std::time::Duration;

use super::generation::{Evidence, Generation, Step};
use super::stopping::Stopping;
use super::{GremsyDriver, TICK, Timer};
use crate::gimbals::driver::DriverOutput;
use crate::gimbals::gremsy::packet;
use crate::gimbals::gremsy::parameters::{Parameter, ParameterTable};
use crate::gimbals::gremsy::version::FirmwareVersion;
use crate::gimbals::report::Report;
use crate::timestamp::Timestamp;
use crate::wire::MavId;
use crate::wire::dialect::MavMessage;
use crate::wire::ids::message;

/// 283 is asked for so often, once a second.
const ASK_EVERY: Duration = Duration::from_secs(1);
const ASK_AT_MOST: u8 = 10;

impl GremsyDriver {
    /// Gets to know the gimbal, from its first heartbeat on and whenever it starts again.
    pub(super) fn begin(&mut self, now: Timestamp, device: MavId) {
        self.begun = now;
        self.asked = 0;
        self.information = None;
        self.aligned_since = None;
        self.is_present = false;
        self.off = None;
        self.is_gone_as_told = false;
        // To whoever steers, the first start is none of a gimbal that was there before.
        self.is_start_told = self.reported.is_none();
        self.end_moves();
        self.stop_v2(now);
        self.heard.status = None;
        self.streams.forget_heard();
        self.timers.set(Timer::AskInformation, now);
        self.timers.set(Timer::Tick, now + TICK);
        self.parameters.refresh(now, device);
        if let Some(generation) = self.search.decided() {
            self.set_streams(now, device, generation);
        }
        self.report_readiness();
    }

    /// Its version, from whichever tells it.
    pub(super) fn version(&self) -> Option<FirmwareVersion> {
        let parameter = |parameter| {
            let table = self.table().unwrap_or(ParameterTable::New);
            self.parameters.value(table.name(parameter)?).map(|value| value as i16)
        };
        let version_z = parameter(Parameter::VersionZ);
        let told = self.information.as_ref().and_then(|information| information.identity.firmware);
        if let Some(told) = told {
            return Some(FirmwareVersion::from_information(told, version_z));
        }
        let (x, y, z) = (parameter(Parameter::VersionX)?, parameter(Parameter::VersionY)?, version_z?);
        Some(FirmwareVersion::from_parameters(x, y, z))
    }

    pub(super) fn evidence(&self) -> Evidence {
        let is_asked = self.information.is_some() || self.asked >= ASK_AT_MOST;
        Evidence {
            version: self.version(),
            is_read: is_asked && self.parameters.is_settled(),
            aligned_since: self.aligned_since,
        }
    }

    /// Goes on with getting to know it.
    pub(super) fn judge(&mut self, now: Timestamp, device: MavId) {
        if !self.is_alive {
            return;
        }
        match self.search.judge(now, self.evidence()) {
            None => {}
            Some(Step::Probe) => {
                let command = packet::set_message_rate(
                    device,
                    message::GIMBAL_DEVICE_ATTITUDE_STATUS,
                    packet::MessageRate::Hertz(10),
                );
                self.outputs.push_back(DriverOutput::Command(Box::new(command)));
            }
            Some(Step::Decided(generation)) => {
                tracing::info!(%device, generation = generation.name(), "the gimbal's protocol is known");
                let speaks = generation == Generation::V2;
                if speaks && self.mount.may_be_turning() {
                    self.mount.forget_rotation();
                    self.stopping = Some(Stopping::of_unknown(now));
                } else if !speaks {
                    self.stopping = None;
                }
                self.outputs.push_back(DriverOutput::Report(Report::SpeaksForItself(speaks)));
                self.report_alive(device);
                self.set_streams(now, device, generation);
            }
        }
        let is_ready = self.search.decided().is_some() && self.parameters.is_settled() && self.aligned_since.is_some();
        if is_ready && !self.is_present && self.off.is_none() {
            self.is_present = true;
            self.look_at_settings();
            if let Some(generation) = self.search.decided() {
                self.streams.want(generation, self.needs_orientation());
            }
            self.set_missing_streams(now, device);
        }
    }

    pub(super) fn set_streams(&mut self, now: Timestamp, device: MavId, generation: Generation) {
        self.streams.want(generation, self.needs_orientation());
        for command in self.streams.set(now, device) {
            self.outputs.push_back(DriverOutput::Command(Box::new(command)));
        }
    }

    /// Those that are wanted since more is known of it.
    pub(super) fn set_missing_streams(&mut self, now: Timestamp, device: MavId) {
        let heard: Vec<_> = self.streams.heard().collect();
        let is_missing = self.streams.wanted().any(|(stream, _)| !heard.contains(&stream));
        if is_missing {
            for command in self.streams.set(now, device) {
                self.outputs.push_back(DriverOutput::Command(Box::new(command)));
            }
        }
    }

    /// In v2, where 285 tells only a yaw from North and that one is wrong.
    pub(super) fn needs_orientation(&self) -> bool {
        let version = self.version();
        self.search.decided() == Some(Generation::V2)
            && version.is_some_and(|version| version.has_wrong_earth_yaw() && !version.tells_yaw_frame())
    }

    pub(super) fn ask_information(&mut self, now: Timestamp, device: MavId) {
        if self.information.is_some() || self.asked >= ASK_AT_MOST {
            return;
        }
        self.asked += 1;
        self.timers.set(Timer::AskInformation, now + ASK_EVERY);
        let command = packet::request_message(device, message::GIMBAL_DEVICE_INFORMATION);
        self.outputs.push_back(DriverOutput::Message(Box::new(MavMessage::COMMAND_LONG(command))));
    }
}
