//! The other end of a link, as written in the configuration and on the command line.

use std::fmt;
use std::net::SocketAddr;
use std::str::FromStr;

/// `serial:PATH:BAUD`, `udpin:ADDR:PORT`, `udpout:ADDR:PORT`, `udpbcast:ADDR:PORT`, `tcpin:ADDR:PORT` or
/// `tcpout:ADDR:PORT`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Endpoint {
    /// A serial port or pseudo-terminal; the path may hold colons, the baud rate stands behind the last.
    Serial { path: String, baud: u32 },
    /// Binds and learns its peers.
    UdpIn(SocketAddr),
    /// Speaks first, to one peer.
    UdpOut(SocketAddr),
    /// Sends to a broadcast address until somebody answers, then to whoever answered.
    UdpBroadcast(SocketAddr),
    /// Listens; each connection is a peer.
    TcpIn(SocketAddr),
    /// Connects, and again when the connection is lost.
    TcpOut(SocketAddr),
}

#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum EndpointError {
    #[error("expected KIND:… with one of serial, udpin, udpout, udpbcast, tcpin, tcpout")]
    Kind,
    #[error("expected serial:PATH:BAUD, for example serial:/dev/ttyUSB0:115200")]
    Serial,
    #[error("the baud rate {0:?} is not a number from 1200 to 4000000")]
    Baud(String),
    #[error("{0:?} is not ADDR:PORT with an IP address and a port, for example 127.0.0.1:14550 or [::1]:14550")]
    Address(String),
    #[error("a peer cannot be reached at port 0")]
    NoPort,
}

impl FromStr for Endpoint {
    type Err = EndpointError;

    fn from_str(text: &str) -> Result<Self, EndpointError> {
        let (kind, rest) = text.split_once(':').ok_or(EndpointError::Kind)?;
        match kind {
            "serial" => {
                let (path, baud) = rest.rsplit_once(':').ok_or(EndpointError::Serial)?;
                if path.is_empty() {
                    return Err(EndpointError::Serial);
                }
                let baud = match baud.parse() {
                    Ok(value @ 1_200..=4_000_000) => value,
                    _ => return Err(EndpointError::Baud(baud.to_owned())),
                };
                Ok(Self::Serial { path: path.to_owned(), baud })
            }
            "udpin" => address(rest).map(Self::UdpIn),
            "udpout" => remote(rest).map(Self::UdpOut),
            "udpbcast" => remote(rest).map(Self::UdpBroadcast),
            "tcpin" => address(rest).map(Self::TcpIn),
            "tcpout" => remote(rest).map(Self::TcpOut),
            _ => Err(EndpointError::Kind),
        }
    }
}

fn address(text: &str) -> Result<SocketAddr, EndpointError> {
    let numeric = match text.strip_prefix("localhost:") {
        Some(port) => format!("127.0.0.1:{port}"),
        None => text.to_owned(),
    };
    numeric.parse().map_err(|_| EndpointError::Address(text.to_owned()))
}

fn remote(text: &str) -> Result<SocketAddr, EndpointError> {
    let address = address(text)?;
    if address.port() == 0 { Err(EndpointError::NoPort) } else { Ok(address) }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { path, baud } => write!(f, "serial:{path}:{baud}"),
            Self::UdpIn(address) => write!(f, "udpin:{address}"),
            Self::UdpOut(address) => write!(f, "udpout:{address}"),
            Self::UdpBroadcast(address) => write!(f, "udpbcast:{address}"),
            Self::TcpIn(address) => write!(f, "tcpin:{address}"),
            Self::TcpOut(address) => write!(f, "tcpout:{address}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "split at the last colon; paths may hold colons" (endpoints).
    #[test]
    fn a_serial_path_may_hold_colons() {
        let endpoint = "serial:/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0:921600".parse();
        let path = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0".to_owned();
        assert_eq!(endpoint, Ok(Endpoint::Serial { path, baud: 921_600 }));
    }

    #[test]
    fn every_kind_reads_back_what_it_prints() {
        for text in [
            "serial:/dev/ttyUSB0:57600",
            "udpin:0.0.0.0:14540",
            "udpout:127.0.0.1:14550",
            "udpbcast:192.168.1.255:14550",
            "tcpin:[::1]:5760",
            "tcpout:10.0.0.2:5760",
        ] {
            let endpoint: Endpoint = text.parse().expect(text);
            assert_eq!(endpoint.to_string(), text);
        }
    }

    #[test]
    fn a_wrong_endpoint_says_what_was_expected() {
        for (text, error) in [
            ("/dev/ttyUSB0", EndpointError::Kind),
            ("usb:/dev/ttyUSB0:57600", EndpointError::Kind),
            ("serial:/dev/ttyUSB0", EndpointError::Serial),
            ("serial::57600", EndpointError::Serial),
            ("serial:/dev/ttyUSB0:fast", EndpointError::Baud("fast".into())),
            ("serial:/dev/ttyUSB0:0", EndpointError::Baud("0".into())),
            ("udpout:gimbal.local:14550", EndpointError::Address("gimbal.local:14550".into())),
            ("udpout:127.0.0.1:0", EndpointError::NoPort),
        ] {
            assert_eq!(text.parse::<Endpoint>(), Err(error), "{text}");
        }
    }
}
