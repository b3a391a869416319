//! Log lines on standard error.
//!
//! A reader that stalls (a full pipe, a busy journal) must not stall the router, so lines are written by a thread of
//! their own; when that falls behind, lines are dropped.

use std::env;
use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::str::FromStr;

use tracing_appender::non_blocking::{NonBlocking, NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::{LevelFilter, ParseError};

/// Lines that may wait for a slow reader; later ones are dropped.
const WAITING_LINES: usize = 1024;

/// What to log, in tracing's filter syntax; known to be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogFilter(String);

/// Why a filter is refused.
#[derive(Debug, thiserror::Error)]
pub enum LogFilterError {
    #[error(transparent)]
    Syntax(#[from] ParseError),
    /// It would be taken for the name of a module that nobody has, and silence everything.
    #[error(
        "{0:?} is no level; expected off, error, warn, info, debug or trace, or MODULE=LEVEL as in gimbald::links=debug"
    )]
    NoSuchLevel(String),
}

impl FromStr for LogFilter {
    type Err = LogFilterError;

    fn from_str(text: &str) -> Result<Self, LogFilterError> {
        EnvFilter::builder().parse(text)?;
        let alone = |directive: &&str| !directive.contains(['=', '[']) && directive.parse::<LevelFilter>().is_err();
        match text.split(',').map(str::trim).filter(|directive| !directive.is_empty()).find(alone) {
            Some(word) if !word.starts_with(env!("CARGO_PKG_NAME")) => {
                Err(LogFilterError::NoSuchLevel(word.to_owned()))
            }
            _ => Ok(Self(text.to_owned())),
        }
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
    let (writer, worker) = patient(io::stderr());
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

/// Takes lines at once and hands them to `writer` when that is ready for them.
fn patient(writer: impl Write + Send + 'static) -> (NonBlocking, WorkerGuard) {
    NonBlockingBuilder::default().lossy(true).buffered_lines_limit(WAITING_LINES).thread_name("log").finish(writer)
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, Sender, channel};

    use super::*;

    /// Takes no line before it is released, and passes on what it takes.
    struct Stalled {
        released: Receiver<()>,
        taken: Sender<Vec<u8>>,
    }

    impl Write for Stalled {
        fn write(&mut self, line: &[u8]) -> io::Result<usize> {
            // Ends with an error when the other side was dropped, which is the release.
            let _ = self.released.recv();
            self.taken.send(line.to_owned()).map_err(io::Error::other)?;
            Ok(line.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_stalled_reader_costs_lines_and_not_time() {
        let ((release, released), (taken, lines)) = (channel(), channel());
        let (mut writer, worker) = patient(Stalled { released, taken });

        // Would not return if lines waited for their reader.
        for number in 0..3 * WAITING_LINES {
            writer.write_all(number.to_string().as_bytes()).expect("lines are taken or dropped");
        }

        let dropped = writer.error_counter().dropped_lines();
        drop(release);
        drop(worker);
        let taken: Vec<String> = lines.iter().map(|line| String::from_utf8(line).expect("digits")).collect();
        assert_eq!(taken.len() + dropped, 3 * WAITING_LINES);
        // One line more may be in the hands of the thread that writes.
        assert!((WAITING_LINES..=WAITING_LINES + 1).contains(&taken.len()), "{}", taken.len());
    }

    #[test]
    fn a_filter_is_checked_when_it_is_read() {
        for right in ["info", "off", "info,gimbald::links=debug", "gimbald[link{name=ground}]=trace"] {
            assert_eq!(right.parse::<LogFilter>().map(|filter| filter.to_string()).ok().as_deref(), Some(right));
        }
        for wrong in ["a=b=c", "gimbald=loud", "gimbald[link", "inof", "info,dbug"] {
            assert!(wrong.parse::<LogFilter>().is_err(), "{wrong}");
        }
    }
}
