// SPDX-License-Identifier: GPL-2.0-or-later
// Helpers for the tests of the page: pkm, a browser, and the page in it.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

export const HOME = resolve(dirname(fileURLToPath(import.meta.url)), "../..");
const { chromium } = createRequire(join(HOME, "page/package.json"))("playwright-core");

/** Folder for the files of this run. */
export const FOLDER = mkdtempSync(join(tmpdir(), "pkmkins-page-test-"));
export const file = (name) => join(FOLDER, name);
export const ini = (machine) => join(HOME, "configs", machine, `${machine}.ini`);

/** The shipped machines, each with its first program. */
export const MACHINES = readdirSync(join(HOME, "configs")).map((machine) => {
  const programs = join(HOME, "configs", machine, "programs");
  return { machine, program: join(programs, readdirSync(programs).filter((name) => name.endsWith(".ngc")).sort()[0]) };
});

/** The command `pkm` and the folder of pictures. A run of mutants also gives the code that replaces the page's own, a script
 * that runs before it, and a function that is called before a page is left. */
export const given = { pkm: undefined, out: undefined, code: undefined, before: undefined, left: async () => {} };

// Tolerance 0: the page and pkm compute with the same code, so results are equal to the last bit.
export const SAME = 0;
// Some roundings of lengths of 1e3: pkm gets a tool without the spindle's offset and adds the offset again.
export const ROUNDED = 1e-9;

export function check(is, text) {
  if (!is) throw new Error(text);
}

/** Fails if two numbers, or lists of numbers, differ by more than a tolerance. */
export function near(found, expected, tolerance, text) {
  const [a, b] = [[found].flat(), [expected].flat()];
  const apart = Math.max(...b.map((value, k) => (a[k] === value ? 0 : Math.abs(a[k] - value))));
  check(a.length === b.length && apart <= tolerance, `${text}: ${a}, expected ${b}`);
}

/** Answers of `pkm` by arguments and input, which tests repeat. */
const answers = new Map();

export function pkm(args, input = "") {
  const asked = JSON.stringify([args, input]);
  if (answers.has(asked)) return answers.get(asked);
  const done = spawnSync(given.pkm, args, { input, encoding: "utf8", maxBuffer: 1 << 28 });
  if (done.error) throw done.error;
  answers.set(asked, done);
  return done;
}

/** Runs a subcommand and returns its answer as an object. */
export function answer(...words) {
  const done = pkm([...words.map(String), "--format", "json"]);
  check(done.status !== 2 && done.stdout !== "", `${words.join(" ")}: ${done.stderr}`);
  return JSON.parse(done.stdout);
}

/** Runs a subcommand with poses of a mechanism as CSV and one tool; returns a list of objects. */
export function table(command, machine, mechanism, poses, tool) {
  const rows = ["x,y,z,a,b,c", ...poses.map((pose) => pose.join(","))].join("\n");
  const done = pkm([command, machine, "--mechanism", String(mechanism + 1), "--tool", ...tool.map(String)], `${rows}\n`);
  const [names, ...lines] = done.stdout.trim().split("\n").map((line) => line.split(","));
  check(lines.length === poses.length, `${machine}: ${lines.length} answers for ${poses.length} poses: ${done.stderr}`);
  const number = (text) => (text === "" ? undefined : Number(text));
  const answers = lines.map((line) => Object.fromEntries(names.map((name, k) => [name, number(line[k])])));
  // Behind the joints are coordinates that follow from others.
  const columns = names.map((name, k) => (command !== "joints" || name.startsWith("joint_") ? k : -1)).filter((k) => k >= 0);
  return { rows: answers, values: lines.map((line) => columns.map((k) => number(line[k]))), reply: done.stderr };
}

/** Returns the tool vector for pkm: without the spindle's offset, or 0 if poses are those of the platform. */
export function ownTool({ scene, tool: spindle }, tool) {
  return tool.map((value, k) => (scene.sees_tool ? value - spindle[k] : 0));
}

export async function browser() {
  return chromium.launch({
    executablePath: "/usr/bin/chromium",
    args: ["--use-angle=swiftshader", "--disable-gpu-compositing", "--enable-unsafe-swiftshader", "--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic", "--no-first-run", ...(process.getuid() === 0 ? ["--no-sandbox"] : [])],
  });
}

/** Records the last scene, renderer and camera, which Three.js reports to developer tools, and counts pictures. It also shortens
 * waits, and skips drawing, which takes longest, unless a test looks at the picture itself. */
