//! What happened around a gimbal, as far as a person may want to know it.

use super::asked::UNCONFIRMED;
use super::control::{Change, How, Place};
use crate::gimbals::mavlink_v1::config::NO_RADIO_CONTROL;
use crate::gimbals::operation::{Operation, OperationError, STARTING};
use crate::wire::MavId;

/// Something that happened around one gimbal.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A place changed hands.
    Control(Change),
    /// A request was not done. `holder` is named where that is why.
    Refused {
        who: MavId,
        reason: &'static str,
        holder: Option<MavId>,
    },
    /// A request was done though its sender may have meant something else.
    Doubtful {
        who: MavId,
        doubt: Doubt,
    },
    /// Primary control was taken over too often; `holder` keeps it for a while, from `other` and everybody else.
    AcquireWar {
        holder: MavId,
        other: Option<MavId>,
    },
    /// The device was heard, for the first time under that id.
    Found {
        device: MavId,
    },
    /// The device was heard again after it was lost.
    Back {
        device: MavId,
    },
    Lost {
        device: Option<MavId>,
    },
    /// It was told to shut down, and is silent since.
    ShutDown {
        device: Option<MavId>,
    },
    /// It does not do any more what it was told.
    Restarted {
        device: Option<MavId>,
    },
    /// It can be steered again after it started or was lost.
    Ready {
        device: Option<MavId>,
    },
    /// Something is wrong with the gimbal, in a few words.
    Fault {
        what: &'static str,
    },
    /// Something else than where it looks was asked of the gimbal, and given on to it. A parameter was `before`, where that
    /// is known.
    Operated {
        who: MavId,
        operation: Operation,
        before: Option<f64>,
    },
    /// What was asked of the gimbal, and given on to it, was not done.
    NotOperated {
        who: MavId,
        operation: Operation,
        error: OperationError,
    },
    /// A rotation was stopped because nobody asked for it any more.
    RatesEnded {
        who: MavId,
        end: RatesEnd,
    },
    RoiStarted {
        who: Option<MavId>,
    },
    /// `who` asked for something else, if anybody did.
    RoiEnded {
        who: Option<MavId>,
    },
}

/// What a sender of gimbal protocol v1 may have meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// A yaw from the nose beyond 180°, as headings are.
    YawLikeAHeading,
    /// Hundredths of a degree, which it is now taken to send.
    SendsCentidegrees,
}

impl Doubt {
    const fn name(self) -> &'static str {
        match self {
            Self::YawLikeAHeading => "yaw_like_a_heading",
            Self::SendsCentidegrees => "sends_centidegrees",
        }
    }

    const fn describe(self) -> &'static str {
        match self {
            Self::YawLikeAHeading => {
                "gives a yaw from the nose that looks like a heading; DO_MOUNT_CONFIGURE with input 2 for yaw makes it one"
            }
            Self::SendsCentidegrees => "is taken to send hundredths of a degree (accept_centidegrees)",
        }
    }
}

/// Why a rotation ended by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RatesEnd {
    /// It was not refreshed, or lasted as long as a command may.
    TimedOut,
    /// Who asked for it was not heard for the lease.
    SenderSilent,
}

