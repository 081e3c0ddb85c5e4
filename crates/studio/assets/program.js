// A program: what deflex understands of it, its text with lines, its path in 3-D, and findings that lead to their lines.

import { button, figure, h, labelled, messages, newId, select, table } from "./elements.js";
import { frame, jobs, read, readJson, run, succeeded } from "./server.js";
import { readingControls, readingOf } from "./reading.js";
import { findingsOf } from "./run.js";

export const title = "Program";

export const show = async (body, app) => {
  const programs = app.names("program");
  if (programs.length === 0) {
    body.replaceChildren(h("p", {}, "There is no program in the folder yet. ", button("Add one in Files", () => app.go("files"), { className: "link" })));
    return undefined;
  }
  const shown = h("div");
  const leave = { now: () => {} };
  const open = async (name) => {
    leave.now();
    app.chosen.program = name;
    shown.replaceChildren(h("p", { role: "status" }, "Reading the program …"));
    leave.now = await look(shown, name, app);
  };
  body.replaceChildren(h("div", { className: "bar" }, labelled("Program", select(programs, app.chosen.program, open))), shown);
  await open(app.chosen.program);
  return () => leave.now();
};

const look = async (root, name, app) => {
  const [{ text }, job] = await Promise.all([read(name), run({ command: "inspect", programs: [name] })]);
  const code = new Listing(text);
  const found = JSON.parse(job.stdout || "{\"files\":[]}").files[0];
  const go = (file, line) => (file === name ? code.goTo(line) : app.goTo(file, line));
  const path = h("div", { className: "path" });
  const findings = h("div", { "aria-live": "polite" });
  // What the last runs found in this program.
  const list = async () => {
    const last = [...jobs.values()].reverse().find((run) => run.run.programs?.includes(name) && ["predict", "check", "compensate"].includes(run.arguments[0]) && run.state !== "running");
    const figures = last?.arguments[0] === "check" && succeeded(last) ? await readJson(last.figures) : undefined;
    const all = [...(last?.messages ?? []).filter(({ severity }) => severity !== "line"), ...findingsOf(figures)];
    findings.replaceChildren(h("h2", {}, "Findings"), messages(all, go) || h("p", { className: "hint" }, last ? `The last run (${last.arguments[0]}) has none.` : "Predict the path to see what deflex finds."));
  };
  const cells = app.names("cell");
  const predict = async () => {
    path.replaceChildren(h("p", { role: "status" }, "Predicting …"));
    try {
      const done = await run({ command: "predict", programs: [name], cell: app.chosen.cell, reading: readingOf(app, [name]) });
      await list();
      path.replaceChildren(succeeded(done) ? await frame(done.page) : h("p", { className: "error" }, "The run could not be done: the findings say why."));
    } catch (error) {
      path.replaceChildren(h("p", { className: "error", role: "alert" }, error.message));
    }
  };
  // The page of a target that is chosen says so; nothing else is taken from it.
  const heard = ({ source, data }) => {
    if (source === path.querySelector("iframe")?.contentWindow && Number.isInteger(data?.line)) code.goTo(data.line);
  };
  addEventListener("message", heard);
  code.chosen = (line) => path.querySelector("iframe")?.contentWindow.postMessage({ line }, "*");

  root.replaceChildren(
    h("section", { className: "card" }, h("h2", {}, "What deflex understands"), summary(found, job, go)),
    h("div", { className: "halves" },
      h("section", { className: "card" }, h("h2", {}, "The text"), code.box, findings),
      h("section", { className: "card" }, h("h2", {}, "The path"),
        cells.length > 0 ? h("div", { className: "bar" }, labelled("Cell", select(cells, app.chosen.cell, (cell) => { app.chosen.cell = cell; })), readingControls(app, { chosen: () => [name] }), button("Predict and show the path", predict, { className: "main" }))
          : h("p", {}, "The path needs a cell. ", button("Make one", () => app.go("cell"), { className: "link" })), path)));
  await list();
  if (app.line) code.goTo(app.line);
  app.line = 0;
  return () => removeEventListener("message", heard);
};

