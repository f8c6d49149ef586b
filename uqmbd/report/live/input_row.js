// One input: its slider over the germ, its value, and its place in its distribution.

import { button, element } from "./dom.js";
import { nearestGerm } from "./germs.js";
import { formatNumber, plainNumber, withSamePower } from "./numbers.js";

const STEPS = 1000;
const CELLS = 80;
const SVG = "http://www.w3.org/2000/svg";

const drawn = (kind, attributes) => {
  const made = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
};

/** The density along a slider as a path over (0, 0) to (1, 1), its highest point at 1; bars for few values. */
export function densityPath(surrogate, k, turned) {
  const germ = surrogate.germs[k];
  const share = (x) => (turned ? 1 - x : x);
  if (germ.values) {
    const count = germ.values.length;
    const parts = Array.from(germ.levels, (level, n) => level - (n ? germ.levels[n - 1] : 0));
    const most = Math.max(...parts);
    const half = 0.3 / Math.max(count - 1, 1);
    return parts.map((part, n) => {
      const x = share(count > 1 ? n / (count - 1) : 0.5);
      return `M${x - half} 0V${part / most}H${x + half}V0Z`;
    }).join("");
  }
  const [low, high] = germ.range;
  const levels = Array.from({ length: CELLS + 1 }, (_, n) => surrogate.level(k, low + ((high - low) * n) / CELLS));
  const heights = levels.slice(1).map((level, n) => Math.max(level - levels[n], 0));
  const most = Math.max(...heights, 1e-300);
  const points = heights.map((height, n) => `${share((n + 0.5) / CELLS)} ${height / most}`);
  const [first, last] = [heights[0], heights[CELLS - 1]].map((height) => height / most);
  return `M${share(0)} 0V${first}L${points.join("L")}L${share(1)} ${last}V0Z`;
}

/** Per cents with as many digits as their distance from 0 and 100 has meaning. */
export function formatLevel(level) {
  const nearest = Math.min(level, 1 - level);
  return `${(100 * level).toFixed(nearest < 0.001 ? 2 : nearest < 0.1 ? 1 : 0)} %`;
}

/**
 * Make the row of input k.
 *
 * @param mean - the germ at the mean
 * @param verified - the ends of the germs of the realisations by which errors are stated; null: there are none
 * @param choose - is called with a germ that the reader chooses
 * @returns { row, show(germs, value), accept(): removes the text on a refused value }
 */
