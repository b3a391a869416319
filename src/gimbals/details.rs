//! What a gimbal tells beyond what every gimbal has, for whoever looks.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// The part of a gimbal's state that its family knows; part of `/api/v1/status`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GimbalDetails {
    /// Which of its family's protocols it speaks.
    pub generation: Option<String>,
    /// Faults of this gimbal or its firmware, and what to do about them.
    pub faults: Vec<String>,
    /// Its parameters by name, as far as they were read.
    pub parameters: BTreeMap<String, f64>,
}
