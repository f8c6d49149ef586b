// What-if: a slider for each input; the stored surrogate is evaluated there for tables, charts and the player.

import { unpackArray } from "./arrays.js";
import { button, element, oncePerPicture } from "./dom.js";
import { meanGerms, randomGerms } from "./germs.js";
import { announceInputs } from "./inputs_bus.js";
import { inputRow } from "./input_row.js";
import { limitAt, marginAt } from "./limits.js";
import { formatError, formatNumber, formatQuantity, nearestIndex, unbroken, withSamePower } from "./numbers.js";
import { NearestRealisation } from "./nearest.js";
import { LiveSurrogate } from "./surrogate.js";
import { onTime, pageTime } from "./time_bus.js";

/** Statistics of outputs beside a surrogate, unpacked. */
const known = (data) => data && { mean: unpackArray(data.mean).values, std: unpackArray(data.std).values };

/** The ends of germ k in which all surrogates state their errors; null where none does. */
function verifiedOf(surrogates, k) {
  const ranges = surrogates.map(({ germs }) => germs[k].verified).filter((range) => range !== null);
  return ranges.length ? [Math.max(...ranges.map(([low]) => low)), Math.min(...ranges.map(([, high]) => high))] : null;
}

/** Make sliders and table of a panel. */
export function makeExplorer(panel, data) {
  const kinds = [data.histories, data.scalars].filter((one) => one !== null);
  const parts = kinds.map((one) => ({ surrogate: one.surrogate.nearest ? new NearestRealisation(one.surrogate) : new LiveSurrogate(one.surrogate), about: known(one) }));
  const margins = data.margins && new LiveSurrogate(data.margins.surrogate);
  const surrogates = [...parts.map((part) => part.surrogate), ...(margins ? [margins] : [])];
  const [surrogate] = surrogates;
  const means = meanGerms(surrogate);
  const germs = Float64Array.from(means);
  const evaluated = kinds.some((one) => one.surrogate.fitted) ? "polynomials that are fitted to the surrogate" : "the surrogate";
  let time = pageTime();

  // the sliders
  const rows = surrogate.inputs.map((_, k) =>
    inputRow(surrogate, k, means[k], verifiedOf(surrogates, k), (germ) => {
      germs[k] = germ;
      moved();
    }),
  );
  const set = (to) => {
    rows.forEach((row) => row.accept());
    germs.set(to);
    moved();
  };
  const docked = button("Keep in view", "Keep the sliders in view while the page is scrolled", () => {
    const on = panel.classList.toggle("docked");
    docked.textContent = on ? "Put back" : "Keep in view";
    docked.setAttribute("aria-pressed", String(on));
  });
  docked.setAttribute("aria-pressed", "false");
  const tools = element(
    "div",
    { class: "tools" },
    button("All at their means", "Reset all inputs to their means", () => set(means)),
    button("Another realisation", "Draw all inputs from their distributions", () => set(randomGerms(surrogate))),
    docked,
  );
  const status = element("p", { class: "state", role: "status" });
  // the main contributor comes first
  const list = element("div", { class: "inputs-list" }, ...(data.order ?? rows.map((_, k) => k)).map((k) => rows[k].row));
  const box = element("div", { class: "chart inputs-box", role: "group", "aria-label": "Inputs" }, tools, list, status);

  // the outputs
  const caption = element("caption");
  const at = data.nearest ? "Nearest realisation" : "At these inputs";
  const heads = ["Output", at, "Mean ± standard deviation", data.nearest ? "Five nearest" : "Stated error"];
  const cells = [];
  const body = element("tbody");
  parts.forEach(({ surrogate: own }, p) =>
    own.outputs.forEach(({ name }, o) => {
      const row = [0, 1, 2].map(() => element("td", { class: "number" }));
      cells.push({ p, o, row });
      body.append(element("tr", {}, element("th", { scope: "row" }, name), ...row));
    }),
  );
  const head = element("thead", {}, element("tr", {}, ...heads.map((text) => element("th", { scope: "col" }, text))));
  const table = element("div", { class: "wide readout", tabindex: 0, role: "region", "aria-label": "Outputs at these inputs" }, element("table", {}, caption, head, body));
  panel.append(box);
  if (parts.length) panel.append(table);

  // the requirements: limits of outputs, then those that have a surrogate of their margins
  const verdicts = data.limits.map((limit) => {
    const units = parts.flatMap(({ surrogate: own }) => own.outputs).find(({ name }) => name === limit.output).units;
    const sign = limit.end === "highest" ? "≤" : "≥";
    const cell = element("td", { class: "text" });
    const name = element("th", { scope: "row" }, limit.requirement);
    const relation = element("td", { class: "text" }, `${limit.output} ${sign} ${formatQuantity(limit.limit, units)}`);
    const find = (outputs) => limitAt(limit, outputs.get(limit.output), units);
    return { find, cell, row: element("tr", {}, name, relation, cell) };
  });
  for (const { name, meaning } of margins ? data.margins.requirements : []) {
    const o = margins.outputs.findIndex((one) => one.name === name);
    const cell = element("td", { class: "text" });
    const find = () => marginAt(margins.values[o], margins.statedRms && margins.statedRms[o], margins.outputs[o].units);
    verdicts.push({ find, cell, row: element("tr", {}, element("th", { scope: "row" }, name), element("td", { class: "text" }, meaning), cell) });
  }
  if (verdicts.length) {
    const titles = ["Requirement", "Condition", at].map((text) => element("th", { scope: "col" }, text));
    const notes = [];
    if (data.limits.length) notes.push(`Limits of outputs are compared with these outputs, at the ${data.nearest ? "stored" : "output"} times.`);
    if (margins) notes.push(`${data.limits.length ? "Other requirements are" : "Requirements are"} evaluated by a surrogate of their margins, or of the smallest margin over time${margins.outputs.every(({ units }) => units) ? "" : ", in the units of the limit"}.`);
    const about = element("caption", {}, notes.join(" "));
    const all = element("table", {}, about, element("thead", {}, element("tr", {}, ...titles)), element("tbody", {}, ...verdicts.map(({ row }) => row)));
    panel.append(element("div", { class: "wide readout limits", tabindex: 0, role: "region", "aria-label": "Requirements at these inputs" }, all));
  }

  function read() {
    const { times } = parts.find(({ surrogate: own }) => own.times)?.surrogate ?? {};
    const index = times ? nearestIndex(times, time ?? times[times.length - 1]) : 0;
    const source = data.nearest ? `of the nearest realisation, sample ${surrogate.numbers[surrogate.row]} of ${data.method}` : `by ${evaluated} of ${data.method}`;
    caption.textContent = times ? `At ${formatNumber(times[index], (times[times.length - 1] - times[0]) / 10)} s, ${source}` : `${source[0].toUpperCase()}${source.slice(1)}`;
    for (const { p, o, row } of cells) {
      const { surrogate: own, about } = parts[p];
      const at = o * own.count + (own.times ? index : 0);
      const { units } = own.outputs[o];
      const spread = about.std[at];
      row[0].textContent = unbroken(formatQuantity(own.values[at], units, spread));
      row[1].textContent = unbroken(`${formatNumber(about.mean[at], spread)} ± ${formatQuantity(spread, units)}`);
      if (own.nearest) row[2].textContent = unbroken(withSamePower(own.rangeAt(at), spread).join(" to ") + (units === "" ? "" : ` ${units}`));
      else row[2].textContent = unbroken(own.statedRms ? formatError(own.statedRms[at], units) : "unknown");
    }
  }

  /** Values of all outputs by their names, after an evaluation. */
  function valuesNow() {
    const outputs = new Map();
    for (const { surrogate: own } of parts) {
      own.outputs.forEach(({ name }, o) => {
        const part = (all) => all && all.subarray(o * own.count, (o + 1) * own.count);
        outputs.set(name, { times: own.times, values: part(own.values), rms: part(own.statedRms), nearest: own.nearest ?? false });
      });
    }
    return outputs;
  }

  function judge(outputs) {
    for (const { find, cell } of verdicts) {
      const { kind, words } = find(outputs);
      cell.textContent = `${{ met: "✓", violated: "✗", near: "?", unknown: "–" }[kind]} ${words}`;
      cell.className = `text verdict-${kind}`;
    }
  }

  /** Which realisation is shown in place of the chosen inputs. */
  function whichIsNearest() {
    const inputs = Array.from(surrogate.point, (x, k) => `${surrogate.inputs[k].name} = ${formatQuantity(x, surrogate.inputs[k].units, surrogate.scales[k])}`);
    return `The values are those of the nearest of ${data.nearest} stored realisations, sample ${surrogate.numbers[surrogate.row]}: ${inputs.join(", ")}.`;
  }

  const evaluate = oncePerPicture(() => {
    const beyond = { outside: new Set(), unverified: new Set() };
    for (const own of surrogates) {
      const { outside, unverified } = own.evaluate(germs);
      outside.forEach((k) => beyond.outside.add(k));
      unverified.forEach((k) => beyond.unverified.add(k));
    }
    const outputs = valuesNow();
    const inputs = surrogate.inputsAt(germs);
    rows.forEach((row, k) => row.show(germs, inputs[k]));
    const names = (numbers) => [...numbers].map((k) => surrogate.germs[k].name).join(", ");
    const said = [];
    if (beyond.outside.size) said.push(`Outside the distribution: ${names(beyond.outside)}.`);
    if (beyond.unverified.size) said.push(`Outside the verification realisations, so the error is unknown: ${names(beyond.unverified)}.`);
    if (data.nearest) said.push(whichIsNearest());
    status.textContent = said.join(" ");
    read();
    judge(outputs);
    announceInputs({ germs, outputs });
  });
  function moved() {
    // paper has the chosen values
    panel.closest("section")?.classList.add("moved");
    evaluate();
  }
  onTime(panel, (to) => {
    time = to;
    read();
  });

  // at first it only says where it is: nothing else changes before a slider does
  surrogates.forEach((own) => own.evaluate(germs));
  const inputs = surrogate.inputsAt(germs);
  rows.forEach((row, k) => row.show(germs, inputs[k]));
  if (data.nearest) status.textContent = whichIsNearest();
  read();
  judge(valuesNow());
}

/** Begin: every panel with a surrogate gets its sliders. */
export function startExplorers() {
  for (const panel of document.querySelectorAll(".explorer")) {
    const data = panel.querySelector('script[type="application/json"]');
    if (data) makeExplorer(panel, JSON.parse(data.textContent));
  }
}
