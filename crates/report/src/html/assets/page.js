// Shows the data of a page, and keeps its picture, charts and panel at the same target.

const page = JSON.parse(byId("data").textContent);

// The first colourings of the 3-D view: column, name and unit.
const COLOURS = [
  { key: "error_mm", label: "Predicted error", unit: "mm" },
  { key: "correction_mm", label: "Correction", unit: "mm" },
  { key: "remaining_mm", label: "Remaining error", unit: "mm" },
  { key: "remaining_path_mm", label: "Remaining on the path", unit: "mm" },
  { key: "shift_mm", label: "Shift", unit: "mm" },
  { key: "turn_deg", label: "Turn", unit: "°" },
  { key: "step_mm", label: "Step from the target before", unit: "mm" },
  { key: "stiffness_normal_n_per_mm", label: "Stiffness along the normal", unit: "N/mm" },
  { key: "stiffness_least_n_per_mm", label: "Least stiffness", unit: "N/mm" },
];

// Rows of the target panel: a label and the columns that it shows.
const triple = (before, after) => ["x", "y", "z"].map((axis) => `${before}${axis}${after}`);
const FIGURES = [
  ["Position, mm", triple("", "_mm")],
  ["Error, mm", triple("error_", "_mm")],
  ["size", ["error_mm"]],
  ["along the normal", ["error_normal_mm"]],
  ["of the part", ["error_part_mm"]],
  ["uncertainty per axis", ["sigma_mm"]],
  ["Error, °", triple("error_r", "_deg")],
  ["Correction, mm", triple("correction_", "_mm")],
  ["size", ["correction_mm"]],
  ["Correction, °", triple("correction_r", "_deg")],
  ["Remaining, mm", triple("remaining_", "_mm")],
  ["size", ["remaining_mm"]],
  ["Remaining on the path, mm", ["remaining_path_mm"]],
  ["Shift, mm", triple("shift_", "_mm")],
  ["size", ["shift_mm"]],
  ["Turn, °", ["turn_deg"]],
  ["Step, mm", ["step_mm"]],
  ["Axes 1 to 3, °", AXES.slice(0, 3)],
  ["Axes 4 to 6, °", AXES.slice(3)],
  ["Margin to a limit, °", ["limit_margin_deg"]],
  ["to a singular wrist", ["singular_margin_deg"]],
  ...["a", "b", "c", "d", "e", "f"].map((axis) => [`eax_${axis}, mm or °`, [`eax_${axis}`]]),
  ["Turn about the tool, °", ["spin_deg"]],
  ["Force, N", triple("f", "_n")],
  ["Load, N", ["load_n"]],
  ["Time, s", ["time_s"]],
  ["Stiffness, N/mm", []],
  ["along the normal", ["stiffness_normal_n_per_mm"]],
  ["softest direction", ["stiffness_least_n_per_mm"]],
  ["stiffest direction", ["stiffness_most_n_per_mm"]],
];

// Names of columns that are in no list above.
const AXIS_STYLES = AXES.map((_, i) => `axis${i + 1}`);
const WORDS = ["status", "name", "frames", "quote"];
const HIDDEN = [...BASE, ...TABLE, ...CIRCLE, "target", "line", ...WORDS];
const unitOf = (key) => ({ mm: "mm", deg: "°", n: "N", s: "s", "n/mm": "N/mm" })[key.endsWith("_n_per_mm") ? "n/mm" : key.split("_").at(-1)] ?? (key.startsWith("eax_") ? "mm or °" : "");
const NAMES = { limit_margin_deg: "Margin to an axis limit", singular_margin_deg: "Margin to a singular wrist", spin_deg: "Turn about the tool axis", sigma_mm: "Uncertainty per axis", error_part_mm: "Error of the part" };
const nameOf = (key) => {
  const words = key.replace(/_(mm|deg|n|s|n_per_mm)$/, "").replaceAll("_", " ");
  return NAMES[key] ?? words[0].toUpperCase() + words.slice(1);
};

