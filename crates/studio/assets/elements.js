// Elements of the page. Text comes in as text, never as markup.

export const h = (tag, properties = {}, ...children) => {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name in element && name !== "list" && name !== "role") element[name] = value;
    else element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...children.flat(Infinity).filter((child) => child !== undefined && child !== null && child !== false));
  return element;
};

let ids = 0;
export const newId = (word) => `${word}-${++ids}`;

// A control with its label, and what is said about it.
export const labelled = (label, control, help) => {
  control.id ||= newId("control");
  const hint = help && h("p", { className: "hint", id: `${control.id}-hint` }, help);
  if (hint) control.setAttribute("aria-describedby", hint.id);
  return h("div", { className: "labelled" }, h("label", { htmlFor: control.id }, label), control, hint);
};

export const button = (text, onclick, properties = {}) => h("button", { type: "button", onclick, ...properties }, text);

export const select = (options, chosen, onchange, properties = {}) => {
  const pairs = options.map((option) => (Array.isArray(option) ? option : [option, option]));
  const element = h("select", { onchange: (event) => onchange?.(event.target.value), ...properties },
    pairs.map(([value, text]) => h("option", { value, selected: value === chosen }, text)));
  return element;
};

export const check = (label, checked, onchange, help) => {
  const box = h("input", { type: "checkbox", checked, id: newId("check"), onchange: (event) => onchange?.(event.target.checked) });
  return h("div", { className: "checked" }, box, h("label", { htmlFor: box.id }, label), help && h("span", { className: "hint" }, help));
};

// A table; numbers are marked as such for their alignment.
export const table = (caption, head, rows) =>
  h("div", { className: "scroll", tabIndex: 0, role: "region", "aria-label": caption },
    h("table", {}, h("caption", { className: "unseen" }, caption),
      h("thead", {}, h("tr", {}, head.map((cell) => h("th", { scope: "col" }, cell)))),
      h("tbody", {}, rows.map((row) => h("tr", {}, row.map((cell) => h("td", { className: typeof cell === "number" ? "number" : undefined }, shown(cell))))))));

const shown = (cell) => (typeof cell === "number" ? figure(cell) : (cell ?? ""));

// A figure with as many digits as mean something.
export const figure = (value) => {
  if (!Number.isFinite(value)) return "–";
  return Number.isInteger(value) ? String(value) : value.toFixed(Math.abs(value) < 100 ? 4 : 1);
};

export const bytes = (size) => (size < 1024 ? `${size} B` : size < 1 << 20 ? `${(size / 1024).toFixed(0)} KiB` : `${(size / (1 << 20)).toFixed(1)} MiB`);

// Whether the user confirms, in a dialog, that something is replaced.
export const confirmed = (question, yes, no = "Cancel") =>
  new Promise((answer) => {
    const dialog = h("dialog", { onclose: () => { dialog.remove(); answer(dialog.returnValue === "yes"); } },
      h("form", { method: "dialog" }, h("p", {}, question),
        h("div", { className: "actions" }, h("button", { value: "yes", className: "main" }, yes), h("button", { value: "no" }, no))));
    document.getElementById("dialogs").append(dialog);
    dialog.showModal();
  });

const SEVERITIES = { error: "Error", warning: "Warning", note: "Note" };

// The messages of a run, most severe first; `go` leads to the place.
export const messages = (all, go) => {
  const order = Object.keys(SEVERITIES);
  const listed = all.filter(({ severity }) => severity in SEVERITIES).toSorted((a, b) => order.indexOf(a.severity) - order.indexOf(b.severity));
  if (listed.length === 0) return "";
  return h("ul", { className: "messages" }, listed.map((message) => {
    const { severity, file, line, column, message: text, help } = message;
    const place = file ? (line ? `${file}, line ${line}` : file) : "";
    const lead = place && (go && line ? button(place, () => go(file, line, column), { className: "link" }) : h("span", { className: "place" }, place));
    return h("li", { className: severity }, h("p", {}, h("strong", {}, SEVERITIES[severity]), " ", lead, place ? ": " : "", text), help && h("p", { className: "hint" }, help));
  }));
};
