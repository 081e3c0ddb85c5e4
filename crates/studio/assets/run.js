// predict, compensate, check and simulate: their options, their progress, and what comes of them.

import { button, check, figure, h, labelled, messages, select, table } from "./elements.js";
import { readingControls, readingOf } from "./reading.js";
import { cancel, frame, listen, readJson, run, succeeded } from "./server.js";

export const title = "Run";

const WHAT = {
  predict: "Reports the errors of a program as it is, without a correction.",
  compensate: "Writes the corrected program, so that the loaded tool goes where the program says.",
  check: "A verdict: is each target within tolerance, and is it reached?",
  simulate: "Cuts the stock in the computer with the poses that the loaded arm takes: the part and its deviation, before you cut it.",
};

const ending = (name) => name.split(".").at(-1).toLowerCase();
const languageOf = (name, app) => (app.facts.languages ?? []).find(({ endings }) => endings.includes(ending(name)))?.word;
// The ending of a program in a language.
const endingOf = (word, app) => (app.facts.languages ?? []).find((language) => language.word === word)?.endings[0] ?? "mod";

export const show = (body, app) => {
  let programs = app.names("program");
  const cells = app.names("cell");
  if (programs.length === 0 || cells.length === 0) {
    body.replaceChildren(h("p", {}, "A run needs a program and a cell. ",
      programs.length === 0 ? button("Add a program", () => app.go("files"), { className: "link" }) : "", " ", cells.length === 0 ? button("Make a cell", () => app.go("cell"), { className: "link" }) : ""));
    return undefined;
  }
  const choice = { command: app.command ?? "predict", programs: new Set([app.chosen.program]), cell: app.chosen.cell };
  const options = {};
  const outcome = h("div", { className: "outcome" });
  const form = h("div", { className: "card" });

  const text = (label, key, help, properties = {}) => labelled(label, h("input", { type: "text", inputMode: "decimal", value: options[key] ?? "", oninput: (event) => { options[key] = event.target.value; }, ...properties }), help);
  const pick = (label, key, names, none, help) => labelled(label, select([["", none], ...names.map((name) => [name, name])], options[key] ?? "", (value) => { options[key] = value; draw(); }), help);
  const flag = (label, key, help) => check(label, options[key] ?? false, (is) => { options[key] = is; }, help);

  let isMoreOpen = false;
  const more = (...controls) => h("details", { className: "more", open: isMoreOpen, ontoggle: (event) => { isMoreOpen = event.target.open; } }, h("summary", {}, "More options"), controls);
  const chosenOf = () => programs.filter((name) => choice.programs.has(name));

  const draw = () => {
    const chosen = chosenOf();
    const isCl = chosen.some((name) => languageOf(name, app) === "cl");
    const several = chosen.length > 1 || chosen.some((name) => ending(name) === "src");
    const against = () => pick("The original, if this is a corrected program", "against", programs.filter((name) => !choice.programs.has(name)), "none: errors count from its own targets");
    const read = () => readingControls(app, { chosen: chosenOf });
    const own = {
      predict: () => [against(), read(), more(flag("Write the driven path as a table", "path", "needs [controller.path] in the cell; a place every 4 ms"))],
      compensate: () => [
        several ? labelled("Folder for the corrected programs", h("input", { type: "text", value: options.folder ?? "corrected", oninput: (event) => { options.folder = event.target.value; } }))
          : labelled("Name of the corrected program", h("input", { type: "text", spellcheck: false, value: options.output ?? proposed(chosen[0], app, options.post), oninput: (event) => { options.output = event.target.value; } })),
        isCl ? labelled("Language of the corrected program", select((app.facts.languages ?? []).map(({ word }) => word), options.post ?? "rapid", (value) => { options.post = value; delete options.output; draw(); })) : "",
        text("Insert targets until at most this error remains between them, mm", "subdivide", "Empty: no targets are inserted."),
        text("Keep the driven path within, mm", "maxPathError", "Needs [controller.path] in the cell. Empty: not bounded."),
        read(),
        more(flag("Correct the position alone", "position", "orientations stay as they are written"),
          flag("Correct a corrected program once more", "again"),
          flag("Declare copies of a target that several motions use with different corrections", "allowClones"),
          isCl ? [text("Split into modules of at most this many targets", "maxTargets", "Empty: one module."), text("Speed of rapid travel, mm/s", "rapidSpeed", "Empty: 200 mm/s."), text("Speed of moves without one, mm/s", "feed")] : ""),
      ],
      check: () => [
        text("Largest error of a target, mm", "maxError"), text("Largest error between targets, mm", "checkedPathError", "Empty: as that of a target."),
        text("Largest jump where the force sets in or ends, mm", "maxJump", "Empty: reported, not judged."),
        against(), read(), flag("Pass though some targets cannot be judged", "allowUnjudged"),
        more(flag("Judge only the targets, not the path between them", "atTargets"), text("Largest correction of a target, mm", "maxCorrection", "Empty: not judged.")),
      ],
      simulate: () => [against(), read(), pick("Nominal points whose deviation is reported", "probe", app.names("table"), "none"),
        h("p", { className: "hint" }, "The cell needs a section [stock], and a cutter for each tool that cuts it.")],
    }[choice.command];
    const tabs = h("div", { className: "tabs", role: "group", "aria-label": "Command" }, Object.keys(WHAT).map((command) =>
      button(command[0].toUpperCase() + command.slice(1), () => { choice.command = app.command = command; draw(); }, { "aria-pressed": String(command === choice.command) })));
    // A form that is drawn again keeps the focus where it was.
    const controls = () => [...form.querySelectorAll("input, select, button")];
    const focused = controls().indexOf(document.activeElement);
    form.replaceChildren(tabs, h("p", { className: "hint" }, WHAT[choice.command]),
      h("fieldset", {}, h("legend", {}, "Programs"), programs.map((name) => check(name, choice.programs.has(name), (is) => {
        if (is) choice.programs.add(name);
        else choice.programs.delete(name);
        if (is) app.chosen.program = name;
        delete options.output;
        draw();
      }))),
      h("div", { className: "fields" }, labelled("Cell", select(cells, choice.cell, (name) => { choice.cell = app.chosen.cell = name; })), own()),
      h("div", { className: "actions" }, button(`Run ${choice.command}`, start, { className: "main" })));
    controls()[focused]?.focus();
  };

  const what = () => {
    const chosen = chosenOf();
    const given = (key) => options[key]?.trim().replace(",", ".") || undefined;
    const base = { command: choice.command, programs: chosen, cell: choice.cell, reading: readingOf(app, chosen) };
    const against = programs.includes(options.against) && !choice.programs.has(options.against) ? options.against : undefined;
    if (choice.command === "predict") return { ...base, against, path: options.path ?? false };
    if (choice.command === "simulate") return { ...base, against, probe: options.probe || undefined };
    if (choice.command === "check") {
      // A limit for the paths between targets has no effect if only the targets are judged.
      const ways = options.atTargets ? { "at-targets": true } : { "max-path-error": given("checkedPathError"), "max-jump": given("maxJump") };
      return { ...base, against, "max-error": given("maxError") ?? "", ...ways, "max-correction": given("maxCorrection"), "allow-unjudged": options.allowUnjudged ?? false };
    }
    const several = chosen.length > 1 || chosen.some((name) => ending(name) === "src");
    const isCl = chosen.some((name) => languageOf(name, app) === "cl");
    const targets = Number(given("maxTargets"));
    const posting = isCl ? { language: options.post && options.post !== "rapid" ? options.post : undefined, "max-targets": targets || undefined, "rapid-speed": given("rapidSpeed"), feed: given("feed") } : undefined;
    return {
      ...base, position: options.position ?? false, again: options.again ?? false, "allow-clones": options.allowClones ?? false, subdivide: given("subdivide"), "max-path-error": given("maxPathError"), posting,
      output: several ? { folder: (options.folder ?? "corrected").trim() } : { file: (options.output ?? proposed(chosen[0], app, options.post)).trim() },
    };
  };

  const start = async () => {
    outcome.replaceChildren(h("p", { role: "status" }, "Starting …"));
    try {
      await report(outcome, what(), app);
      // A program that was written can be chosen from now on.
      programs = app.names("program");
      draw();
    } catch (error) {
      outcome.replaceChildren(h("p", { className: "error", role: "alert" }, error.message));
    }
  };
  body.replaceChildren(form, outcome);
  draw();
  return undefined;
};

