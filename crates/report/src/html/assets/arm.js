// The arm at a target, from the angles of its axes: modified Denavit-Hartenberg rows, mm, in work object axes.

const RAD = Math.PI / 180;

// 3 × 4 matrices, row by row.
const times = (a, b) => a.map((row) => [0, 1, 2, 3].map((k) => row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k] + (k === 3 ? row[3] : 0)));
const origin = (frame) => frame.map((row) => row[3]);

// A unit quaternion, scalar first, from a rotation vector in degrees.
const quaternion = (vector) => {
  const half = Math.hypot(...vector) * RAD / 2;
  const scale = half > 0 ? Math.sin(half) / half * RAD / 2 : 0;
  return [Math.cos(half), ...vector.map((part) => part * scale)];
};

// The rotation between two quaternions at a share of the shorter turn from one to the other.
const blend = (from, to, share) => {
  const side = from.reduce((sum, part, k) => sum + part * to[k], 0) < 0 ? -1 : 1;
  const mixed = from.map((part, k) => (1 - share) * part + share * side * to[k]);
  const size = Math.hypot(...mixed);
  return mixed.map((part) => part / size);
};

// A frame with an orientation and a position.
const placed = ([w, x, y, z], position) => [
  [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), position[0]],
  [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), position[1]],
  [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), position[2]],
];

