//! The files of the page: plain modules and styles, without a build step.

/// A file of the page: its address, its media type and its content.
pub(crate) const ALL: [(&str, &str, &str); 14] = [
    ("/", "text/html; charset=utf-8", include_str!("../assets/index.html")),
    ("/studio.css", "text/css; charset=utf-8", include_str!("../assets/studio.css")),
    ("/studio.js", SCRIPT, include_str!("../assets/studio.js")),
    ("/server.js", SCRIPT, include_str!("../assets/server.js")),
    ("/elements.js", SCRIPT, include_str!("../assets/elements.js")),
    ("/files.js", SCRIPT, include_str!("../assets/files.js")),
    ("/cell.js", SCRIPT, include_str!("../assets/cell.js")),
    ("/program.js", SCRIPT, include_str!("../assets/program.js")),
    ("/reading.js", SCRIPT, include_str!("../assets/reading.js")),
    ("/robot.js", SCRIPT, include_str!("../assets/robot.js")),
    ("/run.js", SCRIPT, include_str!("../assets/run.js")),
    ("/loop.js", SCRIPT, include_str!("../assets/loop.js")),
    ("/compare.js", SCRIPT, include_str!("../assets/compare.js")),
    ("/record.js", SCRIPT, include_str!("../assets/record.js")),
];

const SCRIPT: &str = "text/javascript; charset=utf-8";
