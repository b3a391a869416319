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
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Wanted {
    /// The one with this name, and its place where that is known.
    Named { name: String, index: Option<u16> },
    /// The one with this `param_index`.
    Place(u16),
}

/// What there should be.
#[derive(Debug)]
pub enum List {
    /// Its maker's names, and whatever else it was heard to have.
    Named {
        catalogue: Catalogue,
        /// Those that came since it was begun: what is known of before may have changed.
        heard: BTreeSet<String>,
        /// How often each was read in vain.
        tries: BTreeMap<String, u8>,
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
        Self::Named { catalogue, heard: BTreeSet::new(), tries: BTreeMap::new(), answers_to_names: false }
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
            Self::Named { heard, tries, answers_to_names, .. } => {
                let Some(name) = name else { return };
                *answers_to_names |= tries.get(name).is_some_and(|tries| *tries <= TRIES_BY_NAME);
                heard.insert(name.to_owned());
            }
            Self::Counted { count, heard, .. } => {
                *count = told_count.min(MAX_NAMES as u16).max(*count);
                if usize::from(index) < MAX_NAMES {
                    heard.insert(index);
                }
            }
        }
    }

    /// Those that did not come yet and may still, of a gimbal that is known to have these.
    pub fn missing<V>(&self, known: &BTreeMap<String, V>) -> VecDeque<Wanted> {
        let is_open = |tries: Option<&u8>| tries.is_none_or(|tries| *tries < READ_TRIES);
        match self {
            Self::Named { catalogue, heard, tries, .. } => {
                let listed = catalogue(&|name| known.contains_key(name));
                let names: BTreeSet<&str> = listed.iter().map(|row| row.name).collect();
                let others = known.keys().filter(|name| !names.contains(name.as_str()));
                let listed = listed.iter().map(|row| (row.name, row.index));
                listed
                    .chain(others.map(|name| (name.as_str(), None)))
                    .filter(|(name, _)| !heard.contains(*name) && is_open(tries.get(*name)))
                    .take(MAX_NAMES)
                    .map(|(name, index)| Wanted::Named { name: name.to_owned(), index })
                    .collect()
            }
            Self::Counted { count, heard, tries } => {
                let open = (0..*count).filter(|place| !heard.contains(place) && is_open(tries.get(place)));
                open.map(Wanted::Place).collect()
            }
        }
    }

    /// Whether one has come since it was found to be missing.
    pub fn has_come(&self, wanted: &Wanted) -> bool {
        match (self, wanted) {
            (Self::Named { heard, .. }, Wanted::Named { name, .. }) => heard.contains(name),
            (Self::Counted { heard, .. }, Wanted::Place(place)) => heard.contains(place),
            (Self::Named { .. }, Wanted::Place(_)) | (Self::Counted { .. }, Wanted::Named { .. }) => false,
        }
    }

    /// Name and index of the question for one, which is put now.
    ///
    /// An index beside a name is what some gimbals go by, so it is −1 as long as the name is meant.
    pub fn ask(&mut self, wanted: Wanted) -> (String, i16) {
        let sent = |index: Option<u16>| index.and_then(|index| i16::try_from(index).ok()).unwrap_or(-1);
        match (self, wanted) {
            (Self::Named { tries, answers_to_names, .. }, Wanted::Named { name, index }) => {
                let tries = tries.entry(name.clone()).or_default();
                let by_index = *tries >= TRIES_BY_NAME && !*answers_to_names;
                *tries += 1;
                (name, sent(index.filter(|_| by_index)))
            }
            (Self::Counted { tries, .. }, Wanted::Place(place)) => {
                *tries.entry(place).or_default() += 1;
                (String::new(), sent(Some(place)))
            }
            (Self::Counted { .. }, Wanted::Named { name, .. }) => (name, -1),
            (Self::Named { .. }, Wanted::Place(place)) => (String::new(), sent(Some(place))),
        }
    }

    /// How many of those that are known have not come since it was begun, where its maker says what there is.
    pub fn known_in_vain<V>(&self, known: &BTreeMap<String, V>) -> usize {
        match self {
            Self::Named { heard, .. } => known.keys().filter(|name| !heard.contains(*name)).count(),
            Self::Counted { .. } => 0,
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
