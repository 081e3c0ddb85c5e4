// What was run, with the command lines that do the same.

import { button, h, messages } from "./elements.js";
import { frame, jobs, listen } from "./server.js";

export const title = "Record";

const STATES = { running: "runs", done: "done", cancelled: "cancelled", failed: "failed" };

// Runs that write files; looking at a program or a cell is none.
const written = () => [...jobs.values()].filter((job) => job.writes.length > 0).reverse();

const copied = async (text, said) => {
  try {
    await navigator.clipboard.writeText(text);
    said.textContent = "Copied.";
  } catch {
    said.textContent = "The browser does not permit copying: mark the text and copy it by hand.";
  }
};

export const show = (body, app) => {
  const page = h("div");
  const said = h("span", { className: "hint", role: "status" });
  const list = h("ol", { className: "record", reversed: true });
  const open = async (name) => {
    page.replaceChildren(h("h2", {}, name), await frame(name));
    page.scrollIntoView({ block: "start" });
  };
  const draw = () => {
    const all = written();
    list.start = all.length;
    list.replaceChildren(...all.map((job) => h("li", { className: "card" },
      h("p", { className: "bar" }, h("strong", {}, job.arguments[0]), h("span", { className: "hint" }, `${STATES[job.state]}${job.code ? `, exit code ${job.code}` : ""}, ${job.seconds.toFixed(2)} s`),
        button("Copy", () => copied(job.command_line, said), { "aria-label": `Copy the command line of ${job.arguments[0]}` }),
        job.page && job.state === "done" && job.code !== 2 ? button("Show the page", () => open(job.page)) : ""),
      h("pre", { className: "command", tabIndex: 0, role: "region", "aria-label": `Command line of ${job.arguments[0]}` }, job.command_line),
      h("details", {}, h("summary", {}, `Files: ${job.writes.length}, messages: ${job.messages.length}`), h("p", {}, job.writes.join(", ")), messages(job.messages, (file, line) => app.goTo(file, line))))));
    if (all.length === 0) list.replaceChildren(h("li", { className: "hint" }, "Nothing was run since the window was opened."));
  };
  body.replaceChildren(
    h("p", {}, "Each run is a run of the command line, in this folder: what you tried here can go into a script or into CI as it stands."),
    h("div", { className: "bar" }, button("Copy all, oldest first", () => copied(written().filter((job) => job.state === "done" && job.code !== 2).map((job) => job.command_line).reverse().join("\n"), said)), said),
    list, page);
  draw();
  return listen(draw);
};
