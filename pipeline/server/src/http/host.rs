//! The host that a request addresses.

use super::Problem;
use axum::http::{HeaderMap, Uri, Version, header};
use std::net::{IpAddr, Ipv6Addr};

/// Host and optional port: `uri-host [ ":" port ]` (RFC 9110, section 7.2; RFC 3986, section 3.2.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Host<'a> {
    /// As sent, with the port.
    pub text: &'a str,
    /// Name or address, without the port and without the final dot of a fully qualified name. An IPv6 address keeps its brackets.
    pub name: &'a str,
}

impl<'a> Host<'a> {
    /// The host of a request: that of an absolute request target, else that of its header. `None` for HTTP/1.0 without the header.
    ///
    /// # Errors
    /// The header is missing, repeated or malformed, or the target names a user (RFC 9112, section 3.2).
    pub fn of(version: Version, target: &'a Uri, headers: &'a HeaderMap) -> Result<Option<Self>, Problem> {
        let malformed = || {
            Problem::bad_request("the host is malformed; it must be a name or an IP address, with or without a port")
        };
        let mut sent = headers.get_all(header::HOST).iter();
        let of_header = match (sent.next(), sent.next()) {
            (Some(_), Some(_)) => return Err(Problem::bad_request("the `Host` header is given more than once")),
            (Some(one), None) => Some(one.to_str().ok().and_then(Self::parse).ok_or_else(malformed)?),
            (None, _) if version < Version::HTTP_11 => None,
            (None, _) => return Err(Problem::bad_request("the `Host` header is missing; HTTP/1.1 requires it")),
        };
        match target.authority() {
            Some(authority) => Self::parse(authority.as_str()).map(Some).ok_or_else(malformed),
            None => Ok(of_header),
        }
    }

    /// Parses a host; `None` if it is malformed or empty.
    fn parse(text: &'a str) -> Option<Self> {
        let end = match text.strip_prefix('[') {
            Some(rest) => rest.find(']')? + 2,
            None => text.find(':').unwrap_or(text.len()),
        };
        let (name, port) = text.split_at(end);
        let is_port = |port: &str| port.bytes().all(|b| b.is_ascii_digit());
        let has_port = port.is_empty() || port.strip_prefix(':').is_some_and(is_port);
        let is_host = is_ipv6(name) || is_registered_name(name);
        (is_host && has_port).then(|| Self { text, name: name.strip_suffix('.').unwrap_or(name) })
    }

    /// Whether it is a name or an address of loopback.
    pub fn is_loopback(&self) -> bool {
        let address = self.name.trim_matches(['[', ']']).parse::<IpAddr>();
        self.name.eq_ignore_ascii_case("localhost") || address.is_ok_and(|own| own.to_canonical().is_loopback())
    }
}

/// Whether this is an IPv6 address in brackets, without a zone.
fn is_ipv6(name: &str) -> bool {
    let address = name.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    address.is_some_and(|address| address.parse::<Ipv6Addr>().is_ok())
}

/// Whether this is a `reg-name` that is not empty; browsers send any of its characters. IPv4 addresses are such names too.
fn is_registered_name(name: &str) -> bool {
    let mut bytes = name.bytes();
    while let Some(byte) = bytes.next() {
        let is_part = match byte {
            b'%' => [bytes.next(), bytes.next()].into_iter().all(|digit| digit.is_some_and(|d| d.is_ascii_hexdigit())),
            _ => byte.is_ascii_alphanumeric() || b"-._~!$&'()*+,;=".contains(&byte),
        };
        if !is_part {
            return false;
        }
    }
    !name.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn name(text: &str) -> Option<&str> {
        Host::parse(text).map(|host| host.name)
    }

    #[test]
    fn val_hosts_follow_the_grammar() {
        for (text, expected) in [
            ("localhost", "localhost"),
            ("a_b.example-1.org:8080", "a_b.example-1.org"),
            ("example.org.:80", "example.org"),
            ("127.0.0.1:", "127.0.0.1"),
            ("[::1]:80", "[::1]"),
            ("[2001:db8::7]", "[2001:db8::7]"),
            ("a!b~c$d&e'f(g)h*i+j,k;l=m", "a!b~c$d&e'f(g)h*i+j,k;l=m"),
            ("a%2Db", "a%2Db"),
        ] {
            assert_eq!(name(text), Some(expected), "{text}");
        }
        for text in [
            "",
            ":80",
            "a b",
            "a/b",
            "a\\b",
            "a\"b",
            "a<b",
            "a^b",
            "a|b",
            "a`b",
            "a{b",
            "user@host",
            "user:word@host",
            "a:8o",
            "a:80:80",
            "::1",
            "[::1",
            "::1]",
            "[]",
            "[::1]80",
            "[::1]:8o",
            "[127.0.0.1]",
            "[fe80::1%25eth0]",
            "[v1.x]",
            "a[::1]",
            "a%",
            "a%2",
            "a%2g",
            "caf\u{e9}",
        ] {
            assert_eq!(name(text), None, "{text}");
        }
    }

    #[test]
    fn val_names_of_loopback() {
        let is_loopback = |text: &str| Host::parse(text).unwrap().is_loopback();
        for text in [
            "localhost",
            "LocalHost.:80",
            "127.0.0.1",
            "127.9.9.9:1",
            "[::1]",
            "[0:0:0:0:0:0:0:1]:80",
            "[::ffff:127.0.0.1]",
        ] {
            assert!(is_loopback(text), "{text}");
        }
        for text in [
            "localhost..",
            "localhost.example",
            "a!localhost",
            "0.0.0.0",
            "[::]",
            "192.168.0.7",
            "127.0.0.1.example",
            "%6cocalhost",
        ] {
            assert!(!is_loopback(text), "{text}");
        }
    }

    /// An absolute target names the host; HTTP/1.1 requires the header, exactly once.
    #[test]
    fn val_the_target_goes_before_the_header() {
        let of = |version: Version, target: &str, hosts: &[&'static str]| {
            let (target, mut headers): (Uri, _) = (target.parse().unwrap(), HeaderMap::new());
            for host in hosts {
                headers.append(header::HOST, HeaderValue::from_static(host));
            }
            let host = Host::of(version, &target, &headers).map(|host| host.map(|host| host.text.to_owned()));
            host.map_err(|problem| problem.status().as_u16())
        };
        let (old, new) = (Version::HTTP_10, Version::HTTP_11);
        assert_eq!(of(new, "/v1", &["a.example:80"]), Ok(Some("a.example:80".to_owned())));
        assert_eq!(of(new, "http://b.example/v1", &["a.example"]), Ok(Some("b.example".to_owned())));
        assert_eq!(of(old, "/v1", &[]), Ok(None));
        assert_eq!(of(old, "http://b.example/v1", &[]), Ok(Some("b.example".to_owned())));
        let wrong: [(Version, &str, &[&'static str]); 6] = [
            (new, "/v1", &[]),
            (new, "http://b.example/v1", &[]),
            (new, "/v1", &["a.example", "a.example"]),
            (old, "/v1", &["a.example", "b.example"]),
            (new, "/v1", &["user@a.example"]),
            (new, "http://user@b.example/v1", &["b.example"]),
        ];
        for (version, target, hosts) in wrong {
            assert_eq!(of(version, target, hosts), Err(400), "{target} {hosts:?}");
        }
    }
}