const OBSERVER = () => {
  const later = window.setTimeout;
  window.setTimeout = (act, delay, ...rest) => later(act, Math.min(delay, 40), ...rest);
  window.seen = { rested: () => new Promise((rested) => later(rested, 60)), pictures: 0, isDrawn: location.hash !== "" };
  window.__THREE_DEVTOOLS__ = new EventTarget();
  window.__THREE_DEVTOOLS__.addEventListener("observe", ({ detail }) => {
    if (detail.isScene) window.seen.scene = detail;
    else if (detail.render) {
      const { render } = detail;
      window.seen.renderer = detail;
      detail.render = (scene, camera) => {
        window.seen.camera = camera;
        window.seen.pictures += 1;
        if (window.seen.isDrawn) return render.call(detail, scene, camera);
        scene.updateMatrixWorld();
        camera.updateMatrixWorld();
      };
    }
  });
};

/** Waits until the page has done its delayed computations. */
export const rested = (page) => page.evaluate(() => window.seen.rested());

/** Milliseconds to wait for an element of the page: in a run of mutants, a slow computer must not look like a failure. */
const mostWait = () => (given.code ? 180_000 : 60_000);

/** Opens a tab without network, which collects errors and warnings of its pages. */
export async function tab(browser, options = { offline: true }) {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(mostWait());
  page.complaints = [];
  page.on("console", (reply) => ["error", "warning"].includes(reply.type()) && page.complaints.push(reply.text()));
  page.on("pageerror", (error) => page.complaints.push(error.message));
  if (options.offline) page.on("request", (request) => request.url().match(/^(file|data|blob):/) || page.complaints.push(`asked for ${request.url()}`));
  await page.addInitScript(OBSERVER);
  if (given.before) await page.addInitScript(given.before);
  return page;
}

/** Pages in which a run of mutants has replaced the code. */
const replaced = new Set();

/** Makes a page by `pkm view`; returns the finished process. */
export function view(html, ...words) {
  const made = pkm(["view", ...words, "--html", html]);
  if (given.code && made.status !== 2 && !replaced.has(html)) {
    replaced.add(html);
    const [before, rest] = readFileSync(html, "utf8").split('<script type="module">');
    const [, after] = rest.split("</script>");
    writeFileSync(html, `${before}<script type="module">${given.code}</script>${after}`);
  }
  return made;
}

/** Opens another page in the same tab: a new tab takes more than half of a page's time. */
export async function open(page, html, address = `file://${html}`) {
  page.complaints.length = 0;
  await given.left(page);
  await page.goto("about:blank");
  await page.goto(address);
  const failed = new Promise((_, fail) => page.once("pageerror", fail));
  await Promise.race([page.waitForFunction(() => window.pkm ?? document.querySelector("#page > .error")), failed]);
  check(await page.evaluate(() => window.pkm !== undefined), `${html}: ${await page.locator("#page").textContent()}`);
}

/** Returns the check box of a label. */
export const box = (page, words) => page.locator("label.box", { hasText: words }).locator("input");

/** Makes and opens the page of a machine, with or without a program; returns its mechanisms. */
export async function opened(page, name, machine, ...words) {
  const made = view(file(`${name}.html`), machine, ...words);
  check(made.status !== 2, `${name}: ${made.stderr}`);
  await open(page, file(`${name}.html`));
  return page.evaluate(() => window.pkm.mechanisms());
}

/** Returns errors and warnings, except those of a browser without a graphics card. */
export function complaints(page) {
  return page.complaints.filter((text) => !/GPU stall|GL Driver Message|swiftshader|software WebGL/i.test(text));
}

const NO_NUMBERS = ["NaN", "Infinity", "-Infinity"];

/** Returns the result of a function in the page, transferred as one text: value by value, the browser's protocol takes longer
 * than the page. NaN and infinities are kept. */
export async function asText(page, ask, given) {
  const named = (_, value) => (typeof value === "number" && !Number.isFinite(value) ? String(value) : value);
  const text = await page.evaluate(`JSON.stringify((${ask})(${JSON.stringify(given)}), ${named})`);
  return JSON.parse(text, (_, value) => (NO_NUMBERS.includes(value) ? Number(value) : value));
}

/** Compares the page's joints and refusals at each pose with those of `pkm joints`. */
export function compare(machine, mechanism, own, states, tolerance) {
  const byTool = new Map();
  for (const state of states) {
    const key = ownTool(own, state.tool).join(",");
    byTool.set(key, [...(byTool.get(key) ?? []), state]);
  }
  for (const [key, group] of byTool) {
    const { values, reply } = table("joints", ini(machine), mechanism, group.map(({ pose }) => pose), key.split(",").map(Number));
    group.forEach((state, i) => {
      if (values[i][0] === undefined) {
        check(state.code !== 0, `${machine}: the page accepts ${state.pose}, pkm joints refuses it`);
        check(reply.includes(state.refusal), `${machine}: "${state.refusal}" is not the message of pkm joints: ${reply}`);
      } else {
        check(state.code === 0, `${machine}: the page refuses ${state.pose}: ${state.refusal}`);
        near(state.joints, values[i], tolerance, `${machine}: joints at ${state.pose}`);
      }
    });
  }
}
