// The toolpath in 3-D on a plain canvas: orthographic, z up, turned about the vertical.

// viridis (van der Walt and Smith), which works for colour-blind readers and in grey prints.
const VIRIDIS = ["#440154", "#482475", "#414487", "#355f8d", "#2a788e", "#21918c", "#22a884", "#44bf70", "#7ad151", "#bddf26", "#fde725"];

// Large values are dark on a light page and bright on a dark one. The end of the scale that would be hard to see is
// left out.
const ramp = (share) => {
  const dark = theme("--scheme") === "dark";
  const place = (dark ? 0.18 + 0.82 * share : 0.9 * (1 - share)) * (VIRIDIS.length - 1);
  const low = Math.min(Math.floor(place), VIRIDIS.length - 2);
  const channel = (hex, at) => parseInt(hex.slice(1 + 2 * at, 3 + 2 * at), 16);
  const mixed = [0, 1, 2].map((c) => channel(VIRIDIS[low], c) * (1 - place + low) + channel(VIRIDIS[low + 1], c) * (place - low));
  return `rgb(${mixed.map(Math.round).join(",")})`;
};

const SHADES = 32;
// Number of points that are drawn while the view turns; at rest all are drawn.
const MOST_MOVING = 4000;
// A point farther than this from the pointer is not selected, px.
const REACH = 14;

const VIEWS = { iso: [-55, 28], top: [-90, 90], front: [-90, 0], side: [0, 0] };

// The box of a picture: that of the targets that cut, and of the others that are near them. Otherwise a home position
// at the other end of the cell would make the part a dot.
const framed = (points, cuts) => {
  const all = Array.from(points[0], (_, i) => i);
  const range = (indices) => points.map((v) => indices.reduce(([low, high], i) => [Math.min(low, v[i]), Math.max(high, v[i])], [Infinity, -Infinity]));
  // If no target cuts, the middle eight tenths along each axis are used.
  const middle = () => points.map((v) => {
    const sorted = Array.from(v).sort((a, b) => a - b);
    const at = (share) => sorted[Math.round(share * (sorted.length - 1))];
    return [at(0.1), at(0.9)];
  });
  const cutting = all.filter(cuts);
  const core = cutting.length ? range(cutting) : middle();
  const room = Math.hypot(...core.map(([low, high]) => high - low));
  const near = (i) => points.every((v, axis) => v[i] >= core[axis][0] - room && v[i] <= core[axis][1] + room);
  const shown = room > 0 ? all.filter((i) => cuts(i) && cutting.length || near(i)) : all;
  return range(shown);
};

// Number of points of an arc: half a turn is off by 0.2 % of its radius.
const ON_ARC = 24;

// Points of the arcs of a path by the index of the target at the end: from the target before it through its circle
// point.
const bendsOf = (path, [x, y, z]) => {
  const bends = new Map();
  if (!path.has(CIRCLE[0])) return bends;
  const ordinal = path.column("target").raw;
  for (let i = 1; i < path.length; i++) {
    // Points that the level of detail left out cannot be drawn.
    if (!path.column(CIRCLE[0]).has(i) || ordinal[i] - ordinal[i - 1] !== 1) continue;
    const [from, to] = [i - 1, i].map((k) => [x[k], y[k], z[k]]);
    const arc = arcThrough(from, CIRCLE.map((key) => path.column(key).at(i)), to);
    if (arc) bends.set(i, arc);
  }
  return bends;
};

// Points on the circle from a through b to c; none if the three are on a line.
const arcThrough = (a, b, c) => {
  const [ab, ac] = [minus(b, a), minus(c, a)];
  const normal = cross(ab, ac);
  const size = dot(normal, normal);
  if (size < 1e-12 * dot(ab, ab) * dot(ac, ac)) return null;
  // The circumcentre of a triangle, relative to its corner a.
  const [u, v] = [cross(normal, ab), cross(ac, normal)];
  const centre = a.map((p, k) => p + (dot(ac, ac) * u[k] + dot(ab, ab) * v[k]) / (2 * size));
  const from = minus(a, centre);
  const axis = normal.map((n) => n / Math.sqrt(size));
  const across = cross(axis, from);
  const angle = (p) => {
    const out = minus(p, centre);
    return (Math.atan2(dot(out, across), dot(out, from)) + 2 * Math.PI) % (2 * Math.PI);
  };
  const at = (turn) => centre.map((p, k) => p + Math.cos(turn) * from[k] + Math.sin(turn) * across[k]);
  const whole = angle(c);
  return Array.from({ length: ON_ARC }, (_, n) => at((whole * (n + 1)) / ON_ARC));
};