// All columns of numbers by which a path can be coloured, those with a name of their own first.
const coloursOf = (path) => {
  const named = COLOURS.filter(({ key }) => path.has(key));
  const known = new Set([...HIDDEN, ...named.map(({ key }) => key)]);
  const others = Object.keys(path.columns).filter((key) => !known.has(key) && !path.column(key).isConstant());
  return [...named, ...others.map((key) => ({ key, label: nameOf(key), unit: unitOf(key) }))];
};

// Groups of colourings, by the first part of a column's name.
const GROUPS = [
  ["Error", /^(error|sigma|prefit)/],
  ["Correction", /^correction/],
  ["What remains", /^(remaining|postfit)/],
  ["Difference", /^(shift|turn|step)/],
  ["Force and stiffness", /^(f[xyz]_n|load|stiffness)/],
  ["Arm", /^(axis|limit|singular|eax|spin)/],
  ["Other", /./],
];
const optionsOf = (colours) => GROUPS.flatMap(([group, begins], at) => {
  const own = colours.filter(({ key }) => GROUPS.findIndex(([, other]) => other.test(key)) === at);
  const option = ({ key, label, unit }) => element("option", { value: key, textContent: unit ? `${label}, ${unit}` : label });
  return own.length ? [element("optgroup", { label: group }, ...own.map(option))] : [];
});

// Number of digits of a figure: a tenth of a micrometre, and about an arc second. The CSV report has all digits.
const DIGITS = { mm: 4, "°": 4, N: 1, "N/mm": 0 };
const rounded = (path, key, i) => {
  const column = path.column(key);
  const digits = Math.min(column.decimals, DIGITS[unitOf(key)] ?? column.decimals);
  return column.has(i) ? column.at(i).toFixed(digits).replace(/^-(0\.?0*)$/, "$1") : "";
};

const paths = page.paths.map((json) => new Path(json));

// The number of targets that the level of detail leaves out.
const detail = (path, things) =>
  path.kept === path.count
    ? `All ${grouped(path.count)} ${things} are shown.`
    : `${grouped(path.kept)} of ${grouped(path.count)} ${things} are shown: of every ${path.stride} in a row the first, and those with the largest sizes. ` +
      "The figures above and in the tables are of all of them; the CSV report lists each.";

// The colours of a view, from its smallest to its largest value.
const legend = (low, high) => {
  const stops = Array.from({ length: 12 }, (_, i) => ramp(i / 11));
  byId("ramp").style.background = `linear-gradient(to right, ${stops.join(",")})`;
  [byId("low").textContent, byId("high").textContent] = [low, high].map((value) => `${+value.toPrecision(4)}`);
};

// Places the tip next to a point of a canvas.
const tipAt = (canvas, x, y, text) => {
  const tip = byId("tip");
  tip.hidden = !text;
  canvas.style.cursor = text ? "pointer" : "grab";
  if (!text) return;
  tip.textContent = text;
  tip.style.left = `${canvas.offsetLeft + Math.max(0, Math.min(x + 14, canvas.clientWidth - tip.offsetWidth))}px`;
  tip.style.top = `${canvas.offsetTop + Math.max(0, y - tip.offsetHeight - 10)}px`;
};

const listenToButtons = (view, wholeArm) =>
  document.querySelectorAll("[data-view]").forEach((button) => {
    if (button.dataset.view === "arm" && !page.scene) return button.remove();
    button.addEventListener("click", () => {
      const { view: what } = button.dataset;
      if (what === "fit" || what === "arm") view.frame(what === "arm" ? wholeArm() : []);
      else view.look(what);
    });
  });

const numbers = (path, key) => path.column(key).numbers();

// Time between two updates of the figures while a program plays, ms: no faster than a person can read.
const BETWEEN_FIGURES = 250;
// Number of postures that must fit into a picture of the whole arm.
const POSTURES = 24;

