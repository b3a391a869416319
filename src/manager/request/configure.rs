//! Who is to be in control, as `DO_GIMBAL_MANAGER_CONFIGURE` (1001) asks for it.

use super::{Command, Refusal};
use crate::wire::MavId;
use crate::wire::ids::command;

/// The four parameters of `DO_GIMBAL_MANAGER_CONFIGURE` (1001) that name who is to be in control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Configure {
    pub primary: Claim,
    pub secondary: Claim,
}

/// What is asked for one of the two places.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Claim {
    /// −1: leave unchanged.
    Keep,
    /// −2: the sender takes it.
    Take,
    /// −3: the sender gives it up, if it has it.
    Release,
    /// 0: nobody.
    Clear,
    Assign(MavId),
}

impl Configure {
    /// Reads the parameters: "0: no one in control, -1: leave unchanged, -2: set itself in control, -3: remove
    /// control if currently in control". System and component make one claim; half of one is refused.
    pub fn read(command: &Command) -> Result<Self, Refusal> {
        debug_assert_eq!(command.number, command::DO_GIMBAL_MANAGER_CONFIGURE);
        Ok(Self { primary: claim(command, 1)?, secondary: claim(command, 3)? })
    }
}

fn claim(command: &Command, first: usize) -> Result<Claim, Refusal> {
    let id = |number: usize| -> Result<i16, Refusal> {
        let value = command.params[number - 1];
        if !value.is_finite() {
            return Ok(-1);
        }
        // Fractions come from clients of 2020, whose command 1001 was "track point".
        if (value - value.round()).abs() > 1e-3 {
            return Err(Refusal::denied("not_an_id"));
        }
        if !(-3.0..=255.0).contains(&value.round()) {
            return Err(Refusal::denied("not_an_id"));
        }
        Ok(value.round() as i16)
    };
    match (id(first)?, id(first + 1)?) {
        (-1, -1) => Ok(Claim::Keep),
        (-2, -2) => Ok(Claim::Take),
        (-3, -3) => Ok(Claim::Release),
        (0, 0..) | (0.., 0) => Ok(Claim::Clear),
        (system @ 1.., component @ 1..) => Ok(Claim::Assign(MavId::new(system as u8, component as u8))),
        _ => Err(Refusal::denied("half_a_pair")),
    }
}