impl Event {
    /// A word for programs.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Control(change) => match change.how {
                How::Taken => "taken",
                How::TakenOver => "taken_over",
                How::Borrowed => "borrowed",
                How::Restored => "restored",
                How::Delegated => "delegated",
                How::Released => "released",
                How::Cleared => "cleared",
                How::Lapsed => "lapsed",
                How::Restarted => "holder_restarted",
                How::SystemGone => "system_gone",
            },
            Self::Refused { .. } => "refused",
            Self::Doubtful { .. } => "doubtful",
            Self::AcquireWar { .. } => "acquire_war",
            Self::Found { .. } => "gimbal_found",
            Self::Back { .. } => "gimbal_back",
            Self::Lost { .. } => "gimbal_lost",
            Self::ShutDown { .. } => "gimbal_shut_down",
            Self::Restarted { .. } => "gimbal_restarted",
            Self::Ready { .. } => "gimbal_ready",
            Self::Fault { .. } => "fault",
            Self::Operated { .. } => "operated",
            Self::NotOperated { .. } => "operation_failed",
            Self::RatesEnded { .. } => "rates_ended",
            Self::RoiStarted { .. } => "roi_started",
            Self::RoiEnded { .. } => "roi_ended",
        }
    }

    /// Who did it, or to whom it happened.
    pub const fn who(&self) -> Option<MavId> {
        match *self {
            Self::Control(Change { who, .. })
            | Self::Refused { who, .. }
            | Self::Operated { who, .. }
            | Self::NotOperated { who, .. }
            | Self::Doubtful { who, .. }
            | Self::RatesEnded { who, .. } => Some(who),
            Self::AcquireWar { holder, .. } => Some(holder),
            Self::Found { device } | Self::Back { device } => Some(device),
            Self::Lost { device } | Self::ShutDown { device } | Self::Restarted { device } | Self::Ready { device } => {
                device
            }
            Self::RoiStarted { who } | Self::RoiEnded { who } => who,
            Self::Fault { .. } => None,
        }
    }

    /// Who had control before, or has it and so stood in the way.
    pub const fn from(&self) -> Option<MavId> {
        match *self {
            Self::Control(Change { from, .. }) => from,
            Self::Refused { holder, .. } => holder,
            Self::AcquireWar { other, .. } => other,
            _ => None,
        }
    }

    /// Who has control from now on.
    pub const fn to(&self) -> Option<MavId> {
        match *self {
            Self::Control(Change { to, .. }) => to,
            Self::AcquireWar { holder, .. } => Some(holder),
            _ => None,
        }
    }

    pub const fn place(&self) -> Option<Place> {
        match *self {
            Self::Control(Change { place, .. }) => Some(place),
            _ => None,
        }
    }

    /// Why, where there is more to say than the event's name does.
    pub const fn reason(&self) -> Option<&'static str> {
        match *self {
            Self::Refused { reason, .. } => Some(reason),
            Self::Fault { what } => Some(what),
            Self::Operated { ref operation, .. } | Self::NotOperated { ref operation, .. } => Some(operation.name()),
            Self::Doubtful { doubt, .. } => Some(doubt.name()),
            Self::RatesEnded { end: RatesEnd::TimedOut, .. } => Some("timed_out"),
            Self::RatesEnded { end: RatesEnd::SenderSilent, .. } => Some("sender_silent"),
            _ => None,
        }
    }

    /// A sentence for the person looking, with components as `names` has them.
    pub fn describe(&self, names: Names) -> String {
        let by = |what: &str, who: Option<MavId>| {
            who.map_or_else(|| what.to_owned(), |who| format!("{what}, by {}", names.of(who)))
        };
        match *self {
            Self::Control(change) => describe_change(change, names),
            Self::Refused { who, reason, holder } => {
                format!("{} was refused: {}", names.of(who), why(reason, holder, names))
            }
            Self::Doubtful { who, doubt } => format!("{} {}", names.of(who), doubt.describe()),
            Self::AcquireWar { holder, other } => {
                let others = other.map_or_else(|| "another".to_owned(), |other| names.of(other));
                let holder = names.of(holder);
                format!("{holder} and {others} keep taking control from each other; {holder} keeps it for a while")
            }
            Self::Found { device } => format!("gimbal found as {device}"),
            Self::Back { device } => format!("gimbal {device} is back"),
            Self::Lost { .. } => "gimbal lost".to_owned(),
            Self::ShutDown { .. } => {
                "gimbal shut down, as it was asked to; it is back when it is switched on".to_owned()
            }
            Self::Restarted { .. } => "gimbal restarted; it is told nothing until somebody asks".to_owned(),
            Self::Ready { .. } => "gimbal ready: it can be steered".to_owned(),
            Self::Fault { what } => format!("fault: {what}"),
            Self::Operated { who, ref operation, before } => {
                let before = before.map(|before| format!(" (it was {before})")).unwrap_or_default();
                format!("{} asked for {}{before}", names.of(who), operation.describe())
            }
            Self::NotOperated { who, ref operation, ref error } => {
                format!("{}, which {} asked for, was not done: {error}", operation.describe(), names.of(who))
            }
            Self::RatesEnded { who, end: RatesEnd::TimedOut } => {
                format!("rotation stopped: {} did not ask for it again", names.of(who))
            }
            Self::RatesEnded { who, end: RatesEnd::SenderSilent } => {
                format!("rotation stopped: {}, who asked for it, is silent", names.of(who))
            }
            Self::RoiStarted { who } => by("points at a place", who),
            Self::RoiEnded { who } => by("points at no place any more", who),
        }
    }
}