const summary = (found, job, go) => {
  if (!found) return messages(job.messages, go) || h("p", { className: "error" }, "The program was not read.");
  const { language, dialect, motion_targets, arcs, refused, kept, round_trip, tools, wobjs, extents, feed_mm_s, run_time_s } = found;
  if (refused) return h("div", {}, h("p", { className: "error" }, refused), messages(job.messages, go));
  const facts = [
    ["Language", dialect && dialect !== language ? `${language}, ${dialect}` : language], ["Targets", motion_targets], ["Arcs", arcs],
    ["Tools", (tools ?? []).join(", ")], ["Work objects", (wobjs ?? []).join(", ")],
    ["Feeds, mm/s", feed_mm_s ? [...new Set(feed_mm_s)].join(" to ") : ""], ["Time without joint moves, s", run_time_s ? figure(run_time_s) : ""],
    ["Written again", round_trip ? "byte for byte the same" : "not the same: it cannot be corrected"],
  ];
  return h("div", {},
    h("dl", {}, facts.filter(([, value]) => value !== "" && value !== undefined).map(([name, value]) => [h("dt", {}, name), h("dd", {}, String(value))])),
    extents?.length > 0 ? table("Where the program goes", ["Work object", "x, mm", "y, mm", "z, mm"],
      extents.map(({ wobj, min_mm, max_mm }) => [wobj, ...min_mm.map((least, i) => `${figure(least)} to ${figure(max_mm[i])}`)])) : "",
    kept.length > 0 ? h("details", {}, h("summary", {}, `Statements that are kept as they are: ${kept.length}`),
      h("ul", {}, kept.slice(0, 200).map(({ line, reason }) => h("li", {}, button(`Line ${line}`, () => go(found.path, line), { className: "link" }), `: ${reason}`)))) : "");
};

// Height of a line of the listing, px; that of the style.
const LINE = 20;

// A text with line numbers, of which only the lines in sight are elements.
class Listing {
  constructor(text) {
    this.lines = text.split(/\r?\n/);
    this.at = 0;
    this.chosen = () => {};
    this.inner = h("div", { className: "lines" });
    this.inner.style.height = `${LINE * this.lines.length}px`;
    this.box = h("div", { className: "listing", tabIndex: 0, role: "region", "aria-label": "Text of the program", id: newId("listing"), onscroll: () => this.draw(), onkeydown: (event) => this.key(event) }, this.inner);
    new ResizeObserver(() => this.draw()).observe(this.box);
  }

  draw() {
    const first = Math.max(0, Math.floor(this.box.scrollTop / LINE) - 10);
    const last = Math.min(this.lines.length, first + Math.ceil(this.box.clientHeight / LINE) + 20);
    const row = (i) => {
      const line = h("div", { className: i + 1 === this.at ? "line at" : "line", onclick: () => { this.goTo(i + 1); this.chosen(i + 1); } }, h("span", { className: "number" }, String(i + 1)), h("code", {}, this.lines[i].slice(0, 2000)));
      line.style.top = `${LINE * i}px`;
      return line;
    };
    this.inner.replaceChildren(...Array.from({ length: Math.max(0, last - first) }, (_, i) => row(first + i)));
  }

  key(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step || !this.at) return;
    event.preventDefault();
    this.goTo(this.at + step);
    this.chosen(this.at);
  }

  goTo(line) {
    this.at = Math.max(1, Math.min(this.lines.length, line));
    const top = LINE * (this.at - 1);
    if (top < this.box.scrollTop || top > this.box.scrollTop + this.box.clientHeight - 2 * LINE) this.box.scrollTop = Math.max(0, top - this.box.clientHeight / 3);
    this.draw();
  }
}