const proposed = (name = "", app, post = "rapid") => {
  const stem = name.slice(0, name.length - ending(name).length - 1);
  return `${stem}.corrected.${languageOf(name, app) === "cl" ? endingOf(post, app) : ending(name)}`;
};

// Runs, and shows how it goes and what comes of it. Gives the run when it has ended.
export const report = async (root, what, app, more = () => "") => {
  let stop = () => {};
  const job = await run(what, (started) => {
    const bar = h("progress", { max: 100, "aria-label": "Progress" });
    const words = h("span", { role: "status" }, "Running");
    root.replaceChildren(h("section", { className: "card" }, h("div", { className: "bar" }, words, bar, button("Cancel", () => cancel(started.id)))));
    stop = listen((changed) => {
      if (changed.id !== started.id || !changed.progress) return;
      if (typeof changed.progress.progress === "number") bar.value = changed.progress.progress;
      words.textContent = `Running ${changed.progress.message}`;
    });
  });
  stop();
  await app.refresh();
  const figures = succeeded(job) && job.figures ? await readJson(job.figures) : undefined;
  root.replaceChildren(h("section", { className: "card", "data-outcome": outcomeOf(job, figures).kind },
    h("p", { className: `verdict ${outcomeOf(job, figures).kind}`, role: "status" }, outcomeOf(job, figures).words),
    h("p", { className: "hint" }, job.messages.filter(({ severity }) => severity === "line").map(({ message }) => message).join(" ")),
    messages([...job.messages, ...findingsOf(figures)], (file, line) => app.goTo(file, line)),
    figures ? sums(figures) : "", more(job, figures),
    h("p", { className: "hint" }, `The same in a shell: `, h("code", {}, job.command_line))));
  if (succeeded(job) && job.page) root.append(await frame(job.page));
  return job;
};

