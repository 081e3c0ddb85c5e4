//! What a hostile page, a hostile file, another user or bad luck may try, by hand-written requests.

#![allow(clippy::unwrap_used)] // a failure is a failed test

use deflex_studio::{Options, Studio};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A window and its folder; the folder above is outside.
struct Window {
    above: tempfile::TempDir,
    port: u16,
    key: String,
    once: String,
}

/// An answer.
#[derive(Debug)]
struct Answer {
    status: u16,
    head: String,
    body: String,
}

impl Answer {
    fn json(&self) -> Value {
        serde_json::from_str(&self.body).unwrap()
    }
}

/// Parts of an address.
fn parts(address: &str) -> (u16, String) {
    let (before, key) = address.trim().split_once("/#").unwrap();
    (before.rsplit(':').next().unwrap().parse().unwrap(), key.to_owned())
}

impl Window {
    fn open() -> Self {
        Self::with("/bin/false".into())
    }

    fn with(program: PathBuf) -> Self {
        let above = tempfile::tempdir().unwrap();
        fs::create_dir(above.path().join("folder")).unwrap();
        fs::write(above.path().join("secret"), "secret").unwrap();
        let folder = above.path().join("folder");
        let studio = Studio::open(Options { folder, port: 0, program, facts: json!({}) }).unwrap();
        let (port, key) = parts(&studio.address());
        let (_, once) = parts(&studio.address_once());
        std::thread::spawn(move || studio.serve());
        Self { above, port, key, once }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.above.path().join("folder").join(name)
    }

    /// Sends a request with these headers, and nothing else.
    fn raw(&self, line: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
        raw(self.port, line, headers, body)
    }

    /// Sends a request as the page does.
    fn call(&self, method: &str, path: &str, body: &str) -> Answer {
        let (host, length) = (format!("127.0.0.1:{}", self.port), body.len().to_string());
        let headers =
            [("host", host.as_str()), ("x-deflex-key", &self.key), ("content-length", &length), ("if-match", "*")];
        self.raw(&format!("{method} {path}"), &headers, body.as_bytes())
    }

    fn job(&self, run: &Value) -> Answer {
        self.call("POST", "/api/jobs", &run.to_string())
    }

