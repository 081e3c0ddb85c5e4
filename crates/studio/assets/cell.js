// A cell: made from a robot, a backup or a description; a form and its text, edited in both directions; what deflex says of it.

import { confirmed, button, check, figure, h, labelled, messages, select } from "./elements.js";
import { post, read, readJson, run, succeeded, write } from "./server.js";
import { readingControls, readingOf } from "./reading.js";
import { armPicture } from "./robot.js";

export const title = "Cell";

// Units at the end of a key, the longest first.
const UNITS = [
  ["_nm_per_rad", "N·m/rad"], ["_rad_per_nm", "rad/(N·m)"], ["_n_per_mm", "N/mm"], ["_mm_per_n", "mm/N"], ["_mm_per_k", "mm/K"], ["_n_mm2", "N/mm²"],
  ["_n_mm", "N/mm"], ["_mm_s2", "mm/s²"], ["_mm_s", "mm/s"], ["_deg_s", "°/s"], ["_mm", "mm"], ["_deg", "°"], ["_rad", "rad"], ["_kg", "kg"], ["_rpm", "1/min"],
  ["_n", "N"], ["_s", "s"], ["_c", "°C"],
];

// What a key is called, and its unit.
const named = (key) => {
  const [end, unit] = UNITS.find(([end]) => key.endsWith(end)) ?? ["", ""];
  const words = key.slice(0, key.length - end.length).replaceAll("_", " ");
  return { label: words[0].toUpperCase() + words.slice(1), unit };
};

const PARTS = { 3: ["x", "y", "z"], 4: ["q1", "q2", "q3", "q4"], 6: ["1", "2", "3", "4", "5", "6"] };

export const show = async (body, app) => {
  const cells = app.names("cell");
  const editor = h("div", { className: "editor" });
  const leave = { now: () => {} };
  const open = async (name) => {
    leave.now();
    app.chosen.cell = name;
    leave.now = await edit(editor, name, app);
  };
  const making = h("details", { className: "card", open: cells.length === 0 }, h("summary", {}, "Make a new cell"), maker(app));
  body.replaceChildren(
    cells.length > 0 ? h("div", { className: "bar" }, labelled("Cell", select(cells, app.chosen.cell, open))) : "",
    making, editor);
  if (app.chosen.cell) await open(app.chosen.cell);
  return () => leave.now();
};

// A name that no file has yet.
const fresh = (app, stem) => {
  for (let i = 1; ; i++) {
    const name = `${stem}${i > 1 ? `-${i}` : ""}.toml`;
    if (!app.has(name)) return name;
  }
};

const maker = (app) => {
  const reports = h("div", { "aria-live": "polite" });
  const name = h("input", { type: "text", value: fresh(app, "cell"), spellcheck: false });
  const make = async (origin, tip) => {
    const output = name.value.trim();
    if (app.has(output) && !(await confirmed(`${output} is in the folder already.`, "Replace it"))) return;
    try {
      const job = await run({ command: "init", origin, output, tip });
      reports.replaceChildren(messages(job.messages));
      if (!succeeded(job)) return;
      app.chosen.cell = output;
      await app.refresh();
      app.chosen.cell = output;
      app.go("cell");
    } catch (error) {
      reports.replaceChildren(h("p", { className: "error" }, error.message));
    }
  };
  return h("div", {}, labelled("Name of the cell file", name), robots(app, make), sources(app, make), reports);
};

// Most robots that are shown at once.
const SHOWN = 40;

const robots = (app, make) => {
  const found = h("div");
  const wanted = { text: "", payload: 0, reach: 0 };
  const list = () => {
    const words = wanted.text.toLowerCase().split(/\s+/).filter(Boolean);
    const fits = (app.facts.robots ?? []).filter(({ model, maker, payload_kg, reach_mm }) =>
      words.every((word) => `${maker} ${model}`.toLowerCase().includes(word)) && payload_kg >= wanted.payload && reach_mm >= wanted.reach);
    found.replaceChildren(h("p", { className: "hint", role: "status" }, `Robots that fit: ${fits.length}${fits.length > SHOWN ? `, of which the first ${SHOWN} are shown` : ""}`),
      h("div", { className: "scroll short", tabIndex: 0, role: "region", "aria-label": "Robots" }, h("table", {},
        h("thead", {}, h("tr", {}, ["Arm at home, reach", "Robot", "Maker", "Payload, kg", "Reach, mm", "Choose"].map((text) => h("th", { scope: "col" }, text)))),
        h("tbody", {}, fits.slice(0, SHOWN).map((robot) => h("tr", {},
          h("td", {}, armPicture(robot)), h("th", { scope: "row", title: robot.source }, robot.model, robot.parallelogram ? h("p", { className: "hint" }, "parallelogram") : ""), h("td", {}, robot.maker), h("td", { className: "number" }, String(robot.payload_kg)), h("td", { className: "number" }, String(robot.reach_mm)),
          h("td", {}, button("Make the cell", () => make({ robot: robot.model }), { "aria-label": `Make the cell of ${robot.model}` }))))))));
  };
  const input = (label, slot, type) => {
    const control = h("input", { type: "text", inputMode: type, oninput: (event) => {
      wanted[slot] = slot === "text" ? event.target.value : Number(event.target.value.replace(",", ".")) || 0;
      list();
    } });
    return labelled(label, control);
  };
  list();
  return h("fieldset", {}, h("legend", {}, "From a robot of the library"),
    h("div", { className: "fields" }, input("Maker or model", "text", "text"), input("Payload at least, kg", "payload", "decimal"), input("Reach at least, mm", "reach", "decimal")), found);
};