class PathPage {
  constructor() {
    this.chain = chain;
    this.view = new View(byId("path"), {
      hover: (i, x, y) => this.hover(i, x, y),
      choose: (i) => this.choose(i),
      step: (by) => this.choose(Math.max(0, Math.min(this.path.length - 1, this.chosen + by))),
      look: () => this.twin.sendView(),
    });
    this.twin = new Twin({
      ranges: () => rangesOf(this.path, this.ownBox),
      own: () => this.look(),
      follow: (look) => this.follow(look),
      widen: () => this.widen(),
    });
    this.charts = new Charts(byId("plots"), (i) => this.choose(i));
    this.player = new Player(byId("player"), { move: (place) => this.move(place), rest: (i) => this.choose(i) });
    listenToButtons(this.view, () => this.wholeArm());
    for (const id of ["colour", "zero"]) byId(id).addEventListener("change", () => this.colour());
    byId("held").addEventListener("change", () => this.stand(this.chosen));
    const program = byId("program");
    if (program) {
      program.replaceChildren(...paths.map((path, i) => element("option", { value: i, textContent: path.title })));
      program.addEventListener("change", () => this.show(paths[program.value]));
    }
    addEventListener("message", ({ source, data }) => source === parent && this.chooseLine(data?.line));
    this.show(paths[0]);
  }

  // The first target of a line of the program, if the page has one.
  chooseLine(line) {
    const i = this.path.has("line") ? this.path.column("line").raw.indexOf(line) : -1;
    if (i >= 0) this.choose(i);
  }

  show(path) {
    this.player.stop();
    this.path = path;
    const before = byId("colour").value;
    const colours = coloursOf(path);
    this.colours = colours;
    byId("colour").replaceChildren(...optionsOf(colours));
    if (colours.some(({ key }) => key === before)) byId("colour").value = before;
    byId("detail").textContent = path.length ? detail(path, "targets") : "No target has a position to show.";
    if (!path.length) return;
    this.view.setPath(path);
    this.ownBox = this.view.pathBox;
    const found = new Set(path.findings);
    this.player.setPath(path);
    byId("held").parentNode.hidden = !path.has(TABLE[0]);
    this.view.found = Array.from(path.column("line").raw, (line, i) => (found.has(line) ? i : -1)).filter((i) => i >= 0);
    this.chosen = 0;
    this.widen();
    this.choose(this.worst());
    this.twin.open();
  }

  // The target with the largest value that is shown: of a check, the finding with the largest error at the target or on the path to it.
  // A plan begins at its first target.
  worst() {
    const { path, view: { found } } = this;
    if (page.kind === "plan") return 0;
    const keys = found.length ? ["error_mm", "remaining_path_mm"].filter((key) => path.has(key)) : [byId("colour").value];
    const columns = keys.map((key) => numbers(path, key));
    const size = (i) => Math.max(...columns.map((column) => column[i] || 0));
    return (found.length ? found : Array.from({ length: path.length }, (_, i) => i)).reduce((best, i) => (size(i) > size(best) ? i : best));
  }

  // The ranges of the picture and the charts cover both pages if there are two.
  widen() {
    this.view.pathBox = this.twin.box(this.ownBox);
    this.view.frame([]);
    this.colour();
    this.plot();
    this.charts.mark(this.chosen);
  }

  look() {
    const { azimuth, elevation, zoom, pan, box } = this.view;
    const [isFromZero, isHeld] = ["zero", "held"].map((id) => byId(id).checked);
    return { azimuth, elevation, zoom, pan, box, colour: byId("colour").value, isFromZero, isHeld, target: this.path.column("target").raw[this.chosen] };
  }

  follow({ colour, isFromZero, isHeld, target, azimuth, elevation, zoom, pan, box }) {
    [byId("zero").checked, byId("held").checked] = [Boolean(isFromZero), Boolean(isHeld)];
    if (this.colours.some(({ key }) => key === colour)) byId("colour").value = colour;
    this.colour();
    if (target !== this.look().target) this.choose(this.path.find(target));
    Object.assign(this.view, { azimuth, elevation, zoom, pan, box });
    this.stand(this.chosen);
  }

