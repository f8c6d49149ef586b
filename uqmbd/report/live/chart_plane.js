// Charts in the plane of two quantities: each value has a place of its own, and lines may turn back. It knows no page.

import { unpackArray } from "./arrays.js";
import { alike, formatError, formatNumber, rounding, withUnits } from "./numbers.js";

const isNumeric = (v) => v !== null && Number.isFinite(v);
const extremes = (values) => [values.reduce((a, b) => Math.min(a, b), Infinity), values.reduce((a, b) => Math.max(a, b), -Infinity)];

/** Ends with room for the marks at them; what does not vary gets an axis about it. */
function roomyEnds(values, room) {
  const [low, high] = extremes(values);
  if (!(low <= high)) return [0, 1];
  const largest = Math.max(Math.abs(low), Math.abs(high));
  const away = high - low > 1e-9 * largest ? room * (high - low) : 0.5 * largest || 0.5;
  return [low - away, high + away];
}

function strandsOf({ shape: [count, length], values }, origin) {
  const rounded = rounding(values);
  return Array.from({ length: count }, (_, k) => Array.from(values.subarray(k * length, (k + 1) * length), (v) => rounded(v + origin)));
}

/** Add to methods where their values are along the horizontal axis; `right` and `up` are the ends of both axes. */
export function planeOf({ plane, up }, methods) {
  const position = plane.log ? Math.log10 : (v) => v;
  for (const method of methods) {
    method.places = Array.from(unpackArray(method.places).values, (v) => (Number.isNaN(v) ? null : v));
    method.positions = method.places.map((v) => (v === null ? null : position(v)));
    const { strands } = method;
    if (strands) {
      const [x, y] = [strands.across, strands.up].map((packed, k) => strandsOf(unpackArray(packed), strands.origin[k]));
      method.strands = { name: strands.name, at: strands.at, x, y };
    }
  }
  const all = (own, many) => methods.flatMap((method) => [...method[own] ?? method.lines[0].values, ...(method.strands?.[many].flat() ?? [])]).filter(isNumeric);
  return { ...plane, right: roomyEnds(all("positions", "x"), 0.04), up: up ? [up.low, up.high] : roomyEnds(all("values", "y"), 0.05) };
}

/** Indices of a method at which it has a mark. */
const marked = ({ positions, lines: [{ values }] }) => positions.flatMap((x, k) => (isNumeric(x) && isNumeric(values[k]) ? [k] : []));

/** The index of the mark that is nearest to a place on the screen; `at(x, y)` returns the place of a mark, in pixels. */
export function nearestMark({ methods }, [left, top], at, otherwise) {
  let [found, least] = [otherwise, Infinity];
  for (const method of methods.filter(({ shown, quiet }) => shown && !quiet)) {
    for (const k of marked(method)) {
      const [x, y] = at(method.positions[k], method.lines[0].values[k]);
      const distance = (x - left) ** 2 + (y - top) ** 2;
      if (distance < least) [found, least] = [k, distance];
    }
  }
  return found;
}

