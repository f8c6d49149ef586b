// A chart as a drawing (SVG), for paper and as a file. Own code: uPlot draws on a canvas, whose pixels blur on paper.

import { barsOf, boxOrder, rangesOf, shadeColour, shadeShare } from "./chart_layers.js";
import { shownOf } from "./chart_model.js";
import { chartOptions, LEADING, limitLook, limitName, dotSize, namesOfSigns, seriesData, shortName, showIn, upRows } from "./chart_options.js";
import { markLook, markPath, planeLayers } from "./chart_plane.js";
import { LIGHT } from "./colours.js";
import { formatError, withUnits } from "./numbers.js";

const PAPER = { width: 660, height: 290 };
// half as wide as the page, beside another one
const PART = { width: 400, height: 206 };
const SPACE = "http://www.w3.org/2000/svg";
const FAMILY = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', 'Noto Sans', 'DejaVu Sans', sans-serif";
const ROW = 18;
// the width of a letter of the legend, as wide as they come on the whole
const LETTER = 6.6;

function shape(kind, attributes, text) {
  const made = document.createElementNS(SPACE, kind);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** Call `done(svg)` with the part of a chart that is seen, small as beside another one or not; in a microtask, when uPlot has chosen the axes. */
export function drawChart(model, seen, done, small = false) {
  const size = small || model.title ? PART : PAPER;
  const plot = new uPlot(chartOptions(model, size, () => LIGHT), seriesData(model));
  showIn(plot, model, seen);
  // charts of one figure that have one legend stand below it on paper
  const bare = small && model.sharesLegend && !(model.chosen.values && model.chosen.shown);
  queueMicrotask(() => {
    done(drawingOf(model, plot, size, bare));
    plot.destroy();
  });
}

/** The text of a file. */
export const svgText = (drawing) => `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(drawing)}`;

/** The legend of several charts, in rows as wide as the page. */
export function drawLegend(model) {
  const width = 2 * PART.width + 30;
  const placed = [];
  let [x, rows] = [12, 1];
  model.methods.forEach((method, k) => {
    const text = namesOfSigns(method, k === 0, 50);
    const wide = 44 + LETTER * Array.from(text).length + 24;
    if (x > 12 && x + wide > width) [x, rows] = [12, rows + 1];
    placed.push(...signShapes(method, x, ROW * (rows - 0.4), [text]));
    x += wide;
  });
  const height = ROW * rows + 2;
  const svg = shape("svg", { xmlns: SPACE, viewBox: `0 0 ${width} ${height}`, width, height, "font-family": FAMILY, "font-size": 12 });
  svg.append(...placed);
  return svg;
}

/** The line or the mark of a method, and what it is called beside it in rows of text. */
function signShapes(method, x, row, texts) {
  const look = { stroke: method.colours[0], fill: "none", ...( method.bars ? { "stroke-width": 9 } : method.dots ? { "stroke-width": 6, "stroke-linecap": "round", transform: "translate(17 0)" } : { "stroke-width": method.width, "stroke-dasharray": dashOf(method) }) };
  const shapes = [];
  if (method.joined || !method.shape) shapes.push(shape("path", { d: `M${x} ${row}h${method.dots ? 0.01 : 36}`, ...look }));
  if (method.shape) {
    const { fill, stroke, width } = markLook(method, method.colours[0], LIGHT.paper);
    shapes.push(shape("path", { d: markPath(method.shape, x + 18, row, (method.size ?? 7) / 2), fill, stroke, "stroke-width": width }));
  }
  return [...shapes, ...texts.map((text, n) => shape("text", { x: x + 44, y: row + 4 + n * ROW, fill: LIGHT.ink }, text))];
}

function drawingOf(model, plot, size, bare) {
  const shown = shownOf(model);
  const titled = model.title ? 1 : 0;
  const shaded = model.boxes ? 1 : 0;
  const limits = model.limits ?? [];
  const room = (size.width - 62) / LETTER;
  const signs = bare ? [] : shown.map((method, k) => wrapped(namesOfSigns(method, k === 0, size === PART ? 34 : 50), room));
  const named = signs.reduce((sum, rows) => sum + rows.length, 0);
  const legend = ROW * (named + titled + shaded + limits.length) + 6;
  const ratio = plot.ctx.canvas.width / size.width;
  const box = Object.fromEntries(Object.entries(plot.bbox).map(([side, value]) => [side, value / ratio]));
  const top = legend + box.top;
  const x = (value) => box.left + plot.valToPos(value, "x");
  const y = (value) => top + plot.valToPos(value, "y");
  const height = size.height + legend;
  const svg = shape("svg", { xmlns: SPACE, viewBox: `0 0 ${size.width} ${height}`, width: size.width, height, "font-family": FAMILY, "font-size": 12 });
  svg.append(shape("rect", { width: "100%", height: "100%", fill: LIGHT.paper }));
  if (titled) svg.append(shape("text", { x: 12, y: 0.6 * ROW + 4, fill: LIGHT.ink, "font-weight": 600 }, shortName(model.title, 50)));
  const [across, up] = plot.axes;
  across._splits.forEach((value, k) => {
    if (!across._values[k]) return;
    svg.append(shape("path", { d: `M${x(value)} ${top}v${box.height + 4}`, stroke: LIGHT.grid, fill: "none" }));
    const foot = top + box.height + 18;
    const turned = across._rotate ? { transform: `rotate(${across._rotate} ${x(value)} ${foot - 6})`, "text-anchor": "end" } : { "text-anchor": "middle" };
    svg.append(shape("text", { x: x(value), y: foot, ...turned, fill: LIGHT.soft }, across._values[k]));
  });
  up._splits.forEach((value, k) => {
    svg.append(shape("path", { d: `M${box.left - 4} ${y(value)}h${box.width + 4}`, stroke: LIGHT.grid, fill: "none" }));
    svg.append(shape("text", { x: box.left - 8, y: y(value) + 4, "text-anchor": "end", fill: LIGHT.soft }, up._values[k]));
  });
  svg.append(shape("text", { x: box.left + box.width / 2, y: height - 5, "text-anchor": "middle", fill: LIGHT.ink, "font-size": 13 }, across.label(plot)));
  const middle = top + box.height / 2;
  upRows(up, plot).forEach((text, k) => {
    const left = up.letters * (0.95 + LEADING * k);
    svg.append(shape("text", { x: left, y: middle, transform: `rotate(-90 ${left} ${middle})`, "text-anchor": "middle", fill: LIGHT.ink, "font-size": up.letters }, text));
  });

  // an inner drawing, which ends at its edges
  const inner = { x: box.left, y: top, width: box.width, height: box.height };
  const lines = shape("svg", { ...inner, viewBox: Object.values(inner).join(" "), fill: "none", "stroke-linejoin": "round" });
  const path = (values, spanned = false) => {
    let text = "";
    let pen = "M";
    values.forEach((value, k) => {
      if (value === null) pen = spanned ? pen : "M";
      else {
        text += `${pen}${x(model.time[k]).toFixed(2)} ${y(value).toFixed(2)}`;
        pen = "L";
      }
    });
    return text;
  };
  const within = (at) => Math.min(Math.max(Number.isNaN(at) ? top + box.height : at, top), top + box.height);
  if (model.boxes && model.methods[0].shown) {
    const [{ lines: sides, bands: [band] }] = model.methods;
    for (const j of boxOrder(model.boxes)) {
      const [left, right] = [x(model.boxes.left[j]), x(model.boxes.right[j])];
      const [bottom, ceiling] = [y(sides[band.low].values[j]), y(sides[band.high].values[j])];
      const share = shadeShare(model.boxes, j);
      const look = { fill: share === null ? LIGHT.paper : shadeColour(share, false), stroke: LIGHT.soft, "stroke-width": 0.8 };
      lines.append(shape("rect", { x: left, y: ceiling, width: right - left, height: bottom - ceiling, ...look }));
    }
  }
  for (const { method, left, right, value, from } of barsOf(model)) {
    const [one, other] = [within(y(value)), within(y(from))];
    const area = { y: Math.min(one, other), height: Math.max(Math.abs(other - one), 1), fill: method.colours[0], "fill-opacity": 0.8 };
    lines.append(shape("rect", { x: x(left), width: x(right) - x(left), ...area }));
  }
  const inside = (left, down) => left >= box.left - 1 && left <= box.left + box.width + 1 && down >= top - 1 && down <= top + box.height + 1;
  const marks = shape("g", {});
  for (const one of model.plane ? planeLayers(shown, { x, y, inside, colourOf: ({ colours }) => colours[0], palette: LIGHT, scale: 1 }) : []) {
    const look = { stroke: one.stroke, "stroke-width": one.width, "stroke-dasharray": one.dash?.join(" ") || "none", opacity: one.opacity ?? 1 };
    (one.clipped ? lines : marks).append(shape("path", { d: one.d, fill: one.fill ?? "none", ...look }));
  }
  (model.plane ? [] : shown).forEach((method, k) => {
    const [colour] = method.colours;
    (model.boxes ? [] : method.bands.filter(({ bars }) => !bars)).forEach(({ low, high }, depth) => {
      const ends = [method.lines[low].values, method.lines[high].values];
      if (k > 0) {
        const thin = { stroke: colour, "stroke-width": 0.6 * method.width, "stroke-dasharray": dashOf(method) };
        if (depth === 0) ends.forEach((values) => lines.append(shape("path", { d: path(values), ...thin })));
        return;
      }
      for (const [from, to] of runsOf(ends)) {
        const edge = (values) => values.slice(from, to).map((value, n) => `${x(model.time[from + n]).toFixed(2)} ${y(value).toFixed(2)}`);
        const d = `M${[...edge(ends[0]), ...edge(ends[1]).reverse()].join("L")}Z`;
        lines.append(shape("path", { d, fill: colour, "fill-opacity": depth === 0 ? 0.16 : 0.3 }));
      }
    });
    const [{ values }] = method.lines;
    if (method.filled) {
      for (const [from, to] of runsOf([values, values])) {
        const edge = values.slice(from, to).map((value, n) => `${x(model.time[from + n]).toFixed(2)} ${y(value).toFixed(2)}`);
        const foot = model.up?.log ? top + box.height : y(0);
        const d = `M${x(model.time[from])} ${foot}L${edge.join("L")}L${x(model.time[to - 1])} ${foot}Z`;
        lines.append(shape("path", { d, fill: colour, "fill-opacity": 0.16 }));
      }
    }
    if (method.bars || model.boxes) return;
    const dotted = method.points || method.dots ? values.flatMap((value, n) => (value === null ? [] : [[model.time[n], value]])) : [];
    if (!method.dots) lines.append(shape("path", { d: path(values, method.points), stroke: colour, "stroke-width": method.width, "stroke-dasharray": dashOf(method) }));
    for (const [place, value] of [...dotted, ...(method.marks ?? [])]) {
      lines.append(shape("circle", { cx: x(place), cy: y(value), r: method.dots ? dotSize(model) / 2.2 : method.points ? 2.8 : 4, fill: colour, stroke: LIGHT.paper, "stroke-width": 0.8 }));
    }
  });
  limits.forEach((limit, k) => {
    const { width, role, ...rest } = limitLook(limit);
    const look = { stroke: LIGHT[role], "stroke-width": width, "stroke-dasharray": dashOf({ width, ...rest }), fill: "none" };
    lines.append(shape("path", { d: `M${box.left} ${y(limit.value)}h${box.width}`, ...look }));
    const row = ROW * (named + titled + shaded + k + 0.6);
    svg.append(shape("path", { d: `M12 ${row}h36`, ...look }), shape("text", { x: 56, y: row + 4, fill: LIGHT.ink }, shortName(limitName(limit, model.units), Math.floor(room))));
  });
  svg.append(lines, marks);
  for (const { method, place, ends, shift } of rangesOf(model)) {
    if (place < plot.scales.x.min || place > plot.scales.x.max) continue;
    const [one, other] = ends.map((end) => within(y(end)));
    svg.append(shape("path", { d: `M${x(place) + shift} ${one}V${other}`, stroke: method.colours[0], "stroke-width": 3 }));
  }

  let above = titled;
  signs.forEach((texts, k) => {
    svg.append(...signShapes(shown[k], 12, ROW * (above + 0.6), texts));
    above += texts.length;
  });
  if (model.boxes) svg.append(...shadesRow(model.boxes, ROW * (named + titled + 0.6)));
  return svg;
}

function shadesRow({ name, units, ends }, row) {
  const parts = Array.from({ length: 12 }, (_, k) => shape("rect", { x: 12 + 6 * k, y: row - 5, width: 6, height: 10, fill: shadeColour(k / 11, false) }));
  return [...parts, shape("text", { x: 92, y: row + 4, fill: LIGHT.ink }, `${withUnits(name, units)}: ${ends.map((end) => formatError(end)).join(" to ")}`)];
}

/** A text in rows of so many letters at most, where its words allow it. */
function wrapped(text, most) {
  const rows = [];
  for (const word of text.split(" ")) {
    const last = rows[rows.length - 1];
    if (last !== undefined && last.length + 1 + word.length <= most) rows[rows.length - 1] = `${last} ${word}`;
    else rows.push(word);
  }
  return rows;
}

const dashOf = (method) => method.dash.map((length) => length * method.width).join(" ") || "none";

/** Ranges of indices at which both ends of a band are known. */
function runsOf([low, high]) {
  const runs = [];
  let start = null;
  for (let k = 0; k <= low.length; k++) {
    const known = k < low.length && low[k] !== null && high[k] !== null;
    if (known && start === null) start = k;
    if (!known && start !== null) {
      if (k - start > 1) runs.push([start, k]);
      start = null;
    }
  }
  return runs;
}
