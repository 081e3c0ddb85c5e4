//! Which requests are accepted: those of the page that this server itself has sent, in a browser of the user who started it.
//!
//! - Another machine does not reach the loopback address. A web page that rebinds its own name to it sends that name as `Host`.
//! - Another web page that calls the address is named by `Origin`, and has no key: keys travel in a header of their own, never in a
//!   cookie, which browsers would send to the other ports of the machine as well.
//! - Another user of the machine has no key. Addresses in the arguments of processes are visible to all users, so the key of the
//!   address that a browser is started with works once.

use crate::Shared;
use crate::refused::Refused;
use axum::extract::{Request, State};
use axum::http::header::{self, HeaderMap, HeaderValue};
use axum::http::{Method, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::Semaphore;

/// The header that carries the key.
pub(crate) const KEY: &str = "x-deflex-key";
/// Largest number of requests that are answered at once. A browser has six connections and sends fewer.
const MOST_REQUESTS: usize = 32;
/// Largest number of addresses that are kept for frames.
const MOST_TICKETS: usize = 32;

/// Scripts, styles and calls of the page itself, and frames with the pages of results; nothing from anywhere else.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; \
                           frame-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'; \
                           require-trusted-types-for 'script'";
/// The policy of a result. It runs in an origin of its own, with its own scripts, each of which its own policy names.
pub(crate) const RESULT_POLICY: &str = "sandbox allow-scripts; default-src 'none'; script-src 'unsafe-inline'; \
                                        style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; \
                                        frame-ancestors 'self'";

/// The keys of one server.
#[derive(Debug)]
pub(crate) struct Keys {
    session: String,
    once: String,
    /// Whether the key that works once is still unused.
    fresh: Mutex<bool>,
    tickets: Mutex<VecDeque<(String, crate::name::Name)>>,
    requests: Semaphore,
}

impl Keys {
    pub(crate) fn new() -> io::Result<Self> {
        Ok(Self {
            session: random_text()?,
            once: random_text()?,
            fresh: Mutex::new(true),
            tickets: Mutex::default(),
            requests: Semaphore::new(MOST_REQUESTS),
        })
    }

    pub(crate) fn session(&self) -> &str {
        &self.session
    }

    pub(crate) fn once(&self) -> &str {
        &self.once
    }

    /// The key of the session, for the key of an address; the one that works once is used up by it.
    pub(crate) fn exchange(&self, key: &str) -> Option<&str> {
        let mut fresh = self.fresh.lock().unwrap_or_else(PoisonError::into_inner);
        let once = *fresh && same(key, &self.once);
        if once {
            *fresh = false;
        }
        (once || same(key, &self.session)).then_some(&self.session)
    }

    /// An address for a frame, which can send no header: it leads to one file.
    pub(crate) fn ticket(&self, name: crate::name::Name) -> io::Result<String> {
        let ticket = random_text()?;
        let mut tickets = self.tickets.lock().unwrap_or_else(PoisonError::into_inner);
        tickets.push_back((ticket.clone(), name));
        if tickets.len() > MOST_TICKETS {
            tickets.pop_front();
        }
        Ok(ticket)
    }

    /// The file that an address for a frame leads to.
    pub(crate) fn admitted(&self, ticket: &str) -> Option<crate::name::Name> {
        let tickets = self.tickets.lock().unwrap_or_else(PoisonError::into_inner);
        tickets.iter().find(|(known, _)| same(ticket, known)).map(|(_, name)| name.clone())
    }
}

/// 128 random bits as text.
pub(crate) fn random_text() -> io::Result<String> {
    let mut bytes = [0_u8; 16];
    getrandom::fill(&mut bytes).map_err(|error| io::Error::other(error.to_string()))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Whether two keys are the same, in a time that does not depend on where they differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}

/// Accepts or refuses a request, and states in each answer what a browser may do with it.
pub(crate) async fn guard(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let admitted = admit(&shared, &request);
    let mut response = match (admitted, shared.keys.requests.try_acquire()) {
        (Ok(()), Ok(_held)) => next.run(request).await,
        (Ok(()), Err(_)) => {
            let message = "the window has more requests than it answers at once: try again";
            Refused::new(StatusCode::SERVICE_UNAVAILABLE, message).into_response()
        }
        (Err(refused), _) => refused.into_response(),
    };
    let headers = response.headers_mut();
    let fixed = |text: &'static str| HeaderValue::from_static(text);
    headers.entry(header::CONTENT_SECURITY_POLICY).or_insert(fixed(PAGE_POLICY));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, fixed("nosniff"));
    headers.insert(header::REFERRER_POLICY, fixed("no-referrer"));
    headers.insert(header::CACHE_CONTROL, fixed("no-store"));
    headers.insert("cross-origin-opener-policy", fixed("same-origin"));
    headers.insert("cross-origin-resource-policy", fixed("same-origin"));
    response
}

fn admit(shared: &Shared, request: &Request) -> Result<(), Refused> {
    let refuse = |status, message: &str| Err(Refused::new(status, message));
    let headers = request.headers();
    let port = shared.port;
    let hosts = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    if !only(headers, header::HOST).is_some_and(|host| hosts.iter().any(|own| own == host)) {
        return refuse(
            StatusCode::MISDIRECTED_REQUEST,
            "the address is not that of this window: use the address that it printed",
        );
    }
    if headers.contains_key(header::ORIGIN) {
        let own = hosts.iter().any(|host| only(headers, header::ORIGIN) == Some(&format!("http://{host}")));
        if !own {
            return refuse(StatusCode::FORBIDDEN, "another page may not call this window");
        }
    }
    let path = request.uri().path();
    if path.starts_with("/api/") && path != "/api/session" {
        let key = only(headers, header::HeaderName::from_static(KEY));
        if !key.is_some_and(|key| same(key, &shared.keys.session)) {
            return refuse(
                StatusCode::UNAUTHORIZED,
                "the key is missing or wrong: open the address that deflex studio printed",
            );
        }
    } else if path != "/api/session" && request.method() != Method::GET {
        return refuse(StatusCode::METHOD_NOT_ALLOWED, "this address is only read");
    }
    Ok(())
}

/// The value of a header, if it occurs exactly once.
fn only(headers: &HeaderMap, name: header::HeaderName) -> Option<&str> {
    let mut all = headers.get_all(name).iter();
    let value = all.next()?.to_str().ok()?;
    all.next().is_none().then_some(value)
}
