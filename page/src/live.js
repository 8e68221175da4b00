// SPDX-License-Identifier: GPL-2.0-or-later
// The running machine, from the events of pkm-live.
import { hexadecimal } from "./elements.js";

/** Milliseconds without an event after which the page reports the picture as old. */
const OLD = 2000;

export function follow(page) {
  // pkm-live sends only the first mechanism's pins.
  for (const { drawing } of page.mechanisms.slice(1)) drawing.group.visible = false;
  const source = new EventSource("events");
  let heard = 0;
  source.onmessage = ({ data }) => {
    heard = performance.now();
    page.live = JSON.parse(data);
    show(page);
  };
  setInterval(() => {
    if (performance.now() - heard > OLD) tell(page, "no connection to pkm-live", true);
  }, OLD / 2);
}

function show(page) {
  const { live, mechanisms } = page;
  if (live.state !== "running") {
    tell(page, "LinuxCNC is not running", true);
    return;
  }
  const { geometry_hash: own } = mechanisms[0].scene;
  if (live.geometry_hash !== null && live.geometry_hash !== own) {
    tell(page, `the module has another geometry: ${hexadecimal(live.geometry_hash)}`, true);
  } else if (!live.pose) {
    tell(page, "running, but its pose is unknown: pins are missing", true);
  } else {
    const line = live.line ? `, line ${live.line}` : "";
    tell(page, live.fault ?? `running${line}${live.geometry_hash === null ? ", geometry not compared" : ""}`, live.fault !== null && live.fault !== undefined);
  }
  if (!live.pose) return;
  const { scene, place } = mechanisms[0];
  // Values of missing pins stay unchanged.
  const tool = live.tool ?? place.tool;
  const known = scene.extra_axes.map(({ letter }) => [letter, live.extra[letter.toLowerCase()] ?? place.extra[letter]]);
  const extra = Object.fromEntries(known);
  // A machine at rest needs no new computation.
  if (JSON.stringify(place) !== JSON.stringify({ pose: live.pose, tool, extra })) page.take(live.pose, tool, 0, extra);
}

function tell(page, text, isBad) {
  page.state.textContent = text;
  page.state.classList.toggle("bad", isBad);
}
