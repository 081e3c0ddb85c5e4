//! The answer to a request that is not carried out.

use crate::name::Name;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::fmt::Display;
use std::io;

/// A request that is not carried out: the status and a sentence for the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Refused {
    pub(crate) status: StatusCode,
    pub(crate) message: String,
}

impl Refused {
    pub(crate) fn new(status: StatusCode, message: impl Into<String>) -> Self {
        Self { status, message: message.into() }
    }

    pub(crate) fn too_large(what: impl Display, most: u64) -> Self {
        let message = format!("{what} is larger than the {} MiB that the window takes", most >> 20);
        Self::new(StatusCode::PAYLOAD_TOO_LARGE, message)
    }

    pub(crate) fn of(name: &Name, error: &io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound => Self::new(StatusCode::NOT_FOUND, format!("{name} is not in the folder")),
            io::ErrorKind::PermissionDenied => Self::new(
                StatusCode::FORBIDDEN,
                format!("{name}: the system does not permit it; check the file's rights"),
            ),
            _ => Self::new(StatusCode::INTERNAL_SERVER_ERROR, format!("{name}: {error}")),
        }
    }
}

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        let body = serde_json::json!({ "error": self.message }).to_string();
        (self.status, [(header::CONTENT_TYPE, "application/json")], body).into_response()
    }
}
