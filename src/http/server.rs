//! Listens, and keeps every client within bounds.
//!
//! `axum::serve` knows neither time-outs nor a limit of connections, so hyper is driven here. A client may be slow to
//! ask ([`Limits::header`]), slow to read, or stay ([`Limits::lifetime`]). Of more than [`Limits::connections`] those that
//! wait for nothing make room for those that come, and the others go with their next answer, so that whoever only holds
//! connections open, asks on and on, or does not read keeps nobody out.

use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use axum::Router;
use hyper::body::Body;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::sync::Notify;
use tokio::task::{AbortHandle, JoinSet};
use tokio::time::{Instant, sleep, timeout};
use tracing::{debug, info, warn};

use super::control::Controls;
use super::fresh::FreshSnapshots;
use super::routes::{self, Window};
use crate::config::settings::HttpSettings;
use crate::daemon::window::CoreHandle;
use crate::token::Token;

/// Connections that the kernel holds until they are accepted.
const BACKLOG: u32 = 64;

/// The headers of a request, all together; a browser sends about 1 KiB.
const REQUEST_BYTES: usize = 16 * 1024;

/// What clients may take, and how patient we are.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Between two attempts to open the port.
    pub retry: Duration,
    /// Served at once.
    pub connections: usize,
    /// From the end of one answer, or from connecting, to the end of the next request's headers.
    pub header: Duration,
    /// From the end of the headers to the end of the body.
    pub body: Duration,
    /// After so long a connection is closed at its next answer.
    pub lifetime: Duration,
    /// How long that answer may take to come and be read.
    pub farewell: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            retry: Duration::from_secs(2),
            connections: 32,
            header: Duration::from_secs(5),
            body: Duration::from_secs(5),
            lifetime: Duration::from_secs(30),
            // As long as a gimbal may take for what was asked last.
            farewell: Duration::from_secs(25),
        }
    }
}

/// Serves until the core has dropped its ends of `core`.
pub async fn run(settings: HttpSettings, core: CoreHandle, limits: Limits) {
    let HttpSettings { listen, token } = settings;
    let requests = core.requests.clone();
    tokio::select! {
        () = requests.closed() => {}
        () = async { attend(open(listen, limits.retry).await, listen, core, token, limits).await } => {}
    }
}

/// Serves those who come to `listener`; `listen` is the address that they were told.
pub async fn attend(listener: TcpListener, listen: SocketAddr, core: CoreHandle, token: Option<Token>, limits: Limits) {
    let controls = Controls::new(token, core.requests.clone(), limits.body);
    let (snapshots, collector) = FreshSnapshots::of(core);
    let router = routes::router(Window { snapshots, controls }, listen);
    tokio::join!(collector.run(), serve(listener, router, limits));
}

/// Tries until it succeeds; says once for each kind of failure what to do about it.
async fn open(listen: SocketAddr, retry: Duration) -> TcpListener {
    let mut told = None;
    loop {
        let error = match bind(listen) {
            Ok(listener) => {
                info!(%listen, "the status page can be opened");
                return listener;
            }
            Err(error) => error,
        };
        if told != Some(error.kind()) {
            told = Some(error.kind());
            warn!(%listen, %error, remedy = remedy(error.kind()), "the status page cannot be opened, trying again");
        }
        sleep(retry).await;
    }
}

fn bind(listen: SocketAddr) -> io::Result<TcpListener> {
    let socket = if listen.is_ipv4() { TcpSocket::new_v4()? } else { TcpSocket::new_v6()? };
    socket.set_reuseaddr(true)?;
    socket.bind(listen)?;
    socket.listen(BACKLOG)
}

fn remedy(kind: io::ErrorKind) -> &'static str {
    match kind {
        io::ErrorKind::AddrInUse => {
            "another program listens there (`ss -ltnp` names it): stop it or set another [http] listen"
        }
        io::ErrorKind::AddrNotAvailable => {
            "no network interface has this address yet: bring it up or set another [http] listen"
        }
        io::ErrorKind::PermissionDenied => "ports below 1024 are reserved: set a higher port in [http] listen",
        _ => "check [http] listen",
    }
}

async fn serve(listener: TcpListener, router: Router, limits: Limits) {
    let mut guests = Guests::new(limits.connections);
    let mut failing = false;
    loop {
        match listener.accept().await {
            Ok((stream, peer)) => {
                failing = false;
                debug!(%peer, "connection accepted");
                guests.make_room().await;
                guests.admit(|visit| converse(stream, router.clone(), limits, visit));
            }
            Err(error) => {
                if !failing {
                    failing = true;
                    warn!(%error, "connections to the status page cannot be accepted, trying again");
                }
                // Out of file descriptors: the connection stays in the kernel and would be offered again at once.
                sleep(Duration::from_millis(100)).await;
            }
        }
    }
}

