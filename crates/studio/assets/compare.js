// Two programs, target by target; or two programs or cells side by side on one scale.

import { button, check, h, labelled, messages, select, table } from "./elements.js";
import { frame, readJson, run, succeeded } from "./server.js";
import { readingControls, readingOf } from "./reading.js";
import { difference, report } from "./run.js";

export const title = "Compare";

export const show = (body, app) => {
  const [programs, cells] = [app.names("program"), app.names("cell")];
  const outcome = h("div", { className: "outcome" });
  const fail = (error) => outcome.replaceChildren(h("p", { className: "error", role: "alert" }, error.message));
  const needs = (words) => h("p", { className: "hint" }, words);
  const pairs = programs.length > 0 && cells.length > 0 && programs.length + cells.length > 2;
  body.replaceChildren(
    h("section", { className: "card" }, h("h2", {}, "What changed from one program to another"), programs.length > 1 ? changes(programs, app, outcome, fail) : needs("Add a second program, or correct one.")),
    h("section", { className: "card" }, h("h2", {}, "Two predictions side by side"), pairs ? sides(programs, cells, app, outcome, fail) : needs("Add a second program or a second cell, or extend a cell in the view Loop.")),
    outcome);
  addEventListener("message", pass);
  return () => removeEventListener("message", pass);
};

// Two pages side by side send each other their ranges and views. They read all that they receive as numbers.
const pass = ({ source, data }) => {
  const frames = [...document.querySelectorAll(".sides iframe.result")].map((frame) => frame.contentWindow);
  if (data?.twin && frames.includes(source)) frames.find((frame) => frame !== source)?.postMessage({ twin: data.twin }, "*");
};

// The corrected program of another one comes second, where there is one.
const correctionOf = (programs) => {
  const after = programs.find((name) => name.includes(".corrected.")) ?? programs[1] ?? programs[0];
  const before = programs.find((name) => name !== after && after.startsWith(name.replace(/\.[^.]*$/, ""))) ?? programs.find((name) => name !== after) ?? after;
  return [before, after];
};

const changes = (programs, app, outcome, fail) => {
  let [before, after] = correctionOf(programs);
  const start = () => report(outcome, { command: "diff", original: before, corrected: after }, app, (_, figures) => (figures ? shifts(figures) : "")).catch(fail);
  return h("div", {}, h("div", { className: "fields" }, labelled("Before", select(programs, before, (name) => { before = name; })), labelled("After", select(programs, after, (name) => { after = name; }))),
    h("div", { className: "actions" }, button("Show what changed", start, { className: "main" })));
};

const shifts = ({ targets, moved, max_mm, max_deg, max_step_mm }) =>
  table("What changed", ["Targets", "Moved", "Largest shift, mm", "Largest turn, °", "Largest step, mm"], [[targets, moved.length, max_mm, max_deg, max_step_mm]]);

const FIGURES = [["max_error_mm", "Largest error, mm"], ["rms_error_mm", "Rms error, mm"], ["remaining_path_max_mm", "Largest on the path, mm"], ["remaining_path_rms_mm", "Rms on the path, mm"]];

const sides = (programs, cells, app, outcome, fail) => {
  // With a second cell the question is what it changes, without one what a correction does.
  const chosen = cells.length > 1 ? [app.chosen.program, app.chosen.program] : correctionOf(programs);
  const under = [cells[0], cells[1] ?? cells[0]];
  let isCorrection = true;
  const start = async () => {
    try {
      outcome.replaceChildren(h("p", { role: "status" }, "Predicting both …"));
      const done = [];
      for (const [i, program] of chosen.entries()) {
        const against = i === 1 && isCorrection && program !== chosen[0] ? chosen[0] : undefined;
        // The results have names of their own, so that the second run does not replace those of the first.
        done.push(await run({ command: "predict", programs: [program], cell: under[i], against, results: ["side-a", "side-b"][i], reading: readingOf(app, [program]) }));
      }
      const failed = done.find((job) => !succeeded(job));
      if (failed) return outcome.replaceChildren(h("section", { className: "card" }, h("p", { className: "verdict bad" }, "Could not be done: the two were not compared."), messages(failed.messages, (file, line) => app.goTo(file, line))));
      const [a, b] = (await Promise.all(done.map((job) => readJson(job.figures)))).map(({ files: [sums] }) => sums);
      const frames = await Promise.all(done.map((job) => frame(job.page)));
      const names = chosen.map((program, i) => `${program}, ${under[i]}`);
      outcome.replaceChildren(h("section", { className: "card" }, table("Figures of both", ["", ...names, "Change"], FIGURES.map(([key, label]) => [label, a[key], b[key], difference(a[key], b[key])])),
        h("p", { className: "hint" }, "Both pictures have one view and one scale of colours, and their charts the same axes.")),
        h("div", { className: "halves sides" }, frames.map((page, i) => h("section", {}, h("h2", {}, names[i]), page))));
    } catch (error) {
      fail(error);
    }
  };
  const pick = (label, names, list, i) => labelled(label, select(names, list[i], (name) => { list[i] = name; }));
  return h("div", {}, h("div", { className: "fields" },
    pick("First program", programs, chosen, 0), pick("First cell", cells, under, 0), pick("Second program", programs, chosen, 1), pick("Second cell", cells, under, 1), readingControls(app)),
    check("A second program is a correction of the first: its errors count from the targets of the first", isCorrection, (is) => { isCorrection = is; }),
    h("div", { className: "actions" }, button("Show both", start, { className: "main" })));
};
