// What the browser tests share: the two programs, the window, and a long program.

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { existsSync, writeFileSync } from "node:fs";
import { join, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const root = resolve(fileURLToPath(import.meta.url), "../../..");

// DEFLEX and CHROMIUM name the two programs where they are not found.
export const deflexAt = (kinds = ["debug", "release"]) => {
  const binary = (process.env.DEFLEX && resolve(process.env.DEFLEX)) ?? kinds.map((kind) => join(root, "target", kind, "deflex")).find(existsSync);
  assert(binary, "no deflex: build it first, or set DEFLEX");
  return binary;
};

export const openBrowser = () => {
  const executablePath = process.env.CHROMIUM ?? ["chromium", "chromium-browser", "google-chrome"]
    .map((name) => spawnSync("which", [name], { encoding: "utf8" }).stdout.trim()).find(Boolean);
  assert(executablePath, "no Chromium: install it (Debian: apt-get install chromium), or set CHROMIUM");
  return chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"],
  });
};

// The window on a folder. STUDIO names another program that opens one, with the folder as its argument.
export const openWindow = async (binary, folder) => {
  const args = process.env.STUDIO ? [binary, folder] : ["studio", folder, "--no-browser"];
  const server = spawn(process.env.STUDIO ?? binary, args, { stdio: ["ignore", "pipe", "inherit"] });
  const address = await new Promise((done, failed) => {
    let text = "";
    server.stdout.on("data", (data) => { text += data; if (text.includes("\n")) done(text.trim()); });
    server.on("exit", () => failed(new Error("the window does not open")));
  });
  return { server, address };
};

// A RAPID module of so many targets over a wavy field, and a cell for it.
export const writeLong = (targets, program, cell) => {
  const move = (_, i) => {
    const [row, column] = [Math.floor(i / 400), i % 400];
    const [x, y] = [(row % 2 ? 399 - column : column) * 0.5, row * 0.8];
    const z = 8 * Math.sin(x / 30) * Math.cos(y / 40);
    return `    MoveL [[${x.toFixed(3)},${y.toFixed(3)},${z.toFixed(3)}],[0,1,0,0],[-1,0,1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v20,z1,tMill\\WObj:=wPart;\n`;
  };
  writeFileSync(program, `MODULE Long
  PERS tooldata tMill:=[TRUE,[[0,0,310],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];
  PERS wobjdata wPart:=[FALSE,TRUE,"",[[1000,-400,700],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PROC main()
${Array.from({ length: targets }, move).join("")}  ENDPROC
ENDMODULE
`);
  writeFileSync(cell, CELL);
};

// A cell without a cutter: the same force everywhere.
export const CELL = `[robot]
model = "irb6660-205-1.9"
[robot.stiffness]
joint_nm_per_rad = [8.86e5, 5.5e5, 1.85e6, 3.3e5, 2.1e5, 8.81e4]
[controller]
compensates = []
[cut]
force = "constant"
force_n = [120, -260, 410]
frame = "wobj"
`;
