// The arm at a target, from the angles of its axes: modified Denavit-Hartenberg rows, mm, in work object axes.

const RAD = Math.PI / 180;

// 3 × 4 matrices, row by row.
const times = (a, b) => a.map((row) => [0, 1, 2, 3].map((k) => row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k] + (k === 3 ? row[3] : 0)));
const origin = (frame) => frame.map((row) => row[3]);

// Position, mm, and rotation vector, degrees.
const placed = ([x, y, z, rx, ry, rz]) => {
  const angle = Math.hypot(rx, ry, rz);
  const [a, b, c] = angle > 0 ? [rx / angle, ry / angle, rz / angle] : [0, 0, 1];
  const [s, k] = [Math.sin(angle * RAD), 1 - Math.cos(angle * RAD)];
  return [
    [1 - k * (b * b + c * c), k * a * b - s * c, k * a * c + s * b, x],
    [k * a * b + s * c, 1 - k * (a * a + c * c), k * b * c - s * a, y],
    [k * a * c - s * b, k * b * c + s * a, 1 - k * (a * a + b * b), z],
  ];
};

// Rx(alpha) Tx(a) Rz(angle) Tz(d)
const link = (alpha, a, d, angle) => {
  const [sa, ca, s, c] = [Math.sin(alpha), Math.cos(alpha), Math.sin(angle), Math.cos(angle)];
  return [[c, -s, 0, a], [s * ca, c * ca, -sa, -d * sa], [s * sa, c * sa, ca, d * ca]];
};

// Joint angles, rad, from the angles that the controller counts, degrees.
const joints = (scene, axes) => {
  const motor = axes.map((angle) => angle * RAD);
  motor[2] -= scene.counted_23 * motor[1];
  const serial = motor.map((angle, i) => angle * scene.sign[i]);
  if (scene.parallelogram) serial[2] -= serial[1];
  return serial;
};

const AXES = [1, 2, 3, 4, 5, 6].map((axis) => `axis_${axis}_deg`);
const BASE = ["base_x_mm", "base_y_mm", "base_z_mm", "base_rx_deg", "base_ry_deg", "base_rz_deg"];
const CIRCLE = ["circle_x_mm", "circle_y_mm", "circle_z_mm"];
const TABLE = ["table_x_mm", "table_y_mm", "table_z_mm", "table_i", "table_j", "table_k"];

// Whether a path tells how the arm stands at a target.
const stands = (path, i) => page.scene && path.has(AXES[0]) && path.column(AXES[0]).has(i);

// Frames of base, links and flange at a target.
const chain = (path, i) => {
  const at = (key) => path.column(key).at(i);
  const frames = [placed(BASE.map(at))];
  const angles = joints(page.scene, AXES.map(at));
  page.scene.links.forEach(([alpha, a, d, theta], k) => frames.push(times(frames[k], link(alpha, a, d, theta + angles[k]))));
  return frames;
};

// What stands about the path at a target: lines of points, with a width in mm and a colour of the style sheet.
const standing = (path, i) => {
  const things = [];
  const edges = (lines, colour) => lines?.forEach((line) => things.push({ line, width: 0, colour }));
  edges(page.scene?.stock, "--muted");
  edges(page.scene?.part, "--nominal");
  if (i < 0 || !stands(path, i)) return things;
  const at = (key) => path.column(key).at(i);
  if (path.has(TABLE[0]) && path.column(TABLE[0]).has(i)) {
    const [x, y, z, ...axis] = TABLE.map(at);
    const across = Math.abs(axis[2]) < 0.9 ? [axis[1], -axis[0], 0] : [0, axis[2], -axis[1]];
    const size = Math.hypot(...across);
    const u = across.map((c) => c / size);
    const v = [axis[1] * u[2] - axis[2] * u[1], axis[2] * u[0] - axis[0] * u[2], axis[0] * u[1] - axis[1] * u[0]];
    const rim = Array.from({ length: 49 }, (_, n) => {
      const [c, s] = [Math.cos(n * Math.PI / 24), Math.sin(n * Math.PI / 24)].map((part) => 300 * part);
      return [x + c * u[0] + s * v[0], y + c * u[1] + s * v[1], z + c * u[2] + s * v[2]];
    });
    things.push({ line: rim, width: 0, colour: "--unit" });
  }
  const frames = chain(path, i);
  const base = frames[0];
  for (const { axis, direction, min, max } of page.scene.tracks) {
    const e = path.has(axis) ? at(axis) : NaN;
    if (Number.isNaN(e)) continue;
    const end = (limit, way) => {
      const by = (limit ?? e + way) - e;
      return base.map((row) => row[3] + by * (row[0] * direction[0] + row[1] * direction[1] + row[2] * direction[2]));
    };
    things.push({ line: [end(min, -1000), end(max, 1000)], width: 60, colour: "--unit" });
  }
  // From the base up: corners where a link's length and its offset meet.
  const spots = [origin(base)];
  page.scene.links.forEach(([alpha, a, d], k) => {
    const knee = times(frames[k], [[1, 0, 0, a], [0, 1, 0, 0], [0, 0, 1, 0]]);
    spots.push(k === 0 ? origin(frames[1]) : origin(knee), origin(frames[k + 1]));
  });
  const apart = (a, b) => Math.hypot(...a.map((c, k) => c - b[k])) > 1e-6;
  const arm = spots.filter((spot, k) => k === 0 || apart(spot, spots[k - 1]));
  const widths = (k) => Math.max(60, 150 - 110 * k / arm.length);
  for (let k = 1; k < arm.length; k++) things.push({ line: [arm[k - 1], arm[k]], width: widths(k), colour: "--arm", capsule: true });
  things.push({ line: [origin(frames[6]), ["x_mm", "y_mm", "z_mm"].map(at)], width: 24, colour: "--tool" });
  return things;
};
