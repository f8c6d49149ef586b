// What uPlot draws: series, bands and axes of a chart's model.

import { DARK, LIGHT } from "./colours.js";
import { drawLayers } from "./chart_layers.js";
import { planeLayers } from "./chart_plane.js";
import { axisPower, decadeTicks, formatQuantity, powerLabel, powerText, tickLabels, withUnits } from "./numbers.js";

export const FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', 'Noto Sans', 'DejaVu Sans', sans-serif";
/** Letters of an axis are no smaller than this, and rows of them this many times their size apart. */
const SMALLEST = 10.5;
const LEADING = 1.2;
const OUTER = "2b";
const INNER = "4d";

const colourOf = (method, palette) => method.colours[palette.dark ? 1 : 0];

/** The data of all series, as uPlot wants them: on a logarithmic axis there is no zero. */
export const seriesData = (model) => (model.plane ? planeSeries(model.plane) : [
  model.time,
  ...model.methods.flatMap((m) => m.lines.map(({ values }) => (model.up?.log ? values.map((v) => (v > 0 ? v : null)) : values))),
  ...(model.limits ?? []).map(({ value }) => model.time.map(() => value)),
  model.chosen.values ?? model.time.map(() => null),
]);

// of a chart in a plane it draws the axes only
const planeSeries = ({ right }) => [right, [null, null]];

/** What a plot shows: ends of both axes; null before it is drawn for the first time. */
export const seenIn = ({ scales: { x, y } }) => ({ x: x.min == null ? null : x, y: y.min == null ? null : y });

/** Show the same in another plot; the vertical axis is that of a plane, or finds its ends. */
export function showIn(plot, model, { x, y }) {
  if (x) plot.setScale("x", { min: x.min, max: x.max });
  if (y && model.plane) plot.setScale("y", { min: y.min, max: y.max });
}

/** Ends of the vertical axis with some room; what does not vary gets an axis about it. */
export function verticalRange(low, high) {
  if (low === null || high === null) return [0, 1];
  const largest = Math.max(Math.abs(low), Math.abs(high));
  const room = high - low > 1e-9 * largest ? 0.05 * (high - low) : 0.05 * largest || 0.5;
  return [low - room, high + room];
}

/** Ends of a horizontal axis that data end: all of it, or what is zoomed in. */
const wholeRange = ({ time, whole }, low, high) => (low === time[0] && high === time[time.length - 1] ? whole : [low, high]);

/** Where bars are, zero is: they stand on it. */
const fromZero = ({ methods, up }, low, high) => (low !== null && !up && methods.some(({ bars }) => bars) ? [Math.min(low, 0), Math.max(high, 0)] : [low, high]);

/** Ends of a chart's vertical axis: its own, or those of what is drawn, and not beyond where the data end the axis. */
function upRange(up, low, high) {
  if (up?.log) return [up.low, up.high];
  const [from, to] = verticalRange(low, high);
  const ends = [Math.max(from, up?.low ?? -Infinity), Math.min(to, up?.high ?? Infinity)];
  return ends[0] < ends[1] ? ends : [from, to];
}

/** The title of the horizontal axis, and how it is divided. */
function acrossAxis(model, width, scale) {
  const across = model.plane ?? model.across;
  const power = (u) => (across.linked || across.log || across.whole ? 0 : axisPower(u.scales.x.min, u.scales.x.max));
  const axis = {
    label: (u) => shortName(withUnits(across.name, across.units), (width - 90) / (7.5 * scale)) + powerLabel(power(u)),
    values: (u, ticks, _, __, step) => tickLabels(ticks, step, power(u)),
  };
  if (across.whole) axis.incrs = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
  if (across.categories) {
    const letters = Math.max(...across.texts.map((text) => Array.from(text).length));
    const room = (width / scale - 70) / (across.texts.length * 7.8);
    axis.splits = () => across.texts.map((_, k) => k + 1);
    axis.filter = (_, ticks) => ticks;
    axis.values = (u, ticks) =>
      ticks.map((k) => (k < u.scales.x.min || k > u.scales.x.max ? "" : shortName(across.texts[k - 1], Math.max(room, 14))));
    if (letters > room) Object.assign(axis, { rotate: -40, size: (30 + 4.6 * Math.min(letters, Math.max(room, 14))) * scale });
  }
  if (across.log) {
    axis.splits = (_, __, low, high) => decadeTicks(10 ** low, 10 ** high, width / (60 * scale)).map(Math.log10);
    axis.values = (_, ticks) => ticks.map((tick) => powerText(10 ** tick));
  }
  return axis;
}