// Converts a vector into the axes of a frame, and back.
const into = (frame, v) => [0, 1, 2].map((k) => frame.reduce((sum, row, i) => sum + row[k] * v[i], 0));
const outOf = (frame, v) => frame.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
const point = (frame, v) => outOf(frame, v).map((c, k) => c + frame[k][3]);
const inverse = (frame) => [0, 1, 2].map((k) => [frame[0][k], frame[1][k], frame[2][k], -dot(frame.map((row) => row[k]), origin(frame))]);
const minus = (a, b) => a.map((c, k) => c - b[k]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

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
const POSITION = ["x_mm", "y_mm", "z_mm"];
const CIRCLE = ["circle_x_mm", "circle_y_mm", "circle_z_mm"];
const TABLE = ["table_x_mm", "table_y_mm", "table_z_mm", "table_i", "table_j", "table_k"];

// Whether a path has the posture of the arm at a target.
const stands = (path, i) => page.scene && path.has(AXES[0]) && path.column(AXES[0]).has(i);

// The target before a place if the arm cannot be interpolated from there: one of the two targets has no posture, or
// they are in the axes of different work objects.
const followed = (path, place) => {
  const i = Math.floor(place);
  const isOneWay = i === place || stands(path, i) && stands(path, i + 1) && path.frames(i) === path.frames(i + 1);
  return isOneWay ? place : i;
};

const at = (path, keys, place) => keys.map((key) => path.column(key).between(place));
const isOnTable = (path, i) => path.has(TABLE[0]) && path.column(TABLE[0]).has(i);

// The frame of the arm's base. If the part turns on a table, the base turns about the axis of the table.
const baseAt = (path, place) => {
  const i = Math.floor(place);
  const ends = place === i ? [i] : [i, i + 1];
  const middles = ends.map((end) => (isOnTable(path, end) ? at(path, TABLE.slice(0, 3), end) : [0, 0, 0]));
  const turns = ends.map((end) => quaternion(at(path, BASE.slice(3), end)));
  const frames = ends.map((end, k) => placed(turns[k], at(path, BASE.slice(0, 3), end)));
  if (ends.length === 1) return frames[0];
  const share = place - i;
  const mix = ([a, b]) => a.map((c, k) => c + share * (b[k] - c));
  const seen = mix(frames.map((frame, k) => into(frame, minus(middles[k], origin(frame)))));
  const turned = placed(blend(...turns, share), [0, 0, 0]);
  return placed(blend(...turns, share), minus(mix(middles), outOf(turned, seen)));
};

// Frames of base, links and flange, from joint angles in rad.
const forward = (base, angles) => {
  const frames = [base];
  page.scene.links.forEach(([alpha, a, d, theta], k) => frames.push(times(frames[k], link(alpha, a, d, theta + angles[k]))));
  return frames;
};

// Frames of base, links and flange at a place. Between two targets the joint angles are interpolated, and then
// corrected so that the tip of the tool is at `tip`: a straight line of the tip is not a straight line in joint angles.
const chain = (path, place, tip) => {
  const base = baseAt(path, place);
  let angles = joints(page.scene, at(path, AXES, place));
  let frames = forward(base, angles);
  const i = Math.floor(place);
  if (i === place) return frames;
  const flange = chain(path, i)[6];
  const tool = into(flange, minus(at(path, POSITION, i), origin(flange)));
  // Newton's method with the smallest turn of the joints (Jᵀ(JJᵀ)⁻¹): about three steps to a hundredth of a millimetre.
  for (let step = 0; step < 8; step++) {
    const now = point(frames[6], tool);
    const off = minus(tip, now);
    if (Math.hypot(...off) < 0.01) break;
    const columns = frames.slice(1).map((frame) => cross(frame.map((row) => row[2]), minus(now, origin(frame))));
    // A square millimetre is added so that the matrix can be inverted for a stretched arm.
    const square = [0, 1, 2].map((r) => [0, 1, 2].map((c) => columns.reduce((sum, column) => sum + column[r] * column[c], r === c ? 1 : 0)));
    const [a, b, c] = square;
    const size = dot(a, cross(b, c));
    const weights = [cross(b, c), cross(c, a), cross(a, b)].map((row) => dot(row, off) / size);
    angles = angles.map((angle, k) => angle + dot(columns[k], weights));
    frames = forward(base, angles);
  }
  return frames;
};

// The frame that does not move with table and track: the base without the motion of the track, in the axes of the part.
const floorAt = (path, place) => {
  const base = baseAt(path, place);
  const moved = page.scene.tracks.reduce((sum, { axis, direction }) => {
    const by = path.has(axis) ? path.column(axis).between(place) : NaN;
    return Number.isNaN(by) ? sum : sum.map((c, k) => c + by * direction[k]);
  }, [0, 0, 0]);
  return times(base, [[1, 0, 0, -moved[0]], [0, 1, 0, -moved[1]], [0, 0, 1, -moved[2]]]);
};

// The surroundings of the path at a place: lines of points, each with a width in mm and a colour of the style sheet.
// `tip` is the position of the path there.
const standing = (path, place, tip) => {
  const things = [];
  const edges = (lines, colour) => lines?.forEach((line) => things.push({ line, width: 0, colour }));
  edges(page.scene?.stock, "--muted");
  edges(page.scene?.part, "--nominal");
  if (place < 0 || !stands(path, Math.floor(place))) return things;
  if (isOnTable(path, Math.floor(place))) {
    const [x, y, z, ...axis] = at(path, TABLE, place);
    const across = Math.abs(axis[2]) < 0.9 ? [axis[1], -axis[0], 0] : [0, axis[2], -axis[1]];
    const u = across.map((c) => c / Math.hypot(...across));
    const v = cross(axis, u);
    const rim = Array.from({ length: 49 }, (_, n) => {
      const [c, s] = [Math.cos(n * Math.PI / 24), Math.sin(n * Math.PI / 24)].map((part) => 300 * part);
      return [x, y, z].map((middle, k) => middle + c * u[k] + s * v[k]);
    });
    things.push({ line: rim, width: 0, colour: "--unit" });
  }
  const frames = chain(path, place, tip);
  const base = frames[0];
  for (const { axis, direction, min, max } of page.scene.tracks) {
    const e = path.has(axis) ? path.column(axis).between(place) : NaN;
    if (Number.isNaN(e)) continue;
    const end = (limit, way) => point(base, direction.map((c) => ((limit ?? e + way) - e) * c));
    things.push({ line: [end(min, -1000), end(max, 1000)], width: 60, colour: "--unit" });
  }
  // From the base upwards: the corners where the length of a link and its offset meet.
  const spots = [origin(base)];
  page.scene.links.forEach(([, a], k) => spots.push(k === 0 ? origin(frames[1]) : point(frames[k], [a, 0, 0]), origin(frames[k + 1])));
  const arm = spots.filter((spot, k) => k === 0 || Math.hypot(...minus(spot, spots[k - 1])) > 1e-6);
  const widths = (k) => Math.max(60, 150 - 110 * k / arm.length);
  for (let k = 1; k < arm.length; k++) things.push({ line: [arm[k - 1], arm[k]], width: widths(k), colour: "--arm", capsule: true });
  things.push({ line: [origin(frames[6]), tip], width: 24, colour: "--tool" });
  return things;
};
