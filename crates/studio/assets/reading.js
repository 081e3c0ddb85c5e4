// How programs are read and what force acts: options that the runs of all views share.

import { check, h, labelled, select } from "./elements.js";

const start = () => ({ forces: "", tool: "", freeSpin: false, context: new Set() });

// The controls, with a call at each change. Programs that are chosen themselves are not offered as files that declare names.
export const readingControls = (app, { changed, chosen = () => [] } = {}) => {
  app.reading ??= start();
  const { reading } = app;
  const tables = app.names("table");
  const forces = tables.length === 0 ? "" : labelled("Forces from a table",
    select([["", "none: as the cell says"], ...tables.map((name) => [name, name])], tables.includes(reading.forces) ? reading.forces : "", (name) => { reading.forces = name; changed?.(); }));
  const tool = h("input", { type: "text", spellcheck: false, value: reading.tool, onchange: (event) => { reading.tool = event.target.value.trim(); changed?.(); } });
  const others = app.names("program").filter((name) => !chosen().includes(name));
  const isSet = reading.tool || reading.freeSpin || others.some((name) => reading.context.has(name));
  return [forces, h("details", { className: "more", open: Boolean(isSet) }, h("summary", {}, "How the program is read"),
    labelled("A tool of the cell for every target", tool, "Empty: the tools that the program names."),
    check("Choose the turn about the tool axis", reading.freeSpin, (is) => { reading.freeSpin = is; changed?.(); }, "for the least predicted error; RAPID"),
    others.length > 0 ? h("fieldset", {}, h("legend", {}, "Files that only declare tools, work objects and targets"), others.map((name) => check(name, reading.context.has(name), (is) => {
      if (is) reading.context.add(name);
      else reading.context.delete(name);
      changed?.();
    }))) : "")];
};

// What a run of these programs is given.
export const readingOf = (app, programs) => {
  const { forces, tool, freeSpin, context } = app.reading ?? start();
  const names = app.names("program");
  return {
    forces: app.names("table").includes(forces) ? forces : null,
    tool: tool || null,
    "free-spin": freeSpin,
    context: names.filter((name) => context.has(name) && !programs.includes(name)),
  };
};
