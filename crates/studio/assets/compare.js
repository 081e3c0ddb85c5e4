// Two programs, target by target; or one program under two cells.

import { button, h, labelled, messages, select, table } from "./elements.js";
import { frame, readJson, run, succeeded } from "./server.js";
import { difference, forcesControl, reading, report } from "./run.js";

export const title = "Compare";

export const show = (body, app) => {
  const [programs, cells] = [app.names("program"), app.names("cell")];
  const outcome = h("div", { className: "outcome" });
  const fail = (error) => outcome.replaceChildren(h("p", { className: "error", role: "alert" }, error.message));
  const needs = (words) => h("p", { className: "hint" }, words);
  body.replaceChildren(
    h("section", { className: "card" }, h("h2", {}, "Two programs"), programs.length > 1 ? two(programs, app, outcome, fail) : needs("Add a second program, or correct one.")),
    h("section", { className: "card" }, h("h2", {}, "One program under two cells"), cells.length > 1 && programs.length > 0 ? under(programs, cells, app, outcome, fail) : needs("Add a second cell, or extend one in the view Loop.")),
    outcome);
};

const two = (programs, app, outcome, fail) => {
  const corrected = programs.find((name) => name.includes(".corrected."));
  let after = corrected ?? programs[1];
  let before = programs.find((name) => name !== after && after.startsWith(name.replace(/\.[^.]*$/, ""))) ?? programs.find((name) => name !== after);
  const start = () => report(outcome, { command: "diff", original: before, corrected: after }, app, (_, figures) => (figures ? shifts(figures) : "")).catch(fail);
  return h("div", {}, h("div", { className: "fields" }, labelled("Before", select(programs, before, (name) => { before = name; })), labelled("After", select(programs, after, (name) => { after = name; }))),
    h("div", { className: "actions" }, button("Show what changed", start, { className: "main" })));
};

const shifts = ({ targets, moved, max_mm, max_deg, max_step_mm }) =>
  table("What changed", ["Targets", "Moved", "Largest shift, mm", "Largest turn, °", "Largest step, mm"], [[targets, moved.length, max_mm, max_deg, max_step_mm]]);

const FIGURES = [["max_error_mm", "Largest error, mm"], ["rms_error_mm", "Rms error, mm"], ["remaining_path_max_mm", "Largest on the path, mm"], ["remaining_path_rms_mm", "Rms on the path, mm"]];

const under = (programs, cells, app, outcome, fail) => {
  let program = app.chosen.program;
  const chosen = [cells[0], cells[1]];
  const start = async () => {
    try {
      outcome.replaceChildren(h("p", { role: "status" }, "Predicting under both cells …"));
      const done = [];
      // The results have names of their own, so that the second run does not replace those of the first.
      for (const [i, cell] of chosen.entries()) done.push(await run({ command: "predict", programs: [program], cell, results: ["cell-a", "cell-b"][i], reading: reading(app) }));
      const failed = done.find((job) => !succeeded(job));
      if (failed) return outcome.replaceChildren(h("section", { className: "card" }, h("p", { className: "verdict bad" }, "Could not be done: the two were not compared."), messages(failed.messages, (file, line) => app.goTo(file, line))));
      const [a, b] = (await Promise.all(done.map((job) => readJson(job.figures)))).map(({ files: [sums] }) => sums);
      const frames = await Promise.all(done.map((job) => frame(job.page)));
      outcome.replaceChildren(h("section", { className: "card" }, h("h2", {}, program), table("Figures under both cells", ["", chosen[0], chosen[1], "Change"],
        FIGURES.map(([key, label]) => [label, a[key], b[key], difference(a[key], b[key])]))),
        h("div", { className: "halves" }, frames.map((page, i) => h("section", {}, h("h2", {}, chosen[i]), page))));
    } catch (error) {
      fail(error);
    }
  };
  return h("div", {}, h("div", { className: "fields" }, labelled("Program", select(programs, program, (name) => { program = name; })),
    labelled("First cell", select(cells, chosen[0], (name) => { chosen[0] = name; })), labelled("Second cell", select(cells, chosen[1], (name) => { chosen[1] = name; })), forcesControl(app)),
    h("div", { className: "actions" }, button("Show both", start, { className: "main" })));
};
