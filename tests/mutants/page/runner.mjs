// SPDX-License-Identifier: GPL-2.0-or-later
// Runs the tests of the page for Stryker: one bundle contains all mutants, and a variable in the browser activates one.
//
// PAGE_PART, such as 3/10, selects mutants by number, because Stryker itself runs all. The others are reported as errors,
// which results.mjs ignores.
import { appendFileSync } from "node:fs";
import { createRequire } from "node:module";
import { basename, join } from "node:path";
import { pathToFileURL } from "node:url";
import { PluginKind, declareClassPlugin } from "@stryker-mutator/api/plugin";
import { DryRunStatus, MutantRunStatus, TestStatus } from "@stryker-mutator/api/test-runner";
import { HOME, browser as started, given, tab } from "../../page/browser.mjs";
import { TESTS } from "../../page/tests.mjs";

const modules = join(HOME, "page/node_modules");
const { build } = await import(pathToFileURL(createRequire(join(HOME, "page/package.json")).resolve("esbuild")));

/** Skipped: tests of pkm rather than the page, and machines similar to others. */
const LEFT_OUT = /video has|without a video|5,000 lines|the page of (?!hexapod|lathe-mirrored|rotary-delta|pentapod)/;

/** Milliseconds between two questions to the page, and milliseconds without an answer after which it is in an endless loop. A
 * test has no time limit: on a busy computer it takes minutes. */
const PAUSE = 5_000;
const PATIENCE = 120_000;

const late = (delay) => new Promise((_, fail) => setTimeout(() => fail(new Error(`no answer after ${delay} ms`)), delay).unref());

/** Fails once the page stops answering. */
async function stuck(page) {
  while (!page.isClosed()) {
    // A page that another one replaces fails at once: it is not stuck.
    await Promise.race([page.evaluate(() => true).catch(() => {}), late(PATIENCE)]);
    await new Promise((resolve) => setTimeout(resolve, PAUSE).unref());
  }
  throw new Error("the page was closed");
}

const [part, parts] = process.env.PAGE_PART.split("/").map(Number);
export const isChosen = (id) => Number(id) % parts === part;

class PageRunner {
  tests = TESTS.filter(([name]) => !LEFT_OUT.test(name)).map(([id, test]) => ({ id, test }));

  capabilities() {
    return { reloadEnvironment: true };
  }

  async init() {
    // Stryker puts the mutants into a copy of the sources and runs this process in that folder.
    const { outputFiles: [file] } = await build({
      entryPoints: ["src/page.js"], absWorkingDir: process.cwd(), bundle: true, format: "esm", target: "es2022", charset: "ascii", write: false, nodePaths: [modules], logLevel: "error",
    });
    Object.assign(given, { pkm: process.env.PKM, code: file.text });
    this.browser = await started();
  }

  async dispose() {
    await this.browser?.close();
  }

  /** Runs a test in a new tab, with the variables that Stryker's code in the page reads. */
  async run({ id, test }, stryker, left = async () => {}) {
    Object.assign(given, { before: `window.__stryker__ = ${JSON.stringify(stryker)};`, left });
    const page = await tab(this.browser);
    const began = performance.now();
    try {
      await Promise.race([test(page), stuck(page)]);
      return { id, name: id, status: TestStatus.Success, timeSpentMs: performance.now() - began };
    } catch (error) {
      return { id, name: id, status: TestStatus.Failed, failureMessage: error.message, timeSpentMs: performance.now() - began };
    } finally {
      await left(page).catch(() => {});
      // A page in an endless loop cannot be closed: replace its browser.
      await Promise.race([page.context().close(), late(5000)]).catch(async () => {
        this.browser.close().catch(() => {});
        this.browser = await started();
      });
    }
  }

  async dryRun() {
    const perTest = {};
    const tests = [];
    for (const one of this.tests) {
      const hits = (perTest[one.id] = {});
      const seen = async (page) => {
        const found = await page.evaluate(() => window.__stryker__?.mutantCoverage?.perTest ?? {});
        for (const counts of Object.values(found)) for (const [mutant, count] of Object.entries(counts)) hits[mutant] = (hits[mutant] ?? 0) + count;
      };
      tests.push(await this.run(one, { currentTestId: one.id }, seen));
    }
    return { status: DryRunStatus.Complete, tests, mutantCoverage: { static: {}, perTest } };
  }

  /** Writes each result at once: a run can be interrupted. */
  async mutantRun({ activeMutant, testFilter }) {
    if (!isChosen(activeMutant.id)) return { status: MutantRunStatus.Error, errorMessage: "of another part" };
    const result = await this.judge(activeMutant, testFilter);
    const { fileName, location: { start }, replacement } = activeMutant;
    const words = [result.status, `${basename(fileName)}:${start.line + 1}:${start.column + 1}`, replacement, result.killedBy, result.failureMessage];
    appendFileSync(process.env.PAGE_PROGRESS, `${words.filter(Boolean).join(" | ").replaceAll(/\s+/g, " ")}\n`);
    return result;
  }

  /** Runs the tests that reach a mutant until one fails. */
  async judge(activeMutant, testFilter) {
    const tests = this.tests.filter(({ id }) => testFilter === undefined || testFilter.includes(id));
    for (const [n, one] of tests.entries()) {
      const { status, failureMessage } = await this.run(one, { activeMutant: activeMutant.id });
      if (status === TestStatus.Failed) return { status: MutantRunStatus.Killed, killedBy: [one.id], failureMessage, nrOfTests: n + 1 };
    }
    return { status: MutantRunStatus.Survived, nrOfTests: tests.length };
  }
}

export const strykerPlugins = [declareClassPlugin(PluginKind.TestRunner, "page", PageRunner)];
