// The data of a chart, unpacked: what is drawn, told and exported. It knows no page.

import { unpackArray } from "./arrays.js";
import { chosenLine } from "./chart_chosen.js";
import { planeColumns, planeHeads, planeOf, planeRows, planeSentence } from "./chart_plane.js";
import { alike, formatError, formatQuantity, rounding, withUnits } from "./numbers.js";

const numbersOf = (packed) => Array.from(unpackArray(packed).values, (v) => (Number.isNaN(v) ? null : v));

function linesOf(lines) {
  const exact = numbersOf(lines[0].values);
  // what is stored with seven digits has no more
  const origin = lines[0].values.kind === "float32" ? exact.map((v) => (v === null ? null : Number(v.toPrecision(8)))) : exact;
  const others = lines.slice(1).map(({ name, values }) => {
    const distance = numbersOf(values);
    const rounded = rounding(distance);
    const sum = (v, k) => (v === null ? null : rounded(v + (origin[k] ?? 0)));
    return { name, values: distance.map(sum) };
  });
  return [{ name: lines[0].name, values: origin }, ...others];
}

/** Boxes in a plane: where they are along the axis, and what shades them. Across it they are the band of their line. */
function boxesOf({ left, right, shade, ...rest }) {
  const known = numbersOf(shade);
  return { ...rest, left: numbersOf(left), right: numbersOf(right), shade: known };
}

const OVER_TIME = { name: "time", units: "s", place_units: "s", linked: true };

/**
 * Unpack the data of a chart. `time` are the places along its horizontal axis, which is the time of the page unless the
 * data say what it is (`across`), and `whole` its ends; `at` are their labels: on a logarithmic axis places are
 * logarithms. In a chart in a plane (`plane`) the horizontal axis is another one, and `time` are the places of the cursor
 * along its lines.
 */
export function chartModel(data) {
  const methods = data.methods.map((method) => ({
    ...method,
    lines: linesOf(method.lines),
    columns: method.columns.map(({ values, ...column }) => ({
      ...column,
      values: numbersOf(values).map((v) => (v === null ? null : Number(v.toPrecision(8)))),
    })),
    shown: true,
  }));
  const across = data.across ?? OVER_TIME;
  const at = numbersOf(data.time);
  // an axis whose ends are given shows its limits
  const limited = data.up ? { limits: data.limits ?? [], beyond: [] } : limitsOf(methods, data.limits ?? []);
  const time = across.log ? at.map(Math.log10) : at;
  const whole = across.ends ? (across.log ? across.ends.map(Math.log10) : across.ends) : [time[0], time[time.length - 1]];
  const boxes = data.boxes && boxesOf(data.boxes);
  const plane = data.plane ? { plane: planeOf(data, methods) } : {};
  return { ...data, ...plane, ...limited, across, at, time, whole, boxes, methods, chosen: chosenLine() };
}

/** Where an index is, in words, with as many digits as the axis needs. */
export function placeAt({ at, across }, index) {
  if (across.texts) return across.texts[index];
  const spread = across.whole ? 1 : Math.abs(at[at.length - 1] - at[0]) / 10;
  return `${across.before ?? ""}${formatQuantity(at[index], across.place_units, spread)}`;
}

/** How many times the height of what is drawn a limit may be away from it: farther ones would leave a flat line. */
const REACH = 2;

/** The limits that are drawn, and those that are too far away; lines of reference are drawn. */
export function limitsOf(methods, limits) {
  const drawn = methods.flatMap(({ lines }) => lines.flatMap(({ values }) => values)).filter((v) => v !== null);
  const [low, high] = [drawn.reduce((a, b) => Math.min(a, b), Infinity), drawn.reduce((a, b) => Math.max(a, b), -Infinity)];
  const far = ({ value, reference }) => !reference && high > low && Math.max(value - high, low - value) > REACH * (high - low);
  return { limits: limits.filter((limit) => !far(limit)), beyond: limits.filter(far) };
}

/** What a chart shows: its methods, and the line of the chosen inputs as one that has no bands. */
export function shownOf({ methods, chosen }) {
  const line = chosen.values && chosen.shown ? [{ ...chosen, lines: [{ name: "value", values: chosen.values }], bands: [] }] : [];
  return [...methods.filter((method) => method.shown), ...line];
}

const namesOf = (names) => {
  const different = [...new Set(names)];
  return different.length < 3 ? different.join(" or ") : null;
};

/** Heads of the table of values: what the line is, the further values, and the outer band, where there is one. */
export function headsOf(model) {
  if (model.plane) return planeHeads(model);
  const { methods } = model;
  const bands = methods.flatMap((method) => method.bands.slice(0, 1).map((band) => band.name));
  return [
    namesOf(methods.map((method) => method.lines[0].name)) ?? "value",
    ...columnsOf(methods).map(({ name, units }) => withUnits(name, units ?? "")),
    ...(bands.length > 0 ? [namesOf(bands) ?? "band"] : []),
  ];
}

/** The further values, each once: its name, and units and digits where they are its own. */
const columnsOf = (methods) => {
  const every = methods.flatMap((method) => method.columns);
  return every.filter(({ name }, k) => every.findIndex((column) => column.name === name) === k);
};

/** For each of some sizes the smallest of those within three decades of it: they are written with the same digits. */
const alikeSizes = (sizes) =>
  sizes.map((own) => Math.min(own, ...sizes.filter((size) => size > 1e-3 * own && size < 1e3 * own)));

