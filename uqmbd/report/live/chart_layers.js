// What a chart has besides lines: ranges at places, bars over categories, boxes in a plane. Where they are, in values.

import { DARK, LIGHT } from "./colours.js";

const APART = 6;

/** Ranges of the methods that are shown, as bars from their low to their high ends, pixels beside one another. */
export function rangesOf({ methods, time }) {
  const shown = methods.filter((method) => method.shown && method.bands.some(({ bars }) => bars));
  return shown.flatMap((method, k) =>
    method.bands.filter(({ bars }) => bars).flatMap(({ low, high }) =>
      time.flatMap((place, j) => {
        const ends = [method.lines[low].values[j], method.lines[high].values[j]];
        return ends.includes(null) ? [] : [{ method, place, ends, shift: APART * (k - (shown.length - 1) / 2) }];
      })));
}

/** Bars of the methods that are shown, from `from` on: beside one another at each category. */
export function barsOf({ methods, time, base = 0 }) {
  const shown = methods.filter((method) => method.shown && method.bars);
  const wide = 0.7 / shown.length;
  return shown.flatMap((method, k) =>
    time.flatMap((place, j) => {
      const value = method.lines[0].values[j];
      const left = place - 0.35 + k * wide;
      return value === null ? [] : [{ method, left, right: left + 0.94 * wide, value, from: base }];
    }));
}

/** By which share between the least and the largest a box is shaded. */
export function shadeShare({ shade, ends, log }, k) {
  const of = log ? Math.log : (v) => v;
  const value = shade[k] === null ? null : Math.min(Math.max(shade[k], ends[0]), ends[1]);
  return value === null ? null : ends[1] > ends[0] ? (of(value) - of(ends[0])) / (of(ends[1]) - of(ends[0])) : 0;
}

/** A colour between those of the least and the largest. */
export function shadeColour(share, dark) {
  const stops = (dark ? DARK : LIGHT).shades;
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1);
  const k = Math.min(Math.floor(at), stops.length - 2);
  const part = (colour, from) => Number.parseInt(colour.slice(from, from + 2), 16);
  const mixed = [1, 3, 5].map((from) => Math.round(part(stops[k], from) * (1 - at + k) + part(stops[k + 1], from) * (at - k)));
  return `rgb(${mixed.join(",")})`;
}

/** The order in which boxes are drawn: what matters most is over the others. */
export const boxOrder = ({ shade }) => shade.map((_, k) => k).sort((a, b) => (shade[a] ?? -Infinity) - (shade[b] ?? -Infinity));

/** The box that is seen at a place in the plane; null where there is none. */
export function boxAt({ boxes, methods: [{ lines, bands }] }, x, y) {
  const [low, high] = [lines[bands[0].low].values, lines[bands[0].high].values];
  const found = boxOrder(boxes).filter((k) => boxes.left[k] <= x && x <= boxes.right[k] && low[k] <= y && y <= high[k]);
  return found.length > 0 ? found[found.length - 1] : null;
}

/** Draw on the canvas of uPlot what lies beneath its lines (`boxes`), or over them. */
export function drawLayers(u, model, palette, scale, beneath) {
  const { ctx } = u;
  const dark = palette().dark ? 1 : 0;
  const [x, y] = ["x", "y"].map((key) => (value) => u.valToPos(value, key, true));
  const { left, top, width, height } = u.bbox;
  const inside = (at) => Math.min(Math.max(Number.isNaN(at) ? top + height : at, top), top + height);
  ctx.save();
  if (beneath) {
    ctx.beginPath();
    ctx.rect(left, top, width, height);
    ctx.clip();
    if (model.boxes && model.methods[0].shown) {
      const [{ lines, bands: [band] }] = model.methods;
      for (const k of boxOrder(model.boxes)) {
        const [from, to] = [x(model.boxes.left[k]), x(model.boxes.right[k])];
        const [bottom, ceiling] = [y(lines[band.low].values[k]), y(lines[band.high].values[k])];
        const share = shadeShare(model.boxes, k);
        ctx.fillStyle = share === null ? palette().paper : shadeColour(share, dark);
        ctx.strokeStyle = palette().soft;
        ctx.lineWidth = 0.8 * scale * uPlot.pxRatio;
        ctx.fillRect(from, ceiling, to - from, bottom - ceiling);
        ctx.strokeRect(from, ceiling, to - from, bottom - ceiling);
      }
    }
    for (const { method, left: from, right, value, from: base } of barsOf(model)) {
      const ends = [inside(y(value)), inside(y(base))];
      ctx.fillStyle = method.colours[dark];
      ctx.globalAlpha = 0.8;
      ctx.fillRect(x(from), Math.min(...ends), x(right) - x(from), Math.max(Math.abs(ends[1] - ends[0]), uPlot.pxRatio));
    }
  } else {
    for (const { method, place, ends, shift } of rangesOf(model)) {
      if (place < u.scales.x.min || place > u.scales.x.max) continue;
      ctx.strokeStyle = method.colours[dark];
      ctx.lineWidth = 3 * scale * uPlot.pxRatio;
      ctx.beginPath();
      for (const [k, end] of ends.entries()) {
        ctx[k === 0 ? "moveTo" : "lineTo"](x(place) + shift * scale * uPlot.pxRatio, inside(y(end)));
      }
      ctx.stroke();
    }
  }
  ctx.restore();
}
