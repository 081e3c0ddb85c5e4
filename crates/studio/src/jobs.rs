//! Runs of the command. Each is a process of its own, whose output is read line by line.

use crate::refused::Refused;
use crate::run::{Call, Run, command_line};
use axum::http::StatusCode;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, BufReader};
use tokio::process::{Child, Command};
use tokio::sync::{broadcast, oneshot};

/// Largest number of runs at once: each uses all cores.
const MOST_RUNNING: usize = 4;
/// Largest number of runs that are remembered.
const MOST_KEPT: usize = 200;
/// Largest number of bytes of stdout that are kept: enough for an inspection with a hundred thousand kept statements.
const MOST_OUTPUT: u64 = 8 << 20;
/// Largest number of lines of stderr that are kept. The command itself stops at 50 messages.
const MOST_MESSAGES: usize = 500;
/// Longest line of stderr, bytes.
const LONGEST_LINE: u64 = 256 << 10;
/// Largest number of events that wait for a slow page. Beyond it, the page reads the list again.
const MOST_WAITING: usize = 1024;
/// How long a run may take to end after it was interrupted, until it is killed. On Windows it is killed at once.
#[cfg(unix)]
const PATIENCE: std::time::Duration = std::time::Duration::from_secs(5);

/// The state of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RunState {
    Running,
    /// It ended by itself.
    Done,
    /// The user ended it.
    Cancelled,
    /// It could not be started, or crashed.
    Failed,
}

/// A run, as the page sees it.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Job {
    id: u64,
    run: Run,
    #[serde(flatten)]
    call: Call,
    /// The same command for a shell.
    command_line: String,
    state: RunState,
    /// Exit code, if it ended by itself.
    code: Option<i32>,
    seconds: f64,
    /// Its messages, the oldest first.
    messages: Vec<Value>,
    stdout: String,
}

#[derive(Debug, Default)]
struct Inner {
    last: u64,
    jobs: VecDeque<Job>,
    /// Ends a run that is still going on.
    cancel: Vec<(u64, oneshot::Sender<()>)>,
}

/// All runs of a server.
#[derive(Clone, Debug)]
pub(crate) struct Jobs {
    program: PathBuf,
    folder: PathBuf,
    inner: Arc<Mutex<Inner>>,
    events: broadcast::Sender<String>,
}

