// A chart as a file: its data as CSV, what it shows as PNG.

import { shownOf } from "./chart_model.js";
import { chartOptions, namesOfSigns, seriesData, shortName, showIn } from "./chart_options.js";
import { markLook, markPath } from "./chart_plane.js";
import { LIGHT } from "./colours.js";

const PICTURE = { width: 1600, height: 760, scale: 2 };

/** A name that every system takes for a file. */
export function fileName(name, ending) {
  const plain = name.replace(/[^A-Za-z0-9_.+-]+/g, "-").replace(/^[-.]+|[-.]+$/g, "");
  return `${plain.slice(0, 80) || "chart"}.${ending}`;
}

/** Hand a file to the reader; `address` is that of data, or of a blob. */
export function saveAs(address, name) {
  const link = document.createElement("a");
  link.href = address;
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
}

/** The same, of a blob. */
export function saveBlob(blob, name) {
  const address = URL.createObjectURL(blob);
  saveAs(address, name);
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** Draw the mark of a method before its name. */
function drawSample(pen, method, x, y, scale) {
  const { fill, stroke, width } = markLook(method, method.colours[0], LIGHT.paper, scale);
  const path = new Path2D(markPath(method.shape, x, y, ((method.size ?? 7) / 2) * scale));
  pen.setLineDash([]);
  Object.assign(pen, { fillStyle: fill, strokeStyle: stroke, lineWidth: width });
  pen.fill(path);
  pen.stroke(path);
}

/** Draw what a chart shows, with the names of its methods, on a canvas: always in the colours of paper. */
export async function pictureOf(model, seen) {
  const chart = new uPlot(chartOptions(model, PICTURE, () => LIGHT), seriesData(model));
  showIn(chart, model, seen);
  await new Promise((done) => setTimeout(done, 0));
  const drawn = chart.ctx.canvas;
  const shown = shownOf(model);
  const ratio = drawn.width / PICTURE.width;
  const titled = model.title ? 1 : 0;
  const line = 40 * ratio;
  const canvas = document.createElement("canvas");
  canvas.width = drawn.width;
  canvas.height = drawn.height + line * (shown.length + titled + 0.5);
  const pen = canvas.getContext("2d");
  pen.fillStyle = LIGHT.paper;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.font = `${26 * ratio}px system-ui, sans-serif`;
  pen.textBaseline = "middle";
  pen.fillStyle = LIGHT.ink;
  if (titled) pen.fillText(shortName(model.title, 60), 30 * ratio, 0.75 * line);
  shown.forEach((method, k) => {
    const y = line * (k + titled + 0.75);
    const width = 2 * method.width * ratio;
    pen.strokeStyle = method.colours[0];
    pen.lineWidth = method.bars ? 0.5 * line : width;
    pen.setLineDash(method.dash.map((length) => length * width));
    pen.beginPath();
    pen.moveTo(30 * ratio, y);
    pen.lineTo(120 * ratio, y);
    if (method.joined || !method.shape) pen.stroke();
    if (method.shape) drawSample(pen, method, 75 * ratio, y, 2 * ratio);
    pen.fillStyle = LIGHT.ink;
    pen.fillText(namesOfSigns(method, k === 0, 60), 140 * ratio, y);
  });
  pen.drawImage(drawn, 0, line * (shown.length + titled + 0.5));
  chart.destroy();
  return canvas;
}
