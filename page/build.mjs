// SPDX-License-Identifier: GPL-2.0-or-later
// Builds the page's code into the folder built; with --check compares the built files byte for byte.
import { build } from "esbuild";
import { execFileSync } from "node:child_process";
import { mkdtemp, readFile, writeFile, mkdir, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const HERE = dirname(fileURLToPath(import.meta.url));
const BUILT = join(HERE, "built");
const LIBRARIES = ["three", "uplot"];

async function bundled(folder) {
  await build({
    entryPoints: [join(HERE, "src/page.js"), join(HERE, "src/page.css")],
    outdir: folder,
    bundle: true,
    minify: true,
    format: "esm",
    target: "es2022",
    charset: "ascii",
    legalComments: "inline",
    absWorkingDir: HERE,
    logLevel: "warning",
  });
  const licenses = await Promise.all(LIBRARIES.map(async (name) => {
    const home = join(HERE, "node_modules", name);
    const { version } = JSON.parse(await readFile(join(home, "package.json"), "utf8"));
    return `${name} ${version}\n\n${(await readFile(join(home, "LICENSE"), "utf8")).trim()}\n`;
  }));
  await writeFile(join(folder, "LICENSES.txt"), licenses.join("\n\n"));
}

const FILES = ["page.js", "page.css", "LICENSES.txt"];

async function check() {
  const folder = await mkdtemp(join(tmpdir(), "pkmkins-page-"));
  try {
    await bundled(folder);
    for (const file of FILES) {
      const [fresh, kept] = await Promise.all([folder, BUILT].map((at) => readFile(join(at, file))));
      if (!fresh.equals(kept)) {
        throw new Error(`page/built/${file} is not what page/src gives: run cargo xtask page`);
      }
    }
  } finally {
    await rm(folder, { recursive: true });
  }
  const sources = execFileSync(join(HERE, "core/sources.sh"), { encoding: "utf8" });
  if (sources !== await readFile(join(BUILT, "kinematics.sources"), "utf8")) {
    throw new Error("page/built/kinematics.wasm is built from other sources of the core or of page/core: run cargo xtask page-core");
  }
}

if (process.argv.includes("--check")) {
  await check();
  console.log("page: built files are those of the sources");
} else {
  await mkdir(BUILT, { recursive: true });
  await bundled(BUILT);
}
