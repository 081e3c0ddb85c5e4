//! The addresses of the server.

use crate::Shared;
use crate::assets;
use crate::cell;
use crate::folder::{Expected, LARGEST_FILE, LARGEST_SHOWN};
use crate::guard::{self, RESULT_POLICY};
use crate::name::Name;
use crate::refused::Refused;
use crate::run::Run;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{DefaultBodyLimit, Path, Query, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Response};
use axum::routing::{delete, get, post};
use http_body_util::channel::Channel;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;

type Answer = Result<Response, Refused>;
type Server = State<Arc<Shared>>;

/// Largest request that is no file, bytes: a cell file with the maps of an identification.
const LARGEST_REQUEST: usize = 16 << 20;
/// How often a page that waits for events hears that the server is there; a page that is gone is noticed by that.
const HEARTBEAT: Duration = Duration::from_secs(10);

pub(crate) fn routes(shared: Arc<Shared>) -> Router {
    let mut routes = Router::new();
    for (path, kind, content) in assets::ALL {
        routes = routes.route(path, get(move || async move { ([(header::CONTENT_TYPE, kind)], content) }));
    }
    routes
        .route("/page/{ticket}", get(result_page))
        .route("/api/session", post(session))
        .route("/api/facts", get(facts))
        .route("/api/files", get(files))
        .route("/api/file", get(read_file).put(write_file))
        .route("/api/page", post(ticket))
        .route("/api/cell", post(cell_form))
        .route("/api/cell/edit", post(cell_edit))
        .route("/api/jobs", get(list_jobs).post(start_job))
        .route("/api/jobs/{id}", delete(cancel_job))
        .route("/api/events", get(events))
        .fallback(|| async { Refused::new(StatusCode::NOT_FOUND, "there is nothing at this address") })
        .layer(DefaultBodyLimit::max(LARGEST_REQUEST))
        .layer(from_fn_with_state(shared.clone(), guard::guard))
        .with_state(shared)
}

fn answer(value: &Value) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], value.to_string()).into_response()
}

/// What a request says, in a type that has checked it.
fn read<T: DeserializeOwned>(body: &Bytes) -> Result<T, Refused> {
    serde_json::from_slice(body).map_err(|error| Refused::new(StatusCode::BAD_REQUEST, error.to_string()))
}

