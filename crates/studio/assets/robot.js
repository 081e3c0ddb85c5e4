// The picture of an arm's kinematics: its links at home, seen from the side, with its reach.

const NAMESPACE = "http://www.w3.org/2000/svg";
const draw = (tag, attributes, ...children) => {
  const element = document.createElementNS(NAMESPACE, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
};

// `side_mm`: corners from the base to the flange, forwards and up; `reach_mm` counts from axis 1.
export const armPicture = ({ side_mm: corners, reach_mm }) => {
  const [forwards, up] = [0, 1].map((axis) => corners.map((corner) => corner[axis]));
  const margin = 0.09 * reach_mm;
  const [left, right, top] = [Math.min(0, ...forwards) - margin, Math.max(reach_mm, ...forwards) + margin, Math.max(...up) + margin];
  const low = Math.min(0, ...up) - 2 * margin;
  const place = ([x, z]) => `${x},${-z}`;
  const line = (className, ...points) => draw("polyline", { class: className, points: points.map(place).join(" ") });
  const ground = low + margin;
  return draw("svg", { viewBox: `${left} ${-top} ${right - left} ${top - low}`, class: "arm", "aria-hidden": "true" },
    line("reach", [0, ground - margin / 2], [0, ground + margin / 2], [0, ground], [reach_mm, ground], [reach_mm, ground - margin / 2], [reach_mm, ground + margin / 2]),
    line("base", [-margin, 0], [margin, 0]),
    line("links", ...corners),
    ...corners.slice(1, -1).map(([x, z]) => draw("circle", { class: "joint", cx: x, cy: -z, r: 0.028 * reach_mm })),
    draw("circle", { class: "flange", cx: corners.at(-1)[0], cy: -corners.at(-1)[1], r: 0.034 * reach_mm }));
};
