//! Listens, and keeps every client within bounds.
//!
//! `axum::serve` knows neither time-outs nor a limit of connections, so hyper is driven here. A client may be slow to
//! ask ([`Limits::header`]), slow to read, or stay ([`Limits::lifetime`]). Of more than [`Limits::connections`] those that
//! ask for nothing make room for those that come, so that whoever only holds connections open keeps nobody out.

use std::collections::VecDeque;
use std::io;
use std::net::SocketAddr;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpSocket, TcpStream};
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
                guests.admit(|is_asking| converse(stream, router.clone(), limits, is_asking));
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

/// Nobody has to make room for others before he had so long to ask.
const COURTESY: Duration = Duration::from_millis(100);

/// The connections that are served, the oldest first.
struct Guests {
    most: usize,
    tasks: JoinSet<()>,
    guests: VecDeque<Guest>,
}

struct Guest {
    admitted: Instant,
    task: AbortHandle,
    is_asking: IsAsking,
}

/// Whether a connection has sent a request that is not answered yet.
type IsAsking = Arc<AtomicBool>;

impl Guests {
    fn new(most: usize) -> Self {
        Self { most, tasks: JoinSet::new(), guests: VecDeque::new() }
    }

    /// Whoever comes is let in: for him goes who has asked for nothing for the longest time, or else he waits until
    /// somebody has his answer.
    async fn make_room(&mut self) {
        loop {
            while self.tasks.try_join_next().is_some() {}
            self.guests.retain(|guest| !guest.task.is_finished());
            if self.guests.len() < self.most {
                return;
            }
            let idle = self.guests.iter().find(|guest| !guest.is_asking.load(Ordering::Relaxed));
            let patience = idle.map_or(Duration::MAX, |guest| COURTESY.saturating_sub(guest.admitted.elapsed()));
            if let Some(idle) = idle.filter(|_| patience.is_zero()) {
                idle.task.abort();
            }
            let patience = if patience.is_zero() { Duration::MAX } else { patience };
            // Only how long it takes matters: who has left is seen above.
            let _ = timeout(patience, self.tasks.join_next()).await;
        }
    }

    fn admit<F: Future<Output = ()> + Send + 'static>(&mut self, converse: impl FnOnce(IsAsking) -> F) {
        let is_asking = IsAsking::default();
        let task = self.tasks.spawn(converse(Arc::clone(&is_asking)));
        self.guests.push_back(Guest { admitted: Instant::now(), task, is_asking });
    }
}

async fn converse(stream: TcpStream, router: Router, limits: Limits, is_asking: IsAsking) {
    if let Err(error) = stream.set_nodelay(true) {
        debug!(%error, "answers may come late");
    }
    let router = TowerToHyperService::new(router);
    let service = service_fn(move |request| {
        let (answer, is_asking) = (router.call(request), Arc::clone(&is_asking));
        async move {
            is_asking.store(true, Ordering::Relaxed);
            let answer = answer.await;
            is_asking.store(false, Ordering::Relaxed);
            answer
        }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(limits.header)
        .max_buf_size(REQUEST_BYTES)
        .serve_connection(TokioIo::new(stream), service);
    let mut connection = pin!(connection);
    let result = match timeout(limits.lifetime, connection.as_mut()).await {
        Ok(result) => result,
        Err(_) => {
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
