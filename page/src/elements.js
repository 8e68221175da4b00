// SPDX-License-Identifier: GPL-2.0-or-later
// Builders for elements of the page.

/** Creates an element with attributes, properties (names that begin with a dot), listeners (on…) and children. */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name.startsWith(".")) made[name.slice(1)] = value;
    else if (value !== undefined && value !== false) made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== undefined && child !== null));
  return made;
}

/** Creates a drop-down list; `chosen` gets the option that the user selects. */
export function choice(name, options, chosen) {
  const list = element("select", { "aria-label": name, onchange: () => chosen(list.value) });
  list.append(...options.map((option) => element("option", { value: option }, option)));
  return list;
}

export function box(name, changed, isOn = false) {
  const input = element("input", { type: "checkbox", ".checked": isOn, onchange: () => changed(input.checked) });
  return element("label", { class: "box" }, input, name);
}

/** Formats a number with a fixed number of decimals. */
export function shown(value, digits = 3) {
  if (!isFinite(value)) return "–";
  return (Math.round(value * 10 ** digits) / 10 ** digits + 0).toFixed(digits);
}

/** Formats a geometry hash as the module and pkm write it. */
export function hexadecimal(hash) {
  return `0x${hash.toString(16).padStart(8, "0")}`;
}

/** A long list of rows of equal height, of which only the visible rows are elements. */
export class Rows {
  constructor(rows, height, made) {
    Object.assign(this, { rows, height, made, first: -1 });
    this.space = element("div", { class: "space" });
    this.space.style.height = `${rows.length * height}px`;
    this.root = element("div", { class: "rows", onscroll: () => this.draw() }, this.space);
    new ResizeObserver(() => this.draw(true)).observe(this.root);
  }

  draw(always = false) {
    const first = Math.max(Math.floor(this.root.scrollTop / this.height) - 5, 0);
    if (first === this.first && !always) return;
    this.first = first;
    const count = Math.ceil(this.root.clientHeight / this.height) + 10;
    const rows = this.rows.slice(first, first + count).map((row, n) => {
      const made = this.made(row, first + n);
      made.style.top = `${(first + n) * this.height}px`;
      return made;
    });
    this.space.replaceChildren(...rows);
  }

  /** Scrolls a row into view. Unchanged rows keep their elements: a click is lost if its element is replaced between press
   * and release. */
  go(i, hasChanged) {
    const [top, height] = [i * this.height, this.root.clientHeight];
    if (top < this.root.scrollTop || top > this.root.scrollTop + height - 2 * this.height) {
      this.root.scrollTop = top - height / 2;
    }
    this.draw(hasChanged);
  }
}