  colour() {
    const { key, label, unit } = this.colours.find((colour) => colour.key === byId("colour").value);
    const values = numbers(this.path, key);
    let [low, high] = this.twin.span(key, rangeOf(values, (i) => this.path.status(i) !== "air"), true);
    if (!(high >= low)) [low, high] = [0, 0];
    if (byId("zero").checked) low = 0;
    this.view.setColours(values, low, high);
    legend(low, high);
    const air = (this.view.air.length ? "; grey: no cutting force" : "") + (this.view.found.length ? "; triangles: findings" : "");
    byId("what").textContent = `${label}, ${unit}${page.kind === "diff" ? "" : air}`;
  }

  plot() {
    const { path } = this;
    const x = numbers(path, "target");
    const line = (label, key, style) => (path.has(key) ? [{ key, label, values: numbers(path, key), style }] : []);
    const panels = [];
    if (page.kind === "diff") {
      ["x", "y", "z"].forEach((axis, i) =>
        panels.push({ heading: i ? "" : "Shift along the path", title: axis.toUpperCase(), unit: "mm", digits: 4, series: line("shift", `shift_${axis}_mm`, "after") }));
      panels.push({ title: "Turn", unit: "°", digits: 4, series: line("turn", "turn_deg", "after") });
    } else {
      const corrected = path.has("remaining_x_mm");
      const heading = corrected ? "Error at the targets, before and after" : "Predicted error at the targets";
      const limit = page.tolerance_mm;
      if (limit) panels.push({ heading, title: "Size", unit: "mm", digits: 4, limit, series: [...line("at the target", "error_mm", "before"), ...line("on the path to it", "remaining_path_mm", "after")] });
      ["x", "y", "z"].forEach((axis, i) =>
        panels.push({
          heading: i || limit ? "" : heading,
          title: axis.toUpperCase(),
          unit: "mm",
          digits: 4,
          series: [...line(corrected ? "before" : "error", `error_${axis}_mm`, "before"), ...line("after", `remaining_${axis}_mm`, "after")],
        }));
      if (!corrected) panels.push({ title: "Normal", unit: "mm", digits: 4, series: line("error", "error_normal_mm", "before") });
      if (path.has("stiffness_normal_n_per_mm")) {
        const series = [
          ...line("along the normal", "stiffness_normal_n_per_mm", "normal"),
          ...line("softest direction", "stiffness_least_n_per_mm", "least"),
          ...line("stiffest direction", "stiffness_most_n_per_mm", "most"),
        ];
        panels.push({ heading: "Stiffness of the cell along the path", title: "Stiffness", unit: "N/mm", digits: 1, series });
      }
      if (page.scene && path.has(AXES[0])) {
        const series = AXES.flatMap((key, i) => line(`axis ${i + 1}`, key, AXIS_STYLES[i]));
        panels.push({ heading: "Axes along the path", title: "Axes", unit: "°", digits: 3, series });
        const margins = [...line("to an axis limit", "limit_margin_deg", "least"), ...line("to a singular wrist", "singular_margin_deg", "normal")];
        panels.push({ heading: "Margins along the path", title: "Margin", unit: "°", digits: 3, series: margins });
      }
    }
    if (this.twin.otherBox) {
      for (const panel of panels) panel.range = panel.series.map(({ key, values }) => this.twin.span(key, rangeOf(values))).reduce(wider, NONE);
    }
    this.charts.show(x, "target", panels.filter(({ series }) => series.length), false, this.twin.otherBox && this.twin.span("target", rangeOf(x)));
  }

  choose(i) {
    const { path } = this;
    if (!path.length) return;
    this.player.follow(i);
    this.stand(i);
    this.showFigures(i);
  }

