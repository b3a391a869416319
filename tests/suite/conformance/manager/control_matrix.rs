//! Every CONFIGURE against the rule.
//!
//! "The CONFIGURE matrix of values -4…256, NaN, fractions, mixed pairs, three clients, each policy: no half-owned state is
//! reachable." The manager stands alone here, without links around it, so that there is time for all of it.

use gimbald::channel::ChannelId;
use gimbald::gimbals::report::Report;
use gimbald::gimbals::settings::{GimbalSettings, Takeover};
use gimbald::manager::events::Event;
use gimbald::manager::rank::Ranks;
use gimbald::manager::request::{Command, Form, Request};
use gimbald::manager::settings::ControlSettings;
use gimbald::manager::{GimbalManager, ManagerOutput, Sender, Surroundings};
use gimbald::timestamp::Timestamp;
use gimbald::vehicle::Vehicle;
use gimbald::wire::dialect::MavMessage;
use gimbald::wire::{MavId, Target};

use super::COMPANION;
use crate::support::control_rule::{ACCEPTED, DENIED, Rule};
use crate::support::script::NAN;
use crate::support::world::{AUTOPILOT, GCS, GIMBAL, MANAGER};

const POLICIES: [Takeover; 4] = [Takeover::Open, Takeover::Ask, Takeover::Priority, Takeover::Exclusive];

/// The three clients: a person's, a program's on board, and the autopilot.
const CLIENTS: [MavId; 3] = [GCS, COMPANION, AUTOPILOT];

const START: Timestamp = Timestamp::from_secs(1);

/// Pairs that mean something each, and some that are none.
#[rustfmt::skip]
const PAIRS: [[f32; 2]; 16] = [
    [-1.0, -1.0], [-2.0, -2.0], [-3.0, -3.0], [0.0, 0.0], [0.0, 7.0], [255.0, 0.0], [255.0, 190.0], [1.0, 192.0],
    [1.0, 1.0], [12.0, 34.0], [NAN, NAN], [NAN, -1.0], [-2.0, -3.0], [255.0, -1.0], [0.5, 1.0], [256.0, 1.0],
];

/// Every value of each parameter, beside every kind of partner, for each place.
#[test]
fn every_value_of_every_parameter_does_what_the_rule_says() {
    let specials = [NAN, f32::INFINITY, f32::NEG_INFINITY, 0.5, -0.5, 1.000_5, 0.999_5, 254.5, 1.002, -2.998, 1e9];
    let values: Vec<f32> = (-4_i16..=256).map(f32::from).chain(specials).collect();
    let partners = [-4.0, -3.0, -2.0, -1.0, 0.0, 1.0, 190.0, 192.0, 256.0, NAN, 0.5];
    for policy in POLICIES {
        // A companion has primary control and a ground station secondary.
        let held = Court::new(policy).held([Some(COMPANION), Some(GCS)]).expect("both are free");
        for sender in CLIENTS {
            for value in &values {
                for partner in partners {
                    for pair in [[*value, partner], [partner, *value]] {
                        held.clone().check(sender, [pair[0], pair[1], -1.0, -1.0]);
                        held.clone().check(sender, [-1.0, -1.0, pair[0], pair[1]]);
                    }
                }
            }
        }
    }
}

/// Every kind of pair for both places at once, whoever holds them, borrowed ones too.
#[test]
fn every_pair_of_pairs_does_what_the_rule_says_whoever_holds_the_gimbal() {
    let holders = || [None].into_iter().chain(CLIENTS.map(Some));
    for policy in POLICIES {
        for (primary, secondary) in holders().flat_map(|one| holders().map(move |other| (one, other))) {
            let held = Court::new(policy).held([primary, secondary]).expect("both are free");
            let borrowed = held.clone().borrowed();
            for court in [Some(held), borrowed].into_iter().flatten() {
                for sender in CLIENTS {
                    for [first, second] in PAIRS.iter().flat_map(|one| PAIRS.map(|other| [*one, other])) {
                        court.clone().check(sender, [first[0], first[1], second[0], second[1]]);
                    }
                }
            }
        }
    }
}

/// The same as short stories: any three after one another, so that what one leaves behind is what the next meets.
#[test]
fn every_story_of_three_ends_as_the_rule_says() {
    let pairs = [[-1.0, -1.0], [-2.0, -2.0], [-3.0, -3.0], [0.0, 0.0], [255.0, 190.0], [1.0, 1.0], [255.0, -2.0]];
    let steps: Vec<(MavId, [f32; 4])> = CLIENTS
        .into_iter()
        .flat_map(|sender| pairs.map(|pair| (sender, [pair[0], pair[1], -1.0, -1.0])))
        .chain(CLIENTS.map(|sender| (sender, [-2.0, -2.0, -2.0, -2.0])))
        .collect();
    for policy in POLICIES {
        for first in &steps {
            let mut begun = Court::new(policy);
            begun.check(first.0, first.1);
            for second in &steps {
                let mut court = begun.clone();
                court.check(second.0, second.1);
                for third in &steps {
                    court.clone().check(third.0, third.1);
                }
            }
        }
    }
}

/// A manager, and the rule beside it.
struct Court {
    rule: Rule,
    said: Vec<(MavId, [f32; 4])>,
    manager: GimbalManager,
}

