//! Waiting for input, and for nothing else, on a file descriptor.

use std::io;
use std::os::fd::AsRawFd;

use tokio::io::Interest;
use tokio::io::unix::AsyncFd;

/// `inner` with its readiness for input.
///
/// Room for output is left out on purpose: UDP sockets and serial drivers report it after every frame that left, and
/// each report would wake the event loop. `inner` must own its descriptor and keep it.
pub fn watch_input<T: AsRawFd>(inner: T) -> io::Result<AsyncFd<T>> {
    #[expect(deprecated, reason = "its successor is unsafe; whatever we pass owns its descriptor until it is dropped")]
    AsyncFd::with_interest(inner, Interest::READABLE)
}
