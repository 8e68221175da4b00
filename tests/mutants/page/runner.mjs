// SPDX-License-Identifier: GPL-2.0-or-later
// Runs the tests of the page for Stryker: one bundle contains all mutants, and a variable in the browser activates one.
//
// PAGE_PART, such as 3/10, selects mutants by number, because Stryker itself runs all. The others are reported as errors,
// which results.mjs ignores.
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { PluginKind, declareClassPlugin } from "@stryker-mutator/api/plugin";
import { DryRunStatus, MutantRunStatus, TestStatus } from "@stryker-mutator/api/test-runner";
import { HOME, browser as started, given, tab } from "../../page/browser.mjs";
import { TESTS } from "../../page/tests.mjs";

const modules = join(HOME, "page/node_modules");
const { build } = await import(pathToFileURL(createRequire(join(HOME, "page/package.json")).resolve("esbuild")));

/** Skipped: tests of pkm rather than the page, and machines similar to others. */
const LEFT_OUT = /video has|without a video|5,000 lines|the page of (?!hexapod|lathe-mirrored|rotary-delta|pentapod)/;

/** Milliseconds after which a test has noticed the change: the page waits or loops forever. */
const PATIENCE = 120_000;

const late = (delay) => new Promise((_, fail) => setTimeout(() => fail(new Error(`not over after ${delay} ms`)), delay).unref());

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
      await Promise.race([test(page), late(PATIENCE)]);
      return { id, name: id, status: TestStatus.Success, timeSpentMs: performance.now() - began };
    } catch (error) {
      return { id, name: id, status: TestStatus.Failed, failureMessage: error.message, timeSpentMs: performance.now() - began };
    } finally {
      await left(page).catch(() => {});
      // A page in an endless loop cannot be closed: start another browser.
      await Promise.race([page.context().close(), late(5000)]).catch(async () => (this.browser = await started()));
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

  async mutantRun({ activeMutant, testFilter }) {
    if (!isChosen(activeMutant.id)) return { status: MutantRunStatus.Error, errorMessage: "of another part" };
    const tests = this.tests.filter(({ id }) => testFilter === undefined || testFilter.includes(id));
    for (const [n, one] of tests.entries()) {
      const { status, failureMessage } = await this.run(one, { activeMutant: activeMutant.id });
      if (status === TestStatus.Failed) return { status: MutantRunStatus.Killed, killedBy: [one.id], failureMessage, nrOfTests: n + 1 };
    }
    return { status: MutantRunStatus.Survived, nrOfTests: tests.length };
  }
}

export const strykerPlugins = [declareClassPlugin(PluginKind.TestRunner, "page", PageRunner)];
