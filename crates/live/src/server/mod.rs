//! The server of the page: HTTP/1.1, one request per connection, one thread per connection.
//!
//! It expects the worst of clients: requests are small and have little time, connections are few for every address, an answer
//! that is not read is given up. What can be asked for is a list of names in the program (`answer`); no path of a request reaches
//! the file system. `access` says who may ask.

mod access;
mod answer;
mod limits;
mod request;

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::net::{IpAddr, Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

pub use access::Access;
use answer::{Answer, answer};
pub use limits::Limits;
use request::read_request;

use crate::inbox::Inbox;
use crate::published::Published;

/// The connections that are open, by address.
#[derive(Debug, Default)]
struct Open {
    counts: Mutex<BTreeMap<IpAddr, usize>>,
    changed: Condvar,
}

impl Open {
    fn lock(&self) -> MutexGuard<'_, BTreeMap<IpAddr, usize>> {
        self.counts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Counts a connection; `None` where there are too many.
    fn enter(self: &Arc<Self>, address: IpAddr, limits: &Limits) -> Option<Entered> {
        let mut counts = self.lock();
        let (all, ours) = (counts.values().sum::<usize>(), counts.get(&address).copied().unwrap_or(0));
        if all >= limits.connections || ours >= limits.connections_per_address {
            return None;
        }
        counts.insert(address, ours + 1);
        Some(Entered { open: self.clone(), address })
    }
}

/// A connection that is counted until it is dropped.
#[derive(Debug)]
struct Entered {
    open: Arc<Open>,
    address: IpAddr,
}

impl Drop for Entered {
    fn drop(&mut self) {
        let mut counts = self.open.lock();
        if let Some(count) = counts.get_mut(&self.address) {
            *count -= 1;
            if *count == 0 {
                counts.remove(&self.address);
            }
        }
        drop(counts);
        self.open.changed.notify_all();
    }
}

/// The state that every connection needs.
#[derive(Debug)]
struct Served {
    access: Access,
    limits: Limits,
    port: u16,
    published: Arc<Published>,
    inbox: Arc<Inbox>,
    stopping: AtomicBool,
}

/// A running server.
#[derive(Debug)]
pub struct Server {
    served: Arc<Served>,
    open: Arc<Open>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Serves the page at a bound socket until it is stopped or dropped.
    ///
    /// # Errors
    /// The socket has no address.
    pub fn start(
        listener: TcpListener,
        access: Access,
        limits: Limits,
        published: Arc<Published>,
        inbox: Arc<Inbox>,
    ) -> io::Result<Self> {
        let port = listener.local_addr()?.port();
        let served = Arc::new(Served { access, limits, port, published, inbox, stopping: AtomicBool::new(false) });
        let open = Arc::new(Open::default());
        let (shared, counted) = (served.clone(), open.clone());
        let thread = thread::spawn(move || accept(&listener, &shared, &counted));
        Ok(Self { served, open, thread: Some(thread) })
    }

    /// The address of the page on a machine of this address, with the secret where it is shared.
    pub fn address(&self, machine: IpAddr) -> String {
        format!("http://{}{}", SocketAddr::new(machine, self.served.port), self.served.access.prefix())
    }

    /// Stops, after the answers under way, for which there is a second.
    pub fn stop(mut self) {
        self.end();
        let none = |counts: &mut BTreeMap<IpAddr, usize>| !counts.is_empty();
        let wait = self.open.changed.wait_timeout_while(self.open.lock(), Duration::from_secs(1), none);
        drop(wait.unwrap_or_else(PoisonError::into_inner));
    }

    fn end(&mut self) {
        self.served.stopping.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A connection wakes the thread that waits for one.
            drop(TcpStream::connect((Ipv4Addr::LOCALHOST, self.served.port)));
            // It does not panic: its loop only accepts.
            let _ = thread.join();
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.end();
    }
}

fn accept(listener: &TcpListener, served: &Arc<Served>, open: &Arc<Open>) {
    for stream in listener.incoming() {
        if served.stopping.load(Ordering::Relaxed) {
            return;
        }
        let Ok(stream) = stream else {
            // No descriptors are left, for example: others may be closed soon.
            thread::sleep(Duration::from_millis(20));
            continue;
        };
        let entered = stream.peer_addr().ok().and_then(|peer| open.enter(peer.ip(), &served.limits));
        if let Some(entered) = entered {
            let served = served.clone();
            let talk = move || {
                converse(stream, &served);
                drop(entered);
            };
            // Where no thread can be started the connection is closed, as beyond the limit.
            drop(thread::Builder::new().spawn(talk));
        }
    }
}

/// One request, one answer.
fn converse(mut stream: TcpStream, served: &Served) {
    let deadline = Instant::now() + served.limits.request_time;
    let answer = match read_request(&mut stream, &served.limits, deadline) {
        Ok(request) => match served.access.admit(&request, served.port) {
            Some(path) => answer(&path, &request, &served.published, &served.inbox),
            None => Answer::status(403),
        },
        Err(Some(status)) => Answer::status(status),
        // There is nobody to answer.
        Err(None) => return,
    };
    if answer.write(&mut stream, Instant::now() + served.limits.answer_time).is_ok() {
        finish(&mut stream);
    }
}

/// Closes a connection so that the answer arrives: bytes of a request that nobody has read would make the system discard it.
fn finish(stream: &mut TcpStream) {
    let _ = stream.shutdown(Shutdown::Write);
    let _ = stream.set_read_timeout(Some(Duration::from_millis(100)));
    let mut ignored = [0; 4096];
    for _ in 0..16 {
        match stream.read(&mut ignored) {
            Ok(count) if count > 0 => {}
            _ => break,
        }
    }
}
