//! Which parameters a gimbal should have, which of them have not come, and how each is asked for.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

/// One that was read so often in vain does not exist.
const READ_TRIES: u8 = 5;
/// Where nothing was answered by its name so often, it is read by its index.
const TRIES_BY_NAME: u8 = 2;

/// Two parameters are read at least so far apart where they are known by their names …
const NAMED_SPACING: Duration = Duration::from_millis(10);
/// … and so far where nothing is known of the gimbal ("100 ms pacing").
const COUNTED_SPACING: Duration = Duration::from_millis(100);

/// More than any gimbal has are not kept.
pub const MAX_NAMES: usize = 512;

/// A parameter that a device should have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Known {
    pub name: &'static str,
    /// Its place in the vendor's tables, where that is known.
    pub index: Option<u16>,
}

/// Which parameters a device should have, given those that it was heard to have.
pub type Catalogue = fn(&dyn Fn(&str) -> bool) -> Vec<Known>;

/// One to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wanted {
    Named(Known),
    /// The one with this `param_index`.
    Place(u16),
}

/// What there should be.
#[derive(Debug)]
pub enum List {
    /// Its maker's names.
    Named {
        catalogue: Catalogue,
        /// How often each was read in vain.
        tries: BTreeMap<&'static str, u8>,
        /// Something that was read by its name was answered.
        answers_to_names: bool,
    },
    /// As many as the gimbal says.
    Counted {
        /// The most that `param_count` said since it was begun.
        count: u16,
        heard: BTreeSet<u16>,
        tries: BTreeMap<u16, u8>,
    },
}

impl List {
    pub fn named(catalogue: Catalogue) -> Self {
        Self::Named { catalogue, tries: BTreeMap::new(), answers_to_names: false }
    }

    pub fn counted() -> Self {
        Self::Counted { count: 0, heard: BTreeSet::new(), tries: BTreeMap::new() }
    }

    /// Nothing of it was read.
    pub fn begin(&mut self) {
        *self = match self {
            Self::Named { catalogue, .. } => Self::named(*catalogue),
            Self::Counted { .. } => Self::counted(),
        };
    }

    /// The gimbal told one, of whatever name and value; an index beyond the count says nothing of its place.
    pub fn handle_told(&mut self, name: Option<&str>, index: u16, told_count: u16) {
        match self {
            Self::Named { tries, answers_to_names, .. } => {
                let tries = name.and_then(|name| tries.get(name));
                *answers_to_names |= tries.is_some_and(|tries| *tries <= TRIES_BY_NAME);
            }
            Self::Counted { count, heard, .. } => {
                *count = told_count.min(MAX_NAMES as u16).max(*count);
                if usize::from(index) < MAX_NAMES {
                    heard.insert(index);
                }
            }
        }
    }

    /// Those that did not come yet and may still.
    pub fn missing(&self, has: &dyn Fn(&str) -> bool) -> VecDeque<Wanted> {
        let is_open = |tries: Option<&u8>| tries.is_none_or(|tries| *tries < READ_TRIES);
        match self {
            Self::Named { catalogue, tries, .. } => {
                let open =
                    catalogue(has).into_iter().filter(|known| !has(known.name) && is_open(tries.get(known.name)));
                open.take(MAX_NAMES).map(Wanted::Named).collect()
            }
            Self::Counted { count, heard, tries } => {
                let open = (0..*count).filter(|place| !heard.contains(place) && is_open(tries.get(place)));
                open.map(Wanted::Place).collect()
            }
        }
    }

    /// Whether one has come since it was found to be missing.
    pub fn has(&self, wanted: Wanted, has: &dyn Fn(&str) -> bool) -> bool {
        match (self, wanted) {
            (_, Wanted::Named(known)) => has(known.name),
            (Self::Counted { heard, .. }, Wanted::Place(place)) => heard.contains(&place),
            (Self::Named { .. }, Wanted::Place(_)) => false,
        }
    }

    /// Name and index of the question for one, which is put now.
    ///
    /// An index beside a name is what some gimbals go by, so it is −1 as long as the name is meant.
    pub fn ask(&mut self, wanted: Wanted) -> (&'static str, i16) {
        let index = |index: Option<u16>| index.and_then(|index| i16::try_from(index).ok()).unwrap_or(-1);
        match (self, wanted) {
            (Self::Named { tries, answers_to_names, .. }, Wanted::Named(known)) => {
                let tries = tries.entry(known.name).or_default();
                let by_index = *tries >= TRIES_BY_NAME && !*answers_to_names;
                *tries += 1;
                (known.name, index(known.index.filter(|_| by_index)))
            }
            (Self::Counted { tries, .. }, Wanted::Place(place)) => {
                *tries.entry(place).or_default() += 1;
                ("", index(Some(place)))
            }
            (_, Wanted::Named(known)) => (known.name, -1),
            (_, Wanted::Place(place)) => ("", index(Some(place))),
        }
    }

    /// How many the gimbal says that it has; `None` where its maker does.
    pub fn count(&self) -> Option<u16> {
        match self {
            Self::Named { .. } => None,
            Self::Counted { count, .. } => Some(*count),
        }
    }

    /// Whether one was read as often as a parameter is read.
    pub fn was_read_in_vain(&self, name: &str) -> bool {
        match self {
            Self::Named { tries, .. } => tries.get(name).is_some_and(|tries| *tries >= READ_TRIES),
            Self::Counted { .. } => false,
        }
    }

    pub const fn spacing(&self) -> Duration {
        match self {
            Self::Named { .. } => NAMED_SPACING,
            Self::Counted { .. } => COUNTED_SPACING,
        }
    }
}
