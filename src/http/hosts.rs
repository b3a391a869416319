//! Which `Host` a request may name.
//!
//! A page of a stranger's site, whose name was made to point at this machine (DNS rebinding), may read what a browser
//! on this machine may read. Such a request still names the stranger's host, so a window on loopback answers to
//! the names of loopback only. On other addresses the names are the operator's affair, and any is taken.

use std::net::{IpAddr, SocketAddr};

use axum::http::header::HOST;
use axum::http::request::Parts;
use axum::http::uri::Authority;
use axum::http::{StatusCode, Version};

/// The address that the window listens on.
#[derive(Clone, Copy, Debug)]
pub struct Listening(pub SocketAddr);

impl Listening {
    /// The error is the answer to give, and why.
    pub fn check_host(self, request: &Parts) -> Result<(), (StatusCode, &'static str)> {
        let mut named = request.headers.get_all(HOST).iter();
        match (named.next(), named.next()) {
            (_, Some(_)) => return Err((StatusCode::BAD_REQUEST, "more than one Host header")),
            (None, None) if request.version != Version::HTTP_10 => {
                return Err((StatusCode::BAD_REQUEST, "no Host header"));
            }
            (None, None) => {}
            (Some(host), None) => {
                let host: Option<Authority> = host.to_str().ok().and_then(|host| host.parse().ok()); // text or not, it is malformed
                let host = host.ok_or((StatusCode::BAD_REQUEST, "malformed Host header"))?;
                self.check(host.host())?;
            }
        }
        match request.uri.host() {
            Some(host) => self.check(host),
            None => Ok(()),
        }
    }

    fn check(self, host: &str) -> Result<(), (StatusCode, &'static str)> {
        if self.answers_to(host) {
            Ok(())
        } else {
            Err((
                StatusCode::FORBIDDEN,
                "this window is open to this machine only: use http://localhost or http://127.0.0.1, or set [http] listen",
            ))
        }
    }

    fn answers_to(self, host: &str) -> bool {
        let bound = self.0.ip().to_canonical();
        if !bound.is_loopback() || host.eq_ignore_ascii_case("localhost") {
            return true;
        }
        let numeric = host.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
        numeric.is_ok_and(|address| {
            let address = address.to_canonical();
            address == bound || address.to_string() == "127.0.0.1" || address.to_string() == "::1"
        })
    }
}

#[cfg(test)]
mod tests {
    use axum::http::Request;

    use super::*;

    fn verdict(listen: &str, version: Version, target: &str, hosts: &[&str]) -> Option<StatusCode> {
        let mut request = Request::builder().version(version).uri(target);
        for host in hosts {
            request = request.header(HOST, *host);
        }
        let (parts, ()) = request.body(()).expect("a request").into_parts();
        Listening(listen.parse().expect("an address")).check_host(&parts).err().map(|(status, _)| status)
    }

    #[test]
    #[rustfmt::skip]
    fn a_window_on_loopback_answers_to_the_names_of_loopback() {
        for (listen,           host,                     expected) in [
            ("127.0.0.1:8080", "localhost:8080",         None),
            ("127.0.0.1:8080", "LOCALHOST",              None),
            ("127.0.0.1:8080", "127.0.0.1:9000",         None),
            ("127.0.0.1:8080", "[::1]:8080",             None),
            ("[::1]:8080",     "127.0.0.1:8080",         None),
            ("127.0.0.9:8080", "127.0.0.9:8080",         None),
            ("127.0.0.1:8080", "127.0.0.9:8080",         Some(StatusCode::FORBIDDEN)),
            ("127.0.0.1:8080", "evil.example:8080",      Some(StatusCode::FORBIDDEN)),
            ("127.0.0.1:8080", "localhost.evil.example", Some(StatusCode::FORBIDDEN)),
            ("127.0.0.1:8080", "192.168.1.7:8080",       Some(StatusCode::FORBIDDEN)),
            ("[::1]:8080",     "evil.example",           Some(StatusCode::FORBIDDEN)),
            ("127.0.0.1:8080", "",                       Some(StatusCode::BAD_REQUEST)),
            ("127.0.0.1:8080", "a b",                    Some(StatusCode::BAD_REQUEST)),
            ("0.0.0.0:8080",   "drone.local:8080",       None),
            ("10.0.0.2:8080",  "evil.example",           None),
        ] {
            assert_eq!(verdict(listen, Version::HTTP_11, "/", &[host]), expected, "{listen} asked as {host:?}");
        }
    }

    /// RFC 9112, 3.2: "A server MUST respond with a 400 (Bad Request) status code to any HTTP/1.1 request message that
    /// lacks a Host header field and to any request message that contains more than one Host header field line".
    #[test]
    fn a_request_names_one_host() {
        let listen = "127.0.0.1:8080";
        assert_eq!(verdict(listen, Version::HTTP_11, "/", &[]), Some(StatusCode::BAD_REQUEST));
        assert_eq!(verdict(listen, Version::HTTP_10, "/", &[]), None);
        let twice = ["localhost", "localhost"];
        assert_eq!(verdict(listen, Version::HTTP_11, "/", &twice), Some(StatusCode::BAD_REQUEST));
        let absolute = "http://evil.example/";
        assert_eq!(verdict(listen, Version::HTTP_11, absolute, &["localhost"]), Some(StatusCode::FORBIDDEN));
    }
}