class View {
  constructor(canvas, { hover, choose, step, look }) {
    this.canvas = canvas;
    this.on = { hover, choose, step, look };
    [this.azimuth, this.elevation] = VIEWS.iso;
    this.zoom = 1;
    this.pan = [0, 0];
    this.chosen = -1;
    this.listen();
    new ResizeObserver(() => this.resize()).observe(canvas);
  }

  // `only` draws the points that it marks, without a line.
  setPath(path, only = null) {
    this.only = only;
    this.path = path;
    this.points = POSITION.map((key) => path.column(key).numbers());
    this.pathBox = this.box = framed(this.points, (i) => path.status(i) === "ok");
    this.screen = new Float32Array(2 * path.length);
    this.bends = only ? new Map() : bendsOf(path, this.points);
    this.found = [];
    this.fit();
  }

  // Shades of the line: `values` over [low, high]; air has a colour of its own.
  setColours(values, low, high) {
    const { path } = this;
    this.shades = Array.from({ length: SHADES }, () => []);
    this.air = [];
    for (let i = this.only ? 0 : 1; i < path.length; i++) {
      if (this.only && !this.only[i]) continue;
      const share = (values[i] - low) / (high - low || 1);
      if (path.status(i) === "air" || !(share >= 0)) this.air.push(i);
      else this.shades[Math.min(Math.floor(share * SHADES), SHADES - 1)].push(i);
    }
    this.redraw();
  }

  resize() {
    const scale = window.devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    [this.canvas.width, this.canvas.height] = [Math.round(width * scale), Math.round(height * scale)];
    // Draws at once, because a printer does not wait for a frame.
    this.draw();
  }

  fit() {
    this.zoom = 1;
    this.pan = [0, 0];
    this.redraw();
  }

  look(name) {
    [this.azimuth, this.elevation] = VIEWS[name];
    this.fit();
  }

  // Screen axes in the frame that is held still.
  heldAxes() {
    const [a, e] = [this.azimuth, this.elevation].map((degrees) => (degrees * Math.PI) / 180);
    const right = [-Math.sin(a), Math.cos(a), 0];
    const up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
    return [right, up];
  }

  // Screen axes in the work object.
  axes() {
    const axes = this.heldAxes();
    return this.moved ? axes.map((axis) => outOf(this.moved, axis)) : axes;
  }

  // The middle of the picture in the work object.
  middle() {
    const middle = this.box.map(([low, high]) => (low + high) / 2);
    return this.moved ? point(this.moved, middle) : middle;
  }

  // The point of the drawn line at a place, interpolated between two targets; work object, mm.
  spot(place) {
    const i = Math.floor(place);
    const target = (k) => this.points.map((values) => values[k]);
    if (i === place) return target(i);
    const ways = [target(i), ...(this.bends.get(i + 1) ?? [target(i + 1)])];
    const along = (place - i) * (ways.length - 1);
    const k = Math.floor(along);
    return ways[k].map((c, axis) => c + (along - k) * (ways[k + 1][axis] - c));
  }

  // Pixels for each millimetre with which the whole box is visible.
  scale() {
    const size = this.heldAxes().map((axis) => axis.reduce((sum, c, i) => sum + Math.abs(c) * (this.box[i][1] - this.box[i][0]), 0));
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const room = 0.84;
    return room * this.zoom * Math.min(width / (size[0] || 1e-6), height / (size[1] || 1e-6), 1e6);
  }

  project() {
    const [right, up] = this.axes();
    const scale = this.scale();
    const middle = this.middle();
    const centre = [this.canvas.clientWidth / 2 + this.pan[0], this.canvas.clientHeight / 2 + this.pan[1]];
    const [x, y, z] = this.points;
    for (let i = 0; i < this.path.length; i++) {
      const [px, py, pz] = [x[i] - middle[0], y[i] - middle[1], z[i] - middle[2]];
      this.screen[2 * i] = centre[0] + scale * (px * right[0] + py * right[1] + pz * right[2]);
      this.screen[2 * i + 1] = centre[1] - scale * (px * up[0] + py * up[1] + pz * up[2]);
    }
    return scale;
  }

  // Draws on the next frame, once.
  redraw(moving = false) {
    this.schedule(moving);
    this.on.look?.();
    if (!this.twin) return;
    for (const key of ["azimuth", "elevation", "zoom", "pan"]) this.twin[key] = this[key];
    this.twin.schedule(moving);
  }

  schedule(moving) {
    if (moving) {
      clearTimeout(this.rest);
      this.rest = setTimeout(() => this.redraw(), 150);
    }
    this.moving = moving;
    if (!this.pending) this.pending = requestAnimationFrame(() => this.draw());
  }

