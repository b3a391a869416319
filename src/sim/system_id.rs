//! Under which system id a simulated gimbal speaks.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SystemId {
    /// That of the first vehicle it hears.
    Adopt,
    /// From the start, whoever is there.
    Fixed(u8),
}
