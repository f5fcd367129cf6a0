//! Accepts connections, checks requests, and answers them.

use super::hub::Ask;
use super::request::{self, Refusal, Request};
use super::{CONNECTIONS, Moment, Options, Picture, VIEWERS, WebError, assets, viewer};
use std::io::Read;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Requests to the hub that wait at most; a connection beyond that waits.
const ASKS: usize = 64;
/// Time within which the hub answers.
const ANSWERED_WITHIN: Duration = Duration::from_secs(5);

/// What all connections share.
struct Shared {
    token: String,
    asks: SyncSender<Ask>,
    moment: Arc<Moment>,
    connections: Arc<AtomicUsize>,
    viewers: Arc<AtomicUsize>,
    stopping: AtomicBool,
}

/// A place among a limited number; free again when dropped.
pub(super) struct Place(Arc<AtomicUsize>);

impl Place {
    fn take(taken: &Arc<AtomicUsize>, most: usize) -> Option<Self> {
        let next = |count| (count < most).then_some(count + 1);
        let got = taken.fetch_update(Ordering::AcqRel, Ordering::Acquire, next);
        got.ok().map(|_| Self(Arc::clone(taken)))
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// The server. Its connections have a thread each.
pub(super) struct Server {
    address: SocketAddr,
    shared: Arc<Shared>,
    asks: Mutex<Receiver<Ask>>,
    accepting: std::thread::JoinHandle<()>,
}

impl Server {
    /// Binds the port and begins to accept connections.
    pub(super) fn start(options: &Options) -> Result<Self, WebError> {
        let port = options.port;
        let bind = |error| WebError::Bind { port, error };
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(bind)?;
        let address = listener.local_addr().map_err(bind)?;
        let (sender, receiver) = sync_channel(ASKS);
        let shared = Arc::new(Shared {
            token: token().map_err(WebError::Random)?,
            asks: sender,
            moment: Arc::clone(&options.moment),
            connections: Arc::default(),
            viewers: Arc::default(),
            stopping: AtomicBool::new(false),
        });
        let accepted = Arc::clone(&shared);
        let accepting = std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("view-web".into())
            .spawn(move || accept(&listener, &accepted))
            .map_err(WebError::Thread)?;
        Ok(Self {
            address,
            shared,
            asks: Mutex::new(receiver),
            accepting,
        })
    }

    /// The address of the page.
    pub(super) fn address(&self) -> String {
        format!("http://{}/{}/", self.address, self.shared.token)
    }

    /// The requests of the connections to the hub.
    pub(super) fn asks(&self) -> std::sync::MutexGuard<'_, Receiver<Ask>> {
        self.asks.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Accepts no further connection.
    pub(super) fn stop(self) {
        self.shared.stopping.store(true, Ordering::Release);
        // Wakes the thread that accepts.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_secs(1));
        let _ = self.accepting.join();
    }
}

/// 128 random bits in hexadecimal digits.
fn token() -> std::io::Result<String> {
    let mut bits = [0_u8; 16];
    std::fs::File::open("/dev/urandom")?.read_exact(&mut bits)?;
    Ok(format!("{:032x}", u128::from_be_bytes(bits)))
}

fn accept(listener: &TcpListener, shared: &Arc<Shared>) {
    loop {
        let connection = listener.accept();
        if shared.stopping.load(Ordering::Acquire) {
            return;
        }
        let Ok((stream, _)) = connection else {
            // Too many open files, for instance. The wait keeps the loop from spinning.
            std::thread::sleep(Duration::from_millis(50));
            continue;
        };
        let Some(place) = Place::take(&shared.connections, CONNECTIONS) else {
            busy(stream);
            continue;
        };
        let shared = Arc::clone(shared);
        // Without a thread the connection is dropped.
        let _ = std::thread::Builder::new()
            .stack_size(runner::STACK)
            .name("view-web-page".into())
            .spawn(move || connection_begins(stream, &shared, place));
    }
}

/// Refuses a connection at once, without a thread: the line fits into the buffer of the socket.
fn busy(mut stream: TcpStream) {
    use std::io::Write;
    let line = format!("The server has {CONNECTIONS} connections, the most that it accepts.\n");
    let length = line.len();
    let _ = stream.set_nonblocking(true);
    let _ = write!(
        stream,
        "HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nContent-Type: text/plain\r\n\
         Content-Length: {length}\r\n\r\n{line}"
    );
}

fn connection_begins(mut stream: TcpStream, shared: &Shared, place: Place) {
    let _ = stream.set_nodelay(true);
    let request = match request::read(&mut stream) {
        Ok(Some(request)) => request,
        Ok(None) => return,
        Err(refusal) => return request::refuse(&mut stream, &refusal),
    };
    let path = match path(&request, &shared.token) {
        Ok(path) => path,
        Err(refusal) => return request::refuse(&mut stream, &refusal),
    };
    let media = |media: &str| format!("Content-Type: {media}; charset=utf-8\r\n");
    match path.as_str() {
        "socket" => {
            let viewer = Place::take(&shared.viewers, VIEWERS);
            if viewer.is_some() {
                drop(place);
            }
            viewer::serve(stream, &request, &shared.asks, viewer);
        }
        "moment.svg" => moment(&mut stream, shared, Picture::Svg, "image/svg+xml"),
        "moment.png" => moment(&mut stream, shared, Picture::Png, "image/png"),
        "moment.csv" => moment(&mut stream, shared, Picture::Csv, "text/csv"),
        path => {
            if let Some(asset) = assets::find(path) {
                request::respond(&mut stream, "200 OK", &media(asset.media), asset.bytes);
            } else {
                let line = "The page has no file of this name.";
                request::refuse(&mut stream, &Refusal::new("404 Not Found", line));
            }
        }
    }
}

/// The path below the token, where the request may have it.
pub(super) fn path(request: &Request, token: &str) -> Result<String, Refusal> {
    let forbidden = |line: &str| Refusal::new("403 Forbidden", line);
    let Some(host) = request.field("host") else {
        let line = "The request has no field Host, or several.";
        return Err(Refusal::new("400 Bad Request", line));
    };
    if !is_loopback(host) {
        return Err(forbidden(
            "The page is served under the names 127.0.0.1, localhost and [::1] only.",
        ));
    }
    let same = |origin: &str| origin.strip_prefix("http://") == Some(host);
    if request.has("origin") && !request.field("origin").is_some_and(same) {
        return Err(forbidden("Another page may not use this server."));
    }
    let target = request.target.split(['?', '#']).next().unwrap_or_default();
    let (first, rest) = target
        .strip_prefix('/')
        .map(|target| target.split_once('/').unwrap_or((target, "")))
        .unwrap_or_default();
    if !equal(first.as_bytes(), token.as_bytes()) {
        return Err(forbidden(
            "The address has no valid token. Open the whole address that the command printed.",
        ));
    }
    if target.len() == 1 + token.len() {
        let line = "The address of the page ends with a slash.";
        return Err(Refusal::new("404 Not Found", line));
    }
    Ok(rest.to_owned())
}

/// Whether the authority names this machine. Any port is accepted, because the near end of an SSH tunnel usually has
/// another port.
fn is_loopback(authority: &str) -> bool {
    let (name, port) = match authority.strip_prefix("[::1]") {
        Some(port) => ("[::1]", port),
        None => authority.split_at(authority.find(':').unwrap_or(authority.len())),
    };
    // Without a port, a name means port 80. Other characters after the name are no port.
    let port = match port {
        "" => "80",
        port => port.strip_prefix(':').unwrap_or_default(),
    };
    let port_is_valid = port.bytes().all(|b| b.is_ascii_digit()) && port.parse::<u16>().is_ok();
    let name_is_valid = ["127.0.0.1", "[::1]"].contains(&name)
        || (name.eq_ignore_ascii_case("localhost") && !name.is_empty());
    name_is_valid && port_is_valid
}

/// Compares in a time that does not depend on the contents.
fn equal(a: &[u8], b: &[u8]) -> bool {
    let different = a.iter().zip(b).fold(0, |bits, (a, b)| bits | (a ^ b));
    std::hint::black_box(different) == 0 && a.len() == b.len()
}

fn moment(stream: &mut TcpStream, shared: &Shared, picture: Picture, media: &str) {
    let (sender, receiver) = std::sync::mpsc::channel();
    let _ = shared.asks.send(Ask::Present(sender));
    let made = receiver
        .recv_timeout(ANSWERED_WITHIN)
        .map_err(|_| {
            format!(
                "The source gave no state within {} s.",
                ANSWERED_WITHIN.as_secs()
            )
        })
        .and_then(|present| (shared.moment)(&present, picture));
    match made {
        Ok(bytes) => {
            let name = match picture {
                Picture::Svg => "moment.svg",
                Picture::Png => "moment.png",
                Picture::Csv => "moment.csv",
            };
            let fields = format!(
                "Content-Type: {media}\r\nContent-Disposition: attachment; filename=\"{name}\"\r\n"
            );
            request::respond(stream, "200 OK", &fields, &bytes);
        }
        Err(line) => {
            let refusal = Refusal::new("503 Service Unavailable", line);
            request::refuse(stream, &refusal);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{equal, is_loopback};

    #[test]
    fn only_names_of_this_machine_are_accepted() {
        for good in [
            "127.0.0.1:80",
            "127.0.0.1",
            "localhost:1",
            "LOCALHOST:65535",
            "[::1]:8",
        ] {
            assert!(is_loopback(good), "{good}");
        }
        let bad = "127.0.0.1.example:80,example,127.0.0.2,[::2]:80,localhost:70000,localhost:,:80,,localhost:+8,\
                   127.0.0.1:80:80,localhost.example,[::1]x";
        for bad in bad.split(',') {
            assert!(!is_loopback(bad), "{bad}");
        }
    }

    #[test]
    fn tokens_of_other_length_differ() {
        assert!(equal(b"abc", b"abc"));
        assert!(!equal(b"abc", b"abd") && !equal(b"ab", b"abc") && !equal(b"", b"abc"));
    }
}
