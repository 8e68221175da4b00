// SPDX-License-Identifier: GPL-2.0-or-later
// Elements of the page.

/** An element with attributes, properties whose names begin with a dot, listeners (on…), and children. */
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

/** A list of choices with what happens when one is taken. */
export function choice(name, options, chosen) {
  const list = element("select", { "aria-label": name, onchange: () => chosen(list.value) });
  list.append(...options.map((option) => element("option", { value: option }, option)));
  return list;
}

export function box(name, changed, isOn = false) {
  const input = element("input", { type: "checkbox", ".checked": isOn, onchange: () => changed(input.checked) });
  return element("label", { class: "box" }, input, name);
}

/** As many digits as anybody reads. */
export function shown(value, digits = 3) {
  if (!isFinite(value)) return "–";
  return (Math.round(value * 10 ** digits) / 10 ** digits + 0).toFixed(digits);
}

/** A geometry hash, as the module and pkm write it. */
export function hexadecimal(hash) {
  return `0x${hash.toString(16).padStart(8, "0")}`;
}

/** Of a long list only the rows in sight: all of one height. */
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

  /** Brings a row into sight. Rows that have not changed stay the same elements: a click on an element that is replaced
   * between press and release is lost. */
  go(i, hasChanged) {
    const [top, height] = [i * this.height, this.root.clientHeight];
    if (top < this.root.scrollTop || top > this.root.scrollTop + height - 2 * this.height) {
      this.root.scrollTop = top - height / 2;
    }
    this.draw(hasChanged);
  }
}