  draw() {
    cancelAnimationFrame(this.pending);
    this.pending = 0;
    const { canvas, path } = this;
    if (!path || !this.shades || !canvas.width || !canvas.clientWidth) return;
    const context = canvas.getContext("2d");
    const density = canvas.width / canvas.clientWidth;
    context.setTransform(density, 0, 0, density, 0, 0);
    context.fillStyle = theme("--stage");
    context.fillRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    const scale = this.project();
    const skip = this.moving ? Math.max(1, Math.ceil(path.length / MOST_MOVING)) : 1;
    context.lineCap = "round";
    context.lineJoin = "round";
    const dots = path.length <= 400;
    this.drawStanding(context, scale);
    this.placeOf = this.placer(scale);
    this.stroke(context, this.air, skip, theme("--air"), 1, false);
    this.shades.forEach((list, i) => this.stroke(context, list, skip, ramp(i / (SHADES - 1)), 2.5, dots));
    this.drawFound(context);
    this.drawChosen(context);
    this.drawTriad(context);
    this.drawScale(context, scale);
    Object.assign(canvas.dataset, { azimuth: this.azimuth, elevation: this.elevation, zoom: this.zoom.toFixed(4) });
  }

  stroke(context, list, skip, colour, width, dots) {
    if (!list.length) return;
    const { screen } = this;
    if (this.only) return this.dots(context, list, skip, colour, 3.4);
    context.beginPath();
    for (const i of list) {
      if (i % skip && i !== this.path.length - 1) continue;
      const from = 2 * Math.max(0, i - (i % skip || skip));
      context.moveTo(screen[from], screen[from + 1]);
      const bend = skip === 1 ? this.bends.get(i) : undefined;
      if (bend) bend.forEach((point) => context.lineTo(...this.placeOf(point)));
      else context.lineTo(screen[2 * i], screen[2 * i + 1]);
    }
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
    if (dots) this.dots(context, list, 1, colour, 2.8);
  }

  dots(context, list, skip, colour, radius) {
    const { screen } = this;
    context.beginPath();
    for (const i of list) {
      if (i % skip) continue;
      context.moveTo(screen[2 * i], screen[2 * i + 1]);
      context.arc(screen[2 * i], screen[2 * i + 1], radius, 0, 2 * Math.PI);
    }
    context.fillStyle = colour;
    context.fill();
  }

  // The surroundings of the path. Drawing hidden lines first would need depths, so all lines are transparent.
  drawStanding(context, scale) {
    if (this.only || !this.standing) return;
    const place = this.placer(scale);
    for (const { line, width, colour, capsule } of this.standing) {
      // A tool ends at its tip.
      context.lineCap = capsule ? "round" : "butt";
      context.beginPath();
      line.forEach((point, k) => (k ? context.lineTo(...place(point)) : context.moveTo(...place(point))));
      context.strokeStyle = theme(colour);
      context.globalAlpha = capsule ? 0.45 : width ? 0.35 : 0.8;
      context.lineWidth = Math.max(1.25, width * scale);
      context.stroke();
      if (!capsule) continue;
      // The axis of the line, so that it is visible where lines cover one another.
      context.globalAlpha = 1;
      context.lineWidth = 1.25;
      context.stroke();
    }
    context.globalAlpha = 1;
    context.lineCap = "round";
  }

  // Screen positions of points in the work object.
  placer(scale) {
    const [right, up] = this.axes();
    const middle = this.middle();
    const along = (axis, point) => axis.reduce((sum, c, k) => sum + c * (point[k] - middle[k]), 0);
    const centre = [this.canvas.clientWidth / 2 + this.pan[0], this.canvas.clientHeight / 2 + this.pan[1]];
    return (point) => [centre[0] + scale * along(right, point), centre[1] - scale * along(up, point)];
  }

  // Draws the path and its surroundings.
  frame(things) {
    if (!this.pathBox) return this.fit();
    const points = things.flatMap(({ line }) => line);
    this.box = this.pathBox.map(([low, high], axis) =>
      points.reduce(([least, most], point) => [Math.min(least, point[axis]), Math.max(most, point[axis])], [low, high]));
    this.fit();
  }

  // A triangle over each target with a finding of `check`.
  drawFound(context) {
    if (!this.found?.length) return;
    context.beginPath();
    for (const i of this.found) {
      const [x, y] = this.place(i);
      context.moveTo(x, y - 5);
      context.lineTo(x - 5, y - 14);
      context.lineTo(x + 5, y - 14);
      context.closePath();
    }
    context.fillStyle = theme("--chosen");
    context.globalAlpha = 0.75;
    context.fill();
    context.globalAlpha = 1;
  }

