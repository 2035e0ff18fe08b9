//! A request, read within limits.

use std::io::Read;
use std::net::TcpStream;
use std::time::Instant;

use super::limits::Limits;

/// Most headers.
const MOST_HEADERS: usize = 64;

/// A request without its body, which nothing here needs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Request {
    pub method: String,
    /// Path and query.
    pub target: String,
    /// The headers, with names in lower case.
    headers: Vec<(String, String)>,
}

impl Request {
    /// The value of a header that is there once; `Err` where it is there several times.
    pub(super) fn header(&self, name: &str) -> Result<Option<&str>, ()> {
        let mut values = self.headers.iter().filter(|(header, _)| header == name).map(|(_, value)| value.as_str());
        match (values.next(), values.next()) {
            (_, Some(_)) => Err(()),
            (value, None) => Ok(value),
        }
    }

    #[cfg(test)]
    pub(super) fn of(method: &str, target: &str, headers: &[(&str, &str)]) -> Self {
        let headers = headers.iter().map(|(name, value)| (name.to_lowercase(), (*value).to_owned())).collect();
        Self { method: method.to_owned(), target: target.to_owned(), headers }
    }
}

/// Reads a request.
///
/// # Errors
/// The status of the refusal; `None` where the connection broke.
pub(super) fn read_request(stream: &mut TcpStream, limits: &Limits, deadline: Instant) -> Result<Request, Option<u16>> {
    let mut bytes = Vec::new();
    let (request, head) = loop {
        if let Some(parsed) = parse(&bytes)? {
            break parsed;
        }
        if bytes.len() >= limits.head_bytes {
            return Err(Some(431));
        }
        read_more(stream, &mut bytes, limits.head_bytes, deadline)?;
    };
    let header = |name: &str| request.header(name).map_err(|()| Some(400));
    if header("transfer-encoding")?.is_some() {
        return Err(Some(501));
    }
    let length = match header("content-length")? {
        // A number that does not fit is too large.
        Some(text) if text.bytes().all(|b| b.is_ascii_digit()) && !text.is_empty() => {
            text.parse().unwrap_or(usize::MAX)
        }
        Some(_) => return Err(Some(400)),
        None => 0,
    };
    if length > limits.body_bytes {
        return Err(Some(413));
    }
    while bytes.len() < head + length {
        read_more(stream, &mut bytes, head + length, deadline)?;
    }
    Ok(request)
}

/// Reads what comes, up to a number of bytes in all.
fn read_more(stream: &mut TcpStream, bytes: &mut Vec<u8>, most: usize, deadline: Instant) -> Result<(), Option<u16>> {
    let left = deadline.saturating_duration_since(Instant::now());
    // A timeout of zero would be none.
    if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
        return Err(Some(408));
    }
    let mut part = [0; 1024];
    let wanted = part.len().min(most - bytes.len());
    match stream.read(&mut part[..wanted]) {
        Ok(0) => Err(None),
        Ok(count) => {
            bytes.extend_from_slice(&part[..count]);
            Ok(())
        }
        Err(error) if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {
            Err(Some(408))
        }
        Err(error) if error.kind() == std::io::ErrorKind::Interrupted => Ok(()),
        Err(_) => Err(None),
    }
}

/// The request and the length of its head; `None` while it is not complete.
fn parse(bytes: &[u8]) -> Result<Option<(Request, usize)>, Option<u16>> {
    let mut headers = [httparse::EMPTY_HEADER; MOST_HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    let head = match parsed.parse(bytes) {
        Ok(httparse::Status::Complete(head)) => head,
        Ok(httparse::Status::Partial) => return Ok(None),
        Err(httparse::Error::TooManyHeaders) => return Err(Some(431)),
        Err(_) => return Err(Some(400)),
    };
    let (Some(method), Some(target)) = (parsed.method, parsed.path) else { return Err(Some(400)) };
    let header = |header: &httparse::Header<'_>| {
        let value = std::str::from_utf8(header.value).map_err(|_| Some(400))?;
        Ok((header.name.to_lowercase(), value.trim().to_owned()))
    };
    let headers = parsed.headers.iter().map(header).collect::<Result<Vec<_>, Option<u16>>>()?;
    Ok(Some((Request { method: method.to_owned(), target: target.to_owned(), headers }, head)))
}
