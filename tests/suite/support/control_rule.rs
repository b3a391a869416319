//! Who is in control, as the rules say it: a second reading of protocol.md 2.4, A-16 to A-22, D6 and D24, written without
//! a look at the manager, for tests to compare it with.

use std::time::Duration;

use gimbald::gimbals::settings::Takeover;
use gimbald::timestamp::Timestamp;
use gimbald::wire::MavId;

pub const ACCEPTED: u8 = 0;
pub const DENIED: u8 = 2;

/// "holder's heartbeat *and* traffic missing for `lease_timeout_s`" (D6).
const LEASE: Duration = Duration::from_secs(10);

/// "After more than 5 take-overs of primary within 10 s, further take-overs are DENIED for 10 s" (peers.md F10).
const WAR: (usize, Duration) = (5, Duration::from_secs(10));

/// Who has a place, and when that one was last heard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Held {
    pub id: MavId,
    pub heard: Timestamp,
}

/// The state of control of one gimbal.
#[derive(Clone, Debug)]
pub struct Rule {
    pub takeover: Takeover,
    pub autopilot: MavId,
    /// Those who beat as ground stations.
    pub stations: Vec<MavId>,
    /// Primary and secondary.
    pub places: [Option<Held>; 2],
    /// Who gets primary control back from the autopilot.
    pub lender: Option<Held>,
    takeovers: Vec<Timestamp>,
    truce: Option<Timestamp>,
}

/// What one pair of parameters asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wish {
    /// "−1: leave unchanged"
    Unchanged,
    /// "−3: remove control if currently in control"
    GiveUp,
    /// "0: no one in control"
    Nobody,
    /// "−2: set itself in control", or ids.
    Somebody(MavId),
}

impl Rule {
    pub fn new(takeover: Takeover, autopilot: MavId, stations: &[MavId]) -> Self {
        Self {
            takeover,
            autopilot,
            stations: stations.to_vec(),
            places: [None; 2],
            lender: None,
            takeovers: Vec::new(),
            truce: None,
        }
    }

    pub fn holders(&self) -> [Option<MavId>; 2] {
        self.places.map(|place| place.map(|held| held.id))
    }

    /// Whether `id` may say where the gimbal looks: "only those set"; where nobody is, anybody if it is open.
    pub fn has_a_say(&self, id: MavId, open_when_unclaimed: bool) -> bool {
        let [primary, secondary] = self.holders();
        [primary, secondary].contains(&Some(id)) || (primary.is_none() && open_when_unclaimed)
    }

    /// Something was heard from `id`.
    pub fn hear(&mut self, now: Timestamp, id: MavId) {
        for held in self.places.iter_mut().chain([&mut self.lender]).flatten() {
            if held.id == id {
                held.heard = now;
            }
        }
    }

    /// Time has passed, and each lease that ran out did so at its time.
    pub fn pass(&mut self, now: Timestamp) {
        let next = |rule: &Self| {
            let leases = rule.places.iter().chain([&rule.lender]).flatten();
            leases.map(|held| held.heard + LEASE).min().filter(|at| *at <= now)
        };
        while let Some(at) = next(self) {
            self.lapse(at);
        }
    }

    /// "Slot cleared", and what the autopilot borrowed goes back "if alive".
    fn lapse(&mut self, now: Timestamp) {
        let alive = |held: &Held| now.since(held.heard) < LEASE;
        self.lender = self.lender.filter(alive);
        if self.places[0].is_some_and(|held| !alive(&held)) {
            self.places[0] = self.lender.take();
        }
        self.places[1] = self.places[1].filter(alive);
    }

    /// A CONFIGURE with these first four parameters; how it is answered.
    pub fn configure(&mut self, now: Timestamp, sender: MavId, params: [f32; 4]) -> u8 {
        let wishes = [wish(sender, params[0], params[1]), wish(sender, params[2], params[3])];
        let [Some(primary), Some(secondary)] = wishes else { return DENIED };
        let becomes_primary = primary == Wish::Somebody(sender);
        // Half of it is never done.
        if !self.may(now, sender, 0, primary)
            || !self.may(now, sender, 1, secondary)
            || !(becomes_primary || self.may_have_free_secondary(sender, secondary))
        {
            return DENIED;
        }
        self.grant(now, sender, 0, primary);
        self.grant(now, sender, 1, secondary);
        ACCEPTED
    }

