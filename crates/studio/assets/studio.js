// The window: what is chosen, which view is shown, and how its views are reached.

import { button, h } from "./elements.js";
import { cancel, enter, follow, get, jobs, listen } from "./server.js";
import * as files from "./files.js";
import * as cell from "./cell.js";
import * as program from "./program.js";
import * as run from "./run.js";
import * as loop from "./loop.js";
import * as compare from "./compare.js";
import * as record from "./record.js";

const VIEWS = { files, cell, program, run, loop, compare, record };
const byId = (id) => document.getElementById(id);

// What all views share.
const app = {
  facts: {},
  files: [],
  // What is chosen: names of files.
  chosen: { program: "", cell: "", table: "" },
  // A place in a program that another view leads to.
  line: 0,

  async refresh() {
    const listing = await get("/api/files");
    this.files = listing.files.map((file) => ({ ...file, kind: files.kindOf(file, this.facts) }));
    this.leftOut = listing.left_out;
    for (const kind of Object.keys(this.chosen)) {
      const names = this.names(kind);
      if (!names.includes(this.chosen[kind])) this.chosen[kind] = names[0] ?? "";
    }
  },
  names(...kinds) {
    return this.files.filter(({ kind }) => kinds.includes(kind)).map(({ name }) => name);
  },
  has(name) {
    return this.files.some((file) => file.name === name);
  },
  go(view) {
    if (location.hash === `#/${view}`) show();
    else location.hash = `#/${view}`;
  },
  // To a line of a file: a cell opens in its view, anything else as a program.
  goTo(file, line) {
    const kind = this.files.find(({ name }) => name === file)?.kind;
    if (!kind) return;
    this.line = line;
    this.chosen[kind === "cell" ? "cell" : "program"] = file;
    this.go(kind === "cell" ? "cell" : "program");
  },
};

let leave = () => {};
let shownView = "";

const show = async () => {
  const view = location.hash.slice(2) in VIEWS ? location.hash.slice(2) : "files";
  leave();
  leave = () => {};
  byId("views").replaceChildren(h("ul", {}, Object.entries(VIEWS).map(([name, { title }]) =>
    h("li", {}, h("a", { href: `#/${name}`, "aria-current": name === view ? "page" : null }, title)))));
  byId("views").querySelector("[aria-current]").scrollIntoView({ block: "nearest", inline: "nearest" });
  const heading = h("h1", { tabIndex: -1 }, VIEWS[view].title);
  const body = h("div", { className: `view ${view}` });
  document.title = `${VIEWS[view].title} · deflex studio`;
  byId("content").replaceChildren(heading, body);
  if (shownView !== view && shownView) heading.focus();
  shownView = view;
  try {
    await app.refresh();
    leave = (await VIEWS[view].show(body, app)) ?? leave;
  } catch (error) {
    body.replaceChildren(h("p", { className: "error", role: "alert" }, error.message));
  }
};

// Runs that go on, with their progress.
const status = () => {
  const going = [...jobs.values()].filter((job) => job.state === "running");
  byId("status").replaceChildren(...going.map((job) => {
    const percent = job.progress?.progress;
    const bar = h("progress", { max: 100, "aria-label": `Progress of ${job.arguments[0]}` });
    if (typeof percent === "number") bar.value = percent;
    return h("div", { className: "going" }, h("span", {}, job.arguments[0], " ", h("small", {}, job.progress?.message ?? "")), bar,
      button("Cancel", () => cancel(job.id), { "aria-label": `Cancel ${job.arguments[0]}` }));
  }));
};

const start = async () => {
  try {
    await enter();
    const { folder, program: facts } = await get("/api/facts");
    app.facts = facts;
    byId("folder").textContent = `${folder} · deflex ${facts.version ?? ""}`;
  } catch (error) {
    byId("content").replaceChildren(h("h1", {}, "The window does not open"), h("p", { className: "error", role: "alert" }, error.message));
    return;
  }
  listen(status);
  addEventListener("hashchange", show);
  // A file that is dropped where no place takes it would be opened instead of the window.
  for (const kind of ["dragover", "drop"]) addEventListener(kind, (event) => event.preventDefault());
  follow((error) => {
    document.body.classList.toggle("lost", Boolean(error));
    if (error) byId("status").replaceChildren(h("p", { className: "error" }, "The server does not answer: start deflex studio again."));
    else status();
  });
  // For the tests of the window.
  window.studio = { app, jobs };
  await show();
};

start();
