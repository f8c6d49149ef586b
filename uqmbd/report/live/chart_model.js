// The data of a chart, unpacked: what is drawn, told and exported. It knows no page.

import { unpackArray } from "./arrays.js";
import { formatNumber, formatQuantity, withUnits } from "./numbers.js";

const numbersOf = (packed) => Array.from(unpackArray(packed).values, (v) => (Number.isNaN(v) ? null : v));

/** How to round the sums of numbers and distances that have seven digits: to a hundredth of the last one. */
function rounding(distances) {
  const largest = distances.reduce((most, v) => Math.max(most, Math.abs(v ?? 0)), 0);
  const decimals = largest > 0 ? 9 - Math.floor(Math.log10(largest)) : 100;
  return decimals >= 0 && decimals < 100 ? (v) => Number(v.toFixed(decimals)) : (v) => v;
}

function linesOf(lines) {
  const origin = numbersOf(lines[0].values);
  const others = lines.slice(1).map(({ name, values }) => {
    const distance = numbersOf(values);
    const rounded = rounding(distance);
    const sum = (v, k) => (v === null || origin[k] === null ? null : rounded(v + origin[k]));
    return { name, values: distance.map(sum) };
  });
  return [{ name: lines[0].name, values: origin }, ...others];
}

/** Unpack the data of a chart. */
export function chartModel(data) {
  const methods = data.methods.map((method) => ({
    ...method,
    lines: linesOf(method.lines),
    columns: method.columns.map(({ name, values }) => ({
      name,
      values: numbersOf(values).map((v) => (v === null ? null : Number(v.toPrecision(8)))),
    })),
    shown: true,
  }));
  return { ...data, time: numbersOf(data.time), methods };
}

/** The index of the time that is nearest to one. */
export function nearestIndex(times, time) {
  let low = 0;
  let high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return time - times[low] <= times[high] - time ? low : high;
}

/** What is told of each method at an index: the mean, the standard deviation, and the outer band. */
export function rowsAt(model, index) {
  return model.methods.map(({ label, lines, bands, columns }) => {
    const spread = columns[0].values[index];
    const end = (line) => formatNumber(lines[line].values[index], spread);
    return {
      label,
      mean: formatNumber(lines[0].values[index], spread),
      std: formatNumber(spread),
      low: end(bands[0].low),
      high: end(bands[0].high),
    };
  });
}

/** The same as a sentence, of the methods that are shown. */
export function sentenceAt(model, index) {
  const told = rowsAt(model, index).filter((_, k) => model.methods[k].shown);
  const parts = told.map((row, k) => {
    const { units } = model;
    const unit = units === "" ? "" : ` ${units}`;
    const name = model.methods.length > 1 ? `${row.label}: ` : "";
    return `${name}mean ${row.mean}${unit}, standard deviation ${row.std}${unit}, ${model.methods[k].bands[0].name} from ${row.low} to ${row.high}${unit}`;
  });
  return `${formatQuantity(model.time[index], "s")}. ${parts.join(". ")}`;
}

const cell = (text) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);

/** All of the data as CSV: a row for each time. No cell of the head begins with a sign that programs take for a formula. */
export function csvText(model) {
  const columns = [[withUnits("time", "s"), model.time]];
  for (const { label, lines, columns: told } of model.methods) {
    for (const { name, values } of [lines[0], ...told, ...lines.slice(1)]) {
      columns.push([withUnits(`${name} of ${model.output} by ${label}`, model.units), values]);
    }
  }
  const rows = model.time.map((_, k) => columns.map(([, values]) => (values[k] === null ? "" : String(values[k]))).join(","));
  return [columns.map(([name]) => cell(name)).join(","), ...rows, ""].join("\r\n");
}
