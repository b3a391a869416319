//! Who may steer, whatever is claimed by whom.

use super::*;
use crate::manager::rank::Ranks;
use crate::wire::ids::mav_type;

const GCS: MavId = MavId::new(255, 190);
const COMPANION: MavId = MavId::new(1, 192);
const AUTOPILOT: MavId = MavId::new(1, 1);
const LEASE: Duration = Duration::from_secs(10);

/// `MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE`: "0: no one in control, -1: leave unchanged, -2: set itself in control,
/// -3: remove control if currently in control".
#[test]
#[rustfmt::skip]
fn configure_decides_who_holds_primary_control() {
    for (holder,          sender,    claim,                     expected) in [
        (None,            GCS,       Claim::Assign(GCS),        Ok(Some(GCS))),
        (Some(GCS),       COMPANION, Claim::Keep,               Ok(Some(GCS))),
        (None,            COMPANION, Claim::Take,               Ok(Some(COMPANION))),
        (Some(GCS),       COMPANION, Claim::Release,            Ok(Some(GCS))),
        (Some(GCS),       GCS,       Claim::Release,            Ok(None)),
        (Some(GCS),       COMPANION, Claim::Assign(COMPANION),  Ok(Some(COMPANION))),
        (Some(GCS),       GCS,       Claim::Assign(COMPANION),  Ok(Some(COMPANION))),
        (Some(GCS),       GCS,       Claim::Clear,              Ok(None)),
        (Some(GCS),       AUTOPILOT, Claim::Clear,              Ok(None)),
        (Some(GCS),       COMPANION, Claim::Clear,              Err("not_in_control")),
    ] {
        let mut court = Court::held_by(holder);

        let result = court.claim(sender, claim);

        let outcome = result.map(|_| court.control.primary()).map_err(|refusal| refusal.reason);
        assert_eq!(outcome, expected, "{sender} sent {claim:?}, held by {holder:?}");
        if outcome.is_err() {
            assert_eq!(court.control.primary(), holder, "a refused request changes nothing");
        }
    }
}

/// D24, `takeover = "ask"`: "another's CONFIGURE is DENIED … until the holder releases".
#[test]
fn a_holder_who_must_be_asked_keeps_control_until_it_lets_go() {
    let mut court = Court { takeover: Takeover::Ask, ..Court::held_by(Some(GCS)) };

    let refused = court.claim(COMPANION, Claim::Take);
    assert_eq!((refused, court.control.primary()), (Err(Refusal::denied("holder_must_release")), Some(GCS)));

    assert!(court.claim(GCS, Claim::Release).is_ok());
    assert!(court.claim(COMPANION, Claim::Take).is_ok());
    assert_eq!(court.control.primary(), Some(COMPANION));
}

/// D6: "The autopilot's take-over for RTL, landing or a mission is a *borrow*: the former holder, if alive, is
/// restored when it releases."
#[test]
fn what_the_autopilot_borrowed_goes_back() {
    let change = |how, who, from, to| Change { place: Place::Primary, how, who, from, to };
    let borrowed = change(How::Borrowed, AUTOPILOT, Some(GCS), Some(AUTOPILOT));
    let restored = change(How::Restored, AUTOPILOT, Some(AUTOPILOT), Some(GCS));
    for claim in [Claim::Release, Claim::Clear] {
        let mut court = Court::held_by(Some(GCS));
        assert_eq!(court.claim(AUTOPILOT, Claim::Take), Ok(vec![borrowed]));
        assert_eq!((court.control.primary(), court.control.lender()), (Some(AUTOPILOT), Some(GCS)));
        assert_eq!(court.claim(AUTOPILOT, claim), Ok(vec![restored]), "{claim:?}");
        assert_eq!((court.control.primary(), court.control.lender()), (Some(GCS), None));
    }
    // Or when it falls silent.
    let mut court = Court::held_by(Some(GCS));
    assert_eq!(court.claim(AUTOPILOT, Claim::Take), Ok(vec![borrowed]));
    court.control.handle_heard(Timestamp::from_secs(9), GCS);
    let lapsed = change(How::Lapsed, AUTOPILOT, Some(AUTOPILOT), None);
    let restored = change(How::Restored, AUTOPILOT, None, Some(GCS));
    assert_eq!(court.control.handle_timeout(Timestamp::from_secs(10), LEASE), [lapsed, restored]);
    assert_eq!(court.control.poll_timeout(LEASE), Some(Timestamp::from_secs(19)), "its lease runs on from before");
}

