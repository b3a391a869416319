//! What the process says when it ends, in the numbers of `sysexits.h`.

/// How a command ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExitCode {
    Ok,
    /// The command line is wrong (EX_USAGE).
    Usage,
    /// Something the command needs is not there (EX_UNAVAILABLE).
    Unavailable,
    /// Somebody has to allow it first (EX_NOPERM).
    NoPermission,
    /// The configuration is wrong or missing (EX_CONFIG).
    Config,
}

impl ExitCode {
    pub const fn number(self) -> u8 {
        match self {
            Self::Ok => 0,
            Self::Usage => 64,
            Self::Unavailable => 69,
            Self::NoPermission => 77,
            Self::Config => 78,
        }
    }
}

impl From<ExitCode> for std::process::ExitCode {
    fn from(code: ExitCode) -> Self {
        Self::from(code.number())
    }
}