  drawChosen(context) {
    if (this.chosen >= 0) drawRing(context, ...this.placeOf(this.spot(this.chosen)));
  }

  drawTriad(context) {
    const [right, up] = this.axes();
    drawTriad(context, this.canvas.clientHeight, right.map((x, k) => [x, -up[k]]));
  }

  // A scale bar of a round number of millimetres.
  drawScale(context, scale) {
    const most = 120 / scale;
    const power = 10 ** Math.floor(Math.log10(most));
    const length = power * [5, 2, 1].find((step) => step * power <= most);
    const [x, y] = [this.canvas.clientWidth - 20, this.canvas.clientHeight - 24];
    context.beginPath();
    context.moveTo(x - length * scale, y - 4);
    context.lineTo(x - length * scale, y);
    context.lineTo(x, y);
    context.lineTo(x, y - 4);
    context.strokeStyle = theme("--text");
    context.lineWidth = 1.5;
    context.stroke();
    context.fillStyle = theme("--text");
    context.font = `12px ${theme("--font")}`;
    context.textAlign = "right";
    context.textBaseline = "bottom";
    context.fillText(`${+length.toPrecision(1)} mm`, x, y - 6);
  }

  // The target under the pointer, −1 if there is none.
  near(x, y) {
    if (!this.path) return -1;
    let [best, nearest] = [REACH ** 2, -1];
    for (let i = 0; i < this.path.length; i++) {
      if (this.only && !this.only[i]) continue;
      const distance = (this.screen[2 * i] - x) ** 2 + (this.screen[2 * i + 1] - y) ** 2;
      if (distance < best) [best, nearest] = [distance, i];
    }
    return nearest;
  }

  place(i) {
    return [this.screen[2 * i], this.screen[2 * i + 1]];
  }

  turn(azimuth, elevation) {
    this.azimuth = ((((this.azimuth + azimuth + 180) % 360) + 360) % 360) - 180;
    this.elevation = Math.max(-90, Math.min(90, this.elevation + elevation));
    this.redraw(true);
  }

  move(x, y) {
    this.pan = [this.pan[0] + x, this.pan[1] + y];
    this.redraw(true);
  }

  // Zooms about a point of the canvas, which stays where it is.
  magnify(factor, x = this.canvas.clientWidth / 2, y = this.canvas.clientHeight / 2) {
    const zoom = Math.max(0.2, Math.min(2000, this.zoom * factor));
    const [cx, cy] = [this.canvas.clientWidth / 2, this.canvas.clientHeight / 2];
    const ratio = zoom / this.zoom;
    this.pan = [x - cx - ratio * (x - cx - this.pan[0]), y - cy - ratio * (y - cy - this.pan[1])];
    this.zoom = zoom;
    this.redraw(true);
  }

  listen() {
    const { canvas } = this;
    const fingers = new Map();
    let moved = 0;
    const place = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, place(event));
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const now = place(event);
      const before = fingers.get(event.pointerId);
      if (!before) {
        this.on.hover(this.near(...now), ...now);
        return;
      }
      const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
      moved += Math.abs(dx) + Math.abs(dy);
      fingers.set(event.pointerId, now);
      if (fingers.size === 2) {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
        this.magnify(apart(now) / apart(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
        this.move(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons & 6) this.move(dx, dy);
      else if (moved > 3) this.turn(-0.4 * dx, 0.4 * dy);
    });
    const lift = (event) => {
      const clicked = fingers.delete(event.pointerId) && moved <= 3 && event.type === "pointerup";
      if (!clicked) return;
      const i = this.near(...place(event));
      if (i >= 0) this.on.choose(i);
    };
    canvas.addEventListener("pointerup", lift);
    canvas.addEventListener("pointercancel", lift);
    canvas.addEventListener("pointerleave", () => this.on.hover(-1));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.magnify(Math.exp(-0.0015 * event.deltaY), ...place(event));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const sides = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
      const side = sides[event.key];
      if (side && event.shiftKey) this.move(20 * side[0], 20 * side[1]);
      else if (side) this.turn(-5 * side[0], 5 * side[1]);
      else if (event.key === "+" || event.key === "=") this.magnify(1.25);
      else if (event.key === "-") this.magnify(0.8);
      else if (event.key === "0" || event.key === "Home") this.fit();
      else if (event.key === ",") this.on.step(-1);
      else if (event.key === ".") this.on.step(1);
      else return;
      event.preventDefault();
    });
  }
}