    /// The run when it has ended.
    fn ended(&self, id: u64) -> Value {
        let start = Instant::now();
        loop {
            let jobs = self.call("GET", "/api/jobs", "").json();
            let job = jobs["jobs"].as_array().unwrap().iter().find(|job| job["id"] == id).unwrap().clone();
            if job["state"] != "running" {
                return job;
            }
            assert!(start.elapsed() < Duration::from_secs(20), "{job}");
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Names of all files, hidden ones too.
    fn names(&self) -> Vec<String> {
        names(&self.at(""))
    }
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn raw(port: u16, line: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).unwrap();
    let head: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    stream.write_all(format!("{line} HTTP/1.1\r\n{head}connection: close\r\n\r\n").as_bytes()).unwrap();
    // The server may answer before it has read all.
    let _ = stream.write_all(body);
    answer(stream)
}

fn answer(mut stream: TcpStream) -> Answer {
    let mut bytes = Vec::new();
    // A connection that is cut after the answer has been sent is one that was answered.
    let _ = stream.read_to_end(&mut bytes);
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
    let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    Answer { status, head: head.to_ascii_lowercase(), body: body.to_owned() }
}

/// A program of the shell, as a stand-in for deflex.
#[cfg(unix)]
fn script(folder: &Path, text: &str) -> PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let path = folder.join("program.sh");
    fs::write(&path, format!("#!/bin/sh\n{text}\n")).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path
}

#[test]
fn another_page_is_not_answered() {
    let window = Window::open();
    let host = format!("127.0.0.1:{}", window.port);
    let origins = [
        "http://evil.example",
        "null",
        "http://127.0.0.1:1",
        &format!("https://{host}"),
        &format!("http://{host}.evil.example"),
    ];
    for origin in origins {
        let headers = [
            ("host", &*host),
            ("x-deflex-key", &window.key),
            ("origin", origin),
            ("if-none-match", "*"),
            ("content-length", "1"),
        ];
        assert_eq!(window.raw("PUT /api/file?name=x.mod", &headers, b"x").status, 403, "{origin}");
        assert_eq!(window.raw("GET /", &[("host", &host), ("origin", origin)], b"").status, 403, "{origin}");
    }
    let origin = format!("http://{host}");
    let own = [
        ("host", &*host),
        ("x-deflex-key", &window.key),
        ("origin", &origin),
        ("if-none-match", "*"),
        ("content-length", "1"),
    ];
    assert_eq!(window.raw("PUT /api/file?name=x.mod", &own, b"x").status, 200);
    assert_eq!(window.names(), ["x.mod"]);
    // No answer invites another page to read it.
    assert!(!window.call("GET", "/api/files", "").head.contains("access-control"));
}

#[test]
fn a_name_that_is_rebound_to_this_machine_is_not_answered() {
    let window = Window::open();
    let port = window.port;
    for host in [
        "evil.example",
        &format!("evil.example:{port}"),
        "127.0.0.1",
        "127.0.0.1:1",
        &format!("127.0.0.1.nip.example:{port}"),
        "",
    ] {
        let headers = [("host", host), ("x-deflex-key", &*window.key)];
        for path in ["GET /", "GET /studio.js", "GET /api/files"] {
            let status = window.raw(path, &headers, b"").status;
            assert!(matches!(status, 400 | 421), "{host}: {status}");
        }
    }
    let own = format!("127.0.0.1:{port}");
    let twice = [("host", &*own), ("host", "evil.example"), ("x-deflex-key", &window.key)];
    assert!(matches!(window.raw("GET /api/files", &twice, b"").status, 400 | 421));
    assert_eq!(window.raw("GET /", &[("host", &format!("localhost:{port}"))], b"").status, 200);
}

#[test]
fn without_the_key_nothing_is_read_or_run() {
    let window = Window::open();
    fs::write(window.at("part.mod"), "text").unwrap();
    let host = format!("127.0.0.1:{}", window.port);
    let wrong = ["", "0", &window.key[1..], &window.key.to_uppercase(), &format!("{}0", window.key), &window.once];
    for key in wrong.into_iter().filter(|key| *key != window.key) {
        let headers = [("host", &*host), ("x-deflex-key", key), ("content-length", "0")];
        for line in [
            "GET /api/files",
            "GET /api/facts",
            "GET /api/file?name=part.mod",
            "GET /api/events",
            "GET /api/jobs",
            "POST /api/jobs",
            "POST /api/page",
            "PUT /api/file?name=part.mod",
            "DELETE /api/jobs/1",
            "GET /api/nothing",
        ] {
            let answer = window.raw(line, &headers, b"");
            assert_eq!(answer.status, 401, "{key} {line}");
            assert!(!answer.body.contains("part.mod"));
        }
    }
    let cookie = format!("key={}", window.key);
    assert_eq!(window.raw("GET /api/files", &[("host", &host), ("cookie", &cookie)], b"").status, 401);
    // The page itself holds no key.
    for path in ["/", "/studio.js", "/server.js"] {
        let page = window.raw(&format!("GET {path}"), &[("host", &host)], b"");
        assert_eq!(page.status, 200);
        assert!(!page.body.contains(&window.key) && !page.head.contains("set-cookie"));
    }
}

#[test]
fn the_key_of_the_browsers_address_works_once() {
    let window = Window::open();
    let enter = |key: &str| {
        let body = json!({ "key": key }).to_string();
        let headers = [("host", &*format!("127.0.0.1:{}", window.port)), ("content-length", &body.len().to_string())];
        window.raw("POST /api/session", &headers, body.as_bytes())
    };
    assert_eq!(enter("00000000000000000000000000000000").status, 401);
    assert_eq!(enter(&window.once).json()["key"], window.key.as_str());
    assert_eq!(enter(&window.once).status, 401);
    // The printed address goes on working.
    assert_eq!((enter(&window.key).status, enter(&window.key).status), (200, 200));
}

#[test]
fn no_name_leads_out_of_the_folder() {
    let window = Window::open();
    for name in [
        "../secret", "..%2fsecret", "%2e%2e/secret", "a/../../secret", "/etc/passwd", "%2fetc%2fpasswd", "..%5csecret",
        "C:%5csecret", "%00", "",
    ] {
        for method in ["GET", "PUT"] {
            let answer = window.call(method, &format!("/api/file?name={name}"), "");
            assert_eq!(answer.status, 400, "{method} {name}: {answer:?}");
        }
    }
    for name in ["../secret", "/etc/passwd", "-o", "--html", "a\\..\\b", ".hidden"] {
        for run in [
            json!({ "command": "inspect", "programs": [name] }),
            json!({ "command": "predict", "programs": ["part.mod"], "cell": name }),
            json!({ "command": "init", "origin": { "robot": "irb" }, "output": name }),
            json!({ "command": "init", "origin": { "backup": name }, "output": "c.toml" }),
            json!({ "command": "compensate", "programs": ["part.mod"], "cell": "c.toml", "output": { "folder": name } }),
        ] {
            assert_eq!(window.job(&run).status, 400, "{run}");
        }
    }
    assert_eq!(fs::read_to_string(window.above.path().join("secret")).unwrap(), "secret");
    assert_eq!(names(window.above.path()), ["folder", "secret"]);
    assert!(window.names().is_empty());
}

#[test]
#[cfg(unix)]
fn no_link_leads_out_of_the_folder() {
    use std::os::unix::fs::symlink;
    let window = Window::open();
    symlink(window.above.path().join("secret"), window.at("file.mod")).unwrap();
    symlink(window.above.path(), window.at("up")).unwrap();
    symlink(window.above.path().join("nothing"), window.at("dangling.mod")).unwrap();
    fs::write(window.at("own.mod"), "own").unwrap();
    symlink(window.at("own.mod"), window.at("inner.mod")).unwrap();
    for name in ["file.mod", "up/secret"] {
        assert_eq!(window.call("GET", &format!("/api/file?name={name}"), "").status, 403, "{name}");
        assert_eq!(window.call("POST", "/api/page", &json!({ "name": name }).to_string()).status, 403, "{name}");
        assert_eq!(window.job(&json!({ "command": "inspect", "programs": [name] })).status, 403, "{name}");
    }
    for name in ["file.mod", "up/secret", "up/new.mod", "dangling.mod"] {
        assert_eq!(window.call("PUT", &format!("/api/file?name={name}"), "x").status, 403, "{name}");
        let run = json!({ "command": "init", "origin": { "robot": "irb" }, "output": name });
        assert_eq!(window.job(&run).status, 403, "{name}");
    }
    assert_eq!(window.call("GET", "/api/file?name=inner.mod", "").body, "own");
    assert_eq!(fs::read_to_string(window.above.path().join("secret")).unwrap(), "secret");
    assert_eq!(names(window.above.path()), ["folder", "secret"]);
    let listed = window.call("GET", "/api/files", "").body;
    assert!(!listed.contains("secret") && listed.contains("own.mod"), "{listed}");
}

#[test]
fn an_upload_is_bounded_and_leaves_nothing() {
    let window = Window::open();
    let host = format!("127.0.0.1:{}", window.port);
    let announced =
        [("host", &*host), ("x-deflex-key", &window.key), ("if-none-match", "*"), ("content-length", "1073741824")];
    assert_eq!(window.raw("PUT /api/file?name=large.mod", &announced, b"").status, 413);
    // One that does not say how long it is.
    let mut stream = TcpStream::connect(("127.0.0.1", window.port)).unwrap();
    let head = format!(
        "PUT /api/file?name=large.mod HTTP/1.1\r\nhost: {host}\r\nx-deflex-key: {}\r\nif-none-match: *\r\ntransfer-encoding: chunked\r\nconnection: close\r\n\r\n",
        window.key
    );
    stream.write_all(head.as_bytes()).unwrap();
    let chunk = [b"100000\r\n", &vec![b'x'; 1 << 20][..], b"\r\n"].concat();
    let sent = (0..1024).take_while(|_| stream.write_all(&chunk).is_ok()).count();
    assert!((256..300).contains(&sent), "{sent} MiB were taken");
    assert!(window.names().is_empty(), "{:?}", window.names());
    // Requests that are no files are bounded too.
    let body = " ".repeat(17 << 20);
    assert_eq!(window.call("POST", "/api/cell", &body).status, 413);
    assert_eq!(window.call("GET", "/api/files", "").status, 200);
}

#[test]
fn a_write_says_what_it_expects_and_is_whole_or_not_at_all() {
    let window = Window::open();
    let host = format!("127.0.0.1:{}", window.port);
    let put = |expected: (&str, &str), body: &str| {
        let headers =
            [("host", &*host), ("x-deflex-key", &window.key), expected, ("content-length", &body.len().to_string())];
        window.raw("PUT /api/file?name=sub/cell.toml", &headers, body.as_bytes())
    };
    assert_eq!(put(("accept", "*"), "a").status, 428);
    let first = put(("if-none-match", "*"), "first");
    assert_eq!(first.status, 200);
    assert_eq!(put(("if-none-match", "*"), "second").status, 412);
    let version = first.json()["version"].as_str().unwrap().to_owned();
    let second = put(("if-match", &version), "longer than the first");
    assert_eq!(second.status, 200);
    assert_eq!(put(("if-match", &version), "third").status, 412);
    assert_eq!(fs::read_to_string(window.at("sub/cell.toml")).unwrap(), "longer than the first");
    // A client that dies in the middle of it.
    let mut stream = TcpStream::connect(("127.0.0.1", window.port)).unwrap();
    write!(stream, "PUT /api/file?name=sub/cell.toml HTTP/1.1\r\nhost: {host}\r\nx-deflex-key: {}\r\nif-match: *\r\ncontent-length: 1000\r\n\r\nhalf", window.key).unwrap();
    std::thread::sleep(Duration::from_millis(100));
    assert_eq!(names(&window.at("sub")).len(), 2);
    drop(stream);
    let start = Instant::now();
    while names(&window.at("sub")).len() > 1 {
        assert!(start.elapsed() < Duration::from_secs(10), "{:?}", names(&window.at("sub")));
        std::thread::sleep(Duration::from_millis(10));
    }
    assert_eq!(fs::read_to_string(window.at("sub/cell.toml")).unwrap(), "longer than the first");
}

#[test]
fn answers_permit_no_script_from_elsewhere() {
    let window = Window::open();
    fs::write(window.at("page.html"), "<script>1</script>").unwrap();
    let host = format!("127.0.0.1:{}", window.port);
    let page = window.raw("GET /", &[("host", &host)], b"");
    for part in [
        "default-src 'none'",
        "script-src 'self'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
        "nosniff",
        "no-referrer",
        "no-store",
    ] {
        assert!(page.head.contains(part), "{part}: {}", page.head);
    }
    assert!(!page.head.contains("unsafe"));
    // A file of the folder is saved, not shown; as a page it has an origin of its own.
    let file = window.call("GET", "/api/file?name=page.html", "");
    assert!(file.head.contains("content-disposition: attachment") && file.head.contains("application/octet-stream"));
    let address =
        window.call("POST", "/api/page", r#"{"name":"page.html"}"#).json()["address"].as_str().unwrap().to_owned();
    let shown = window.raw(&format!("GET {address}"), &[("host", &host)], b"");
    assert!(
        shown.head.contains("sandbox allow-scripts;") && shown.head.contains("default-src 'none'"),
        "{}",
        shown.head
    );
    assert!(!shown.head.contains("allow-same-origin"));
    assert_eq!(shown.body, "<script>1</script>");
    assert_eq!(window.raw("GET /page/0123456789abcdef0123456789abcdef", &[("host", &host)], b"").status, 404);
}

#[test]
#[cfg(unix)]
fn a_run_has_the_arguments_that_are_shown_and_no_shell_reads_them() {
    let outside = tempfile::tempdir().unwrap();
    let program = script(
        outside.path(),
        r#"for a in "$@"; do echo "[$a]"; done; echo '{"severity":"note","message":"m","line":3}' >&2; echo plain >&2; exit 1"#,
    );
    let window = Window::with(program);
    let hostile = "$(touch pwned);`touch pwned`'&.mod";
    fs::write(window.at(hostile), "").unwrap();
    let started = window.job(&json!({ "command": "inspect", "programs": [hostile] }));
    assert_eq!(started.status, 201, "{started:?}");
    let job = window.ended(started.json()["job"]["id"].as_u64().unwrap());
    assert_eq!(job["stdout"], format!("[inspect]\n[{hostile}]\n[--json]\n"));
    assert_eq!((job["code"].as_i64(), job["state"].as_str()), (Some(1), Some("done")));
    assert_eq!(
        job["messages"],
        json!([{ "severity": "note", "message": "m", "line": 3 }, { "severity": "line", "message": "plain" }])
    );
    assert_eq!(window.names(), [hostile]);
    // The line that is shown does the same in a shell.
    let line = job["command_line"].as_str().unwrap().replacen("deflex", "printf '[%s]\\n'", 1);
    let said = Command::new("sh").args(["-c", &line]).current_dir(window.at("")).output().unwrap().stdout;
    assert_eq!(String::from_utf8(said).unwrap(), job["stdout"].as_str().unwrap());
    assert_eq!(window.names(), [hostile]);
}

#[test]
#[cfg(target_os = "linux")]
fn a_run_is_interrupted_as_a_user_would_and_the_number_of_runs_is_bounded() {
    let outside = tempfile::tempdir().unwrap();
    // A shell handles a signal at once while it waits, and not before the end of a command in the foreground. It cannot handle a signal
    // that was ignored when it started, as it is in jobs in the background: `env` takes that back.
    let waits = "exec env --default-signal=INT sh -c '\
                 trap \"kill \\$!; echo cleaned; exit 130\" INT; sleep 600 >/dev/null 2>&1 & echo go >&2; wait'";
    let program = script(outside.path(), waits);
    let window = Window::with(program);
    fs::write(window.at("a.mod"), "").unwrap();
    let run = json!({ "command": "inspect", "programs": ["a.mod"] });
    let ids: Vec<u64> = (0..4).map(|_| window.job(&run).json()["job"]["id"].as_u64().unwrap()).collect();
    assert_eq!(window.job(&run).status, 429);
    // The trap of the shell is set when it has said so.
    let said = |id: u64| {
        let jobs = window.call("GET", "/api/jobs", "").json();
        jobs["jobs"]
            .as_array()
            .unwrap()
            .iter()
            .any(|job| job["id"] == id && job["messages"].as_array().is_some_and(|all| !all.is_empty()))
    };
    for &id in &ids {
        while !said(id) {
            std::thread::sleep(Duration::from_millis(10));
        }
        assert_eq!(window.call("DELETE", &format!("/api/jobs/{id}"), "").json()["cancelled"], true);
        let job = window.ended(id);
        assert_eq!((job["state"].as_str(), job["stdout"].as_str()), (Some("cancelled"), Some("cleaned\n")), "{job}");
        assert_eq!(window.call("DELETE", &format!("/api/jobs/{id}"), "").json()["cancelled"], false);
    }
    assert_eq!(window.call("DELETE", "/api/jobs/99", "").status, 404);
}

#[test]
#[cfg(unix)]
fn a_run_that_crashes_or_says_too_much_ends_alone() {
    let outside = tempfile::tempdir().unwrap();
    let loud = "i=0; while [ $i -lt 2000 ]; do echo \"line $i\" >&2; i=$((i+1)); done; head -c 20000000 /dev/zero; kill -SEGV $$";
    let window = Window::with(script(outside.path(), loud));
    fs::write(window.at("a.mod"), "").unwrap();
    let id = window.job(&json!({ "command": "inspect", "programs": ["a.mod"] })).json()["job"]["id"].as_u64().unwrap();
    let job = window.ended(id);
    assert_eq!(job["state"], "failed", "{}", job["code"]);
    assert_eq!(job["messages"].as_array().unwrap().len(), 500);
    assert_eq!(job["stdout"].as_str().unwrap().len(), 8 << 20);
    assert_eq!(window.call("GET", "/api/files", "").status, 200);
}

#[test]
fn events_come_as_they_happen() {
    let window = Window::with("/bin/echo".into());
    fs::write(window.at("a.mod"), "").unwrap();
    let mut stream = TcpStream::connect(("127.0.0.1", window.port)).unwrap();
    write!(
        stream,
        "GET /api/events HTTP/1.1\r\nhost: 127.0.0.1:{}\r\nx-deflex-key: {}\r\n\r\n",
        window.port, window.key
    )
    .unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let mut lines = BufReader::new(stream).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.is_empty()));
    window.job(&json!({ "command": "inspect", "programs": ["a.mod"] }));
    let mut states = lines.filter_map(|line| {
        let event: Value = serde_json::from_str(line.strip_prefix("data: ")?).unwrap();
        event["job"]["state"].as_str().map(str::to_owned)
    });
    assert_eq!((states.next().unwrap(), states.next().unwrap()), ("running".to_owned(), "done".to_owned()));
}

