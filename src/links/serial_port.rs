//! Opening a serial port, and which terminals are none.

use std::fs::{self, Metadata};
use std::os::unix::fs::{FileTypeExt, MetadataExt};

use nix::sys::stat::{major, minor};
use tokio::runtime;
use tokio_serial::SerialStream;

/// Opens a port for us alone (`TIOCEXCL` and a lock) and without blocking; whoever waits for it watches the descriptor.
///
/// A stream of tokio-serial lets its runtime watch for room for output too. It is given one that never runs, so that
/// input alone can be watched; `docs/decisions/serial-port.md` has the figures.
pub fn open(path: &str, baud: u32) -> tokio_serial::Result<SerialStream> {
    let idle = runtime::Builder::new_current_thread().enable_io().build()?;
    let port = {
        let _entered = idle.enter();
        SerialStream::open(&tokio_serial::new(path, baud))
    };
    // There is nothing to wait for, and waiting is not allowed inside the event loop.
    idle.shutdown_background();
    port
}

/// What the terminal at `path` is where it leads to no line; `None` for serial ports, and for what is not there.
pub fn leads_to_no_line(path: &str) -> Option<&'static str> {
    // What is not there yet may come.
    terminal_without_line(&fs::metadata(path).ok()?)
}

/// What a terminal is that leads to no line.
pub fn terminal_without_line(file: &Metadata) -> Option<&'static str> {
    let is_device = file.file_type().is_char_device();
    is_device.then(|| of_numbers(major(file.rdev()), minor(file.rdev()))).flatten()
}

/// The same by the numbers of its device (the kernel's `devices.txt`).
const fn of_numbers(major: u64, minor: u64) -> Option<&'static str> {
    match (major, minor) {
        (2, _) | (5, 2) => Some("what makes pseudo-terminals"),
        (4, 0..64) | (5, 1) => Some("a console of this computer"),
        (5, 0) => Some("the terminal that gimbald was started from"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_without_a_line_is_known_by_its_numbers() {
        for (numbers, what) in [
            ((2, 7), Some("what makes pseudo-terminals")),
            ((4, 0), Some("a console of this computer")),
            ((4, 63), Some("a console of this computer")),
            ((4, 64), None), // ttyS0
            ((5, 0), Some("the terminal that gimbald was started from")),
            ((5, 1), Some("a console of this computer")),
            ((5, 64), None),   // cua0
            ((136, 0), None),  // pts/0
            ((166, 0), None),  // ttyACM0
            ((188, 0), None),  // ttyUSB0
            ((204, 64), None), // ttyAMA0
        ] {
            assert_eq!(of_numbers(numbers.0, numbers.1), what, "{numbers:?}");
        }
    }
}