    fn may(&self, now: Timestamp, sender: MavId, place: usize, wish: Wish) -> bool {
        let Some(holder) = self.places[place].map(|held| held.id).filter(|holder| *holder != sender) else {
            // What is free, and what is one's own, is at one's disposal.
            return true;
        };
        let is_autopilot = sender == self.autopilot;
        let taker = match wish {
            Wish::Unchanged | Wish::GiveUp => return true,
            // "Clearing to 0/0 by someone who is not the holder: allow only the holder, our own system's autopilot"
            Wish::Nobody if !is_autopilot => return false,
            Wish::Nobody => None,
            Wish::Somebody(id) if id == holder => return true,
            Wish::Somebody(id) => Some(id),
        };
        let for_itself = taker == Some(sender);
        let borrows = is_autopilot && for_itself && place == 0;
        let takes_back = for_itself && place == 0 && self.lender.is_some_and(|lender| lender.id == sender);
        let by_policy = match self.takeover {
            Takeover::Open => true,
            Takeover::Ask => borrows || takes_back,
            Takeover::Priority => self.rank(sender) > self.rank(holder),
            Takeover::Exclusive => false,
        };
        let is_truce = self.truce.is_some_and(|until| now < until);
        by_policy && !(is_truce && place == 0 && taker.is_some())
    }

    /// "While somebody holds primary control, secondary control that nobody has is that one's to give: others get it where
    /// the policy would give them primary control too" (`docs/configuration.md`), which nobody borrows.
    fn may_have_free_secondary(&self, sender: MavId, wish: Wish) -> bool {
        let [Some(primary), None] = self.holders() else { return true };
        let is_claimed = matches!(wish, Wish::Somebody(_));
        let by_policy = match self.takeover {
            Takeover::Open => true,
            Takeover::Ask | Takeover::Exclusive => false,
            Takeover::Priority => self.rank(sender) > self.rank(primary),
        };
        !is_claimed || primary == sender || by_policy
    }

    fn grant(&mut self, now: Timestamp, sender: MavId, place: usize, wish: Wish) {
        let before = self.places[place];
        let is_own = before.is_some_and(|held| held.id == sender);
        let fresh = |id| Some(Held { id, heard: now });
        let after = match wish {
            Wish::Unchanged => return,
            Wish::GiveUp if is_own => None,
            Wish::GiveUp => {
                // "Or releasing … ends the borrow."
                if place == 0 {
                    self.lender = self.lender.filter(|lender| lender.id != sender);
                }
                return;
            }
            Wish::Nobody => None,
            Wish::Somebody(id) if before.is_some_and(|held| held.id == id) => {
                // Only its own word keeps a holder alive.
                if id == sender {
                    self.hear(now, id);
                }
                return;
            }
            Wish::Somebody(id) => fresh(id),
        };
        if place == 1 {
            self.places[1] = after;
            return;
        }
        let lender = self.lender.take();
        let Some(after) = after else {
            self.places[0] = lender;
            return;
        };
        self.places[0] = Some(after);
        if before.is_some() && !is_own {
            if after.id == sender && sender == self.autopilot {
                self.lender = before;
            }
            self.takeovers.retain(|at| now.since(*at) < WAR.1);
            self.takeovers.push(now);
            if self.takeovers.len() > WAR.0 {
                self.takeovers.clear();
                self.truce = Some(now + WAR.1);
            }
        }
    }

    /// "Ground station > our vehicle's autopilot > other components of our system > anybody else."
    fn rank(&self, id: MavId) -> u8 {
        match id {
            id if self.stations.contains(&id) => 3,
            id if id == self.autopilot => 2,
            id if id.system == self.autopilot.system => 1,
            _ => 0,
        }
    }
}

/// "Convert with `round()`; non-finite → treat as −1; not within 1e-3 of an integer → DENIED; outside −3..255 → DENIED.
/// Mixed sentinel/value pairs → DENIED."
fn wish(sender: MavId, system: f32, component: f32) -> Option<Wish> {
    let number = |value: f32| -> Option<i32> {
        if !value.is_finite() {
            return Some(-1);
        }
        let whole = value.round();
        ((value - whole).abs() <= 1e-3 && (-3.0..=255.0).contains(&whole)).then_some(whole as i32)
    };
    let pair = (number(system)?, number(component)?);
    Some(match pair {
        (-1, -1) => Wish::Unchanged,
        (-2, -2) => Wish::Somebody(sender),
        (-3, -3) => Wish::GiveUp,
        (system, component) if system < 0 || component < 0 => return None,
        (0, _) | (_, 0) => Wish::Nobody,
        (system, component) => Wish::Somebody(MavId::new(system as u8, component as u8)),
    })
}