const HALF_SIDE = 0.5 * Math.sqrt(Math.PI);
const polygon = (corners) => `M${corners.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`).join("L")}Z`;
const SHAPES = {
  disc: (x, y, r) => `M${(x - r).toFixed(2)} ${y.toFixed(2)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`,
  square: (x, y, r) => polygon([[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => [x + HALF_SIDE * r * a, y + HALF_SIDE * r * b])),
  diamond: (x, y, r) => polygon([[0, -1], [1, 0], [0, 1], [-1, 0]].map(([a, b]) => [x + 1.25 * r * a, y + 1.25 * r * b])),
  up: (x, y, r) => polygon([[0, -1.3], [1.15, 0.8], [-1.15, 0.8]].map(([a, b]) => [x + r * a, y + r * b])),
  down: (x, y, r) => polygon([[0, 1.3], [1.15, -0.8], [-1.15, -0.8]].map(([a, b]) => [x + r * a, y + r * b])),
  plus: (x, y, r) => arms(x, y, r, [1, 0]),
  cross: (x, y, r) => arms(x, y, r, [Math.SQRT1_2, Math.SQRT1_2]),
};

/** A cross with arms along a direction and across it. */
function arms(x, y, r, [c, s]) {
  const [long, thin] = [1.25 * r, 0.4 * r];
  const outline = [[thin, thin], [thin, long], [-thin, long], [-thin, thin], [-long, thin], [-long, -thin], [-thin, -thin], [-thin, -long], [thin, -long], [thin, -thin], [long, -thin], [long, thin]];
  return polygon(outline.map(([a, b]) => [x + c * a - s * b, y + s * a + c * b]));
}

/** The outline of a mark, as a path of SVG, which a canvas draws, too. */
export const markPath = (shape, x, y, radius) => (SHAPES[shape] ?? SHAPES.disc)(x, y, radius);

/** How the mark of a method is painted. */
export function markLook(method, colour, paper, scale = 1) {
  return method.hollow ? { fill: paper, stroke: colour, width: 1.4 * scale } : { fill: colour, stroke: paper, width: 0.6 * scale };
}

const radiusOf = (method) => (method.size ?? 7) / 2;

function linePath(positions, values, x, y) {
  let text = "";
  let pen = "M";
  positions.forEach((place, k) => {
    if (!isNumeric(place) || !isNumeric(values[k])) pen = "M";
    else {
      text += `${pen}${x(place).toFixed(2)} ${y(values[k]).toFixed(2)}`;
      pen = "L";
    }
  });
  return text;
}

/**
 * What a chart of this kind draws, from beneath to above: { d, stroke, fill, width, dash, opacity, clipped }, with `d` a
 * path of SVG. `x` and `y` tell where positions are, `inside(x, y)` whether a mark is seen.
 */
export function planeLayers(methods, { x, y, inside, colourOf, palette, scale }) {
  const layers = [];
  for (const method of methods) {
    const [{ values }] = method.lines;
    const colour = colourOf(method);
    if (method.strands) {
      const d = method.strands.x.map((one, k) => linePath(one, method.strands.y[k], x, y)).join("");
      layers.push({ d, stroke: palette.soft, width: 0.7 * scale, opacity: 0.35, clipped: true });
    }
    if (method.joined) {
      const dash = method.dash.map((length) => length * method.width * scale);
      layers.push({ d: linePath(method.positions, values, x, y), stroke: colour, width: method.width * scale, dash, clipped: true });
    }
    if (method.shape) {
      const places = marked(method).map((k) => [x(method.positions[k]), y(values[k])]).filter((place) => inside(...place));
      const d = places.map((place) => markPath(method.shape, ...place, radiusOf(method) * scale)).join("");
      layers.push({ d, ...markLook(method, colour, palette.paper, scale) });
    }
  }
  return layers;
}

/** Heads of the table of values. */
export function planeHeads(model) {
  const value = model.up?.hidden ? [] : [withUnits(model.axis ?? model.output, model.units)];
  return [...value, withUnits(model.plane.name, model.plane.units), ...textNames(model)];
}

const textNames = ({ methods }) => [...new Set(methods.flatMap(({ texts }) => (texts ?? []).map(({ name }) => name)))];
const textAt = ({ texts }, name, index) => (texts ?? []).find((one) => one.name === name)?.values[index] || "–";

/** Values of methods in words, with the digits that the ends of their axis need. */
const alikeWithin = (values, [low, high]) => alike(values, (high - low) / 10, Math.max(Math.abs(low), Math.abs(high)));

function placesText({ plane }, places) {
  if (plane.whole) return places.map((v) => formatNumber(v, 1));
  if (plane.log) return places.map((v) => formatError(v));
  return alikeWithin(places, plane.right);
}

/** What stands beneath these heads for each method at an index. */
export function planeRows(model, index) {
  const { methods, plane, up, digits } = model;
  const here = methods.map(({ places, lines: [{ values }] }) => isNumeric(values[index]) && isNumeric(places[index]));
  const values = methods.map(({ lines: [line] }, k) => (here[k] ? line.values[index] : null));
  const told = digits ? values.map((v) => formatError(v)) : alikeWithin(values, plane.up);
  const places = placesText(model, methods.map(({ places: own, quiet }, k) => (here[k] && !quiet ? own[index] : null)));
  return methods.map((method, k) => [
    ...(up?.hidden ? [] : [told[k]]),
    places[k],
    ...textNames(model).map((name) => (here[k] ? textAt(method, name, index) : "–")),
  ]);
}

/** The same as words, of the methods that are shown and have a mark there. */
export function planeSentence(model, index) {
  const quantity = (text, units) => (units === "" ? text : `${text} ${units}`);
  const parts = planeRows(model, index).flatMap((texts, k) => {
    const method = model.methods[k];
    if (!method.shown || texts.every((text) => text === "–")) return [];
    const rest = [...texts];
    const value = model.up?.hidden ? [] : [`${model.axis ?? model.output} ${quantity(rest.shift(), model.units)}`];
    const place = rest.shift();
    const words = [...value, ...(place === "–" ? [] : [`${model.plane.name} ${quantity(place, model.plane.units)}`]), ...rest.filter((text) => text !== "–")];
    return [`${model.methods.length > 1 ? `${method.label}: ` : ""}${words.join(", ")}`];
  });
  return parts.join(". ");
}

/** Columns of the data as CSV besides those along which the cursor moves: name and values of each. */
export function planeColumns(model) {
  const { plane, output, units, time, up } = model;
  return model.methods.filter(({ quiet }) => !quiet).flatMap(({ label, places, lines: [{ values }], texts, strands }) => {
    const own = [[withUnits(`${plane.name} by ${label}`, plane.units), places]];
    if (!up?.hidden) own.push([withUnits(`${output} by ${label}`, units), values]);
    for (const one of texts ?? []) own.push([`${one.name} of ${label}`, one.values]);
    for (const [k, x] of (strands?.x ?? []).entries()) {
      const spread = (line) => time.map((_, n) => line[strands.at.indexOf(n)] ?? null);
      own.push([withUnits(`${plane.name} of realisation ${k + 1} by ${label}`, plane.units), spread(x)]);
      own.push([withUnits(`${output} of realisation ${k + 1} by ${label}`, units), spread(strands.y[k])]);
    }
    return own;
  });
}