  // The figures of a target, its place in the charts, and its line for a window that shows this page in a frame.
  showFigures(i) {
    const { path } = this;
    this.chosen = i;
    this.charts.mark(i);
    this.twin.sendView();
    if (parent !== window && path.has("line")) parent.postMessage({ line: path.column("line").raw[i] }, "*");
    const name = path.name(i) ? ` ${path.name(i)}` : "";
    byId("chosen").textContent = `Target ${path.column("target").raw[i]}${name}`;
    const rows = [element("tr", {}, element("th", { textContent: "Line" }), this.cell(["line"], i)),
      element("tr", {}, element("th", { textContent: "Status" }), element("td", { colSpan: 3, textContent: path.status(i) }))];
    if (path.frames(i)) rows.push(element("tr", {}, element("th", { textContent: "Tool, work object" }), element("td", { colSpan: 3, textContent: path.frames(i) })));
    if (path.quote(i)) {
      const quote = element("code", { textContent: path.quote(i) });
      rows.splice(1, 0, element("tr", { className: "quote" }, element("td", { colSpan: 4 }, quote)));
    }
    rows.push(element("tr", { className: "part" }, ...["", "X", "Y", "Z"].map((axis) => element("th", { className: axis && "number", textContent: axis }))));
    for (const [label, keys] of FIGURES) {
      const shown = keys.filter((key) => path.has(key) && path.column(key).has(i));
      const heading = !keys.length && path.has("stiffness_normal_n_per_mm");
      if (!shown.length && !heading) continue;
      const part = /^[a-z]/.test(label);
      const cells = shown.length === 3 ? shown.map((key) => this.cell([key], i, 1)) : shown.length ? [this.cell(shown, i)] : [];
      rows.push(element("tr", { className: part ? "part" : "" }, element("th", { textContent: label }), ...cells));
    }
    byId("figures").replaceChildren(element("table", {}, element("tbody", {}, ...rows)));
    byId("figures").dataset.target = path.column("target").raw[i];
  }

  // The picture at a place: the arm, and the floor held still if the part turns on a table.
  stand(place) {
    const { path, view } = this;
    view.chosen = followed(path, place);
    view.standing = standing(path, view.chosen, view.spot(view.chosen));
    view.moved = byId("held").checked ? null : this.moved(view.chosen);
    view.redraw();
  }

  // The motion of the floor in the axes of the part since the first target in the same axes.
  moved(place) {
    const { path } = this;
    const i = Math.floor(place);
    if (!isOnTable(path, i) || !stands(path, i)) return null;
    const first = Array.from({ length: i + 1 }, (_, k) => k).find((k) => stands(path, k) && path.frames(k) === path.frames(i));
    return times(floorAt(path, place), inverse(floorAt(path, first)));
  }

  // While the program plays, the picture is updated at once, figures and charts a few times a second.
  move(place) {
    this.stand(place);
    const i = Math.round(place);
    if (i === this.chosen || performance.now() < this.next) return;
    this.next = performance.now() + BETWEEN_FIGURES;
    this.showFigures(i);
  }

  // The surroundings of the path at places all along it.
  wholeArm() {
    const { path, view } = this;
    const last = path.length - 1;
    return Array.from({ length: POSTURES }, (_, k) => Math.round(k * last / (POSTURES - 1))).flatMap((i) => {
      const moved = view.moved && this.moved(i);
      const things = standing(path, i, view.spot(i));
      return moved ? things.map((thing) => ({ ...thing, line: thing.line.map((spot) => point(inverse(moved), spot)) })) : things;
    });
  }

  cell([key], i, span = 3) {
    const cell = element("td", { className: "number", colSpan: span, textContent: rounded(this.path, key, i), title: this.path.column(key).text(i) });
    cell.dataset.key = key;
    return cell;
  }

  hover(i, x, y) {
    if (i < 0) return tipAt(this.view.canvas, x, y, "");
    const { path } = this;
    const { key, label, unit } = this.colours.find((colour) => colour.key === byId("colour").value);
    const name = path.name(i) ? ` ${path.name(i)}` : "";
    const text = `target ${path.column("target").raw[i]}${name} · line ${path.column("line").raw[i]} · ${label.toLowerCase()} ${rounded(path, key, i)} ${unit}`;
    tipAt(this.view.canvas, x, y, text);
  }

  repaint() {
    const { chosen } = this;
    if (!this.path.length) return;
    this.colour();
    this.plot();
    this.charts.mark(chosen);
    this.view.resize();
  }
}