/// D6: "if alive"; and who does not want it back, or has taken it back, or was overtaken by a third, does not get it.
#[test]
fn a_borrow_ends_in_other_ways_too() {
    let third = MavId::new(255, 191);
    type Way = (&'static str, fn(&mut Court), Option<MavId>);
    let ways: [Way; 6] = [
        ("the lender fell silent", |court| drop(court.control.handle_timeout(Timestamp::from_secs(10), LEASE)), None),
        ("the lender's system is gone", |court| drop(court.control.forget_system(Timestamp::ZERO, 255)), None),
        ("the lender released", |court| drop(court.claim(GCS, Claim::Release)), None),
        ("the lender took it back", |court| drop(court.claim(GCS, Claim::Take)), Some(GCS)),
        ("a third took it", |court| drop(court.claim(MavId::new(255, 191), Claim::Take)), Some(third)),
        ("the autopilot gave it away", |court| drop(court.claim(AUTOPILOT, Claim::Assign(COMPANION))), Some(COMPANION)),
    ];
    for (name, end, holder) in ways {
        let mut court = Court::held_by(Some(GCS));
        assert!(court.claim(AUTOPILOT, Claim::Take).is_ok());
        court.control.handle_heard(Timestamp::from_secs(5), AUTOPILOT);
        end(&mut court);
        assert_eq!(court.control.lender(), None, "{name}");
        assert!(court.claim(AUTOPILOT, Claim::Release).is_ok());
        assert_eq!(court.control.primary(), holder, "{name}");
    }
}

/// `takeover = "ask"` and `"priority"`: who lent its place may take it back under the first, and under the second if
/// it ranks above the autopilot.
#[test]
fn a_lender_takes_back_what_is_its_own() {
    let ask = || Court { takeover: Takeover::Ask, ..Court::held_by(Some(COMPANION)) };
    let priority = || Court { takeover: Takeover::Priority, ..Court::held_by(Some(COMPANION)) };
    for (mut court, taker, allowed) in
        [(ask(), COMPANION, true), (ask(), GCS, false), (priority(), COMPANION, false), (priority(), GCS, true)]
    {
        assert!(court.claim(AUTOPILOT, Claim::Take).is_ok());
        assert_eq!(court.claim(taker, Claim::Take).is_ok(), allowed, "{:?}: {taker}", court.takeover);
    }
}

/// Both places change or none: a claim to one that is refused leaves the other as it was.
#[test]
fn half_of_a_configure_is_never_applied() {
    let mut court = Court { takeover: Takeover::Ask, ..Court::held_by(None) };
    let both = |primary, secondary| Configure { primary, secondary };
    let given = court.configure(GCS, both(Claim::Keep, Claim::Take)).expect("it is free");
    assert_eq!(given, [Change { place: Place::Secondary, how: How::Taken, who: GCS, from: None, to: Some(GCS) }]);

    let refused = court.configure(COMPANION, both(Claim::Take, Claim::Take));

    assert_eq!(refused, Err(Refusal::denied("holder_must_release")));
    assert_eq!((court.control.primary(), court.control.secondary()), (None, Some(GCS)));
}

/// Protocol checklist 63: with the quirk on, (−2, −2) from the autopilot that holds control is a release, and its
/// repeat half a second later is not a new claim.
#[test]
fn the_px4_quirk_makes_minus_two_a_release_once() {
    let mut court = Court { quirk: true, ..Court::held_by(Some(AUTOPILOT)) };
    for (millis, expected) in [(0, None), (500, None), (6_000, Some(AUTOPILOT))] {
        court.now = Timestamp::from_millis(millis);
        let result = court.claim(AUTOPILOT, Claim::Take);
        assert_eq!((result.is_ok(), court.control.primary()), (true, expected), "at {millis} ms");
    }
}

#[test]
#[rustfmt::skip]
fn the_gate_opens_to_who_is_in_control() {
    let denied = |reason| Err(Refusal::denied(reason));
    let (whole, second) = (Ok(Voice::Whole), |whole| Ok(Voice::Second { whole }));
    for (primary,      secondary,       sender,    silent, open,  expected) in [
        (None,         None,            GCS,       true,   true,  whole),
        (None,         None,            GCS,       true,   false, denied("nobody_in_control")),
        (Some(GCS),    None,            GCS,       false,  false, whole),
        (Some(GCS),    Some(COMPANION), AUTOPILOT, true,   true,  denied("not_in_control")),
        (Some(GCS),    Some(COMPANION), COMPANION, false,  true,  second(false)),
        (Some(GCS),    Some(COMPANION), COMPANION, true,   true,  second(true)),
        (Some(GCS),    Some(GCS),       GCS,       false,  true,  whole),
        (None,         Some(COMPANION), COMPANION, true,   false, whole),
    ] {
        let mut court = Court { open, ..Court::held_by(primary) };
        let holder = |id| Holder { id, since: Timestamp::ZERO, heard: Timestamp::ZERO };
        court.control.secondary = secondary.map(holder);
        assert_eq!(court.control.gate(sender, silent, court.policy()), expected, "{primary:?} {secondary:?} {sender}");
    }
}

/// D6: the slot of a holder not heard for the lease is cleared; who was given control and never heard is silent from
/// then on.
#[test]
fn a_silent_holder_loses_control() {
    let mut court = Court::held_by(Some(GCS));
    court.control.handle_heard(Timestamp::from_secs(5), GCS);
    assert_eq!(court.control.poll_timeout(LEASE), Some(Timestamp::from_secs(15)));
    assert_eq!(court.control.handle_timeout(Timestamp::from_micros(14_999_999), LEASE), []);
    let lapsed = Change { place: Place::Primary, how: How::Lapsed, who: GCS, from: Some(GCS), to: None };
    assert_eq!(court.control.handle_timeout(Timestamp::from_secs(15), LEASE), [lapsed]);
    assert_eq!(court.control.primary(), None);

    court.now = Timestamp::from_secs(20);
    assert!(court.claim(GCS, Claim::Assign(MavId::new(9, 9))).is_ok());
    assert_eq!(court.control.poll_timeout(LEASE), Some(Timestamp::from_secs(30)));
}

/// A [`Control`] with the rules over it.
struct Court {
    now: Timestamp,
    control: Control,
    takeover: Takeover,
    open: bool,
    quirk: bool,
    ranks: Ranks,
}

impl Court {
    fn held_by(holder: Option<MavId>) -> Self {
        let primary = holder.map(|id| Holder { id, since: Timestamp::ZERO, heard: Timestamp::ZERO });
        let mut ranks = Ranks::default();
        ranks.set_own_system(Some(1));
        ranks.handle_heartbeat(GCS, mav_type::GCS);
        let control = Control { primary, ..Control::default() };
        Self { now: Timestamp::ZERO, control, takeover: Takeover::Open, open: true, quirk: false, ranks }
    }

    fn policy(&self) -> Policy<'_> {
        Policy {
            open_when_unclaimed: self.open,
            takeover: self.takeover,
            px4_release_quirk: self.quirk,
            autopilot: Some(AUTOPILOT),
            ranks: &self.ranks,
        }
    }

    fn configure(&mut self, sender: MavId, configure: Configure) -> Result<Vec<Change>, Refusal> {
        let mut control = self.control.clone();
        let result = control.configure(self.now, sender, configure, self.policy());
        self.control = control;
        result
    }

    fn claim(&mut self, sender: MavId, primary: Claim) -> Result<Vec<Change>, Refusal> {
        self.configure(sender, Configure { primary, secondary: Claim::Keep })
    }
}