/// A window in a process of its own: this test binary, called for [`a_window_for_another_test`].
struct Apart {
    process: Child,
    port: u16,
    key: String,
}

impl Apart {
    fn open(folder: &Path) -> Self {
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", "a_window_for_another_test", "--ignored", "--nocapture"]).env("STUDIO_FOLDER", folder);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut lines = BufReader::new(process.stdout.take().unwrap()).lines().map(Result::unwrap);
        let line = lines.find(|line| line.contains("http://")).unwrap();
        let (port, key) = parts(&line[line.find("http://").unwrap()..]);
        // All else that it writes is read and dropped, so that a full pipe does not stop it.
        std::thread::spawn(move || lines.for_each(drop));
        Self { process, port, key }
    }
}

impl Drop for Apart {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
#[ignore = "called by others in a process of its own"]
#[allow(clippy::print_stdout)] // the address is what they wait for
fn a_window_for_another_test() {
    let folder = std::env::var_os("STUDIO_FOLDER").unwrap().into();
    let studio = Studio::open(Options { folder, port: 0, program: "/bin/false".into(), facts: json!({}) }).unwrap();
    println!("{}", studio.address());
    studio.serve().unwrap();
}

#[test]
fn a_thousand_requests_at_once_are_each_answered() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.mod"), "").unwrap();
    let window = Apart::open(folder.path());
    // Each process may have 1024 files open, on most systems.
    let mut streams: Vec<TcpStream> = Vec::new();
    for _ in 0..960 {
        streams.push(TcpStream::connect(("127.0.0.1", window.port)).unwrap());
    }
    for stream in &mut streams {
        write!(
            stream,
            "GET /api/files HTTP/1.1\r\nhost: 127.0.0.1:{}\r\nx-deflex-key: {}\r\nconnection: close\r\n\r\n",
            window.port, window.key
        )
        .unwrap();
    }
    for stream in streams {
        stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        let answer = answer(stream);
        assert!(matches!(answer.status, 200 | 503), "{answer:?}");
    }
    let host = format!("127.0.0.1:{}", window.port);
    let after = raw(window.port, "GET /api/files", &[("host", &host), ("x-deflex-key", &window.key)], b"");
    assert!(after.body.contains("a.mod"));
    #[cfg(target_os = "linux")]
    {
        let status = fs::read_to_string(format!("/proc/{}/status", window.process.id())).unwrap();
        let resident = status.lines().find(|line| line.starts_with("VmRSS")).unwrap();
        let kib: u64 = resident.split_whitespace().nth(1).unwrap().parse().unwrap();
        assert!(kib < 50 << 10, "{resident}");
    }
}

