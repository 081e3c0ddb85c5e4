// Functions of the pages that need no browser: node tests/browser/units.mjs
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";

const assets = new URL("../../crates/report/src/html/assets/", import.meta.url);

// The function that begins with `const NAME` in a script and ends before the text `behind`.
const taken = (file, name, behind) => {
  const text = readFileSync(new URL(file, assets), "utf8");
  const [start, end] = [text.indexOf(`const ${name} =`), text.indexOf(behind)];
  assert.ok(start >= 0 && end > start, `${file} has ${name}`);
  return new Function(`${text.slice(start, end)}; return ${name};`)();
};

// Ticks of a scale differ, and none is a negative zero.
const tickLabels = taken("charts.js", "tickLabels", "// Charts along");
assert.deepEqual(tickLabels([-2e-5, -0, 1e-5], 1e-5), ["-0.00002", "0.00000", "0.00001"]);
assert.deepEqual(tickLabels([0, 0.1, 0.2], 0.1), ["0.0", "0.1", "0.2"]);
assert.deepEqual(tickLabels([0, 5e-9], 5e-9), ["0", "5.0e-9"]);
assert.deepEqual(tickLabels([-200, 0, 200], 200), ["-200", "0", "200"]);

// A picture is of what cuts and of what is near it; a home position far away does not shrink it.
const framed = taken("view.js", "framed", "class View");
const home = [[0, 100, 50, -3000], [0, 50, 20, 0], [0, 0, 80, 2000]];
assert.deepEqual(framed(home, (i) => i < 2), [[0, 100], [0, 50], [0, 80]]);
const air = [[...Array(10).keys(), -3000], Array(11).fill(0), [...Array(10).fill(0), 2000]];
assert.deepEqual(framed(air, () => false), [[0, 9], [0, 0], [0, 0]]);
assert.deepEqual(framed([[5], [5], [5]], () => true), [[5, 5], [5, 5], [5, 5]]);

console.log("units of the pages: ok");