/// Why somebody was refused; `holder` is who stands in the way.
pub fn why(reason: &str, holder: Option<MavId>, names: Names) -> String {
    let reason = explain(reason);
    match holder.map(|holder| names.of(holder)) {
        Some(holder) if reason.is_empty() => format!("{holder} is in control"),
        Some(holder) => format!("{holder} is in control, and {reason}"),
        None => reason,
    }
}

/// What components are called where people read it.
///
/// Programs that ask over HTTP have the manager's own ids (D5), and are called `http`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// The manager's own ids, once its system id is settled.
    pub own: Option<MavId>,
}

impl Names {
    pub fn of(self, id: MavId) -> String {
        if self.own == Some(id) { "http".to_owned() } else { id.to_string() }
    }
}

/// A reason in words; nothing where naming the holder says it all.
fn explain(reason: &str) -> String {
    match reason {
        "not_in_control" => "",
        "primary_is_active" => "steers at this moment",
        "holder_must_release" => "must release first (takeover = \"ask\")",
        "holder_ranks_no_lower" => "ranks no lower (takeover = \"priority\")",
        "exclusively_held" => "must release first (takeover = \"exclusive\")",
        "nobody_in_control" => "nobody is in control, and unclaimed = \"closed\" lets nobody steer before",
        "overruled" => "it goes on moving after somebody else took over; it is obeyed again when it asks for something new",
        "acquire_war" => "control changed hands too often lately",
        "other_vehicle" => "it belongs to another vehicle",
        UNCONFIRMED => "it is dangerous, and its word was not said",
        "only_for_the_holder" => "only who has control may ask for that",
        "id_of_nobody" => "its system or component id is 0, which is nobody's; for control it needs ids of its own",
        "half_a_pair" => "it named half of a system and component id",
        "not_an_id" => "it named something that is no id",
        "unknown_gimbal" => "it named a gimbal that is not here",
        "no_gimbal_yet" => "no gimbal was heard yet",
        "gimbal_unknown_yet" => "the gimbal is heard, and is still being got to know or starting",
        "gimbal_starting" => STARTING,
        "gimbal_shut_down" => "the gimbal was shut down; switch it on",
        "no_attitude" => "the attitude of the gimbal is not known",
        "no_heading" => "the heading of the vehicle is not known",
        "no_home_position" => "the autopilot has not told where home is; it is asked",
        "looks_like_centidegrees" => {
            "its angles look like hundredths of a degree, and DO_MOUNT_CONTROL has degrees (accept_centidegrees = true takes them)"
        }
        "looks_like_a_place" => "its angles look like a place, which MOUNT_CONFIGURE or DO_MOUNT_CONFIGURE in mode 4 makes of them",
        "place_in_the_first_parameters" => "it has the place in parameters 1 to 3, as of old; it belongs into 4 to 6",
        "v1_radio_control_is_none" => NO_RADIO_CONTROL,
        "no_rc_inputs" | "mount_mode_rc_targeting_unsupported" => {
            "the gimbal tells of no radio control of its own; a Gremsy may be left to it by name (radio-control)"
        }
        "mount_mode_sysid_target_unsupported" => {
            "a mount follows no other vehicle; DO_SET_ROI_LOCATION (195) with its position, again and again, does"
        }
        "mount_mode_wpnext_offset_unsupported" => "a mount knows no waypoints; DO_SET_ROI_LOCATION (195) points at one",
        _ => return reason.replace('_', " "),
    }
    .to_owned()
}