const sizeOf = (values) => Math.max(0, ...values.map((v) => Math.abs(v ?? 0)).filter(Number.isFinite));

const fixed = (v, decimals) => (v === null ? "–" : v.toFixed(decimals).replace("-", "−"));

/** The index at which a line is read: a bar that is known at one place, as for a whole motion, is read there. */
function placeOf({ bars }, { values }, index) {
  if (!bars) return index;
  const known = Array.from(values.keys()).filter((k) => Number.isFinite(values[k]));
  return known.length === 1 ? known[0] : index;
}

/** The cells beneath these heads for each method at an index: the value, the further values, and the outer band's ends. */
export function rowsAt(model, index) {
  if (model.plane) return planeRows(model, index);
  const besides = columnsOf(model.methods);
  const { decimals } = model;
  const told = besides.map(({ name }) =>
    model.methods.map(({ columns }) => columns.find((column) => column.name === name)?.values[index] ?? null),
  );
  const ends = model.methods.map(({ lines, bands }) =>
    bands.slice(0, 1).flatMap((band) => [band.low, band.high].map((k) => lines[k].values[placeOf(band, lines[k], index)])),
  );
  const spread = besides.length > 0 && besides[0].units === undefined ? told[0] : [];
  const spreads = ends.map(([low = null, high = null], k) => spread[k] ?? (low === null || high === null ? 0 : (high - low) / 4));
  const banded = ends.some((pair) => pair.length > 0);
  const values = model.methods.map(({ lines }, k) => [lines[0].values[index], ...ends[k]]);
  const least = Math.min(...spreads.filter((spread) => spread > 0));
  // what has no spread of its own has the digits of the others
  const sizes = alikeSizes(spreads.map((spread) => spread || (Number.isFinite(least) ? least : 0)));
  const columns = told.map((column, j) => {
    if (besides[j].digits) return column.map((v) => formatError(v));
    if (decimals !== undefined) return column.map((v) => fixed(v, decimals));
    const own = alikeSizes(column.map((v) => Math.abs(v ?? 0)));
    return column.map((v, k) => alike([v], own[k] / 10, sizeOf(column))[0]);
  });
  return model.methods.map((_, k) => {
    const [value, ...pair] =
      decimals !== undefined ? values[k].map((v) => fixed(v, decimals))
      : model.digits ? values[k].map((v) => formatError(v))
      : alike(values[k], sizes[k], sizeOf(values.flat()));
    const band = pair.length > 0 && pair.some((text) => text !== "–") ? pair.join(" to ") : "–";
    return [value, ...columns.map((texts) => texts[k]), ...(banded ? [band] : [])];
  });
}

/** The same as a sentence, of the methods that are shown. */
export function sentenceAt(model, index) {
  const where = model.across.linked ? formatQuantity(model.at[index], "s") : placeAt(model, index);
  if (model.plane) return `${where}: ${planeSentence(model, index)}`;
  const besides = columnsOf(model.methods);
  const unit = model.units === "" ? "" : ` ${model.units}`;
  const parts = rowsAt(model, index).flatMap(([value, ...others], k) => {
    const { label, lines, bands, shown } = model.methods[k];
    if (!shown) return [];
    const own = ({ units }) => (units === undefined ? unit : units === "" ? "" : ` ${units}`);
    const told = besides.map((column, j) => `, ${column.name} ${others[j]}${own(column)}`).join("");
    const range = others[besides.length];
    const band = bands.length > 0 && !(bands[0].bars && /^–/.test(range)) ? `, ${bands[0].name} from ${range}${unit}` : "";
    return [`${model.methods.length > 1 ? `${label}: ` : ""}${lines[0].name} ${value}${unit}${told}${band}`];
  });
  const { values, shown, label } = model.chosen;
  if (values && shown) parts.push(`${label[0].toUpperCase()}${label.slice(1)}: ${formatQuantity(values[index], model.units, model.methods[0].columns[0].values[index])}`);
  return `${where}: ${parts.join(". ")}`;
}

/** A cell of the head; no program takes it for a formula. */
const cell = (head) => quoted(/^[=+@\t\r-]/.test(head) ? `'${head}` : head);
const inCell = (value) => (typeof value === "number" ? String(value) : cell(value));
const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** All of the data as CSV: a row for each place along the axis. */
export function csvText(model) {
  const { across, boxes } = model;
  const columns = [[withUnits(across.name, across.units), across.categories ? across.texts : model.at]];
  if (boxes) columns.push(...["left", "right"].map((end) => [withUnits(`${end} end of ${across.name}`, across.units), boxes[end]]));
  if (model.plane) columns.push(...planeColumns(model));
  for (const { label, lines, columns: told } of model.plane ? [] : model.methods) {
    for (const { name, values, units = model.units } of [lines[0], ...told, ...lines.slice(1)]) {
      const what = model.output.startsWith(name) ? model.output : `${name} of ${model.output}`;
      columns.push([withUnits(`${what} by ${label}`, units), values]);
    }
  }
  const { values, label } = model.chosen;
  if (values) columns.push([withUnits(`${model.output} ${label}`, model.units), values]);
  const rows = model.time.map((_, k) => columns.map(([, values]) => (values[k] === null ? "" : inCell(values[k]))).join(","));
  return [columns.map(([name]) => cell(name)).join(","), ...rows, ""].join("\r\n");
}
