//! Who is let in: names of this server, origins of pages, tokens.

use std::net::SocketAddr;
use std::sync::Arc;

use axum::http::header::{HOST, ORIGIN, SEC_WEBSOCKET_PROTOCOL};
use axum::http::{HeaderMap, HeaderName, Uri};

/// Says how a page with a token reaches the controller; none where the token is not accepted. Thread of the server; waits for nothing.
pub type TokenCheck = Arc<dyn Fn(&str) -> Option<Entry> + Send + Sync>;

/// How a page comes to the controller.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Entry {
    /// What is said to the controller before the page says anything: a line, without its end. The page hears neither the greeting
    /// before it nor its answer, but what follows: another greeting.
    pub opening: Option<String>,
}

/// The name of the protocol that the page speaks, among those that a WebSocket offers.
pub const PROTOCOL: &str = "tandem.2";
/// What stands before the token among the protocols that a WebSocket offers: a browser lets a page say nothing else there.
const TOKEN_PREFIX: &str = "token.";

/// Judges requests by their headers.
#[derive(Clone)]
pub struct AccessCheck {
    /// Names with port, in small letters, as `Host` has them.
    hosts: Arc<[String]>,
    tokens: TokenCheck,
}

impl AccessCheck {
    /// For a server at `address`, which is also reached by `names` (with or without a port of their own). Allocates.
    pub fn new(address: SocketAddr, names: &[String], tokens: TokenCheck) -> Self {
        let port = address.port();
        let mut hosts = vec![];
        let own = [
            "127.0.0.1".to_string(),
            "localhost".to_string(),
            "[::1]".to_string(),
        ];
        for name in own.iter().chain(names) {
            let name = name.to_ascii_lowercase();
            let has_port = name
                .rsplit_once(':')
                .is_some_and(|(_, end)| end.parse::<u16>().is_ok());
            if has_port {
                hosts.push(name);
                continue;
            }
            // A browser leaves the port of http out.
            if port == 80 {
                hosts.push(name.clone());
            }
            hosts.push(format!("{name}:{port}"));
        }
        Self {
            hosts: hosts.into(),
            tokens,
        }
    }

    /// Judges the name under which this server is asked.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn host(&self, uri: &Uri, headers: &HeaderMap) -> Result<(), &'static str> {
        let host = only(headers, &HOST).ok_or("the request names no host, or more than one")?;
        if !self.is_own(host)
            || uri
                .authority()
                .is_some_and(|named| !self.is_own(named.as_str()))
        {
            return Err(
                "this server is not reached by that name: tandem serve --http-host NAME adds one",
            );
        }
        Ok(())
    }

    /// Judges who opens a WebSocket: a page of this server, with the token.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn socket(&self, headers: &HeaderMap) -> Result<Entry, &'static str> {
        let origin =
            only(headers, &ORIGIN).ok_or("the request names no origin, or more than one")?;
        if !origin
            .strip_prefix("http://")
            .is_some_and(|host| self.is_own(host))
        {
            return Err("pages of other servers are not let in");
        }
        let offered = only(headers, &SEC_WEBSOCKET_PROTOCOL).unwrap_or_default();
        let token = offered
            .split(',')
            .find_map(|name| name.trim().strip_prefix(TOKEN_PREFIX))
            .ok_or("the token is missing: open the address that tandem serve has printed")?;
        self.token(token)
    }

    /// Judges a token, in hexadecimal digits of its bytes.
    ///
    /// # Errors
    /// Why it is refused.
    pub fn token(&self, digits: &str) -> Result<Entry, &'static str> {
        text_of(digits)
            .and_then(|token| (self.tokens)(&token))
            .ok_or("the token is another one: open the address that tandem serve has printed last")
    }

    fn is_own(&self, host: &str) -> bool {
        self.hosts.iter().any(|own| own.eq_ignore_ascii_case(host))
    }
}

/// The one value of a header as text; none where it stands there more than once.
fn only<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    let mut all = headers.get_all(name).iter();
    let value = all.next().filter(|_| all.next().is_none());
    value.and_then(|value| value.to_str().ok())
}

/// Text from the hexadecimal digits of its bytes: in this form any token fits into a header.
fn text_of(digits: &str) -> Option<String> {
    if !digits.len().is_multiple_of(2) || !digits.is_ascii() {
        return None;
    }
    let byte = |at: usize| u8::from_str_radix(&digits[at..at + 2], 16).ok();
    let bytes: Option<Vec<u8>> = (0..digits.len()).step_by(2).map(byte).collect();
    bytes.and_then(|bytes| String::from_utf8(bytes).ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn access(port: u16, names: &[&str]) -> AccessCheck {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let address = SocketAddr::from(([127, 0, 0, 1], port));
        AccessCheck::new(
            address,
            &names,
            Arc::new(|token| (token == "abc").then(Entry::default)),
        )
    }

    fn headers(all: &[(HeaderName, &str)]) -> HeaderMap {
        all.iter()
            .map(|(name, value)| (name.clone(), value.parse().unwrap()))
            .collect()
    }

    #[test]
    fn a_foreign_name_is_refused_though_it_leads_here() {
        let access = access(8080, &["mill.local", "proxy.example:443"]);
        let uri = Uri::from_static("/");
        for own in [
            "127.0.0.1:8080",
            "LocalHost:8080",
            "[::1]:8080",
            "mill.local:8080",
            "proxy.example:443",
        ] {
            assert_eq!(access.host(&uri, &headers(&[(HOST, own)])), Ok(()), "{own}");
        }
        for foreign in [
            "evil.example:8080",
            "127.0.0.1",
            "127.0.0.1:8081",
            "localhost:8080.evil.example",
            "proxy.example:8080",
            "",
        ] {
            assert!(
                access.host(&uri, &headers(&[(HOST, foreign)])).is_err(),
                "{foreign}"
            );
        }
        let twice = headers(&[(HOST, "127.0.0.1:8080"), (HOST, "evil.example")]);
        assert!(
            access.host(&uri, &twice).is_err() && access.host(&uri, &HeaderMap::new()).is_err()
        );
        let absolute = Uri::from_static("http://evil.example/");
        assert!(
            access
                .host(&absolute, &headers(&[(HOST, "127.0.0.1:8080")]))
                .is_err()
        );
    }

    #[test]
    fn a_browser_leaves_the_usual_port_out() {
        let uri = Uri::from_static("/");
        assert!(
            access(80, &[])
                .host(&uri, &headers(&[(HOST, "localhost")]))
                .is_ok()
        );
    }

    #[test]
    fn a_socket_needs_a_page_of_this_server_and_the_token() {
        let access = access(8080, &[]);
        let with = |origin: &str, offered: &str| {
            access.socket(&headers(&[
                (ORIGIN, origin),
                (SEC_WEBSOCKET_PROTOCOL, offered),
            ]))
        };
        let (own, right) = ("http://127.0.0.1:8080", "tandem.2, token.616263");
        assert_eq!(with(own, right), Ok(Entry::default()));
        for origin in [
            "http://evil.example:8080",
            "null",
            "https://127.0.0.1:8080",
            "http://127.0.0.1:8080.evil.example",
        ] {
            assert!(with(origin, right).is_err(), "{origin}");
        }
        for offered in [
            "tandem.2",
            "token.",
            "token.6162",
            "token.61626364",
            "token.61626",
            "token.zz",
            "token.ä",
        ] {
            assert!(with(own, offered).is_err(), "{offered}");
        }
        assert!(
            access
                .socket(&headers(&[(SEC_WEBSOCKET_PROTOCOL, right)]))
                .is_err()
        );
    }
}
