// SPDX-License-Identifier: GPL-2.0-or-later
// Writes Stryker's results as lists of mutants: results.mjs REPORT.json FOLDER
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

const [report, folder] = process.argv.slice(2);
const [part, parts] = process.env.PAGE_PART.split("/").map(Number);
const lists = { Killed: "caught", Timeout: "caught", Survived: "missed", NoCoverage: "missed" };
const found = { caught: [], missed: [], unviable: [] };
for (const [file, { source, mutants }] of Object.entries(JSON.parse(readFileSync(report, "utf8")).files)) {
  const lines = source.split("\n");
  for (const { id, status, location: { start, end }, replacement } of mutants) {
    if (Number(id) % parts !== part || status === "Ignored") continue;
    const from = lines[start.line - 1].slice(start.column - 1, start.line === end.line ? end.column - 1 : undefined);
    const change = `${from.trim().slice(0, 60)} becomes ${replacement.replaceAll(/\s+/g, " ").slice(0, 60)}`;
    found[lists[status] ?? "unviable"].push(`page/${file}:${start.line}:${start.column}: ${change}`);
  }
}
for (const [name, lines] of Object.entries(found)) writeFileSync(join(folder, `${name}.txt`), lines.map((line) => `${line}\n`).join(""));
