//! Answers to clients, and to those that mean no good.

use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use depthcal_live::{Access, Command, Event, Inbox, Limits, PageState, Published, Server};

use crate::captures::arrivals;

struct Running {
    server: Server,
    inbox: Arc<Inbox>,
    published: Arc<Published>,
    port: u16,
    prefix: String,
}

fn start(access: Access, limits: Limits) -> Running {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let (inbox, published) = (Arc::new(Inbox::default()), Arc::new(Published::default()));
    let prefix = access.prefix();
    let server = Server::start(listener, access, limits, published.clone(), inbox.clone()).unwrap();
    Running { server, inbox, published, port, prefix }
}

impl Running {
    fn connect(&self) -> TcpStream {
        TcpStream::connect((Ipv4Addr::LOCALHOST, self.port)).unwrap()
    }

    /// The answer to raw bytes; empty where there is none.
    fn raw(&self, request: &[u8]) -> Vec<u8> {
        let mut stream = self.connect();
        // The server may answer and close before it has read all.
        let _ = stream.write_all(request);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        answer
    }

    fn ask(&self, line: &str, headers: &str) -> (u16, String) {
        let request = format!("{line} HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n{headers}\r\n", self.port);
        parts(&self.raw(request.as_bytes()))
    }

    fn get(&self, path: &str) -> (u16, String) {
        self.ask(&format!("GET {}{path}", self.prefix), "")
    }

    fn post(&self, path: &str, headers: &str) -> u16 {
        self.ask(&format!("POST {}{path}", self.prefix), headers).0
    }

    /// The commands that have arrived; ends the test's use of the inbox.
    fn commands(&self) -> Vec<Command> {
        self.inbox.end(depthcal_live::SourceEnd { problem: None });
        let mut commands = Vec::new();
        while let Event::Command(command) = self.inbox.next() {
            commands.push(command);
        }
        commands
    }
}

fn parts(answer: &[u8]) -> (u16, String) {
    let text = String::from_utf8_lossy(answer);
    let status = text.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    (status, text.split_once("\r\n\r\n").map_or(String::new(), |(_, body)| body.to_owned()))
}