/// Nobody has to make room for others before he had so long to ask, or to read what he was answered.
const COURTESY: Duration = Duration::from_millis(100);

/// The connections that are served, the oldest first.
struct Guests {
    most: usize,
    tasks: JoinSet<()>,
    guests: VecDeque<Guest>,
}

struct Guest {
    task: AbortHandle,
    visit: Visit,
}

/// What a connection and whoever needs its place know of each other.
#[derive(Clone)]
pub(super) struct Visit {
    admitted: Instant,
    /// Milliseconds after `admitted` since which it waits for nothing from us; [`Self::WAITS`] while it does.
    idle_since: Arc<AtomicU64>,
    /// Its place is needed: the next answer is its last.
    farewell: Arc<Notify>,
}

impl Visit {
    const WAITS: u64 = u64::MAX;

    fn begin() -> Self {
        Self { admitted: Instant::now(), idle_since: Arc::default(), farewell: Arc::default() }
    }

    /// A request has come whole; from now on the connection waits for us, before we waited for it.
    pub(super) fn has_asked(&self) {
        self.idle_since.store(Self::WAITS, Ordering::Relaxed);
    }

    fn is_answered(&self) {
        let elapsed = u64::try_from(self.admitted.elapsed().as_millis()).unwrap_or(Self::WAITS - 1);
        self.idle_since.store(elapsed, Ordering::Relaxed);
    }

    /// How long it has been waiting for nothing: `None` while it waits for an answer.
    fn idle(&self) -> Option<Duration> {
        let since = self.idle_since.load(Ordering::Relaxed);
        (since != Self::WAITS).then(|| self.admitted.elapsed().saturating_sub(Duration::from_millis(since)))
    }
}

impl Guests {
    fn new(most: usize) -> Self {
        Self { most, tasks: JoinSet::new(), guests: VecDeque::new() }
    }

    /// Whoever comes is let in: for him goes who has waited for nothing for the longest time. Where all wait for answers
    /// he waits too, and those who were there first go with the next answer that they get.
    async fn make_room(&mut self) {
        loop {
            while self.tasks.try_join_next().is_some() {}
            self.guests.retain(|guest| !guest.task.is_finished());
            if self.guests.len() < self.most {
                return;
            }
            let idle = |guest: &Guest| guest.visit.idle().filter(|idle| *idle >= COURTESY);
            match self.guests.iter().max_by_key(|guest| idle(guest)).filter(|guest| idle(guest).is_some()) {
                Some(idle) => idle.task.abort(),
                None => {
                    let waiting = self.guests.iter().filter(|guest| guest.visit.idle().is_none());
                    waiting.for_each(|guest| guest.visit.farewell.notify_one());
                }
            }
            // Only how long it takes matters: who has left is seen above.
            let _ = timeout(COURTESY, self.tasks.join_next()).await;
        }
    }

    fn admit<F: Future<Output = ()> + Send + 'static>(&mut self, converse: impl FnOnce(Visit) -> F) {
        let visit = Visit::begin();
        let task = self.tasks.spawn(converse(visit.clone()));
        self.guests.push_back(Guest { task, visit });
    }
}

async fn converse(stream: TcpStream, router: Router, limits: Limits, visit: Visit) {
    if let Err(error) = stream.set_nodelay(true) {
        debug!(%error, "answers may come late");
    }
    let router = TowerToHyperService::new(router);
    let farewell = Arc::clone(&visit.farewell);
    let service = service_fn(move |mut request: hyper::Request<hyper::body::Incoming>| {
        let visit = visit.clone();
        let is_whole = request.body().is_end_stream();
        // Whoever reads the body says when it is there.
        request.extensions_mut().insert(visit.clone());
        let answer = router.call(request);
        async move {
            if is_whole {
                visit.has_asked();
            }
            let answer = answer.await;
            visit.is_answered();
            answer
        }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(limits.header)
        .max_buf_size(REQUEST_BYTES)
        .serve_connection(TokioIo::new(stream), service);
    let mut connection = pin!(connection);
    let stay = async { drop(timeout(limits.lifetime, farewell.notified()).await) };
    let result = tokio::select! {
        result = connection.as_mut() => result,
        () = stay => {
            connection.as_mut().graceful_shutdown();
            match timeout(limits.farewell, connection).await {
                Ok(result) => result,
                Err(_) => return debug!("connection cut: its client does not read"),
            }
        }
    };
    if let Err(error) = result {
        debug!(%error, "connection ended");
    }
}