/** Draw lines and marks of a chart in a plane. */
function drawPlane(u, model, palette, scale) {
  const { ctx, bbox } = u;
  const ratio = uPlot.pxRatio;
  const x = (value) => u.valToPos(value, "x", true);
  const y = (value) => u.valToPos(value, "y", true);
  const inside = (left, top) => left >= bbox.left - 1 && left <= bbox.left + bbox.width + 1 && top >= bbox.top - 1 && top <= bbox.top + bbox.height + 1;
  const colours = palette();
  const looks = { x, y, inside, colourOf: (method) => colourOf(method, colours), palette: colours, scale: scale * ratio };
  for (const { d, stroke, fill, width, dash, opacity, clipped } of planeLayers(model.methods.filter(({ shown }) => shown), looks)) {
    const path = new Path2D(d);
    ctx.save();
    if (clipped) {
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
    }
    ctx.globalAlpha = opacity ?? 1;
    ctx.setLineDash(dash ?? []);
    ctx.lineJoin = "round";
    Object.assign(ctx, { lineWidth: width, strokeStyle: stroke });
    if (fill) {
      ctx.fillStyle = fill;
      ctx.fill(path);
    }
    ctx.stroke(path);
    ctx.restore();
  }
}
/** Of many dots each is small. */
export const dotSize = ({ time }) => (time.length <= 100 ? 6 : 3.5);

/** Draw what marks places of methods, such as where a limit is passed. */
function drawMarks(u, model, palette, scale) {
  const { ctx } = u;
  for (const method of model.methods.filter((one) => one.shown && one.marks)) {
    for (const [place, value] of method.marks) {
      if (place < u.scales.x.min || place > u.scales.x.max) continue;
      ctx.beginPath();
      ctx.arc(u.valToPos(place, "x", true), u.valToPos(value, "y", true), 4.5 * scale * uPlot.pxRatio, 0, 2 * Math.PI);
      ctx.fillStyle = colourOf(method, palette());
      ctx.strokeStyle = palette().paper;
      ctx.lineWidth = 1.2 * scale * uPlot.pxRatio;
      ctx.fill();
      ctx.stroke();
    }
  }
}

/**
 * Return the options of uPlot.
 *
 * @param model - of the chart; `methods[k].shown` is read whenever it is drawn
 * @param size - { width, height, scale }: scale 2 for a picture with lines and letters of twice the size
 * @param palette - returns LIGHT or DARK, and is asked whenever the chart is drawn
 */