#[test]
fn the_page_its_state_and_its_picture() {
    let running = start(Access::local(), Limits::default());
    assert_eq!(running.get("picture").0, 404, "there is no frame yet");
    let frame = Arc::new(arrivals(false).remove(0));
    running
        .published
        .publish(PageState { picture: 7, message: "kept \"0001\"".to_owned(), ..PageState::default() }, Some(frame));
    let (status, state) = running.get("state?after=0");
    assert!(status == 200 && state.contains(r#""picture":7"#) && state.contains(r#"kept \"0001\""#), "{state}");
    let picture = running.raw(format!("GET /picture HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", running.port).as_bytes());
    let start = picture.windows(4).position(|w| w == b"\r\n\r\n").unwrap() + 4;
    assert_eq!(&picture[start..start + 4], b"\x89PNG");
    for page in ["", "live.js", "live.css"] {
        assert_eq!(running.get(page).0, 200);
    }
    let mark = "X-Depthcal: live\r\nContent-Length: 0\r\n";
    assert_eq!(["capture", "take-back", "skip", "finish"].map(|path| running.post(path, mark)), [200; 4]);
    assert_eq!(running.commands(), [Command::Capture, Command::TakeBack, Command::Skip, Command::Finish]);
    running.server.stop();
}

/// A state that comes while a client waits for one is sent to it.
#[test]
fn a_waiting_client_gets_the_next_state() {
    let running = start(Access::local(), Limits::default());
    running.published.publish(PageState::default(), None);
    let version = running.get("state?after=0").1;
    assert!(version.contains(r#""version":1"#), "{version}");
    let mut stream = running.connect();
    write!(stream, "GET /state?after=1 HTTP/1.1\r\nHost: localhost:{}\r\n\r\n", running.port).unwrap();
    running.published.publish(PageState { events: 5, ..PageState::default() }, None);
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    assert!(answer.contains(r#""events":5"#), "{answer}");
}

#[test]
fn nothing_is_loaded_from_elsewhere() {
    let running = start(Access::local(), Limits::default());
    for page in ["", "live.js", "live.css"] {
        let (_, text) = running.get(page);
        for word in ["http:", "https:", "//cdn", "@import", "import(", "src=\"/", "href=\"/", "url("] {
            assert!(!text.contains(word), "{page} has {word}");
        }
        assert!(!text.contains("src=\"//") && text.len() > 500);
    }
    let head = running.raw(format!("GET / HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", running.port).as_bytes());
    let head = String::from_utf8_lossy(&head).into_owned();
    assert!(
        head.contains("default-src 'none'") && head.contains("Cross-Origin-Resource-Policy: same-origin"),
        "{head}"
    );
}

#[test]
fn without_the_secret_of_a_shared_page_nothing_is_answered() {
    let running = start(Access::shared(), Limits::default());
    assert_eq!(running.get("").0, 200);
    for path in ["/", "/state", "/capture", "/live.js", "/0123456789abcdef0123456789abcdef/", "/nothing"] {
        let (status, body) = running.ask(&format!("GET {path}"), "");
        assert_eq!((status, body.as_str()), (403, "Forbidden"), "{path}");
    }
    let post = running.ask("POST /capture", "X-Depthcal: live\r\n");
    assert_eq!(post.0, 403);
    let address = running.server.address(IpAddr::V4(Ipv4Addr::new(192, 168, 1, 5)));
    assert!(address.starts_with("http://192.168.1.5:") && address.ends_with(&running.prefix), "{address}");
    assert!(running.commands().is_empty());
}

#[test]
fn other_sites_and_rebound_names_get_nothing() {
    let running = start(Access::local(), Limits::default());
    running.published.publish(PageState::default(), None);
    let mark = "X-Depthcal: live\r\n";
    assert_eq!(running.post("capture", ""), 403, "a form of another site");
    assert_eq!(running.post("capture", &format!("{mark}Origin: http://evil.example\r\n")), 403);
    assert_eq!(running.post("capture", &format!("{mark}Sec-Fetch-Site: cross-site\r\n")), 403);
    assert_eq!(running.ask("GET /picture", "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Dest: image\r\n").0, 403);
    let rebound = format!("GET /state HTTP/1.1\r\nHost: evil.example:{}\r\n\r\n", running.port);
    assert_eq!(parts(&running.raw(rebound.as_bytes())).0, 403);
    assert_eq!(running.ask("OPTIONS /capture", "Access-Control-Request-Headers: x-depthcal\r\n").0, 405);
    assert_eq!(running.get("capture").0, 405, "an image of another site asks by GET");
    assert!(running.commands().is_empty());
}

#[test]
fn no_path_reaches_the_file_system() {
    let running = start(Access::local(), Limits::default());
    let paths = [
        "/../../../../etc/passwd",
        "/..%2f..%2fetc/passwd",
        "/%2e%2e/Cargo.toml",
        "/Cargo.toml",
        "//etc/passwd",
        "/picture/../../etc/passwd",
        "/live.js/..",
        "/dataset.toml",
        "/image/0001.png",
    ];
    for path in paths {
        assert_eq!(running.ask(&format!("GET {path}"), ""), (404, "Not Found".to_owned()), "{path}");
    }
    assert_eq!(running.ask("GET file:///etc/passwd", "").0, 404);
}

#[test]
fn huge_requests_are_refused() {
    let running = start(Access::local(), Limits::default());
    let mark = "X-Depthcal: live\r\n";
    assert_eq!(running.post("capture", &format!("{mark}Content-Length: 1025\r\n")), 413);
    assert_eq!(running.post("capture", &format!("{mark}Content-Length: 99999999999999999999999999\r\n")), 413);
    assert_eq!(running.post("capture", &format!("{mark}Content-Length: -1\r\n")), 400);
    assert_eq!(running.post("capture", &format!("{mark}Content-Length: 3\r\nContent-Length: 0\r\n")), 400);
    assert_eq!(running.post("capture", &format!("{mark}Transfer-Encoding: chunked\r\n")), 501);
    assert_eq!(running.ask("GET /", &format!("X: {}\r\n", "a".repeat(9000))).0, 431);
    assert_eq!(running.ask("GET /", &"X: a\r\n".repeat(100)).0, 431);
    assert_eq!(parts(&running.raw(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03")).0, 400, "TLS");
    let mut body =
        format!("POST /capture HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n{mark}Content-Length: 8000000\r\n\r\n", running.port);
    body.push_str(&"a".repeat(8_000_000));
    // The answer may be lost where the connection is reset; nothing is done in any case.
    assert!(matches!(parts(&running.raw(body.as_bytes())).0, 413 | 0));
    assert_eq!(running.get("").0, 200, "others are answered as before");
    assert!(running.commands().is_empty());
}

/// Clients that send nothing, or a byte now and then, are cut off, and meanwhile others from elsewhere are answered: one address
/// holds a few connections.
#[test]
fn slow_clients_are_cut_off() {
    let limits = Limits { request_time: Duration::from_millis(300), connections_per_address: 4, ..Limits::default() };
    let running = start(Access::local(), limits);
    let mut slow: Vec<TcpStream> = (0..4).map(|_| running.connect()).collect();
    let dripping = std::thread::spawn({
        let mut stream = slow.pop().unwrap();
        move || {
            let line = "GET / HTTP/1.1\r\nX: ".to_owned() + &"a".repeat(100_000);
            let mut sent = 0;
            for byte in line.bytes() {
                if stream.write_all(&[byte]).is_err() {
                    break;
                }
                sent += 1;
                std::thread::sleep(Duration::from_millis(10));
            }
            sent
        }
    });
    // Too many connections: closed without an answer.
    assert_eq!(parts(&running.raw(b"GET / HTTP/1.1\r\n\r\n")).0, 0);
    for mut stream in slow {
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        assert_eq!(parts(&answer).0, 408);
    }
    let sent = dripping.join().unwrap();
    assert!(sent < 1000, "a byte every 10 ms for 300 ms, and some that the system takes: {sent}");
    assert_eq!(running.get("").0, 200);
}

/// A client that does not read its answer does not stop others, and is given up.
#[test]
fn unread_answers_are_given_up() {
    let limits = Limits { answer_time: Duration::from_millis(200), connections_per_address: 1, ..Limits::default() };
    let running = start(Access::local(), limits);
    // Noise, which PNG does not make smaller: more than the system buffers of one connection.
    let mut frame = arrivals(false).remove(0);
    let mut value = 1_u32;
    let mut noise = || {
        value = value.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (value >> 16) as u16
    };
    (frame.image.width, frame.image.height) = (960, 20_000);
    frame.image.data = (0..960 * 20_000).map(|_| noise() & 255).collect();
    running.published.publish(PageState { picture: 1, ..PageState::default() }, Some(Arc::new(frame)));
    let line = format!("GET /picture HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", running.port);
    let mut unread = running.connect();
    unread.write_all(line.as_bytes()).unwrap();
    // The one connection of this address is in use until it is given up.
    let answered = (0..1000).any(|_| {
        std::thread::sleep(Duration::from_millis(20));
        running.get("").0 == 200
    });
    assert!(answered);
    let mut bytes = Vec::new();
    let _ = unread.read_to_end(&mut bytes);
    let text = String::from_utf8_lossy(&bytes[..500]).into_owned();
    let length: usize = text.split("Content-Length: ").nth(1).unwrap().lines().next().unwrap().parse().unwrap();
    assert!(length > 15_000_000 && bytes.len() < length, "the answer was cut: {} of {length}", bytes.len());
}
