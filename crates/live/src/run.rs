//! A live session from its source to its end.

use std::net::{IpAddr, Ipv4Addr, TcpListener, UdpSocket};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use depthcal_detect::DetectOptions;
use depthcal_model::Target;
use tracing::info;

use crate::command::Command;
use crate::error::LiveError;
use crate::fit::LiveFit;
use crate::fitter::Fitter;
use crate::inbox::{Event, Inbox};
use crate::published::Published;
use crate::server::{Access, Limits, Server};
use crate::session::Session;
use crate::source::{Source, spawn};

/// Time after the end in which pages still get to know of it: one that has just asked asks again at once, one that was refused
/// after half a second.
const LAST_WORDS: Duration = Duration::from_millis(800);

/// Options of a live session.
#[derive(Debug, Clone)]
pub struct LiveOptions {
    /// The board.
    pub target: Target,
    /// Folder for the kept frames.
    pub out: PathBuf,
    /// Port of the page; 0 for any that is free.
    pub port: u16,
    /// Whether other machines of the local network may see the page, by an address with a secret.
    pub share: bool,
    /// How the board is searched.
    pub detect: DetectOptions,
    /// How kept frames are fitted.
    pub fit: LiveFit,
}

/// How a session ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ended {
    /// The folder of the dataset.
    pub folder: PathBuf,
    /// Names of the kept frames.
    pub kept: Vec<String>,
    /// A problem by which the source ended.
    pub problem: Option<String>,
}

/// Runs a session until the page ends it or the stream is at its end. `tell` is given the address of the page once it is served.
///
/// # Errors
/// [`LiveError`] where the session cannot begin.
pub fn run(options: LiveOptions, source: Source, tell: impl FnOnce(&str)) -> Result<Ended, LiveError> {
    let LiveOptions { target, out, port, share, detect, fit } = options;
    if let Source::Folder { path, .. } = &source
        && let (Ok(source), Ok(out)) = (path.canonicalize(), out.canonicalize())
        && source == out
    {
        return Err(LiveError::OutIsSource { path: out });
    }
    let mut session = Session::open(&out, &target, detect)?;
    let is_endless = matches!(source, Source::Folder { .. });
    let ip = if share { Ipv4Addr::UNSPECIFIED } else { Ipv4Addr::LOCALHOST };
    let listen = |error| LiveError::Listen { port, error };
    let listener = TcpListener::bind((ip, port)).map_err(listen)?;
    let access = if share { Access::shared() } else { Access::local() };
    let (inbox, published) = (Arc::new(Inbox::default()), Arc::new(Published::default()));
    let server =
        Server::start(listener, access, Limits::default(), published.clone(), inbox.clone()).map_err(listen)?;
    let fitter = Fitter::start(fit, inbox.clone());
    session.fit_job().into_iter().for_each(|job| fitter.submit(job));
    spawn(source, inbox.clone())?;
    tell(&server.address(if share { local_address() } else { IpAddr::V4(Ipv4Addr::LOCALHOST) }));
    let mut source_ended = None;
    let problem = loop {
        let mut state = session.page_state();
        (state.is_fitting, state.source_ended) = (fitter.is_busy(), source_ended.clone());
        published.publish(state, session.shown());
        let changes = session.changes();
        match inbox.next() {
            Event::Frame(arrival) => {
                let name = arrival.name.clone();
                if let Err(error) = session.see(*arrival) {
                    session.tell(format!("{name}: {error}"));
                }
            }
            Event::Command(Command::Capture) => drop(session.capture()),
            Event::Command(Command::TakeBack) => drop(session.take_back()),
            Event::Command(Command::Skip) => session.skip(),
            Event::Command(Command::Finish) => break None,
            Event::Fitted(outcome) => session.fitted(*outcome),
            Event::Ended(end) if is_endless => {
                source_ended = Some(end.problem.unwrap_or_else(|| "the folder is gone".to_owned()));
            }
            Event::Ended(end) => break end.problem,
        }
        if session.changes() != changes {
            info!("{} frames are kept", session.kept().len());
            session.fit_job().into_iter().for_each(|job| fitter.submit(job));
        }
    };
    inbox.close();
    let mut state = session.page_state();
    (state.is_over, state.source_ended) = (true, source_ended);
    published.publish(state, session.shown());
    thread::sleep(LAST_WORDS);
    server.stop();
    Ok(Ended { folder: session.folder().to_owned(), kept: session.kept(), problem })
}

/// The address of this machine in the local network: that from which it would send to another network. Nothing is sent.
fn local_address() -> IpAddr {
    let socket = UdpSocket::bind((Ipv4Addr::UNSPECIFIED, 0));
    // 192.0.2.0/24 is for documentation (RFC 5737).
    let address = socket.and_then(|socket| {
        socket.connect((Ipv4Addr::new(192, 0, 2, 1), 9))?;
        socket.local_addr()
    });
    address.map_or(IpAddr::V4(Ipv4Addr::LOCALHOST), |address| address.ip())
}
