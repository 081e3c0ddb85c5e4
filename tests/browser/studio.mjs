// Drives the window of deflex in headless Chromium with the mouse and typed numbers, from an empty folder to a corrected program, a
// part map and an extended cell; then runs the command lines of its record in another folder and compares all files byte for byte.
//
//   node studio.mjs                      the tests
//   node studio.mjs --screenshots DIR    the same, with a picture of each step, wide and narrow, light and dark
//
// DEFLEX and CHROMIUM name the two programs where they are not found.

import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { deflexAt, openBrowser, openWindow, root } from "./common.mjs";

const binary = deflexAt();
const pictures = process.argv[2] === "--screenshots" ? resolve(process.argv[3]) : undefined;
if (pictures) mkdirSync(pictures, { recursive: true });

const sample = (name) => join(root, "samples", name);
const folder = mkdtempSync(join(tmpdir(), "deflex-studio-"));
const again = mkdtempSync(join(tmpdir(), "deflex-again-"));
const at = (name) => join(folder, name);

const { server, address } = await openWindow(binary, folder);
const browser = await openBrowser();
const context = await browser.newContext({ viewport: { width: 1500, height: 1000 } });
const page = await context.newPage();
page.setDefaultTimeout(30_000);
const wrong = [];
const own = new URL(address).origin;
page.on("console", (message) => ["error", "warning"].includes(message.type()) && wrong.push(message.text()));
page.on("pageerror", (error) => wrong.push(error.stack));
page.on("request", (request) => !request.url().startsWith(own) && !request.url().startsWith("data:") && wrong.push(`asks for ${request.url()}`));

const axe = readFileSync(join(root, "tests/browser/node_modules/axe-core/axe.min.js"), "utf8");
let seen = 0;
// What is on the page now: no serious fault of accessibility, in light and dark; pictures where they are wanted.
const look = async (name) => {
  seen += 1;
  for (const colorScheme of ["light", "dark"]) {
    await page.emulateMedia({ colorScheme });
    // The window's own policy permits no script from here; a debugger may evaluate one all the same.
    const faults = await page.evaluate(async (source) => {
      if (!globalThis.axe) (0, eval)(source);
      const { violations } = await globalThis.axe.run(document, { iframes: false });
      return violations.filter(({ impact }) => ["serious", "critical"].includes(impact)).map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join("\n")}`);
    }, axe);
    assert.deepEqual(faults, [], `${name}, ${colorScheme}`);
    for (const width of pictures ? [1500, 390] : []) {
      await page.setViewportSize({ width, height: width > 1000 ? 1000 : 844 });
      const path = join(pictures, `${String(seen).padStart(2, "0")}-${name}-${width}-${colorScheme}.png`);
      await page.waitForTimeout(150);
      await page.screenshot({ path, fullPage: true });
      if (width === 390) assert(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${name} is wider than 390 px`);
    }
  }
  await page.setViewportSize({ width: 1500, height: 1000 });
  await page.emulateMedia({ colorScheme: "light" });
};

const go = async (view) => {
  await page.click(`nav a[href="#/${view}"]`);
  await page.waitForSelector(`.view.${view} > *`);
};
const press = (name, exact = true) => page.getByRole("button", { name, exact }).first().click();
const program = (name) => page.getByRole("group", { name: "Programs", exact: true }).getByLabel(name, { exact: true });
const choose = (label, value) => page.getByLabel(label, { exact: true }).first().selectOption(value);
const add = async (...files) => {
  await go("files");
  const [chooser] = await Promise.all([page.waitForEvent("filechooser"), press("Add files…")]);
  await chooser.setFiles(files);
  for (const file of files) await page.getByRole("rowheader", { name: file.split("/").at(-1), exact: true }).waitFor();
};
// Waits for the outcome of a run.
const outcome = async (kind) => {
  await page.waitForSelector("[data-outcome]", { timeout: 180_000 });
  assert.equal(await page.getAttribute("[data-outcome]", "data-outcome"), kind, await page.textContent(".outcome"));
};
// The page of a result has drawn its path, or its part.
const drawn = async () => {
  const frame = await (await page.waitForSelector("iframe.result")).contentFrame();
  await frame.waitForFunction(() => window.deflex ?? document.querySelector("canvas")?.width > 300);
  return frame;
};
const cellText = () => page.inputValue("#cell-text");
// Changes a field of the form, and waits until it is saved.
const set = async (section, key, value, part = 0) => {
  const details = page.locator(`details[data-title="${section}"]`);
  if ((await details.getAttribute("open")) === null) await details.locator("summary").first().click();
  const control = details.locator(`.field[data-key="${key}"]`).locator("input, select").nth(part);
  if ((await control.evaluate((element) => element.tagName)) === "SELECT") await control.selectOption(value);
  else {
    await control.fill(value);
    await control.blur();
  }
  await saved();
};
const saved = () => page.waitForFunction(() => document.querySelector(".editor .bar .hint")?.textContent === "Saved");