fn describe_change(change: Change, names: Names) -> String {
    let Change { place, how, who, from, to } = change;
    let control = match place {
        Place::Primary => "control",
        Place::Secondary => "secondary control",
    };
    let name = |id: Option<MavId>| id.map_or_else(|| "nobody".to_owned(), |id| names.of(id));
    let (who, from, to) = (names.of(who), name(from), name(to));
    match how {
        How::Taken => format!("{who} took {control}"),
        How::TakenOver if to == who => format!("{who} took {control} from {from}"),
        How::TakenOver => format!("{who} took {control} from {from} for {to}"),
        How::Borrowed => format!("the autopilot borrowed {control} from {from}"),
        How::Restored => format!("{to} has {control} back from the autopilot"),
        How::Delegated => format!("{who} gave {control} to {to}"),
        How::Released => format!("{who} released {control}"),
        How::Cleared => format!("{who} ended the {control} of {from}"),
        How::Lapsed => format!("{who} is silent and lost {control}"),
        How::Restarted => format!("{who} has started again and lost {control}"),
        How::SystemGone => format!("{who} is no part of this vehicle and lost {control}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbals::operation::Motors;

    /// "Who is in control, since when, why somebody was refused": as sentences.
    #[test]
    fn events_read_as_sentences() {
        let (gcs, autopilot, script) = (MavId::new(255, 190), MavId::new(1, 1), MavId::new(245, 191));
        let change = |how, who, from, to| Event::Control(Change { place: Place::Primary, how, who, from, to });
        let operated = |operation, before| Event::Operated { who: MavId::new(1, 191), operation, before };
        let set = |name: &str, value| Operation::SetParameter { name: name.to_owned(), value };
        let denied = |operation| Event::NotOperated { who: script, operation, error: OperationError::Denied };
        for (event, text) in [
            (change(How::TakenOver, script, Some(gcs), Some(script)), "245/191 took control from 255/190"),
            (change(How::TakenOver, script, Some(gcs), Some(autopilot)), "245/191 took control from 255/190 for 1/1"),
            (
                change(How::Borrowed, autopilot, Some(gcs), Some(autopilot)),
                "the autopilot borrowed control from 255/190",
            ),
            (change(How::Restored, autopilot, None, Some(gcs)), "255/190 has control back from the autopilot"),
            (change(How::Lapsed, gcs, Some(gcs), None), "255/190 is silent and lost control"),
            (change(How::Restarted, gcs, Some(gcs), None), "255/190 has started again and lost control"),
            (
                Event::Refused { who: script, reason: "not_in_control", holder: Some(gcs) },
                "245/191 was refused: 255/190 is in control",
            ),
            (
                Event::Refused { who: script, reason: "unknown_gimbal", holder: None },
                "245/191 was refused: it named a gimbal that is not here",
            ),
            (operated(Operation::Motors(Motors::Off), None), "http asked for motors off"),
            (operated(set("PWR_PAN", 60.0), Some(55.0)), "http asked for parameter PWR_PAN = 60 (it was 55)"),
            (operated(set("PWR_PAN", 0.5), None), "http asked for parameter PWR_PAN = 0.5"),
            (
                denied(Operation::Motors(Motors::Off)),
                "motors off, which 245/191 asked for, was not done: the gimbal denied it",
            ),
            (
                Event::Refused { who: MavId::new(1, 191), reason: "not_in_control", holder: Some(gcs) },
                "http was refused: 255/190 is in control",
            ),
        ] {
            assert_eq!(event.describe(Names { own: Some(MavId::new(1, 191)) }), text);
        }
    }
}