impl Clone for Court {
    /// A manager is not copied but led to the same state again.
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.rule.takeover);
        for (sender, params) in &self.said {
            copy.say(*sender, *params);
        }
        Self { rule: self.rule.clone(), said: self.said.clone(), ..copy }
    }
}

impl Court {
    fn new(takeover: Takeover) -> Self {
        let settings = GimbalSettings { takeover, ..GimbalSettings::found("camera".to_owned()) };
        let mut manager = GimbalManager::new(settings, ControlSettings::default(), None);
        // Before it is known whether it is a v2 device, no status tells an id of it.
        for report in [Report::Alive { device: GIMBAL }, Report::SpeaksForItself(true)] {
            around(|around| manager.handle_report(START, report, around));
        }
        while manager.poll_output().is_some() {}
        Self { rule: Rule::new(takeover, AUTOPILOT, &[GCS]), said: Vec::new(), manager }
    }

    /// Each holder takes its place itself, the secondary first: beside a primary its place is not free under each policy.
    fn held(mut self, holders: [Option<MavId>; 2]) -> Option<Self> {
        let [primary, secondary] = holders;
        for (holder, params) in [(secondary, [-1.0, -1.0, -2.0, -2.0]), (primary, [-2.0, -2.0, -1.0, -1.0])] {
            if let Some(holder) = holder {
                self.check(holder, params);
            }
        }
        (self.rule.holders() == holders).then_some(self)
    }

    /// The autopilot borrows primary control, where the policy lets it and there is somebody to borrow from.
    fn borrowed(mut self) -> Option<Self> {
        self.check(AUTOPILOT, [-2.0, -2.0, -1.0, -1.0]);
        self.rule.lender.is_some().then_some(self)
    }

    /// Says it to both; answer, 281, events and holders must be those of the rule.
    #[track_caller]
    fn check(&mut self, sender: MavId, params: [f32; 4]) {
        let before = self.rule.holders();
        let expected = self.rule.configure(START, sender, params);
        let outputs = self.say(sender, params);
        let case = || format!("{:?}, held by {before:?}: {sender} sent {params:?}", self.rule.takeover);

        let mut acks = Vec::new();
        let mut told = Vec::new();
        let mut changed = Vec::new();
        let mut refused = 0;
        for output in outputs {
            match output {
                ManagerOutput::Reply { to, message, .. } => {
                    let MavMessage::COMMAND_ACK(ack) = *message else { panic!("{message:?}: {}", case()) };
                    assert_eq!((to, ack.command), (sender, 1001), "{}", case());
                    acks.push(ack.result);
                }
                ManagerOutput::Broadcast { channels: None, message } => {
                    let MavMessage::GIMBAL_MANAGER_STATUS(status) = *message else { panic!("{message:?}: {}", case()) };
                    let pair = |system, component| match (system, component) {
                        (0, 0) => None,
                        (0, _) | (_, 0) => panic!("half a pair: {}", case()),
                        (system, component) => Some(MavId::new(system, component)),
                    };
                    told.push([
                        pair(status.primary_control_sysid, status.primary_control_compid),
                        pair(status.secondary_control_sysid, status.secondary_control_compid),
                    ]);
                }
                ManagerOutput::Event(Event::Control(change)) => changed.push((change.from, change.to)),
                ManagerOutput::Event(Event::Refused { who, .. }) if who == sender => refused += 1,
                other => panic!("{other:?}: {}", case()),
            }
        }
        let after = self.rule.holders();
        assert_eq!(acks, [expected], "{}", case());
        assert_eq!(refused, u32::from(expected == DENIED), "{}", case());
        let control = self.manager.control();
        assert_eq!([control.primary(), control.secondary()], after, "{}", case());
        assert_eq!(control.lender(), self.rule.lender.map(|lender| lender.id), "{}", case());
        let changes: Vec<_> = before.into_iter().zip(after).filter(|(before, after)| before != after).collect();
        assert_eq!(changed, changes, "{}", case());
        assert_eq!(told, if changes.is_empty() { vec![] } else { vec![after] }, "{}", case());
        assert!(expected == ACCEPTED || before == after, "{}", case());
    }

    fn say(&mut self, sender: MavId, params: [f32; 4]) -> Vec<ManagerOutput> {
        self.said.push((sender, params));
        let [a, b, c, d] = params;
        let command = Command {
            number: 1001,
            target: Target::Component(MANAGER),
            params: [a, b, c, d, NAN, NAN, 154.0],
            form: Form::Long,
            confirmation: 0,
        };
        let sender = Sender { id: sender, channel: ChannelId::new(0).expect("below the bound") };
        around(|around| self.manager.handle_request(START, sender, &Request::Command(command), around));
        std::iter::from_fn(|| self.manager.poll_output()).collect()
    }
}

/// Our system is 1, and `GCS` calls itself a ground station.
fn around(with: impl FnOnce(Surroundings<'_>)) {
    let vehicle = Vehicle::new();
    let mut ranks = Ranks::default();
    ranks.set_own_system(Some(1));
    ranks.handle_heartbeat(GCS, 6);
    with(Surroundings {
        vehicle: &vehicle,
        autopilot: Some(AUTOPILOT),
        ranks: &ranks,
        overheard: false,
        other_vehicle: false,
    });
}
