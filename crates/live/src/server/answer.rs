//! Answers: a list of names, each with what belongs to it.

use std::io::{self, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::request::Request;
use crate::command::Command;
use crate::inbox::Inbox;
use crate::published::Published;

/// Longest time that a request for a new state waits for one.
const WAIT: Duration = Duration::from_secs(5);
/// Bytes that are written at once; between two parts the time is looked at.
const PART: usize = 16 << 10;
/// Headers of every answer: nothing of other sites is loaded, run or embedded, and no other site may embed the answer.
const SAFETY: &str = "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
    connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
    Cross-Origin-Resource-Policy: same-origin\r\nCross-Origin-Opener-Policy: same-origin\r\nReferrer-Policy: no-referrer\r\n\
    X-Content-Type-Options: nosniff\r\nCache-Control: no-store\r\n";

/// An answer.
#[derive(Debug, Clone)]
pub(super) struct Answer {
    status: u16,
    kind: &'static str,
    body: Arc<Vec<u8>>,
}

impl Answer {
    /// A status without more than its words.
    pub(super) fn status(status: u16) -> Self {
        Self { status, kind: "text/plain; charset=utf-8", body: Arc::new(words(status).as_bytes().to_vec()) }
    }

    fn of(kind: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self { status: 200, kind, body: Arc::new(body.into()) }
    }

    /// Writes the answer; what is not read until the deadline is given up.
    pub(super) fn write(&self, stream: &mut TcpStream, deadline: Instant) -> io::Result<()> {
        let head = format!(
            "HTTP/1.1 {} {}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n{SAFETY}\r\n",
            self.status,
            words(self.status),
            self.kind,
            self.body.len()
        );
        for part in std::iter::once(head.as_bytes()).chain(self.body.chunks(PART)) {
            let mut part = part;
            while !part.is_empty() {
                let left = deadline.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    return Err(io::ErrorKind::TimedOut.into());
                }
                stream.set_write_timeout(Some(left))?;
                match stream.write(part)? {
                    0 => return Err(io::ErrorKind::WriteZero.into()),
                    count => part = &part[count..],
                }
            }
        }
        Ok(())
    }
}

fn words(status: u16) -> &'static str {
    match status {
        200 => "OK",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        413 => "Content Too Large",
        431 => "Request Header Fields Too Large",
        501 => "Not Implemented",
        _ => "Error",
    }
}

/// The answer to an admitted request for a path, which is without the secret.
pub(super) fn answer(path: &str, request: &Request, published: &Published, inbox: &Inbox) -> Answer {
    let command = match path {
        "/capture" => Some(Command::Capture),
        "/take-back" => Some(Command::TakeBack),
        "/skip" => Some(Command::Skip),
        "/finish" => Some(Command::Finish),
        _ => None,
    };
    match (request.method.as_str(), command) {
        ("POST", Some(command)) => {
            inbox.command(command);
            Answer::of("application/json", "{}")
        }
        ("GET", None) => match path {
            "/" => Answer::of("text/html; charset=utf-8", include_str!("../page/index.html")),
            "/live.js" => Answer::of("text/javascript; charset=utf-8", include_str!("../page/live.js")),
            "/live.css" => Answer::of("text/css; charset=utf-8", include_str!("../page/live.css")),
            "/state" => Answer::of("application/json", published.state_after(version(&request.target), WAIT)),
            "/picture" => match published.picture() {
                Some(body) => Answer { status: 200, kind: "image/png", body },
                None => Answer::status(404),
            },
            _ => Answer::status(404),
        },
        ("POST", None) => Answer::status(404),
        _ => Answer::status(405),
    }
}

/// The version of the state that a page has: `after` of the query, 0 where it has none.
fn version(target: &str) -> u64 {
    let query = target.split_once('?').map_or("", |(_, query)| query);
    query.split('&').find_map(|pair| pair.strip_prefix("after=")?.parse().ok()).unwrap_or(0)
}
