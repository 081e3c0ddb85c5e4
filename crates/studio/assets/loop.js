// The loop: from a measured table to the effect that the cell lacks, and to what is to be measured next.

import { button, check, figure, h, labelled, select, table } from "./elements.js";
import { read } from "./server.js";
import { place } from "./files.js";
import { readingOf } from "./reading.js";
import { report } from "./run.js";

export const title = "Loop";

export const show = async (body, app) => {
  const outcome = h("div", { className: "outcome" });
  const planned = h("div", { className: "outcome" });
  const logged = h("div", { className: "outcome" });
  const cells = app.names("cell");
  if (cells.length === 0) {
    body.replaceChildren(h("p", {}, "The loop needs a cell. ", button("Make one", () => app.go("cell"), { className: "link" })));
    return;
  }
  const cell = labelled("Cell", select(cells, app.chosen.cell, (name) => { app.chosen.cell = name; app.go("loop"); }));
  const tables = app.names("table");
  const found = tables.length > 0 ? await identification(app, outcome) : h("p", { className: "hint" }, "There is no measured table yet: add one.");
  body.replaceChildren(h("div", { className: "bar" }, cell),
    h("section", { className: "card" }, h("h2", {}, "What was measured"), place("Drop a measured table (CSV) here.", () => app.go("loop")), found), outcome,
    h("section", { className: "card" }, h("h2", {}, "How the controller drives"), driven(app, logged)), logged,
    h("section", { className: "card" }, h("h2", {}, "What to measure next"), plan(app, planned)), planned);
};

// Controls for pairs of a program and a table; `pairs` is changed in place.
const pairControls = (app, pairs, legend, words) => {
  const root = h("fieldset");
  const [programs, tables] = [app.names("program"), app.names("table")];
  const draw = () => root.replaceChildren(h("legend", {}, legend), ...pairs.map((pair, i) => h("div", { className: "fields" },
    labelled(`${words.program} ${i + 1}`, select(programs, pair.program, (name) => { pair.program = name; })),
    labelled(`${words.table} ${i + 1}`, select(tables, pair.table, (name) => { pair.table = name; })),
    button("Remove", () => { pairs.splice(i, 1); draw(); }, { "aria-label": `Remove ${words.table.toLowerCase()} ${i + 1}` }))),
    button(words.add, () => { pairs.push({ program: app.chosen.program, table: tables.at(-1) }); draw(); }));
  draw();
  return root;
};

// The law of the path that a controller drives, from logs of its axes.
const driven = (app, outcome) => {
  if (app.names("table").length < 2 || app.names("program").length === 0) return h("p", { className: "hint" }, "Add two logs or more of the controller's axes (time_s, q1_deg … q6_deg), and the programs that ran.");
  const logs = [];
  const output = h("input", { type: "text", spellcheck: false, value: `${app.chosen.cell.replace(/\.toml$/, "")}.path.toml` });
  const start = async () => {
    const name = output.value.trim();
    try {
      await report(outcome, { command: "identify", cell: app.chosen.cell, output: name, logs }, app, (job) => (job.code === 0 ? h("div", {},
        h("pre", {}, job.stdout), h("div", { className: "actions" }, button("Use this cell", () => { app.chosen.cell = name; app.go("cell"); }, { className: "main" }))) : ""));
    } catch (error) {
      outcome.replaceChildren(h("p", { className: "error", role: "alert" }, error.message));
    }
  };
  return h("div", {}, h("p", { className: "hint" }, "From logs of its axes deflex finds how the controller leaves the programmed path. About every fourth log is held out."),
    pairControls(app, logs, "Logs", { program: "Program that ran", table: "Log", add: "Add a log" }),
    h("div", { className: "fields" }, labelled("Name of the cell with the law", output)),
    h("div", { className: "actions" }, button("Find the law of the path", start, { className: "main" })));
};