export function chartOptions(model, { width, height, scale = 1 }, palette) {
  const series = [{}];
  const bands = [];
  const first = () => model.methods.find((method) => method.shown);
  if (model.plane) series.push({ points: { show: false } });
  for (const method of model.plane ? [] : model.methods) {
    const start = series.length;
    method.lines.forEach((_, k) => {
      const outer = method.bands.length > 0 && !method.bands[0].bars && [method.bands[0].low, method.bands[0].high].includes(k);
      const lineWidth = (k === 0 ? method.width : 0.6 * method.width) * scale;
      series.push({
        stroke: () => {
          if (k === 0 && (method.dots || method.bars || model.boxes)) return "transparent";
          if (k === 0) return colourOf(method, palette());
          // the ends of the first method's bands are those of its areas; of the inner bands of others nothing is seen
          return outer && !model.boxes && method !== first() ? colourOf(method, palette()) : "transparent";
        },
        width: lineWidth,
        dash: method.dash.map((length) => length * Math.max(lineWidth, scale)),
        // few values are points, and the line goes on where one between them is not known
        points: { show: Boolean(method.points || method.dots) && k === 0, size: (method.dots ? dotSize(model) : 6.5) * scale, stroke: () => colourOf(method, palette()), fill: () => colourOf(method, palette()) },
        spanGaps: Boolean(method.points),
        fill: method.filled ? () => colourOf(method, palette()) + OUTER : undefined,
        show: method.shown,
        pxAlign: 0, // points between pixels: rounded ones make smooth curves jagged
      });
    });
    method.bands.forEach(({ low, high, bars }, k) => {
      if (bars || model.boxes) return;
      bands.push({
        series: [start + high, start + low],
        fill: () => (method === first() ? colourOf(method, palette()) + (k === 0 ? OUTER : INNER) : "transparent"),
      });
    });
  }
  for (const limit of model.limits ?? []) {
    const { width, dash, role } = limitLook(limit);
    const lengths = dash.map((length) => length * width * scale);
    series.push({ stroke: () => palette()[role], width: width * scale, dash: lengths, points: { show: false } });
  }
  // the last one: what the surrogate says at the chosen inputs
  const chosen = { width: model.chosen.width * scale, points: { show: false }, show: model.chosen.shown, pxAlign: 0 };
  if (!model.plane) series.push({ stroke: () => colourOf(model.chosen, palette()), ...chosen });
  const upName = model.up?.hidden ? "" : withUnits(model.axis ?? model.output, model.units);
  const { letters, rows } = fitted(upName, (height - 60) / scale);
  const font = `${12 * scale}px ${FONT}`;
  const axis = {
    font,
    labelFont: `${13 * scale}px ${FONT}`,
    labelSize: 20 * scale,
    labelGap: 2 * scale,
    gap: 5 * scale,
    stroke: () => palette().soft,
    grid: { stroke: () => palette().grid, width: scale },
    ticks: { stroke: () => palette().grid, width: scale, size: 5 * scale },
  };
  return {
    width,
    height,
    series,
    bands,
    padding: [10 * scale, 20 * scale, 0, 0],
    legend: { show: false },
    scales: {
      x: { time: false, ...(model.across.ends && !model.plane ? { range: (_, low, high) => wholeRange(model, low, high) } : {}) },
      y: { distr: model.up?.log ? 3 : 1, range: (_, low, high) => model.plane?.up ?? upRange(model.up, ...fromZero(model, low, high)) },
    },
    hooks: model.plane
      ? { drawAxes: [(u) => drawUpRows(u, palette, scale)], draw: [(u) => drawPlane(u, model, palette, scale)] }
      : {
          drawAxes: [(u) => drawUpRows(u, palette, scale), (u) => drawLayers(u, model, palette, scale, true)],
          draw: [(u) => drawLayers(u, model, palette, scale, false), (u) => drawMarks(u, model, palette, scale)],
        },
    axes: [
      {
        ...axis,
        size: 28 * scale,
        space: 60 * scale,
        ...acrossAxis(model, width, scale),
      },
      {
        ...axis,
        // its rows are drawn below: uPlot writes one only
        label: "",
        labelSize: (rows.length === 1 ? 20 : letters * (1 + LEADING) + 3) * scale,
        letters,
        rows,
        log: Boolean(model.up?.log),
        // low charts have at least two ticks
        space: Math.min(34 * scale, Math.max(height / 7, 18 * scale)),
        size: (_, values) => (values ? Math.max(...values.map((v) => v.length)) * 7 + 14 : 30) * scale,
        values: (u, ticks, _, __, step) => tickLabels(ticks, step, axisPower(u.scales.y.min, u.scales.y.max)),
        ...(model.up?.hidden ? { values: (_, ticks) => ticks.map(() => ""), grid: { show: false }, ticks: { show: false } } : {}),
        ...(model.up?.log
          ? {
              splits: (_, __, low, high) => decadeTicks(low, high, Math.min(height / (34 * scale), 6), false),
              filter: (_, ticks) => ticks,
              values: (_, ticks) => ticks.map(powerText),
            }
          : {}),
      },
    ],
    cursor: {
      x: !model.plane,
      y: false,
      drag: { x: true, y: Boolean(model.plane) },
      points: model.plane ? { show: false } : { size: 7 * scale, show: meanPoint(model, scale) },
      // the place stays when the pointer leaves, so that one can read, and other charts stay there, too
      bind: { mouseleave: () => null },
    },
  };
}

