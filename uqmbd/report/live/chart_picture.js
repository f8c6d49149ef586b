// A chart as a picture: a drawing (SVG) for paper and files, or pixels (PNG). uPlot draws both; the legend is ours.

import { shadeColour } from "./chart_layers.js";
import { shownOf } from "./chart_model.js";
import { FONT, chartOptions, limitLook, limitName, namesOfSigns, seriesData, shortName, showIn } from "./chart_options.js";
import { markLook, markPath } from "./chart_plane.js";
import { LIGHT } from "./colours.js";
import { formatError, withUnits } from "./numbers.js";
import { SvgPen, shape, withPen } from "./svg_canvas.js";

const FILE = { width: 800, height: 380 };
const PAPER = { width: 660, height: 290 };
// half as wide as the page, beside another one
const PART = { width: 400, height: 206 };
const ROW = 18;
// the width of a letter of the legend, as wide as they come on the whole
const LETTER = 6.6;

/** Draw the line or the mark of a method. */
function drawSample(pen, method, x, y) {
  const [colour] = method.colours;
  pen.save();
  Object.assign(pen, { strokeStyle: colour, fillStyle: colour, lineWidth: method.bars ? 9 : method.width });
  pen.setLineDash(method.dash.map((length) => length * method.width));
  pen.beginPath();
  if (method.dots) pen.arc(x + 18, y, 3, 0, 2 * Math.PI);
  else {
    pen.moveTo(x, y);
    pen.lineTo(x + 36, y);
  }
  if (method.dots) pen.fill();
  else if (method.joined || !method.shape) pen.stroke();
  if (method.shape) {
    const { fill, stroke, width } = markLook(method, colour, LIGHT.paper);
    const path = new Path2D(markPath(method.shape, x + 18, y, (method.size ?? 7) / 2));
    pen.setLineDash([]);
    Object.assign(pen, { fillStyle: fill, strokeStyle: stroke, lineWidth: width });
    pen.fill(path);
    pen.stroke(path);
  }
  pen.restore();
}

function drawShades(pen, x, y) {
  for (let k = 0; k < 12; k++) {
    pen.fillStyle = shadeColour(k / 11, false);
    pen.fillRect(x + 6 * k, y - 5, 6, 10);
  }
}

/** Rows of the legend of a chart: what each draws before its text, and this text. */
function rowsOf(model, width, bare) {
  const room = Math.floor((width - 62) / LETTER);
  const rows = model.title ? [{ text: shortName(model.title, 50), bold: true }] : [];
  shownOf(model).forEach((method, k) => {
    if (bare) return;
    wrapped(namesOfSigns(method, k === 0, 50), room).forEach((text, n) => rows.push({ sample: n === 0 ? (pen, y) => drawSample(pen, method, 12, y) : null, text }));
  });
  if (model.boxes) {
    const { name, units, ends } = model.boxes;
    rows.push({ sample: (pen, y) => drawShades(pen, 12, y), text: `${withUnits(name, units)}: ${ends.map((end) => formatError(end)).join(" to ")}`, left: 92 });
  }
  for (const limit of model.limits ?? []) {
    rows.push({ sample: (pen, y) => drawSample(pen, limitLook(limit), 12, y), text: shortName(limitName(limit, model.units), room) });
  }
  return rows;
}

function drawRows(pen, rows) {
  pen.textBaseline = "middle";
  rows.forEach(({ sample, text, bold, left = 56 }, k) => {
    const y = ROW * (k + 0.6);
    sample?.(pen, y);
    pen.font = `${bold ? "600 " : ""}12px ${FONT}`;
    pen.fillStyle = LIGHT.ink;
    pen.fillText(text, bold ? 12 : left, y);
  });
}

/** Make a plot and draw it at once; `scale` 2 for lines and letters of twice the size. Drawings have no pixels to align with. */
function plotOf(model, seen, { width, height }, scale = 1, aligned = 1) {
  const size = { width: scale * width, height: scale * height, scale };
  const plot = new uPlot({ ...chartOptions(model, size, () => LIGHT), pxAlign: aligned }, seriesData(model));
  plot.batch(() => showIn(plot, model, seen));
  return plot;
}

function sheet(width, height, ...parts) {
  const svg = shape("svg", { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${width} ${height}`, width, height, "font-family": FONT });
  svg.append(...parts);
  return svg;
}

/** The part of a chart that is seen as a drawing, small as beside another one or not. */
export function drawingOf(model, seen, small = false) {
  const size = small || model.title ? PART : PAPER;
  // charts of one figure that have one legend stand below it on paper
  const rows = rowsOf(model, size.width, small && model.sharesLegend && !(model.chosen.values && model.chosen.shown));
  const [words, lines] = [new SvgPen(), new SvgPen()];
  // uPlot draws once more when all this is over
  withPen(lines, () => plotOf(model, seen, size, 1, 0).destroy());
  const drawn = lines.take();
  withPen(words, () => drawRows(words, rows));
  const top = ROW * rows.length + 6;
  drawn.setAttribute("transform", `translate(0 ${top}) scale(${1 / uPlot.pxRatio})`);
  return sheet(size.width, top + size.height, shape("rect", { width: "100%", height: "100%", fill: LIGHT.paper }), words.root, drawn);
}

/** The text of a file. */
export const svgText = (drawing) => `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(drawing)}`;

/** The same as pixels. */
export function pixelsOf(model, seen) {
  const rows = rowsOf(model, FILE.width, false);
  const top = ROW * rows.length + 6;
  const plot = plotOf(model, seen, FILE, 2);
  const canvas = document.createElement("canvas");
  const ratio = plot.ctx.canvas.width / FILE.width;
  Object.assign(canvas, { width: FILE.width * ratio, height: (FILE.height + top) * ratio });
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.fillStyle = LIGHT.paper;
  pen.fillRect(0, 0, FILE.width, FILE.height + top);
  drawRows(pen, rows);
  pen.drawImage(plot.ctx.canvas, 0, top, FILE.width, FILE.height);
  plot.destroy();
  return canvas;
}

/** The legend of several charts, in rows as wide as the page. */
export function legendOf(model) {
  const width = 2 * PART.width + 30;
  const pen = new SvgPen();
  Object.assign(pen, { font: `12px ${FONT}`, textBaseline: "middle" });
  let [x, rows] = [12, 1];
  withPen(pen, () => model.methods.forEach((method, k) => {
    const text = namesOfSigns(method, k === 0, 50);
    const wide = 44 + LETTER * Array.from(text).length + 24;
    if (x > 12 && x + wide > width) [x, rows] = [12, rows + 1];
    drawSample(pen, method, x, ROW * (rows - 0.4));
    pen.fillStyle = LIGHT.ink;
    pen.fillText(text, x + 44, ROW * (rows - 0.4));
    x += wide;
  }));
  return sheet(width, ROW * rows + 2, pen.root);
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