// Backups and robot descriptions in the folder.
const sources = (app, make) => {
  const backups = app.files.map(({ name }) => name.match(/^(.*)\/SYSPAR\/MOC\.cfg$/i)?.[1]).filter(Boolean);
  const urdfs = app.files.filter(({ name, head }) => /\.urdf$/i.test(name) || (/\.xml$/i.test(name) && head.includes("<robot"))).map(({ name }) => name);
  const tip = h("input", { type: "text", spellcheck: false });
  return h("fieldset", {}, h("legend", {}, "From a controller's backup or a URDF"),
    backups.length + urdfs.length === 0 ? h("p", { className: "hint" }, "Add the folder of an ABB backup (with SYSPAR/MOC.cfg) or a URDF file in the view Files.") : "",
    urdfs.length > 0 ? h("div", { className: "fields" }, labelled("Last link of the URDF", tip, "Empty: tool0, flange, or the end of the only chain of six joints.")) : "",
    h("div", { className: "actions" },
      backups.map((folder) => button(`Backup ${folder}`, () => make({ backup: folder }))), urdfs.map((file) => button(`URDF ${file}`, () => make({ urdf: file }, tip.value.trim() || undefined)))));
};

// How long the text rests before the form follows, ms.
const REST = 300;

const edit = async (root, name, app) => {
  let { text, version } = await read(name);
  let saved = text;
  const undo = [];
  const form = h("div", { className: "form", "aria-label": "The cell as a form" });
  const area = h("textarea", { spellcheck: false, wrap: "off", id: "cell-text" });
  const state = h("span", { className: "hint", role: "status" });
  const said = h("div", { className: "said", "aria-live": "polite" });
  const watch = watcher(app, name);
  let diagnostics = [];

  const put = (changed, shown) => {
    text = changed;
    area.value = changed;
    draw(shown);
    tellState();
  };
  const tellState = () => {
    state.textContent = text === saved ? "Saved" : "Not saved";
    saveButton.disabled = text === saved;
    undoButton.disabled = undo.length === 0;
  };
  const fail = (error) => { said.replaceChildren(h("p", { className: "error", role: "alert" }, error.message)); };

  // Writes the text, and shows the messages of deflex about it.
  const save = async () => {
    try {
      const sent = text;
      state.textContent = "Saving …";
      version = await write(name, sent, version);
      saved = sent;
      state.textContent = "Saved, reading …";
      const [looked] = await Promise.all([run({ command: "pose", cell: name }), watch.again()]);
      diagnostics = looked.messages.filter(({ severity }) => severity !== "line");
      said.replaceChildren(messages(diagnostics, (_, line) => goTo(line)) || h("p", { className: "good" }, "deflex reads this cell without a message."));
      mark();
    } catch (error) {
      fail(error);
    }
    tellState();
  };
  // One after the other: each begins with the text that the one before left.
  let changes = Promise.resolve();
  const change = (edit) => {
    state.textContent = "Saving …";
    changes = changes.then(() => apply(edit));
  };
  const apply = async (edit) => {
    try {
      const { text: changed, form: shown } = await post("/api/cell/edit", { text, edit });
      undo.push(text);
      put(changed, shown);
      await save();
    } catch (error) {
      fail(error);
      draw(await post("/api/cell", { text }));
      tellState();
    }
  };
  const saveButton = button("Save", save, { className: "main" });
  const undoButton = button("Undo", async () => {
    state.textContent = "Saving …";
    const before = undo.pop();
    put(before, await post("/api/cell", { text: before }));
    await save();
  });

  // The line of the text, and the field of that line.
  const goTo = (line) => {
    const start = text.split("\n").slice(0, line - 1).reduce((at, row) => at + row.length + 1, 0);
    area.focus();
    area.setSelectionRange(start, text.indexOf("\n", start) < 0 ? text.length : text.indexOf("\n", start));
    const height = parseFloat(getComputedStyle(area).lineHeight);
    area.scrollTop = Math.max(0, (line - 4) * height);
    reveal(fieldAt(line));
    fieldAt(line)?.scrollIntoView({ block: "nearest" });
  };
  const fieldAt = (line) => [...form.querySelectorAll("[data-first]")].find(({ dataset }) => +dataset.first <= line && line <= +dataset.last);
  // Where the field of a line is hidden, so is what is said of it.
  const reveal = (field) => field?.closest("details")?.setAttribute("open", "");
  // Puts what deflex says at the field of its line.
  const mark = () => {
    for (const old of form.querySelectorAll(".at-field")) old.remove();
    for (const { severity, line, message, help, code } of diagnostics) {
      if (code === "cell.example") continue;
      reveal(fieldAt(line));
      fieldAt(line)?.append(h("p", { className: `at-field ${severity}` }, help ? `${message}: ${help}` : message));
    }
  };

  const draw = (shown) => {
    const focus = document.activeElement?.dataset?.path;
    const open = new Set([...form.querySelectorAll("details[open]")].map(({ dataset }) => dataset.title));
    const isFirst = !form.hasChildNodes();
    if (shown.wrong) {
      const { line, column, message } = shown.wrong;
      form.replaceChildren(h("p", { className: "error" }, button(`Line ${line}, column ${column}`, () => goTo(line), { className: "link" }), `: ${message}. The form comes back when the text is TOML again.`));
      return;
    }
    form.replaceChildren(...shown.sections.map((section, i) => drawn(section, isFirst ? i < 3 || section.title.startsWith("cut") : open.has(section.title))),
      shown.offers.length > 0 ? h("fieldset", {}, h("legend", {}, "Sections that can be added"), h("ul", { className: "offers" },
        shown.offers.map(({ key, place, line, help }) => h("li", {}, button(`Add [${key}]`, () => change({ what: "take-section", place, line })), " ", help)))) : "");
    mark();
    if (focus) [...form.querySelectorAll("[data-path]")].find(({ dataset }) => dataset.path === focus)?.focus();
  };

  const drawn = (section, open) => {
    const { title, path, help, fields, offers } = section;
    const waiting = fields.filter(({ is_example }) => is_example).length;
    const isNamed = path.length === 2 && typeof path[1] === "string" && ["tools", "wobjs"].includes(path[0]);
    const isListed = typeof path.at(-1) === "number";
    return h("details", { open, "data-title": title, className: "section" },
      h("summary", {}, h("code", {}, `[${title}]`), waiting > 0 ? h("span", { className: "mark" }, `${waiting} to check`) : ""),
      h("div", { "data-first": section.line, "data-last": section.line }, help && h("p", { className: "hint" }, help)),
      fields.map((field) => drawnField(field)),
      offers.length > 0 ? h("p", { className: "offers" }, offers.map(({ key, place, line, help }) => button(`+ ${key}`, () => change({ what: "take", path, place, line }), { title: help }))) : "",
      path.length > 0 && title !== "robot" ? h("p", { className: "actions" },
        isNamed ? button("Copy under another name", () => copy(section)) : isListed ? button("Add another", () => change({ what: "copy", path, name: "" })) : "",
        button("Remove the section", async () => (await confirmed(`Remove [${title}]? Undo brings it back.`, "Remove it")) && change({ what: "remove", path }))) : "");
  };
  const copy = ({ path, title }) => {
    const input = h("input", { type: "text" });
    const dialog = h("dialog", { onclose: () => { dialog.remove(); if (dialog.returnValue === "yes") change({ what: "copy", path, name: input.value.trim() }); } },
      h("form", { method: "dialog" }, labelled(`Name of the copy of ${title}`, input), h("div", { className: "actions" }, h("button", { value: "yes", className: "main" }, "Copy"), h("button", { value: "no" }, "Cancel"))));
    document.getElementById("dialogs").append(dialog);
    dialog.showModal();
  };

  const drawnField = (field) => {
    const { key, path, kind, value, lines: [first, last], help, is_example, choices } = field;
    const { label, unit } = named(key);
    const words = unit ? `${label}, ${unit}` : label;
    const control = (at, shown, label) => {
      const where = JSON.stringify(at);
      const set = (typed) => typed !== shown && change({ what: "set", path: at, value: typed });
      const all = choicesOf(key, choices, app, field);
      if (typeof shown === "string" && kind === "text" && all.length > 1 && all.includes(shown)) return select(all, shown, set, { "aria-label": label, "data-path": where });
      return h("input", { type: "text", value: shown, inputMode: ["text", "other"].includes(kind) ? "text" : "decimal", spellcheck: false, "aria-label": label, "data-path": where, className: kind, onchange: (event) => set(event.target.value) });
    };
    const several = (values, path) => values.map((shown, i) => control([...path, i], shown, `${words}, ${PARTS[values.length]?.[i] ?? i + 1}`));
    let controls;
    if (kind === "flag") controls = check("yes", value, (is) => change({ what: "set", path, value: String(is) }));
    else if (kind === "numbers") controls = h("div", { className: "several" }, several(value, path));
    else if (kind === "rows") controls = value.map((row, i) => h("div", { className: "several" }, several(row, [...path, i])));
    else controls = control(path, value, words);
    return h("div", { className: "field", role: "group", "aria-label": words, "data-first": first, "data-last": last, "data-key": key },
      h("div", { className: "name" }, h("span", { title: key }, words),
        is_example ? button("Keep this example value", () => change({ what: "accept", path }), { className: "small" }) : "",
        h("button", { type: "button", className: "link small", title: "Leaves the key out: it becomes a comment", "aria-label": `leave out: ${key}`, onclick: () => change({ what: "omit", path }) }, "leave out")),
      controls, help && h("p", { className: "hint" }, help));
  };

  let rest;
  area.addEventListener("input", () => {
    clearTimeout(rest);
    rest = setTimeout(async () => {
      if (text === area.value) return;
      undo.push(text);
      text = area.value;
      draw(await post("/api/cell", { text }));
      tellState();
    }, REST);
  });
  const keys = (event) => {
    if ((event.ctrlKey || event.metaKey) && event.key === "s") {
      event.preventDefault();
      clearTimeout(rest);
      if (text !== area.value) undo.push(text);
      text = area.value;
      post("/api/cell", { text }).then(draw).then(save);
    }
  };
  addEventListener("keydown", keys);

  area.value = text;
  root.replaceChildren(
    h("div", { className: "bar" }, saveButton, undoButton, state),
    watch.box, said,
    h("div", { className: "halves" }, h("section", { className: "card" }, h("h2", {}, "Form"), form),
      h("section", { className: "card source" }, h("h2", {}, h("label", { htmlFor: "cell-text" }, `${name}, the text`)), area)));
  draw(await post("/api/cell", { text }));
  tellState();
  await save();
  if (app.line) goTo(app.line);
  app.line = 0;
  return () => removeEventListener("keydown", keys);
};

