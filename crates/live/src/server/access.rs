//! Who may ask: the page itself, on this machine or, with the secret of its address, from the local network.
//!
//! A page of another site that is open in the same browser can send requests here too. It gets nothing: its requests have its
//! origin, or tell by `Sec-Fetch-Site` that they come from elsewhere. A name that an attacker's server resolves to this machine
//! (DNS rebinding) is told by `Host`, which is then that name: only addresses and `localhost` are answered.

use std::net::IpAddr;

use super::request::Request;

/// Header of requests that change something. Forms cannot send it, and scripts of other sites would have to ask before.
pub(super) const MARK: (&str, &str) = ("x-depthcal", "live");

/// Who may ask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Access {
    /// The secret part of the address; `None` where only this machine may ask.
    secret: Option<String>,
}

impl Access {
    /// Only this machine.
    pub fn local() -> Self {
        Self { secret: None }
    }

    /// Whoever knows the secret, 128 random bits that are part of the address.
    pub fn shared() -> Self {
        // Seeded and reseeded by the operating system's generator.
        Self { secret: Some(format!("{:032x}", rand::random::<u128>())) }
    }

    /// The path of the page.
    pub fn prefix(&self) -> String {
        self.secret.as_ref().map_or_else(|| "/".to_owned(), |secret| format!("/{secret}/"))
    }

    /// The path that is asked for, without the secret; `None` where the request is refused.
    pub(super) fn admit(&self, request: &Request, port: u16) -> Option<String> {
        let host = request.header("host").ok()??;
        if !self.is_our_host(host, port) {
            return None;
        }
        let path = request.target.split('?').next()?;
        let path = match &self.secret {
            None => path.to_owned(),
            Some(secret) => {
                let (given, name) = path.strip_prefix('/')?.split_once('/')?;
                is_equal(given.as_bytes(), secret.as_bytes()).then(|| format!("/{name}"))?
            }
        };
        if let Some(origin) = request.header("origin").ok()?
            && origin != format!("http://{host}")
        {
            return None;
        }
        // The page itself may be opened by a link of another site: it has no data, and cannot be put into a frame.
        let opens_page = path == "/" && request.header("sec-fetch-dest").ok()? == Some("document");
        let is_own = matches!(request.header("sec-fetch-site").ok()?, None | Some("same-origin" | "none"));
        let is_marked = request.method != "POST" || request.header(MARK.0).ok()? == Some(MARK.1);
        ((is_own || opens_page) && is_marked).then_some(path)
    }

    /// Whether a host is this machine: by an address, not by a name that somebody else decides about.
    fn is_our_host(&self, host: &str, port: u16) -> bool {
        let (name, given) = match host.rsplit_once(':') {
            Some((name, digits)) if !digits.ends_with(']') => (name, digits.parse().ok()),
            _ => (host, Some(80)),
        };
        let address = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name).parse::<IpAddr>();
        let is_ours = match address {
            Ok(address) => address.is_loopback() || self.secret.is_some(),
            Err(_) => name.eq_ignore_ascii_case("localhost"),
        };
        is_ours && given == Some(port)
    }
}

/// Compares in a time that does not tell how far two texts are equal.
fn is_equal(a: &[u8], b: &[u8]) -> bool {
    a.len() == b.len() && a.iter().zip(b).fold(0, |different, (a, b)| different | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn admitted(access: &Access, method: &str, target: &str, headers: &[(&str, &str)]) -> Option<String> {
        access.admit(&Request::of(method, target, headers), 8345)
    }

    const HOST: (&str, &str) = ("Host", "127.0.0.1:8345");
    const MARKED: (&str, &str) = ("X-Depthcal", "live");

    #[test]
    fn hosts_are_addresses_of_this_machine() {
        let local = Access::local();
        let get = |access: &Access, host: &str, path: &str| admitted(access, "GET", path, &[("Host", host)]).is_some();
        for host in ["127.0.0.1:8345", "localhost:8345", "LOCALHOST:8345", "[::1]:8345"] {
            assert!(get(&local, host, "/state"), "{host}");
        }
        let shared = Access::shared();
        let path = format!("{}state", shared.prefix());
        assert!(get(&shared, "192.168.1.5:8345", &path) && get(&shared, "[fe80::1]:8345", &path));
        for host in
            ["evil.example:8345", "127.0.0.1", "127.0.0.1:80", "127.0.0.1.evil.example:8345", "", ":8345", "[::1]"]
        {
            assert!(!get(&local, host, "/state") && !get(&shared, host, &path), "{host}");
        }
        assert!(!get(&local, "192.168.1.5:8345", "/state"));
        assert!(admitted(&local, "GET", "/state", &[]).is_none(), "no host");
        assert!(admitted(&local, "GET", "/state", &[HOST, HOST]).is_none(), "two hosts");
    }

    #[test]
    fn other_sites_get_nothing() {
        let local = Access::local();
        let get = |more: (&str, &str)| admitted(&local, "GET", "/state", &[HOST, more]).is_some();
        assert!(get(("Origin", "http://127.0.0.1:8345")) && get(("Sec-Fetch-Site", "same-origin")));
        for origin in
            ["http://evil.example", "null", "https://127.0.0.1:8345", "http://127.0.0.1:3000", "http://localhost:8345"]
        {
            assert!(!get(("Origin", origin)), "{origin}");
        }
        // Another port of this machine is the same site and another origin.
        assert!(!get(("Sec-Fetch-Site", "cross-site")) && !get(("Sec-Fetch-Site", "same-site")));
        let link = [HOST, ("Sec-Fetch-Site", "cross-site"), ("Sec-Fetch-Dest", "document")];
        assert!(admitted(&local, "GET", "/", &link).is_some() && admitted(&local, "GET", "/state", &link).is_none());
        assert!(admitted(&local, "POST", "/capture", &[HOST]).is_none(), "a form");
        assert!(admitted(&local, "POST", "/capture", &[HOST, MARKED]).is_some());
        let crossing = [HOST, MARKED, ("Origin", "http://evil.example")];
        assert!(admitted(&local, "POST", "/capture", &crossing).is_none());
    }

    #[test]
    fn without_the_secret_nothing_is_answered() {
        let shared = Access::shared();
        let secret = shared.prefix();
        assert_eq!(secret.len(), 34);
        assert_ne!(Access::shared(), shared, "it is another every time");
        let get = |path: &str| admitted(&shared, "GET", path, &[HOST]);
        assert_eq!(get(&secret).as_deref(), Some("/"));
        assert_eq!(get(&format!("{secret}state?after=3")).as_deref(), Some("/state"));
        let shorter = format!("/{}/state", &secret[1..32]);
        for path in ["/", "/state", "/00000000000000000000000000000000/state", &shorter, &secret[..33], "", "//state"] {
            assert_eq!(get(path), None, "{path}");
        }
    }
}