// Runs command lines in a folder with the same inputs, and compares what they write with the files of the window.
const replayed = (lines) => {
  const replay = mkdtempSync(join(again, "folder-"));
  for (const name of ["part.mod", "loop.mod", "loop.toml", "measured.csv", "cell.toml"]) copyFileSync(at(name), join(replay, name));
  const names = new Set();
  for (const line of lines) {
    const words = line.match(/'[^']*'|\S+/g).slice(1).map((word) => word.replaceAll("'", ""));
    const ran = spawnSync(binary, words, { cwd: replay, encoding: "utf8" });
    assert([0, 1].includes(ran.status), `${line}\n${ran.stderr}`);
    words.filter((word, i) => ["-o", "--report", "--json", "--html", "--stl", "--measured"].includes(words[i - 1])).forEach((word) => names.add(word));
  }
  for (const name of names) assert(readFileSync(at(name)).equals(readFileSync(join(replay, name))), `${name} differs`);
  return `${names.size} files are the same`;
};

// An ABB controller's file of the robot, and a robot description, as short as they may be.
const MOC = `MOC:CFG_1.0:6:0::
#
ROBOT:

      -name "ROB_1" -use_robot_type "ROB1_6700_200_2.60" ${[0, 1, 2, 3, 4, 5].map((i) => `-use_joint_${i} "rob1_${i + 1}"`).join(" ")}
`;
const URDF = `<robot name="arm">
${["base", "l1", "l2", "l3", "l4", "l5", "tool0"].map((name) => `<link name="${name}"/>`).join("\n")}
${[["base", "l1", "0 0 0.8", "0 0 1"], ["l1", "l2", "0.3 0 0", "0 1 0"], ["l2", "l3", "0 0 0.9", "0 1 0"], ["l3", "l4", "0 0 0.2", "1 0 0"], ["l4", "l5", "1 0 0", "0 1 0"], ["l5", "tool0", "0.2 0 0", "1 0 0"]]
    .map(([parent, child, xyz, axis], i) => `<joint name="j${i + 1}" type="revolute"><parent link="${parent}"/><child link="${child}"/><origin xyz="${xyz}" rpy="0 0 0"/><axis xyz="${axis}"/><limit lower="-2" upper="2" effort="0" velocity="2"/></joint>`).join("\n")}
</robot>
`;