// How a table parts its columns: by what its first line has most of.
const parted = (head) => {
  const count = (separator) => head.split(separator).length;
  return [";", "\t", ","].toSorted((a, b) => count(b) - count(a))[0];
};

const identification = async (app, outcome) => {
  const root = h("div");
  const tables = app.names("table");
  const programs = app.names("program");
  const known = app.facts.columns ?? [];
  const further = [];
  const options = { match: "", tool: "" };
  const typed = (label, key, help) => labelled(label, h("input", { type: "text", spellcheck: false, value: options[key], oninput: (event) => { options[key] = event.target.value; } }), help);
  const open = async (name) => {
    app.chosen.table = name;
    const { text } = await read(name);
    const lines = text.split(/\r?\n/).filter(Boolean);
    const separator = parted(lines[0] ?? "");
    const split = (line = "") => line.split(separator).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1"));
    const head = split(lines[0]);
    const unknown = head.filter((column) => !known.includes(column));
    const free = known.filter((column) => !head.includes(column));
    const renamed = new Map();
    const carriesPosture = head.includes("q1_deg");
    let program = app.chosen.program;
    let sparse = false;
    const stem = app.chosen.cell.replace(/\.toml$/, "");
    const output = h("input", { type: "text", spellcheck: false, value: `${stem}.identified.toml` });
    const start = async () => {
      const columns = [...head.filter((column) => known.includes(column)).map((column) => `${column}=${column}`), ...[...renamed].map(([column, as]) => `${as}=${column}`)];
      const what = {
        command: "identify", cell: app.chosen.cell, output: output.value.trim(), sparse,
        runs: carriesPosture ? [] : [{ program, table: name }, ...further], poses: carriesPosture ? [name] : [],
        "match-mm": options.match.trim().replace(",", ".") || undefined, tool: options.tool.trim() || undefined,
        context: carriesPosture ? [] : readingOf(app, [program, ...further.map((run) => run.program)]).context,
        columns: unknown.length > 0 ? columns.join(",") : undefined,
      };
      try {
        await report(outcome, what, app, (_, figures) => (figures ? answer(figures, output.value.trim(), app) : ""));
      } catch (error) {
        outcome.replaceChildren(h("p", { className: "error", role: "alert" }, error.message));
      }
    };
    body.replaceChildren(
      h("p", {}, `Rows: ${lines.length - 1}. `, carriesPosture ? "Each row carries its own motor angles: no program is needed." : ""),
      table("The first rows of the table", head, lines.slice(1, 6).map(split)),
      h("h3", {}, "Columns"),
      h("p", {}, "Recognised: ", head.filter((column) => known.includes(column)).join(", ") || "none"),
      unknown.length > 0 ? h("div", { className: "fields" }, unknown.map((column) => labelled(`“${column}” is`, select([["", "not used"], ...free.map((as) => [as, as])], "", (as) => {
        if (as) renamed.set(column, as);
        else renamed.delete(column);
      })))) : "",
      h("div", { className: "fields" },
        carriesPosture ? "" : programs.length > 0 ? labelled("Program that was measured", select(programs, program, (value) => { program = app.chosen.program = value; })) : h("p", { className: "error" }, "Add the program that was measured."),
        labelled("Name of the extended cell", output),
        check("Write only the effects that are named outright", sparse, (is) => { sparse = is; })),
      h("details", { className: "more" }, h("summary", {}, "More options"),
        carriesPosture || programs.length === 0 ? "" : pairControls(app, further, "Further runs that were measured", { program: "Program", table: "Table", add: "Add a run" }),
        h("div", { className: "fields" },
          typed("Tool of the cell with which the rows were measured", "tool", "Empty: as the program says."),
          typed("How far from the path a row may lie, mm", "match", "For rows with nominal coordinates and no target. Empty: 5 mm."))),
      h("div", { className: "actions" }, button("Find the cause", start, { className: "main", disabled: !carriesPosture && programs.length === 0 })));
  };
  const body = h("div");
  root.append(labelled("Measured table", select(tables, app.chosen.table, open)), body);
  await open(app.chosen.table);
  return root;
};