// What may stand in a text: what its comment lists, materials, and the names that the cell has.
const choicesOf = (key, choices, app) => (key === "material" ? app.facts.materials ?? [] : choices);

// Figures of a program under the cell, again after each change.
const FIGURES = [["max_error_mm", "Largest error, mm"], ["rms_error_mm", "Rms error, mm"], ["remaining_path_max_mm", "Largest on the path, mm"]];

const watcher = (app, cell) => {
  const programs = app.names("program");
  const tiles = h("div", { className: "tiles", role: "status" });
  let on = false;
  let last;
  const again = async () => {
    if (!on || !app.chosen.program) return;
    const job = await run({ command: "predict", programs: [app.chosen.program], cell, reading: readingOf(app, [app.chosen.program]) });
    if (!succeeded(job)) return tiles.replaceChildren(messages(job.messages, (file, line) => app.goTo(file, line)));
    const [sums] = (await readJson(job.figures)).files;
    tiles.replaceChildren(...FIGURES.map(([key, label]) => {
      const change = last ? sums[key] - last[key] : 0;
      return h("div", { className: "tile" }, h("p", { className: "label" }, label), h("p", { className: "figure", "data-figure": key }, figure(sums[key])),
        h("p", { className: "hint" }, last ? (change === 0 ? "as before" : `${change > 0 ? "+" : "−"}${figure(Math.abs(change))} since the change before`) : `${sums.targets} targets`));
    }), h("p", { className: "hint" }, `Predicted in ${job.seconds.toFixed(2)} s. `, button("See the path", () => app.go("program"), { className: "link" })));
    last = sums;
  };
  const box = programs.length === 0 ? h("p", { className: "hint" }, "Add a program, and its error is shown here after each change of the cell.")
    : h("section", { className: "card watch" }, h("h2", {}, "See the error move"),
      h("div", { className: "bar" }, labelled("Program", select(programs, app.chosen.program, (name) => { app.chosen.program = name; last = undefined; again(); })), readingControls(app, { changed: () => { last = undefined; again(); }, chosen: () => [app.chosen.program] }),
        check("Predict after each change", on, (is) => { on = is; again(); })), tiles);
  return { box, again };
};
