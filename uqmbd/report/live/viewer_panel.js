// The lists next to the drawing of the viewer: what is wrong, the tree of parts, and the inputs.

import { button, element } from "./dom.js";
import { formatNumber } from "./numbers.js";

const quantity = (value, units) => `${formatNumber(value)}${units ? ` ${units}` : ""}`;

/** Rows on what is probably wrong, the most important first. */
export function findingRows(scene, facts) {
  const rows = [];
  const add = (kind, text, part = null) => rows.push({ kind, text, part });
  if (scene.note) add("bad", `Not assembled; the drawing shows the given pose. ${scene.note}`);
  for (const { component, distance, closed } of scene.gaps)
    add(closed ? "note" : "bad", `${component}: the points of the joint are ${quantity(distance, "m")} apart in the given pose${closed ? "; the assembly closed the joint" : ""}.`, { kind: "component", name: component });
  for (const { body, text } of scene.moved) add("note", `The assembly moved ${text}.`, { kind: "body", name: body });
  for (const { name, free } of scene.bodies) if (free) add("note", `${name}: no joint, spring or load is attached to this body.`, { kind: "body", name });
  if (facts) {
    if (facts.problem) add("bad", facts.problem);
    for (const one of facts.redundant) add("note", `Redundant equation: ${one}. It follows from the others.`);
    for (const one of facts.findings) add(one.severity === "warning" ? "warn" : "note", `${one.place}: ${one.text}`);
  }
  return rows;
}

export function showFindings(list, rows, mark, complete) {
  list.replaceChildren(...rows.map(({ kind, text, part }) => {
    const row = element("li", { class: kind }, text);
    if (part) markedBy(row, part, mark);
    return row;
  }));
  if (!complete) list.append(element("li", {}, "Checking …"));
  else if (!rows.length) list.append(element("li", { class: "fine" }, "Nothing was found."));
}

/** Name a part while the pointer or the focus is on its row. */
function markedBy(row, part, mark) {
  row.tabIndex = 0;
  for (const begin of ["pointerenter", "focus"]) row.addEventListener(begin, () => mark(part));
  for (const end of ["pointerleave", "blur"]) row.addEventListener(end, () => mark(null));
}

/** Bodies, and below each its components; a component of two bodies is below its last one. */
export function showTree(list, scene, mark) {
  const rowOf = (part, title, text, children) => {
    const row = element("li", { "data-kind": part.kind, "data-name": part.name }, element("span", { class: "name" }, title), text ? element("span", { class: "soft" }, ` ${text}`) : "");
    markedBy(row.firstChild, part, mark);
    if (children.length) row.append(element("ul", {}, ...children));
    return row;
  };
  const rows = scene.bodies.map(({ name }, b) => {
    const own = scene.components.filter(({ bodies }) => bodies[bodies.length - 1] === name || (bodies[bodies.length - 1] === "ground" && bodies[0] === name));
    const known = scene.ellipsoids[b];
    const children = own.map((one) => rowOf({ kind: "component", name: one.name }, one.name, `${one.type}${one.bodies.length > 1 ? `, from ${one.bodies.filter((other) => other !== name).join(", ")}` : ""}`, []));
    return rowOf({ kind: "body", name }, name, known ? quantity(known.mass, "kg") : "massless", children);
  });
  list.replaceChildren(...rows);
}

export function nameRow(tree, part) {
  for (const row of tree.querySelectorAll("li")) row.classList.toggle("named", part !== null && row.dataset.kind === part.kind && row.dataset.name === part.name);
}

const STEPS = 200;

/** A slider for each input; `choose` is called with all values after each change. */
export function showInputs(place, inputs, values, choose) {
  const now = Object.fromEntries(inputs.map(({ name, mean, low, high }) => [name, name in values && values[name] >= low && values[name] <= high ? values[name] : mean]));
  const rows = inputs.map(({ name, units, description, mean, low, high }, k) => {
    const slider = element("input", { type: "range", id: `input-${k}`, min: 0, max: STEPS, step: "any" });
    const shown = element("output", { for: `input-${k}` });
    const show = () => {
      slider.value = high > low ? (STEPS * (now[name] - low)) / (high - low) : 0;
      shown.textContent = quantity(now[name], units);
      slider.setAttribute("aria-valuetext", shown.textContent);
    };
    slider.disabled = !(high > low);
    slider.addEventListener("input", () => {
      now[name] = low + ((high - low) * Number(slider.value)) / STEPS;
      show();
      choose({ ...now });
    });
    const reset = button("↺", `Reset ${name} to its mean`, () => {
      now[name] = mean;
      show();
      choose({ ...now });
    });
    reset.setAttribute("aria-label", reset.title);
    show();
    return element("div", { class: "input" }, element("label", { for: `input-${k}`, title: description }, name), shown, reset, slider);
  });
  place.replaceChildren(...(rows.length ? rows : [element("p", { class: "soft" }, "There are no random inputs.")]));
  return { ...now };
}
