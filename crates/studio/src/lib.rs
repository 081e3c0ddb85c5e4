//! The window of deflex: a server of one folder on the loopback address, for people who do not use a shell.
//!
//! The crate knows nothing of robots. A run is a run of the command itself: the server starts the program [`Options::program`] in
//! the folder, with the arguments that it shows to the user, and passes on what the program writes to stderr. So the files are
//! those of the command line, and a run that fails does not affect the server.
//!
//! The server serves one user, and only the page that it sends itself. Every call needs a random key. `Host` and `Origin` must be
//! those of the address. No name leads out of the folder. The browser sends typed values, and the server builds the arguments
//! from them.

mod assets;
mod cell;
mod folder;
mod guard;
mod jobs;
mod name;
mod refused;
mod run;
mod server;

use folder::Folder;
use guard::Keys;
use jobs::Jobs;
use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use thiserror::Error;

/// The options of a server.
///
/// # Examples
/// ```
/// use deflex_studio::Options;
///
/// let options =
///     Options { folder: "parts".into(), port: 0, program: "deflex".into(), facts: serde_json::json!({ "version": "0.2.0" }) };
/// ```
#[derive(Clone, Debug)]
pub struct Options {
    /// The folder that the window shows; no file outside of it is read or written.
    pub folder: PathBuf,
    /// TCP port on the loopback address; 0 takes a free one.
    pub port: u16,
    /// The program that makes the runs: deflex itself.
    pub program: PathBuf,
    /// The lists that the page shows: `version`, `robots`, `materials`, `languages` and `columns`. `template` is a cell file with
    /// every possible key, commented out or not.
    pub facts: serde_json::Value,
}

/// Why the window cannot be opened.
///
/// # Examples
/// ```
/// use deflex_studio::{Error, Options, Studio};
///
/// let options =
///     Options { folder: "no such folder".into(), port: 0, program: "deflex".into(), facts: serde_json::Value::Null };
/// assert!(matches!(Studio::open(options), Err(Error::Folder { .. })));
/// ```
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// The folder cannot be opened.
    #[error("the folder {} cannot be opened: {cause}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// The error of the system.
        cause: io::Error,
    },
    /// The port cannot be listened on.
    #[error("port {port} of the loopback address cannot be opened: {cause}")]
    Port {
        /// The port.
        port: u16,
        /// The error of the system.
        cause: io::Error,
    },
    /// The system gives no random numbers, or no threads.
    #[error("the window cannot be opened: {0}")]
    System(String),
}

/// The data that all requests share.
#[derive(Debug)]
struct Shared {
    folder: Folder,
    keys: Keys,
    jobs: Jobs,
    facts: serde_json::Value,
    port: u16,
}

/// An open window. Its port is taken, and it answers as soon as [`Studio::serve`] runs.
///
/// # Examples
/// ```
/// use deflex_studio::{Error, Options, Studio};
///
/// /// Opens a window on a folder, and serves it until the process ends.
/// fn window(options: Options) -> Result<(), Error> {
///     let studio = Studio::open(options)?;
///     println!("{}", studio.address());
///     println!("{}", studio.address_once()); // for a browser that is started with it
///     studio.serve()
/// }
/// ```
#[derive(Debug)]
pub struct Studio {
    listener: TcpListener,
    shared: Arc<Shared>,
}

impl Studio {
    /// Opens the folder and takes the port.
    ///
    /// # Errors
    /// Where the folder cannot be opened, the port is taken, or the system gives no random numbers.
    pub fn open(options: Options) -> Result<Self, Error> {
        let Options { folder, port, program, facts } = options;
        let folder = Folder::open(&folder).map_err(|cause| Error::Folder { path: folder, cause })?;
        let keys = Keys::new().map_err(|cause| Error::System(cause.to_string()))?;
        let taken = |cause| Error::Port { port, cause };
        let listener = TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).map_err(taken)?;
        listener.set_nonblocking(true).map_err(taken)?;
        let port = listener.local_addr().map_err(taken)?.port();
        let jobs = Jobs::new(program, folder.root().to_owned());
        Ok(Self { listener, shared: Arc::new(Shared { folder, keys, jobs, facts, port }) })
    }

    /// The address for the user, with the key. The key stands after `#`: browsers send that part to no server.
    #[must_use]
    pub fn address(&self) -> String {
        self.address_with(self.shared.keys.session())
    }

    /// The address with which a browser is started. Its key works once, because other users of the machine may see the arguments
    /// of a process.
    #[must_use]
    pub fn address_once(&self) -> String {
        self.address_with(self.shared.keys.once())
    }

    fn address_with(&self, key: &str) -> String {
        format!("http://127.0.0.1:{}/#{key}", self.shared.port)
    }

    /// Serves until the process ends.
    ///
    /// # Errors
    /// Where the system gives no threads, or the port is taken away.
    pub fn serve(self) -> Result<(), Error> {
        let failed = |error: io::Error| Error::System(error.to_string());
        // Runs are processes of their own: one thread answers the requests of one user.
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_io().enable_time().build().map_err(failed)?;
        runtime
            .block_on(async {
                let listener = tokio::net::TcpListener::from_std(self.listener)?;
                axum::serve(listener, server::routes(self.shared)).await
            })
            .map_err(failed)
    }
}