/** How a limit is drawn: as a method's line, but for the name of its colour. Lines of reference are dashed, limits dotted. */
export function limitLook({ reference }) {
  const role = reference ? "soft" : "limit";
  const look = reference ? { width: 1, dash: [5, 3] } : { width: 1.6, dash: [1.25, 1.875] };
  return { ...look, role, colours: [LIGHT[role], DARK[role]] };
}

/** What a dotted line is, in words. */
export const limitName = ({ name, value, reference }, units) =>
  `${reference ? "" : "limit: "}${name} (${formatQuantity(value, units)})`;

/** Make the mark of the cursor on a mean; other lines have none. */
function meanPoint(model, scale) {
  const means = new Set();
  let next = 1;
  for (const { lines } of model.methods) {
    means.add(next);
    next += lines.length;
  }
  means.add(next + (model.limits ?? []).length);
  return (_, number) => {
    if (!means.has(number)) return undefined;
    const mark = document.createElement("div");
    Object.assign(mark.style, { width: `${7 * scale}px`, height: `${7 * scale}px`, margin: `${-3.5 * scale}px 0 0 ${-3.5 * scale}px` });
    if (model.boxes) mark.style.outline = "2px solid white";
    return mark;
  };
}

/** Rows of the label of a vertical axis, the first of them leftmost; the last one states the power of ten. */
function upRows({ rows, log }, { scales: { y } }) {
  const power = log ? "" : powerLabel(axisPower(y.min, y.max));
  return rows.map((row, k) => (k === rows.length - 1 ? row + power : row));
}

function drawUpRows(u, palette, scale) {
  const [, up] = u.axes;
  const size = up.letters * scale * uPlot.pxRatio;
  const { ctx, bbox } = u;
  ctx.save();
  Object.assign(ctx, { font: `${size}px ${FONT}`, fillStyle: palette().soft, textAlign: "center", textBaseline: "middle" });
  upRows(up, u).forEach((text, k) => {
    ctx.save();
    ctx.translate(size * (0.65 + LEADING * k), bbox.top + bbox.height / 2);
    ctx.rotate(-Math.PI / 2);
    ctx.fillText(text, 0, 0);
    ctx.restore();
  });
  ctx.restore();
}

/**
 * The size of letters with which a name has room, in pixels, and its rows: one, or two of small letters, which are still
 * read. What two have no room for loses its middle.
 */
export function fitted(name, room) {
  const count = Array.from(name).length;
  const letters = Math.min(Math.max(room / (0.577 * count), SMALLEST), 13);
  const most = room / (0.577 * letters);
  if (count <= most) return { letters, rows: [name] };
  const spaces = [...name.matchAll(/ /g)].map(({ index }) => index);
  const longer = (at) => Math.max(Array.from(name.slice(0, at)).length, Array.from(name.slice(at + 1)).length);
  const at = spaces.reduce((best, one) => (best === null || longer(one) < longer(best) ? one : best), null);
  const parts = at === null ? [name] : [name.slice(0, at), name.slice(at + 1)];
  return { letters, rows: parts.map((part) => shortName(part, most)) };
}

/** Cut the middle out of a long name: what tells names apart is often their end. */
export function shortName(name, most) {
  const letters = Array.from(name);
  if (letters.length <= most) return name;
  const half = Math.max(Math.floor(most / 2) - 1, 3);
  return `${letters.slice(0, half).join("")} … ${letters.slice(-half).join("")}`;
}

/** What the signs of a method mean, with at most so many letters of its name: inner bands are seen of the first one. */
export function namesOfSigns({ label, lines, bands, strands }, first, most) {
  const others = [...(first ? bands : bands.slice(0, 1)), ...(strands ? [strands] : [])].map(({ name }) => name);
  const signs = [lines[0].name, ...others].filter(Boolean).join(", ");
  return `${shortName(label, most)}${signs && ": "}${signs}`;
}