impl Jobs {
    pub(crate) fn new(program: PathBuf, folder: PathBuf) -> Self {
        Self { program, folder, inner: Arc::default(), events: broadcast::channel(MOST_WAITING).0 }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        // No change can be left half made, so a poisoned lock is safe to use.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Receives the events from now on.
    pub(crate) fn events(&self) -> broadcast::Receiver<String> {
        self.events.subscribe()
    }

    /// All remembered runs, as JSON.
    pub(crate) fn list(&self) -> Value {
        json!({ "jobs": self.inner().jobs })
    }

    /// One of the runs.
    pub(crate) fn get(&self, id: u64) -> Option<Job> {
        self.inner().jobs.iter().find(|job| job.id == id).cloned()
    }

    /// Starts a run.
    pub(crate) fn start(&self, run: Run, call: Call) -> Result<Job, Refused> {
        let mut inner = self.inner();
        if inner.cancel.len() >= MOST_RUNNING {
            let message = format!("{MOST_RUNNING} runs are going on: wait for one, or cancel it");
            return Err(Refused::new(StatusCode::TOO_MANY_REQUESTS, message));
        }
        let failed = |error: io::Error| {
            Refused::new(StatusCode::INTERNAL_SERVER_ERROR, format!("the run cannot be started: {error}"))
        };
        let child = self.command(&call).spawn().map_err(failed)?;
        inner.last += 1;
        let id = inner.last;
        let job = Job {
            id,
            run,
            command_line: command_line(&call.arguments),
            call,
            state: RunState::Running,
            code: None,
            seconds: 0.0,
            messages: Vec::new(),
            stdout: String::new(),
        };
        inner.jobs.push_back(job.clone());
        if inner.jobs.len() > MOST_KEPT {
            inner.jobs.pop_front();
        }
        let (cancel, cancelled) = oneshot::channel();
        inner.cancel.push((id, cancel));
        drop(inner);
        self.send(&json!({ "job": job }));
        let jobs = self.clone();
        tokio::spawn(async move { jobs.follow(id, child, cancelled).await });
        Ok(job)
    }

    fn command(&self, call: &Call) -> Command {
        let mut command = Command::new(&self.program);
        command.args(&call.arguments).current_dir(&self.folder);
        // One JSON object a line instead of text for people: progress and messages with their places.
        command.env("DEFLEX_MESSAGES", "json").env_remove("RUST_BACKTRACE");
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Ends a run that is still going on.
    pub(crate) fn cancel(&self, id: u64) -> bool {
        let mut inner = self.inner();
        let Some(at) = inner.cancel.iter().position(|(other, _)| *other == id) else { return false };
        // A run that has ended in the meantime no longer receives this.
        inner.cancel.swap_remove(at).1.send(()).is_ok()
    }

    fn send(&self, event: &Value) {
        // Sending fails if no page is open, which is no error.
        let _ = self.events.send(event.to_string());
    }

    async fn follow(self, id: u64, mut child: Child, cancelled: oneshot::Receiver<()>) {
        let started = Instant::now();
        let (stdout, stderr) = (child.stdout.take(), child.stderr.take());
        let output = async {
            let mut bytes = Vec::new();
            if let Some(mut stdout) = stdout {
                let _ = (&mut stdout).take(MOST_OUTPUT).read_to_end(&mut bytes).await;
                // The pipe is read to its end, because a full pipe would block the run.
                let _ = tokio::io::copy(&mut stdout, &mut tokio::io::sink()).await;
            }
            String::from_utf8_lossy(&bytes).into_owned()
        };
        let lines = async {
            if let Some(stderr) = stderr {
                self.read_lines(id, BufReader::new(stderr)).await;
            }
        };
        let ended = async {
            let mut cancelled = cancelled;
            tokio::select! {
                status = child.wait() => (status, false),
                // If the sender is gone, no user can end the run any more.
                Ok(()) = &mut cancelled => (interrupt(&mut child).await, true),
            }
        };
        let (stdout, (), (status, was_cancelled)) = tokio::join!(output, lines, ended);
        let code = status.ok().and_then(|status| status.code());
        self.end(id, Ended { seconds: started.elapsed().as_secs_f64(), stdout, code, was_cancelled });
    }

    async fn read_lines(&self, id: u64, mut reader: impl AsyncBufReadExt + Unpin) {
        loop {
            let mut line = Vec::new();
            let read = (&mut reader).take(LONGEST_LINE).read_until(b'\n', &mut line).await;
            if !matches!(read, Ok(count) if count > 0) {
                return;
            }
            let text = String::from_utf8_lossy(&line).trim_end().to_owned();
            if text.is_empty() {
                continue;
            }
            let message: Value = serde_json::from_str(&text)
                .ok()
                .filter(Value::is_object)
                .unwrap_or_else(|| json!({ "severity": "line", "message": text }));
            // Progress is passed on, and not kept.
            if message.get("progress").is_none() {
                let mut inner = self.inner();
                let job = inner.jobs.iter_mut().find(|job| job.id == id);
                if let Some(job) = job.filter(|job| job.messages.len() < MOST_MESSAGES) {
                    job.messages.push(message.clone());
                }
            }
            self.send(&json!({ "id": id, "message": message }));
        }
    }

    fn end(&self, id: u64, Ended { seconds, stdout, code, was_cancelled }: Ended) {
        let mut inner = self.inner();
        inner.cancel.retain(|(other, _)| *other != id);
        let Some(job) = inner.jobs.iter_mut().find(|job| job.id == id) else { return };
        job.seconds = seconds;
        job.stdout = stdout;
        job.code = code;
        job.state = match job.code {
            // Once its files have their names, a run ends as if it had not been interrupted.
            Some(0 | 1) => RunState::Done,
            _ if was_cancelled => RunState::Cancelled,
            Some(2) => RunState::Done,
            _ => RunState::Failed,
        };
        let event = json!({ "job": job });
        drop(inner);
        self.send(&event);
    }
}

/// The end of a run.
struct Ended {
    seconds: f64,
    stdout: String,
    /// Exit code; `None` where the process was ended by a signal or could not be waited for.
    code: Option<i32>,
    was_cancelled: bool,
}

/// Ends a run as Ctrl-C does, so that it removes its unfinished files. A run that does not end is killed. On Windows a run is
/// killed at once: its unfinished files have no final name yet, and the next run removes them.
async fn interrupt(child: &mut Child) -> io::Result<ExitStatus> {
    #[cfg(unix)]
    {
        use nix::sys::signal::{Signal, kill};
        use nix::unistd::Pid;
        // A process that has been waited for has no process id any more.
        if let Some(number) = child.id().and_then(|number| i32::try_from(number).ok()) {
            let _ = kill(Pid::from_raw(number), Signal::SIGINT);
        }
        if let Ok(status) = tokio::time::timeout(PATIENCE, child.wait()).await {
            return status;
        }
    }
    child.kill().await?;
    child.wait().await
}