// What was found, in words and figures.
const answer = (figures, output, app) => {
  const { before, after, added, advice, unexplained, rows, held_out_rows, noise_mm, effects } = figures;
  const words = added.length > 0 ? `Found: ${added.map(({ kind, posterior }) => `${kind.replaceAll("_", " ")} (${(100 * posterior).toFixed(0)} %)`).join(", ")}.` : "No effect is named outright.";
  return h("div", {},
    h("h3", {}, words),
    table("Error on rows that no fit has seen", ["Error on rows that no fit has seen", "rms, mm", "mean, mm", "largest, mm"],
      [["before", before.rms_mm, before.mean_mm, before.max_mm], ["after", after.rms_mm, after.mean_mm, after.max_mm]]),
    h("p", { className: "hint" }, `Rows: ${rows}, held out: ${held_out_rows}; noise ${figure(noise_mm)} mm per axis; effects in the model: ${effects?.length ?? 0}.`),
    unexplained?.significant ? h("p", { className: "warning" }, "A part of the error stays unexplained: the page shows what it depends on.") : "",
    advice?.length > 0 ? h("details", {}, h("summary", {}, "What to measure next"), h("ul", {}, advice.map((text) => h("li", {}, text)))) : "",
    h("div", { className: "actions" }, button("Use this cell", () => { app.chosen.cell = output; app.go("cell"); }, { className: "main" }),
      button("Correct the program with it", () => { app.chosen.cell = output; app.command = "compensate"; app.go("run"); })));
};

const plan = (app, outcome) => {
  const rows = h("input", { type: "text", inputMode: "numeric", value: "24" });
  const output = h("input", { type: "text", spellcheck: false, value: "plan.mod" });
  const after = app.files.filter(({ name }) => name.endsWith(".identify.json")).map(({ name }) => name);
  let settled = "";
  const pool = new Set();
  let [post, ask] = ["", ""];
  const start = async () => {
    try {
      const what = { command: "plan", cell: app.chosen.cell, rows: Number(rows.value) || 0, output: output.value.trim(), after: settled || undefined, pool: [...pool], post: post || undefined, ask: ask || undefined, context: readingOf(app, [...pool]).context };
      await report(outcome, what, app, (job) => (job.code === 0 ? h("p", {}, `Run ${job.writes[0]} on the robot, fill in ${job.writes[1]}, and drop it above.`) : ""));
    } catch (error) {
      outcome.replaceChildren(h("p", { className: "error", role: "alert" }, error.message));
    }
  };
  return h("div", {}, h("p", { className: "hint" }, "The cell's section [plan] says where the tool may go, which loads can be applied and which instrument measures. It can be added in the view Cell."),
    h("div", { className: "fields" }, labelled("Rows to measure (8 to 500)", rows), labelled("Name of the measuring program", output),
      after.length > 0 ? labelled("Settle what an identification left open", select([["", "no"], ...after.map((name) => [name, name])], "", (name) => { settled = name; })) : ""),
    h("details", { className: "more" }, h("summary", {}, "More options"),
      h("div", { className: "fields" },
        labelled("Language of the program", select([["", "that of the cell's controller"], ...(app.facts.languages ?? []).map(({ word }) => [word, word])], post, (word) => { post = word; })),
        labelled("Stop for the operator", select([["", "never: the arm waits ten seconds at each target"], ["load", "at each change of the load"], ["target", "at each target too"]], ask, (word) => { ask = word; }))),
      app.names("program").length > 0 ? h("fieldset", {}, h("legend", {}, "Programs whose targets are the places to choose from, instead of the box of [plan]"), app.names("program").map((name) => check(name, pool.has(name), (is) => {
        if (is) pool.add(name);
        else pool.delete(name);
      }))) : ""),
    h("div", { className: "actions" }, button("Plan the measurement", start, { className: "main" })));
};
