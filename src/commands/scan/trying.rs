//! Tries one port at the likely baud rates, until somebody answers.

use std::collections::BTreeMap;
use std::io::{self, Read, Write};

use tokio::io::unix::AsyncFd;
use tokio::time::timeout;
use tokio_serial::{ClearBuffer, SerialPort, SerialStream};

use super::conversation::Conversation;
use super::finding::Finding;
use super::party::Party;
use super::ports::{Port, PortError};
use super::say;
use crate::daemon::clock::Clock;
use crate::links::input_ready::watch_input;
use crate::wire::MavId;

/// The likely ones first.
const BAUDS: [u32; 8] = [115_200, 921_600, 57_600, 230_400, 460_800, 500_000, 1_000_000, 38_400];

#[derive(Debug, thiserror::Error)]
pub enum TryError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error("lost: {0}")]
    Lost(#[from] io::Error),
}

/// Tries each baud rate until somebody answers.
pub async fn try_port(port: &Port, errors: &mut impl Write) -> Result<Option<Finding>, TryError> {
    let mut device = watch_input(port.open(BAUDS[0])?)?;
    let clock = Clock::start();
    for baud in BAUDS {
        if let Err(error) = device.get_mut().set_baud_rate(baud) {
            say(errors, format_args!("{}: {baud} baud: {error}", port.name.display()));
            continue;
        }
        say(errors, format_args!("{}: {baud} baud …", port.name.display()));
        // What came in, or waits to go out, at another rate is noise at this one.
        device.get_ref().clear(ClearBuffer::All).map_err(io::Error::from)?;
        let parties = converse(&mut device, baud, clock).await?;
        if !parties.is_empty() {
            return Ok(Some(Finding { port: port.clone(), baud, parties }));
        }
    }
    Ok(None)
}

/// Speaks with whoever is at the other end, for as long as it is worth it.
async fn converse(device: &mut AsyncFd<SerialStream>, baud: u32, clock: Clock) -> io::Result<BTreeMap<MavId, Party>> {
    let mut conversation = Conversation::new(clock.now(), baud);
    let mut buffer = [0; 4096];
    loop {
        let now = clock.now();
        if conversation.is_over(now) {
            return Ok(conversation.into_parties());
        }
        conversation.handle_timeout(now);
        while let Some(frame) = conversation.poll_output() {
            match device.get_mut().write(&frame) {
                Ok(_) => {}
                // A line that takes nothing has nobody who answers; what is cut off is repeated.
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
        }
        let Ok(ready) = timeout(conversation.poll_timeout().since(now), device.readable_mut()).await else { continue };
        let mut ready = ready?;
        match ready.get_inner_mut().read(&mut buffer) {
            Ok(0) => return Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the device is gone")),
            Ok(length) => conversation.handle_received(clock.now(), &buffer[..length]),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => ready.clear_ready(),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}