const tests = {
  async "the window opens, and its key leaves the address"() {
    await page.goto(address);
    await page.waitForSelector(".view.files .drop");
    assert(!page.url().includes(address.split("#")[1]));
    await page.reload();
    await page.waitForSelector(".view.files .drop");
    await look("empty");
  },
  async "a cell is made from a robot of the library"() {
    await go("cell");
    await page.getByLabel("Maker or model").fill("");
    // Each arm has a picture of its kinematics, and the largest reaches farthest.
    const arms = await page.locator("svg.arm .links").evaluateAll((all) => all.map((links) => links.getAttribute("points").split(" ").length));
    assert(arms.length === 40 && arms.every((corners) => corners >= 5), `${arms}`);
    await page.getByLabel("Maker or model").fill("6660");
    await look("robots");
    await press("Make the cell of irb6660-205-1.9");
    await page.waitForSelector(".form .section");
    await saved();
    const made = spawnSync(binary, ["init", "--robot", "irb6660-205-1.9"], { encoding: "utf8" }).stdout;
    assert.equal(await cellText(), made);
    await look("cell");
  },
  async "the form changes the text at its place, and the text changes the form"() {
    const before = await cellText();
    await set("cut.cutter", "diameter_mm", "12,5");
    assert.equal(await cellText(), before.replace(/diameter_mm = 25\.0( +)# <</, "diameter_mm = 12.5"));
    assert.equal(readFileSync(at("cell.toml"), "utf8"), await cellText());
    await press("Undo");
    await saved();
    assert.equal(await cellText(), before);
    // Two changes at once, as from a quick keyboard: both are kept.
    await page.evaluate(() => {
      for (const [key, value] of [["teeth", "3"], ["helix_deg", "35"]]) {
        const input = document.querySelector(`details[data-title="cut.cutter"] .field[data-key="${key}"] input`);
        input.value = value;
        input.dispatchEvent(new Event("change"));
      }
    });
    await page.waitForFunction(() => /teeth = 3\n[^]*helix_deg = 35\n/.test(document.querySelector("#cell-text").value));
    await saved();
    // A mass in the wrong unit is reported at its field.
    await set("tools.tMill", "mass_kg", "18000");
    const said = page.locator('.field[data-key="mass_kg"] .at-field');
    await said.waitFor();
    assert((await said.textContent()).includes("it looks like g"), await said.textContent());
    await look("doubt");
    await set("tools.tMill", "mass_kg", "18");
    await said.waitFor({ state: "detached" });
    await set("cut.cutter", "diameter_mm", "16");
    // The other direction.
    await page.fill("#cell-text", (await cellText()).replace("max_step_mm = 0.5 ", "max_step_mm = 0.75 "));
    await page.waitForFunction(() => [...document.querySelectorAll('.field[data-key="max_step_mm"] input')].some(({ value }) => value === "0.75"));
    await press("Save");
    await saved();
    await page.fill("#cell-text", `${await cellText()}\n[robot\n`);
    await page.waitForSelector(".form .error");
    await press("Undo");
    await saved();
  },
  async "a program is added and seen"() {
    await add(sample("stock/part.mod"));
    await look("files");
    await press("Look at it: part.mod");
    await page.waitForSelector(".listing .line");
    await press("Predict and show the path");
    const frame = await drawn();
    await frame.waitForSelector("#path");
    await look("program");
    // The arm plays, and the text follows; a frame out of sight stands still.
    await page.locator("iframe.result").scrollIntoViewIfNeeded();
    const listed = () => page.textContent(".listing .line.at .number").catch(() => "");
    await frame.evaluate(() => window.deflex.choose(0));
    await frame.selectOption("#pace", "10");
    await frame.click("#play");
    await page.waitForFunction(() => Number(document.querySelector(".listing .line.at .number")?.textContent) > 40);
    await frame.click("#play");
    assert(Number(await listed()) > 40);
    // A click on a target of the page leads to its line.
    const line = await frame.evaluate(() => {
      const { path } = window.deflex;
      window.deflex.choose(Math.floor(path.length / 2));
      return path.column("line").raw[Math.floor(path.length / 2)];
    });
    await page.waitForFunction((line) => document.querySelector(".listing .line.at .number")?.textContent === String(line), line);
    // And a click on a line to its target.
    await page.locator(".listing .line.at + .line").click();
    await frame.waitForFunction((line) => window.deflex.path.column("line").raw[window.deflex.chosen] === line, line + 1);
  },
  async "the cell gets its stock, and what does not go together is reported"() {
    await go("cell");
    await page.waitForSelector(".form .section");
    await saved();
    await press("Add [stock]");
    await page.waitForSelector('details[data-title="stock"]');
    const box = ["0", "0", "-20", "48", "48", "0"];
    for (const [i, value] of box.entries()) await set("stock", "box_mm", value, i);
    await set("cut.engagement", "mode", "stock");
    for (const key of ["depth_mm", "width_mm", "lead_deg", "tilt_deg"]) {
      await page.locator('details[data-title="cut.engagement"]').getByRole("button", { name: `leave out: ${key}` }).click();
      await page.waitForFunction((key) => !document.querySelector(`details[data-title="cut.engagement"] .field[data-key="${key}"]`), key);
      await saved();
    }
    assert.equal(await page.locator(".said .error").count(), 0, await page.textContent(".said"));
  },
  async "an error moves when a number changes"() {
    await page.getByLabel("Predict after each change").check();
    await page.waitForSelector('[data-figure="max_error_mm"]');
    const largest = async () => Number(await page.textContent('[data-figure="max_error_mm"]'));
    const before = await largest();
    const start = Date.now();
    await set("robot.stiffness", "joint_nm_per_rad", "2e5", 1);
    await page.waitForFunction((before) => Number(document.querySelector('[data-figure="max_error_mm"]').textContent) > before, before);
    const took = Date.now() - start;
    await look("moves");
    await set("robot.stiffness", "joint_nm_per_rad", "5.5e5", 1);
    await page.getByLabel("Predict after each change").uncheck();
    return `${took} ms`;
  },
  async "a program is corrected, checked and cut"() {
    await go("run");
    await press("Compensate");
    await look("run");
    await press("Run compensate");
    await outcome("good");
    await drawn();
    assert(existsSync(at("part.corrected.mod")));
    await look("corrected");
    await press("Check");
    await program("part.corrected.mod").click();
    await program("part.mod").click();
    await page.getByLabel("Largest error of a target, mm").fill("0.02");
    await page.getByLabel("Pass though some targets cannot be judged").check();
    await page.getByText("More options").click();
    await page.getByLabel("Judge only the targets, not the path between them").check();
    await choose("The original, if this is a corrected program", "part.mod");
    await press("Run check");
    await outcome("bad");
    assert((await page.textContent(".outcome")).includes("--at-targets"));
    await look("checked");
    await press("Simulate");
    await press("Run simulate");
    await outcome("good");
    const frame = await drawn();
    assert((await frame.title()).includes("simulate"));
    await look("part");
  },
  async "two programs and two cells are compared"() {
    await go("compare");
    await press("Show what changed");
    await outcome("good");
    await drawn();
    await look("compared");
    // Side by side: one scale of colours, the same axes, and one view.
    await press("Show both");
    await page.waitForFunction(() => document.querySelectorAll(".sides iframe.result").length === 2);
    const frames = await Promise.all((await page.$$(".sides iframe.result")).map((frame) => frame.contentFrame()));
    for (const frame of frames) await frame.waitForFunction(() => window.deflex?.twin.otherBox);
    const scales = () => Promise.all(frames.map((frame) => frame.evaluate(() => {
      const { charts, view } = window.deflex;
      const ends = ["low", "high"].map((id) => document.getElementById(id).textContent);
      return JSON.stringify({ ends, axes: charts.plots.map(({ scales: { x, y } }) => [x.min, x.max, y.min, y.max]), box: view.box });
    })));
    const [before, after] = await scales();
    assert.equal(before, after);
    const largest = await Promise.all(frames.map((frame) => frame.textContent('[data-key="max_error_mm"]')));
    assert.equal(JSON.parse(before).ends[1], String(Number(Math.max(...largest.map(Number)).toPrecision(4))));
    assert.notEqual(largest[0], largest[1], "a correction changes nothing");
    const looks = () => Promise.all(frames.map((frame) => frame.evaluate(() => JSON.stringify(window.deflex.look()))));
    const actions = {
      turned: () => frames[0].locator("#path").press("ArrowLeft"),
      framed: () => frames[1].click("[data-view=arm]"),
      coloured: () => frames[1].selectOption("#colour", "limit_margin_deg"),
      chosen: () => frames[0].evaluate(() => window.deflex.choose(9)),
    };
    for (const [what, act] of Object.entries(actions)) {
      const [before] = await looks();
      await act();
      for (let tries = 0; tries < 50; tries++) {
        const [left, right] = await looks();
        if (left === right && left !== before) break;
        await page.waitForTimeout(50);
      }
      const [left, right] = await looks();
      assert.equal(left, right, what);
      assert.notEqual(left, before, what);
    }
    await look("sides");
  },
  async "a measured table leads to an extended cell, and a plan to the next table"() {
    const renamed = join(again, "loop");
    mkdirSync(renamed);
    copyFileSync(sample("closed-loop/cell.toml"), join(renamed, "loop.toml"));
    copyFileSync(sample("closed-loop/part.mod"), join(renamed, "loop.mod"));
    copyFileSync(sample("closed-loop/measured.csv"), join(renamed, "measured.csv"));
    await add(...["loop.toml", "loop.mod", "measured.csv"].map((name) => join(renamed, name)));
    await go("loop");
    await choose("Cell", "loop.toml");
    await page.waitForFunction(() => document.querySelector(".view.loop select")?.value === "loop.toml");
    await choose("Measured table", "measured.csv");
    await choose("Program that was measured", "loop.mod");
    await look("loop");
    await press("Find the cause");
    await outcome("good");
    assert((await page.textContent(".outcome h3")).includes("backlash"));
    await drawn();
    await look("found");
    await press("Use this cell");
    await page.waitForSelector('details[data-title^="effect"]');
    await saved();
    assert((await cellText()).includes('kind = "backlash"'));
    await look("extended");
  },
  async "the record has the command lines, and they write the same bytes"() {
    await go("record");
    await page.waitForSelector(".record .command");
    await look("record");
    const lines = (await page.locator(".record .command").allTextContents()).reverse();
    assert(lines.length >= 6, lines.join("\n"));
    // Of each command on each program the last: the files of the others were replaced since. The cell was changed after `init`.
    const last = (line) => lines.findLast((other) => other.split(" ").slice(1, 3).join(" ") === line.split(" ").slice(1, 3).join(" ")) === line;
    return replayed(lines.filter((line) => !line.startsWith("deflex init ") && last(line)));
  },
  async "a measurement is planned, and a run is cancelled"() {
    await go("cell");
    await page.waitForSelector(".form .section");
    await choose("Cell", "cell.toml");
    await page.waitForFunction(() => document.querySelector(".source h2")?.textContent.startsWith("cell.toml"));
    await saved();
    await press("Add [plan]");
    await page.waitForSelector('details[data-title="plan"]');
    await saved();
    await go("loop");
    await page.getByLabel("Rows to measure (8 to 500)").fill("40");
    await press("Plan the measurement");
    await press("Cancel");
    await outcome("bad");
    assert((await page.textContent("[data-outcome]")).includes("Cancelled: nothing was written."));
    assert(!existsSync(at("plan.mod")));
    await page.getByLabel("Rows to measure (8 to 500)").fill("8");
    const next = page.locator("section", { hasText: "What to measure next" });
    await next.getByText("More options").click();
    await next.getByLabel("Stop for the operator").selectOption("target");
    await press("Plan the measurement");
    await page.waitForSelector(".outcome .verdict.good", { timeout: 180_000 });
    const frame = await (await page.waitForSelector("iframe.result")).contentFrame();
    await frame.waitForSelector("h1");
    await look("plan");
    return replayed([await page.evaluate(() => [...window.studio.jobs.values()].at(-1).command_line)]);
  },
  async "a backup and a URDF become cells, and sections come and go"() {
    const backup = join(again, "backup");
    mkdirSync(join(backup, "SYSPAR"), { recursive: true });
    mkdirSync(join(backup, "RAPID/TASK1/PROGMOD"), { recursive: true });
    writeFileSync(join(backup, "SYSPAR/MOC.cfg"), MOC);
    writeFileSync(join(backup, "RAPID/TASK1/PROGMOD/tools.mod"), "MODULE Tools\n  PERS tooldata tOwn:=[TRUE,[[0,0,250],[1,0,0,0]],[12,[0,0,100],[1,0,0,0],0,0,0]];\nENDMODULE\n");
    writeFileSync(join(again, "arm.urdf"), URDF);
    await add(join(again, "arm.urdf"));
    const [chooser] = await Promise.all([page.waitForEvent("filechooser"), press("Add a folder…")]);
    await chooser.setFiles(backup);
    await page.getByRole("rowheader", { name: "backup/SYSPAR/MOC.cfg" }).waitFor();
    for (const [source, name] of [["URDF arm.urdf", "arm.toml"], ["Backup backup", "backup.toml"]]) {
      await go("cell");
      await page.waitForSelector(".form .section");
      await saved();
      await page.click("summary:has-text('Make a new cell')");
      await page.getByLabel("Name of the cell file").fill(name);
      await press(source);
      await page.waitForFunction((name) => document.querySelector(".source h2")?.textContent.startsWith(name), name);
      await saved();
    }
    assert((await cellText()).includes("[tools.tOwn]"));
    const before = await cellText();
    const details = page.locator('details[data-title="tools.tOwn"]');
    await details.locator("summary").first().click();
    await details.getByRole("button", { name: "Copy under another name" }).click();
    await page.getByLabel("Name of the copy of tools.tOwn").fill("tSecond");
    await press("Copy");
    await page.waitForSelector('details[data-title="tools.tSecond"]');
    await saved();
    const second = page.locator('details[data-title="tools.tSecond"]');
    await second.locator("summary").first().click();
    await second.getByRole("button", { name: "Remove the section" }).click();
    await press("Remove it");
    await second.waitFor({ state: "detached" });
    await saved();
    assert.equal((await cellText()).trimEnd().replace(/\n+/g, "\n"), before.trimEnd().replace(/\n+/g, "\n"));
    // No stiffness is published for this robot: fields to fill in.
    await press("Add [robot.stiffness]");
    await page.waitForSelector('details[data-title="robot.stiffness"]');
    await saved();
    assert(await page.locator(".said .error").count() > 0, "a stiffness of 0 is no error");
    for (let i = 0; i < 6; i++) await set("robot.stiffness", "joint_nm_per_rad", "1e6", i);
    assert.equal(await page.locator(".said .error").count(), 0);
    // A key comes as an example, and is accepted.
    await page.locator('details[data-title="robot"]').getByRole("button", { name: "+ start_deg" }).click();
    const accept = page.locator('.field[data-key="start_deg"]').getByRole("button", { name: "Keep this example value" });
    await accept.click();
    await accept.waitFor({ state: "detached" });
    await saved();
    assert(/^start_deg = .*# (?!<<)/m.test(await cellText()));
  },
  async "several files, CL data, other columns and two cells"() {
    const other = join(again, "other");
    mkdirSync(other);
    for (const [from, to] of [["kuka/ring.src", "ring.src"], ["kuka/ring.dat", "ring.dat"], ["kuka/cell.toml", "kuka.toml"], ["blade/blade.aptsource", "blade.aptsource"], ["blade/cell.toml", "blade.toml"]]) copyFileSync(sample(from), join(other, to));
    const [head, ...rows] = readFileSync(sample("closed-loop/measured.csv"), "utf8").split("\n");
    writeFileSync(join(other, "named.csv"), [head.replace("target", "Punkt Nr").replace("x_mm", "X Ist").replaceAll(",", ";"), ...rows.map((row) => row.replaceAll(",", ";"))].join("\n"));
    await add(...readdirSync(other).map((name) => join(other, name)));
    const compensate = async (name, cell) => {
      await go("run");
      await press("Compensate");
      const chosen = page.getByRole("group", { name: "Programs", exact: true }).locator("input:checked");
      while (await chosen.count() > 0) await chosen.first().click();
      // The form is drawn again, and keeps the focus for the keyboard.
      assert.equal(await page.evaluate(() => document.activeElement.type), "checkbox");
      await program(name).click();
      await choose("Cell", cell);
      await press("Run compensate");
      await outcome("good");
    };
    await compensate("ring.src", "kuka.toml");
    assert.deepEqual(readdirSync(at("corrected")).filter((name) => /\.(src|dat)$/.test(name)), ["ring.dat", "ring.src"]);
    await compensate("blade.aptsource", "blade.toml");
    assert(readFileSync(at("blade.corrected.mod"), "utf8").includes("MODULE"));
    await go("loop");
    await choose("Cell", "loop.toml");
    await page.waitForFunction(() => document.querySelector(".view.loop select")?.value === "loop.toml");
    await choose("Measured table", "named.csv");
    await choose("“Punkt Nr” is", "target");
    await choose("“X Ist” is", "x_mm");
    await choose("Program that was measured", "loop.mod");
    await press("Find the cause");
    await outcome("good");
    assert((await page.textContent(".outcome h3")).includes("backlash"));
    await go("compare");
    for (const which of ["First program", "Second program"]) await choose(which, "loop.mod");
    await choose("First cell", "loop.toml");
    await choose("Second cell", "loop.identified.toml");
    await press("Show both");
    // The cells take their forces from a table: without it the run says so.
    await page.getByText("Could not be done").waitFor();
    await choose("Forces from a table", "measured.csv");
    await press("Show both");
    await page.waitForFunction(() => document.querySelectorAll("iframe.result").length === 2);
    await look("cells");
    // Options that the other views have: a tool for every target, and files that only declare names.
    await go("run");
    await press("Predict");
    const chosen = page.getByRole("group", { name: "Programs", exact: true }).locator("input:checked");
    while (await chosen.count() > 0) await chosen.first().click();
    await program("loop.mod").click();
    await choose("Cell", "loop.toml");
    await page.getByText("How the program is read").click();
    await page.getByRole("group", { name: "Files that only declare tools, work objects and targets" }).getByLabel("part.mod", { exact: true }).check();
    await page.getByLabel("A tool of the cell for every target").fill("tMill");
    await press("Run predict");
    await page.waitForSelector("[data-outcome]");
    assert((await page.textContent(".outcome code")).includes("--forces measured.csv --tool tMill --context part.mod"), await page.textContent(".outcome"));
    await look("options");
    await page.getByLabel("A tool of the cell for every target").fill("");
    await page.getByRole("group", { name: "Files that only declare tools, work objects and targets" }).getByLabel("part.mod", { exact: true }).uncheck();
    // Logs of axes: a measured table is none, which the run says.
    await go("loop");
    await press("Add a log");
    await press("Add a log");
    await press("Find the law of the path");
    await outcome("bad");
    assert((await page.textContent("[data-outcome]")).includes("--log "), await page.textContent("[data-outcome]"));
    await go("record");
    await press("Copy the command line of predict");
    await page.waitForFunction(() => document.querySelector(".record + div") && /Copied|permit/.test(document.querySelector(".view.record .bar .hint").textContent));
  },
  async "nothing hidden is left, and nothing went wrong in the page"() {
    assert.deepEqual(readdirSync(folder).filter((name) => name.startsWith(".")), []);
    assert.deepEqual(wrong, []);
    const memory = existsSync(`/proc/${server.pid}/status`) ? Number(readFileSync(`/proc/${server.pid}/status`, "utf8").match(/VmRSS:\s*(\d+)/)[1]) / 1024 : 0;
    assert(memory < 50, `the server takes ${memory} MiB`);
    return `${memory.toFixed(0)} MiB`;
  },
};

let failed = 0;
try {
  for (const [name, test] of Object.entries(tests)) {
    try {
      const said = await test();
      console.log(`ok      ${name}${said ? `: ${said}` : ""}`);
    } catch (error) {
      failed += 1;
      console.log(`FAILED  ${name}\n${[error.stack, ...wrong.slice(0, 3)].join("\n")}`);
      if (pictures) await page.screenshot({ path: join(pictures, `failed-${failed}.png`), fullPage: true });
      // Each step goes on from the one before.
      break;
    }
  }
} finally {
  await browser.close();
  server.kill();
  for (const made of [folder, again]) rmSync(made, { recursive: true });
}
process.exitCode = failed ? 1 : 0;