// Findings that are listed here; the page of the run has them all.
const MOST_FINDINGS = 50;

// The findings of a check, as messages.
export const findingsOf = (figures) =>
  (figures?.files ?? []).flatMap?.(({ findings = [] }) => findings).slice(0, MOST_FINDINGS).map((finding) => ({ severity: "error", ...finding })) ?? [];

const outcomeOf = (job, figures) => {
  if (job.state === "cancelled") return { kind: "bad", words: "Cancelled: nothing was written." };
  if (job.state === "failed") return { kind: "bad", words: "The run ended unexpectedly: nothing was written." };
  if (job.code === 2) return { kind: "bad", words: "Could not be done: nothing was written." };
  if (figures && "passed" in figures) return figures.passed ? { kind: "good", words: "Passed." } : { kind: "bad", words: "Not passed: the findings say where." };
  return { kind: "good", words: `Done in ${job.seconds.toFixed(2)} s. Written: ${job.writes.join(", ")}` };
};

// What the figures of a run are called.
const SUMS = [
  ["targets", "Targets"], ["max_error_mm", "Largest error, mm"], ["rms_error_mm", "Rms error, mm"], ["max_correction_mm", "Largest correction, mm"], ["max_remaining_mm", "Largest remaining, mm"],
  ["remaining_path_max_mm", "Largest on the path, mm"], ["rms_mm", "Rms, mm"], ["max_mm", "Largest, mm"], ["mean_mm", "Mean, mm"], ["gouge_mm", "Deepest gouge, mm"], ["leftover_mm", "Most left over, mm"],
];

// A table of the figures of a run, a row a program.
export const sums = ({ files }) => {
  if (!Array.isArray(files) || files.length === 0) return "";
  const columns = SUMS.filter(([key]) => files.some((file) => typeof file[key] === "number"));
  if (columns.length === 0) return "";
  return table("Figures", ["Program", ...columns.map(([, label]) => label)], files.map((file) => [file.path ?? "", ...columns.map(([key]) => (typeof file[key] === "number" ? file[key] : "–"))]));
};

export const difference = (a, b) => `${b - a > 0 ? "+" : "−"}${figure(Math.abs(b - a))}`;
