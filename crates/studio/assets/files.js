// The folder: what is in it, and how files get there.

import { confirmed, button, bytes, h } from "./elements.js";
import { frame, write } from "./server.js";

export const title = "Files";

const KINDS = {
  program: "Programs",
  cell: "Cells",
  table: "Measured tables",
  page: "Pages of results",
  other: "Other files",
};

const ending = (name) => (name.includes(".") ? name.split(".").at(-1).toLowerCase() : "");

// Columns of the tables that deflex writes; measured tables have none of them.
const WRITTEN = ["remaining_mm", "shift_mm", "deviation_mm", "whitened"];

// What a file is, by its ending and its beginning.
export const kindOf = ({ name, head }, facts) => {
  const end = ending(name);
  if (end === "toml") return /^\s*\[robot/m.test(head) || /cell/i.test(head) ? "cell" : "other";
  if (end === "csv") return WRITTEN.some((column) => head.split("\n")[0].includes(column)) ? "other" : "table";
  if (end === "html") return "page";
  if (["json", "stl", "urdf", "xml", "cfg"].includes(end)) return "other";
  return (facts.languages ?? []).some(({ endings }) => endings.includes(end)) ? "program" : "other";
};

// Files of a drop, with those of folders.
const dropped = async (transfer) => {
  const found = [];
  const walk = async (entry) => {
    if (entry.isFile) {
      const file = await new Promise((done, failed) => entry.file(done, failed));
      found.push([entry.fullPath.replace(/^\//, ""), file]);
      return;
    }
    const reader = entry.createReader();
    for (let part; (part = await new Promise((done, failed) => reader.readEntries(done, failed))).length > 0; ) {
      for (const inner of part) await walk(inner);
    }
  };
  for (const entry of [...transfer.items].map((item) => item.webkitGetAsEntry()).filter(Boolean)) await walk(entry);
  return found;
};

// Puts files into the folder. The user must confirm before a file is replaced. Failures are shown in `faults`.
const add = async (pairs, faults) => {
  const wrong = [];
  for (const [name, file] of pairs) {
    // Hidden files of a folder are none that a run reads.
    if (name.split("/").some((part) => part.startsWith("."))) continue;
    try {
      await write(name, file, "new");
    } catch (error) {
      if (error.status !== 412) wrong.push(error.message);
      else if (await confirmed(`${name} is in the folder already.`, "Replace it", "Keep the old one")) await write(name, file, "any");
    }
  }
  faults.replaceChildren(...wrong.map((message) => h("p", { className: "error" }, message)));
};

// A place to drop files on, with buttons that do the same.
export const place = (words, done) => {
  const faults = h("div", { role: "alert" });
  const take = async (pairs) => {
    await add(await pairs, faults);
    if (!faults.hasChildNodes()) await done();
  };
  const inputs = [
    ["Add files…", h("input", { type: "file", multiple: true, className: "unseen", tabIndex: -1, "aria-label": "Files to add" })],
    ["Add a folder…", h("input", { type: "file", webkitdirectory: true, className: "unseen", tabIndex: -1, "aria-label": "Folder to add" })],
  ];
  for (const [, input] of inputs) {
    input.addEventListener("change", () => take([...input.files].map((file) => [file.webkitRelativePath || file.name, file])));
  }
  const box = h("div", { className: "drop" }, h("p", {}, words),
    h("div", { className: "actions" }, inputs.map(([text, input]) => [button(text, () => input.click()), input])), faults);
  box.addEventListener("dragover", (event) => { event.preventDefault(); box.classList.add("over"); });
  box.addEventListener("dragleave", () => box.classList.remove("over"));
  box.addEventListener("drop", (event) => {
    event.preventDefault();
    box.classList.remove("over");
    take(dropped(event.dataTransfer));
  });
  return box;
};

const ACTIONS = {
  program: ["Look at it", "program", "program"],
  cell: ["Open", "cell", "cell"],
  table: ["Find the cause", "table", "loop"],
};

export const show = async (body, app) => {
  const page = h("div", { className: "pages" });
  const open = async (name) => {
    page.replaceChildren(h("h2", {}, name), await frame(name));
    page.scrollIntoView({ block: "start" });
  };
  const row = ({ name, size, modified_s, kind }) => {
    const [text, slot, view] = ACTIONS[kind] ?? [];
    const act = kind === "page" ? button("Show", () => open(name), { "aria-label": `Show ${name}` })
      : view && button(text, () => { app.chosen[slot] = name; app.go(view); }, { "aria-label": `${text}: ${name}` });
    return h("tr", {}, h("th", { scope: "row" }, name), h("td", { className: "number" }, bytes(size)),
      h("td", {}, new Date(1000 * modified_s).toLocaleString()), h("td", {}, act));
  };
  const section = ([kind, heading]) => {
    const own = app.files.filter((file) => file.kind === kind);
    if (own.length === 0) return "";
    return h("section", { className: "card" }, h("h2", {}, `${heading} (${own.length})`),
      h("div", { className: "scroll" }, h("table", { className: "files" }, h("thead", { className: "unseen" },
        h("tr", {}, ["Name", "Size", "Changed", "Action"].map((text) => h("th", { scope: "col" }, text)))), h("tbody", {}, own.map(row)))));
  };
  body.replaceChildren(
    place("Drop programs, cells, measured tables, a URDF or the folder of a controller backup here. They are copied into this folder and stay on this machine.", () => app.go("files")),
    app.files.length === 0 ? h("p", { className: "hint" }, "The folder is empty. Begin with a cell: choose your robot in the view Cell.") : "",
    app.leftOut > 0 ? h("p", { className: "hint" }, `${app.leftOut} more files or folders have names that the window does not take, are too deep, or are links.`) : "",
    ...Object.entries(KINDS).map(section), page);
};