#[test]
fn a_server_that_is_killed_in_the_middle_of_a_write_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cell.toml"), "old").unwrap();
    let mut window = Apart::open(folder.path());
    let mut stream = TcpStream::connect(("127.0.0.1", window.port)).unwrap();
    write!(stream, "PUT /api/file?name=cell.toml HTTP/1.1\r\nhost: 127.0.0.1:{}\r\nx-deflex-key: {}\r\nif-match: *\r\ncontent-length: 1000\r\n\r\nhalf", window.port, window.key).unwrap();
    let start = Instant::now();
    while names(folder.path()).len() < 2 {
        assert!(start.elapsed() < Duration::from_secs(10));
        std::thread::sleep(Duration::from_millis(10));
    }
    window.process.kill().unwrap();
    window.process.wait().unwrap();
    assert_eq!(fs::read_to_string(folder.path().join("cell.toml")).unwrap(), "old");
    // What it had begun goes with the next window that opens after an hour.
    let begun = names(folder.path()).into_iter().find(|name| name.starts_with('.')).unwrap();
    drop(Apart::open(folder.path()));
    assert!(names(folder.path()).contains(&begun), "another window may still write it");
    let old = std::time::SystemTime::now() - Duration::from_secs(4000);
    fs::File::options().write(true).open(folder.path().join(&begun)).unwrap().set_modified(old).unwrap();
    drop(Apart::open(folder.path()));
    assert_eq!(names(folder.path()), ["cell.toml"]);
}