fn named(query: &HashMap<String, String>) -> Result<Name, Refused> {
    let name = query.get("name").cloned().unwrap_or_default();
    Name::try_from(name).map_err(|why| Refused::new(StatusCode::BAD_REQUEST, why))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Address {
    key: String,
}

async fn session(State(shared): Server, body: Bytes) -> Answer {
    let Address { key } = read(&body)?;
    match shared.keys.exchange(&key) {
        Some(session) => Ok(answer(&json!({ "key": session }))),
        None => {
            let message =
                "this address was used before, or is of another window: open the one that deflex studio printed";
            Err(Refused::new(StatusCode::UNAUTHORIZED, message))
        }
    }
}

async fn facts(State(shared): Server) -> Response {
    let folder = shared.folder.root().file_name().map_or_else(|| "/".into(), |name| name.to_string_lossy());
    answer(&json!({ "folder": folder, "program": shared.facts }))
}

async fn files(State(shared): Server) -> Response {
    answer(&json!(shared.folder.list()))
}

async fn read_file(State(shared): Server, Query(query): Query<HashMap<String, String>>) -> Answer {
    let content = shared.folder.read(&named(&query)?, LARGEST_SHOWN)?;
    // Whatever the file is, a browser that comes here by itself saves it and shows nothing.
    let headers = [
        (header::CONTENT_TYPE, "application/octet-stream".to_owned()),
        (header::CONTENT_DISPOSITION, "attachment".to_owned()),
        (header::ETAG, content.version),
    ];
    Ok((headers, content.bytes).into_response())
}

async fn write_file(
    State(shared): Server,
    Query(query): Query<HashMap<String, String>>,
    headers: HeaderMap,
    request: Request,
) -> Answer {
    let text = |name: header::HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
    let expected = match (text(header::IF_MATCH), text(header::IF_NONE_MATCH)) {
        (Some("*"), None) => Expected::Anything,
        (Some(version), None) => Expected::Version(version.to_owned()),
        (None, Some("*")) => Expected::Nothing,
        _ => {
            let message = "a write says what it expects to find: If-Match or If-None-Match";
            return Err(Refused::new(StatusCode::PRECONDITION_REQUIRED, message));
        }
    };
    // What is too long by its own word is not begun.
    let length = text(header::CONTENT_LENGTH).and_then(|length| length.parse::<u64>().ok());
    if length.is_some_and(|length| length > LARGEST_FILE) {
        return Err(Refused::too_large("the file", LARGEST_FILE));
    }
    let version = shared.folder.write(&named(&query)?, request.into_body(), &expected).await?;
    Ok(answer(&json!({ "version": version })))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Page {
    name: Name,
}

async fn ticket(State(shared): Server, body: Bytes) -> Answer {
    let Page { name } = read(&body)?;
    shared.folder.existing(&name)?;
    let ticket = shared.keys.ticket(name);
    let ticket = ticket.map_err(|error| Refused::new(StatusCode::INTERNAL_SERVER_ERROR, error.to_string()))?;
    Ok(answer(&json!({ "address": format!("/page/{ticket}") })))
}

async fn result_page(State(shared): Server, Path(ticket): Path<String>) -> Answer {
    let Some(name) = shared.keys.admitted(&ticket) else {
        return Err(Refused::new(StatusCode::NOT_FOUND, "this page is no longer shown: open it again in the window"));
    };
    let content = shared.folder.read(&name, LARGEST_SHOWN)?;
    let headers =
        [(header::CONTENT_TYPE, "text/html; charset=utf-8"), (header::CONTENT_SECURITY_POLICY, RESULT_POLICY)];
    Ok((headers, content.bytes).into_response())
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Form {
    text: String,
}

/// A cell with all that one may have, for what can be added.
fn template(shared: &Shared) -> &str {
    shared.facts["template"].as_str().unwrap_or_default()
}

async fn cell_form(State(shared): Server, body: Bytes) -> Answer {
    let Form { text } = read(&body)?;
    Ok(answer(&json!(cell::form_with(&text, template(&shared)))))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CellEdit {
    text: String,
    edit: cell::Edit,
}

async fn cell_edit(State(shared): Server, body: Bytes) -> Answer {
    let CellEdit { text, edit } = read(&body)?;
    let template = template(&shared);
    let text = edit.apply(&text, template).map_err(|why| Refused::new(StatusCode::UNPROCESSABLE_ENTITY, why))?;
    Ok(answer(&json!({ "form": cell::form_with(&text, template), "text": text })))
}

async fn list_jobs(State(shared): Server) -> Response {
    answer(&shared.jobs.list())
}

async fn start_job(State(shared): Server, body: Bytes) -> Answer {
    let run: Run = read(&body)?;
    let call = run.call().map_err(|why| Refused::new(StatusCode::UNPROCESSABLE_ENTITY, why))?;
    // What a run reads or replaces is in the folder itself, not at the end of a link that leads out of it.
    for name in &call.reads {
        shared.folder.existing(name)?;
    }
    for name in &call.writes {
        shared.folder.is_inside(name)?;
    }
    let job = shared.jobs.start(run, call)?;
    Ok((StatusCode::CREATED, answer(&json!({ "job": job }))).into_response())
}

async fn cancel_job(State(shared): Server, Path(id): Path<u64>) -> Answer {
    if shared.jobs.get(id).is_none() {
        return Err(Refused::new(StatusCode::NOT_FOUND, "there is no such run"));
    }
    Ok(answer(&json!({ "cancelled": shared.jobs.cancel(id) })))
}

/// Everything that happens, as server-sent events, for as long as the page listens.
async fn events(State(shared): Server) -> Response {
    let (mut page, body) = Channel::<Bytes, Infallible>::new(16);
    let mut events = shared.jobs.events();
    tokio::spawn(async move {
        loop {
            let text = match tokio::time::timeout(HEARTBEAT, events.recv()).await {
                Ok(Ok(event)) => format!("data: {event}\n\n"),
                Ok(Err(RecvError::Lagged(_))) => "data: {\"missed\":true}\n\n".to_owned(),
                Ok(Err(RecvError::Closed)) => return,
                Err(_) => ": here\n\n".to_owned(),
            };
            if page.send_data(text.into()).await.is_err() {
                return;
            }
        }
    });
    ([(header::CONTENT_TYPE, "text/event-stream")], Body::new(body)).into_response()
}
