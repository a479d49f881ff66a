// SPDX-License-Identifier: MIT
// ui.js - what pages are made of. Text is never HTML: elements are made one by one.
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

export const button = (text, onclick, attributes = {}) => element("button", { type: "button", onclick, ...attributes }, text);
export const number = (value, digits = 2) => (value === null || value === undefined ? "–" : value.toFixed(digits));

// Rebuilds a part of the page only where it says something else: focus and a finger stay where they are.
export function fill(part, ...children) {
  if (!part) return;
  const fresh = element("div", {}, ...children);
  if (part.dataset.shown !== fresh.innerHTML) {
    part.dataset.shown = fresh.innerHTML;
    part.replaceChildren(...fresh.childNodes);
  }
}

export const rowsOf = (pairs) => element("dl", {}, ...pairs.flatMap(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]));

// Columns behind the first one are numbers, unless they are words.
export function table(head, rows, isWords = false) {
  const cell = (tag) => (value, i) => element(tag, { class: i && !isWords ? "number" : "" }, value);
  return element("div", { class: "scroll", tabindex: "0" }, element("table", {}, element("thead", {}, element("tr", {}, ...head.map(cell("th")))),
    element("tbody", {}, ...rows.map((row) => element("tr", {}, ...row.map(cell("td")))))));
}

export const choice = (label, values, chosen, onchange, name = (value) => value) => element("label", {}, `${label} `, element("select", { onchange: (event) => onchange(event.target.value) },
  ...values.map((value) => element("option", { value, selected: value === chosen }, name(value)))));

// An emptied canvas of its place's width: {pen: draws in CSS pixels, width, colour(name): of the page}; null while it is not shown.
export function penOn(canvas, tall) {
  const width = canvas.clientWidth, ratio = window.devicePixelRatio || 1;
  if (width === 0) return null;
  canvas.style.height = `${tall}px`;
  canvas.width = width * ratio;
  canvas.height = tall * ratio;
  const pen = canvas.getContext("2d"), style = getComputedStyle(document.body);
  pen.scale(ratio, ratio);
  return { pen, width, colour: (name) => style.getPropertyValue(`--${name}`).trim() };
}