export function inputRow(surrogate, k, mean, verified, choose) {
  const input = surrogate.inputs[k];
  const germ = surrogate.germs[k];
  const turned = input.map !== null && input.map.kind !== "table" && input.map.scale < 0;
  const [low, high] = germ.range;
  const steps = germ.values ? germ.values.length - 1 : STEPS;
  const given = input.sum.filter(([number]) => number !== k).map(([number]) => surrogate.inputs[number].name);
  let all = surrogate.start();
  all[k] = mean;

  const toGerm = (step) => {
    const n = turned ? steps - step : step;
    return germ.values ? germ.values[n] : low + ((high - low) * n) / steps;
  };
  const toStep = (x) => {
    const n = germ.values ? germ.values.indexOf(x) : (steps * (x - low)) / (high - low);
    return turned ? steps - n : n;
  };

  const name = `input-${k}`;
  const slider = element("input", { type: "range", id: name, min: 0, max: steps, step: germ.values ? 1 : "any" });
  const units = input.units === "" ? "" : ` ${input.units}`;
  const value = input.map
    ? element("input", { type: "text", inputmode: "decimal", class: "value", "aria-label": `Value of ${input.name}${units}`, autocomplete: "off", spellcheck: "false" })
    : element("span", { class: "value" });
  const place = element("output", { class: "place", for: name });
  const density = drawn("svg", { viewBox: "0 0 1 1", preserveAspectRatio: "none", "aria-hidden": "true", class: "density" });
  const flipped = drawn("g", { transform: "matrix(1 0 0 -1 0 1)" });
  const mark = (kind, x) => drawn("line", { class: kind, x1: x, x2: x, y1: 0, y2: 1 });
  const share = (x) => Math.min(Math.max(toStep(x) / Math.max(steps, 1), 0), 1);
  const needle = mark("needle", 0);
  const shades = germ.values || !verified ? [] : [[0, Math.min(...verified.map(share))], [Math.max(...verified.map(share)), 1]];
  const beyond = shades.filter(([from, to]) => to > from).map(([from, to]) => drawn("rect", { class: "unverified", x: from, y: 0, width: to - from, height: 1 }));
  flipped.append(...beyond, drawn("path", { d: densityPath(surrogate, k, turned) }), mark("mean", share(mean)), needle);
  density.append(flipped);
  const about = [input.description];
  if (!input.map) about.push(input.reason);
  else if (given.length) about.push(`It depends on ${given.join(", ")} and changes with them. Its position is that among realisations with equal values of these.`);
  if (germ.values) about.push("It has only these values.");
  const reset = button("↺", `Reset ${input.name} to its ${input.map ? "mean" : "median"}`, () => pick(mean));
  reset.setAttribute("aria-label", reset.title);
  const row = element(
    "div",
    { class: "input-row" },
    element("label", { for: name, title: input.description }, input.name),
    element("span", { class: "quantity" }, value, units),
    reset,
    element("div", { class: "track" }, density, slider),
    place,
  );
  const refusal = element("p", { class: "refusal", role: "alert" });
  const said = about.filter((text) => text !== "");
  row.append(refusal);
  if (said.length) row.append(element("details", {}, element("summary", {}, given.length || !input.map ? "About this input (dependent)" : "About this input"), element("span", {}, said.join(" "))));

  /** Forget the refused value: another one is chosen. */
  function accept() {
    refusal.textContent = "";
  }
  const pick = (x) => {
    accept();
    choose(x);
  };
  slider.addEventListener("input", () => pick(toGerm(Number(slider.value))));
  // an arrow key moves a hundredth of the way, not the smallest step there is
  slider.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 }[event.key];
    if (by === undefined || germ.values) return;
    event.preventDefault();
    pick(toGerm(Math.min(Math.max(toStep(all[k]) + (by * steps) / 100, 0), steps)));
  });
  let typing = false; // a text that is not entered yet, which an update from another input must not replace
  if (input.map) {
    value.addEventListener("input", () => (typing = true));
    value.addEventListener("blur", () => (typing = false));
    value.addEventListener("change", () => {
      typing = false;
      const text = value.value.trim().replace("−", "-").replace(",", ".");
      const wanted = text === "" ? NaN : Number(text);
      const found = surrogate.germOf(k, wanted, all);
      const [first, last] = germ.reach;
      const rounding = 1e-9 * (last - first);
      if (found >= first - rounding && found <= last + rounding) return pick(nearestGerm(germ, Math.min(Math.max(found, first), last)));
      choose(all[k]);
      refusal.textContent = Number.isFinite(wanted) ? refused(text) : "Enter a number.";
    });
  }

  /** Values of the input at two germs, in words. */
  function between(ends) {
    const scale = Math.abs(spread(all));
    const found = ends.map((end) => surrogate.inputsAt(Float64Array.from(all, (x, n) => (n === k ? end : x)))[k]);
    return withSamePower(found.sort((a, b) => a - b), scale).join(" to ") + units;
  }

  /** Why a value is not taken. */
  function refused(text) {
    const share = germ.support.includes(null) ? ", except for a share of 10⁻¹²" : "";
    const condition = given.length ? `, given ${given.join(", ")}` : "";
    return `${text.replace("-", "−")}${units} is refused. ${surrogate.nearest ? `The realisations have values of ${input.name}` : `The distribution of ${input.name} has values`} from ${between(germ.reach)}${share}${condition}.`;
  }

  function show(germs, now) {
    all = germs;
    const x = germs[k];
    const level = surrogate.level(k, x);
    const lower = turned ? 1 - level : level;
    slider.value = toStep(x);
    needle.setAttribute("x1", share(x));
    needle.setAttribute("x2", share(x));
    const scale = input.map ? Math.abs(spread(germs)) : 0;
    const text = input.map ? formatNumber(now, scale) : "";
    if (input.map && !typing) value.value = plainNumber(now, scale);
    else if (!input.map) value.textContent = "value unknown";
    const unverified = verified !== null && (x < verified[0] || x > verified[1]);
    row.classList.toggle("beyond-verified", unverified);
    const limits = unverified && input.map ? `. Beyond the verified range, ${between(verified)}: the error is unknown` : "";
    const told = `${formatLevel(lower)} of realisations are ${germ.values ? "this or lower" : "lower"}${given.length ? `, given ${given.join(", ")}` : ""}${limits}`;
    place.textContent = told;
    slider.setAttribute("aria-valuetext", `${text}${text ? units : ""}; ${told}`);
  }

  /** How much the value changes along the slider, for the digits that mean something. */
  function spread(germs) {
    const ends = [low, high].map((end) => surrogate.inputsAt(Float64Array.from(germs, (x, n) => (n === k ? end : x)))[k]);
    return (ends[1] - ends[0]) / 10;
  }

  return { row, show, accept };
}
