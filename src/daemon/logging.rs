//! Log lines on standard error.
//!
//! A reader that stalls (a full pipe, a busy journal) must not stall the router, so lines are written by a thread of
//! their own; when that falls behind, lines are dropped.

use std::env;
use std::fmt;
use std::io::{self, IsTerminal};
use std::str::FromStr;

use tracing_appender::non_blocking::{NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::ParseError;

/// Lines that may wait for a slow reader; later ones are dropped.
const WAITING_LINES: usize = 1024;

/// What to log, in tracing's filter syntax; known to be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogFilter(String);

impl FromStr for LogFilter {
    type Err = ParseError;

    fn from_str(text: &str) -> Result<Self, ParseError> {
        EnvFilter::builder().parse(text).map(|_| Self(text.to_owned()))
    }
}

impl fmt::Display for LogFilter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Writes the lines that wait when it is dropped, for at most a second; keep it until the process ends.
#[must_use]
pub struct Logging {
    _worker: WorkerGuard,
}

/// Starts logging for the whole process; to be called once.
///
/// Colours are for terminals only (and never with `NO_COLOR`); there are no times when the journal, which has its own,
/// reads the lines (`JOURNAL_STREAM` is set).
pub fn start(filter: &LogFilter) -> Logging {
    let (writer, worker) = NonBlockingBuilder::default()
        .lossy(true)
        .buffered_lines_limit(WAITING_LINES)
        .thread_name("log")
        .finish(io::stderr());
    let filter = EnvFilter::builder().parse(&filter.0).expect("a LogFilter was parsed before");
    let coloured = io::stderr().is_terminal() && env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let lines = tracing_subscriber::fmt().with_env_filter(filter).with_ansi(coloured).with_writer(writer);
    if env::var_os("JOURNAL_STREAM").is_some() {
        lines.without_time().init();
    } else {
        lines.init();
    }
    Logging { _worker: worker }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_is_checked_when_it_is_read() {
        for right in ["info", "off", "info,gimbald::links=debug", "gimbald[link{name=ground}]=trace"] {
            assert_eq!(right.parse::<LogFilter>().map(|filter| filter.to_string()).ok().as_deref(), Some(right));
        }
        for wrong in ["a=b=c", "gimbald=loud", "gimbald[link"] {
            assert!(wrong.parse::<LogFilter>().is_err(), "{wrong}");
        }
    }
}
