//! Opening a serial port.

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
