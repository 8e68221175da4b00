#!/usr/bin/env node
// SPDX-License-Identifier: GPL-2.0-or-later
// Tests the page of pkm view in a headless browser without network, for every shipped machine.
//
//     tests/page/page_test.mjs PKM [--only TEXT] [--out FOLDER]
//
// First compares page/built with a new build of page/src. Needs chromium and npm ci in the folder page. --out keeps a picture
// of every page.
import { spawnSync } from "node:child_process";
import { mkdirSync, rmSync } from "node:fs";
import { join, resolve } from "node:path";
import { FOLDER, HOME, browser as started, given, tab } from "./browser.mjs";
import { TESTS } from "./tests.mjs";

/** Milliseconds after which a test has failed: a page can be in an endless loop. */
const PATIENCE = 180_000;

const option = (name) => {
  const place = process.argv.indexOf(name);
  return place < 0 ? undefined : process.argv[place + 1];
};

/** Returns a promise that fails after PATIENCE. */
function late() {
  return new Promise((_, fail) => setTimeout(() => fail(new Error(`not over after ${PATIENCE / 1000} s`)), PATIENCE).unref());
}

async function main() {
  if (spawnSync(process.execPath, [join(HOME, "page/build.mjs"), "--check"], { stdio: "inherit" }).status !== 0) process.exit(1);
  Object.assign(given, { pkm: resolve(process.argv[2]), out: option("--out") });
  if (given.out) mkdirSync(given.out, { recursive: true });
  const browser = await started();
  let page = await tab(browser);
  let failed = 0;
  const chosen = TESTS.filter(([name]) => name.includes(option("--only") ?? ""));
  for (const [name, test] of chosen) {
    try {
      const reply = await Promise.race([test(page), late()]);
      console.log(`PASS ${name}${reply ? `: ${reply}` : ""}`);
    } catch (error) {
      failed += 1;
      console.log(`FAIL ${name}: ${error.message}`);
      page = await tab(browser);
    }
  }
  await browser.close();
  rmSync(FOLDER, { recursive: true });
  console.log(`page: ${chosen.length - failed} passed, ${failed} failed`);
  process.exitCode = failed > 0 ? 1 : 0;
}

await main();