class ResidualPage {
  constructor() {
    this.path = paths[0];
    this.chosen = -1;
    this.charts = new Charts(byId("plots"), (i) => this.choose(this.wanted[i]));
    this.views = ["before", "after"].map((id) => new View(byId(id), {
      hover: (i, x, y) => tipAt(byId(id), x, y, i < 0 ? "" : this.words(i)),
      choose: (i) => this.choose(i),
      step: (by) => this.step(by),
    }));
    [this.views[0].twin, this.views[1].twin] = [this.views[1], this.views[0]];
    listenToButtons(this.views[0]);
    byId("detail").textContent = detail(this.path, "rows");
    byId("rows").addEventListener("change", () => this.show());
    byId("own").addEventListener("change", () => this.repaint());
    this.show();
  }

  show() {
    const { path } = this;
    const all = byId("rows").value === "all";
    const held = path.has("held_out") ? path.column("held_out").raw : [];
    const only = Array.from(held, (value) => all || value === 1);
    this.wanted = only.flatMap((wanted, i) => (wanted ? [i] : []));
    if (this.wanted.length) this.views.forEach((view) => view.setPath(path, only));
    this.repaint();
    const sizes = numbers(path, "prefit_mm");
    if (this.wanted.length) this.choose(this.wanted.reduce((best, i) => (sizes[i] > sizes[best] ? i : best)));
  }

  // One scale for both pictures shows what the extended cell removed; a scale for each shows what remains.
  repaint() {
    const { path, wanted } = this;
    const own = byId("own").checked;
    const sizes = ["prefit_mm", "postfit_mm"].map((key) => numbers(path, key));
    const most = sizes.map((size) => wanted.reduce((most, i) => Math.max(most, size[i] || 0), 0));
    const high = Math.max(...most);
    this.views.forEach((view, i) => {
      const [id, cell] = [["before-most", "declared"], ["after-most", "extended"]][i];
      byId(id).textContent = `${cell} cell, largest ${most[i].toFixed(4)} mm`;
      if (!wanted.length) return;
      view.setColours(sizes[i], 0, own ? most[i] : high);
      view.resize();
    });
    legend(0, high);
    if (own) byId("high").textContent = "largest of each";
    byId("what").textContent = "Size of the residual, mm; axes of the base";
    this.plot();
    if (this.chosen >= 0) this.charts.mark(wanted.indexOf(this.chosen));
  }

  plot() {
    const { path } = this;
    const pick = (key) => this.wanted.map((i) => path.column(key).at(i));
    const panel = (title, before, after, heading = "") => ({
      heading,
      title,
      unit: "mm",
      digits: 4,
      series: [{ label: "declared cell", values: pick(before), style: "before" }, { label: "extended cell", values: pick(after), style: "after" }],
    });
    const panels = [panel("Size", "prefit_mm", "postfit_mm", "Residuals before and after")];
    ["x", "y", "z"].filter((axis) => path.has(`prefit_${axis}_mm`)).forEach((axis) =>
      panels.push(panel(axis.toUpperCase(), `prefit_${axis}_mm`, `postfit_${axis}_mm`)));
    this.charts.show(pick("target"), "row", panels, true);
  }

  words(i) {
    const { path } = this;
    const text = (key) => path.column(key).text(i);
    const size = (key) => rounded(path, key, i);
    return `row ${text("target")} · line ${text("line")} · ${path.status(i)} · ${size("prefit_mm")} mm before, ${size("postfit_mm")} mm after`;
  }

  choose(i) {
    this.chosen = i;
    byId("chosen").textContent = this.words(i);
    byId("chosen").dataset.target = this.path.column("target").raw[i];
    this.views.forEach((view) => { view.chosen = i; });
    this.views[0].redraw();
    this.charts.mark(this.wanted.indexOf(i));
  }

  step(by) {
    const at = Math.max(0, this.wanted.indexOf(this.chosen));
    if (this.wanted.length) this.choose(this.wanted[Math.max(0, Math.min(this.wanted.length - 1, at + by))]);
  }
}

const shown = page.kind === "identify" ? new ResidualPage() : new PathPage();

// The pictures use the colours of the style sheet, and are painted again when these change.
const repaint = () => shown.repaint();
for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", repaint);

// For tests that drive the page from outside.
window.deflex = shown;
