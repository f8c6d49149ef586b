// Strokes of symbols on the page. Python says what a symbol is (uqmbd/report/mechanisms/symbols.py, whose `projected`
// does the same); here strokes are projected and drawn. Places on the page are in inches, y upwards.

import { axesOf, dot, hullOf, isKnown, leftOf, lengthOf, minus, plus, scaled, unitOf } from "./geometry.js";

const THICK = 4.2;
// a body that is a point
const POINT = 9;
const [FIRST, STEP, HIGH] = [0.04, 0.06, 0.05];
const BETWEEN = [0, 1e9];

/** Strokes on the right of a line; a null breaks them. */
function hatched([start, end]) {
  const along = unitOf(minus(end, start));
  const right = scaled(leftOf(along), -1);
  const strokes = [];
  const count = Math.trunc((lengthOf(minus(end, start)) - FIRST) / STEP + 1.01);
  for (let k = 0; k < count; k++) {
    const top = plus(start, along, FIRST + k * STEP);
    strokes.push(top, plus(plus(top, right, HIGH), along, -FIRST), null);
  }
  return strokes;
}

/** A shape on the page: { points, edge, face, width, closed, dashes, order, alpha }. */
const shapeOf = (points, looks) => ({ edge: "ink", face: null, width: 1, closed: false, dashes: null, order: 4, alpha: 1, ...looks, points });

/**
 * Return a stroke as a shape; null where it is not shown.
 *
 * @param view - { project, depth, unit (metres to an inch) }
 * @param stroke - one of player_data.py, with its lists of points
 * @param points, radii - in the world, m
 */
export function strokeShape(view, stroke, points, radii) {
  const { at, tips, limits, between = BETWEEN } = stroke;
  const first = at[0];
  const last = at[at.length - 1];
  const frame = stroke.axis === undefined ? null : axesOf(points[stroke.axis]);
  let measure = radii[last] / view.unit;
  const size = stroke.scaled ? measure : 1;
  const place = (from, local, metres) => {
    if (frame === null) return plus(view.project(points[from]), local.slice(0, 2), size);
    return view.project(frame.reduce((to, axis, k) => plus(to, axis, view.unit * size * local[k] + (metres ? metres[k] : 0)), points[from]));
  };
  let laid;
  if (tips === undefined) laid = stroke.points.map((p, k) => place(first, p, stroke.metres?.[k]));
  else {
    let start = place(first, tips[0]);
    const end = place(last, tips[1]);
    if (limits && frame) {
      const away = dot(minus(points[last], points[first]), frame[0]) / view.unit;
      const length = Math.min(Math.max(Math.abs(away), limits[0]), limits[1]);
      start = place(last, frame.map((_, k) => (k ? 0 : away < 0 ? length : -length)));
    }
    const span = minus(end, start);
    measure = lengthOf(span);
    const along = unitOf(span);
    const less = stroke.shrinks ? Math.min(1, measure / stroke.shrinks) : 1;
    laid = stroke.points.map(([share, ahead, left]) => plus(plus(plus(start, span, share), along, less * ahead), leftOf(along), less * left));
  }
  if (!(between[0] <= measure && measure < between[1]) || !laid.every(isKnown)) return null;
  if (stroke.facing && frame && stroke.facing * view.depth(frame[0]) > 0) return null;
  if (stroke.convex) laid = hullOf(laid);
  if (stroke.hatch) laid = hatched(laid);
  return laid.length ? shapeOf(laid, stroke) : null;
}

/** A body as the rounded link or plate that its points on the page span; `along`: as a line through the points. */
export function bodyShapes(page, role, order, along = false) {
  const rounded = page.map((p) => p.map((x) => Math.round(1e3 * x) / 1e3));
  const corners = along ? page : hullOf(rounded.filter((p, k) => rounded.findIndex((q) => q[0] === p[0] && q[1] === p[1]) === k));
  const closed = corners.length > 2 && !along;
  const shown = corners.length > 1 ? corners : [plus(corners[0], [-1e-3, 0]), plus(corners[0], [1e-3, 0])];
  const width = corners.length > 1 ? THICK : POINT;
  return [
    shapeOf(shown, { edge: role, face: closed ? role : null, width, closed, order }),
    shapeOf(shown, { edge: `pale-${role}`, face: closed ? `pale-${role}` : null, width: 0.8 * width, closed, order: order + 1e-3 }),
  ];
}

/** A body of another realisation: its outline only; `along`: a line through the points. */
export function ghostShape(page, spatial, looks, along = false) {
  if (along) return shapeOf(page, { width: 0.8, order: 1.9, ...looks });
  const corners = spatial && page.length > 3 ? hullOf(page) : page;
  if (corners.length === 1) return shapeOf([corners[0], plus(corners[0], [1e-3, 0])], { width: 0.6 * POINT, order: 1.9, ...looks });
  return shapeOf(corners, { width: 0.8, closed: corners.length > 2, order: 1.9, ...looks });
}

/** Put shapes on a canvas, from the back to the front; `inch`: pixels of an inch, `high`: of the canvas. */
export function paintShapes(context, shapes, inch, high) {
  for (const shape of [...shapes].sort((a, b) => a.order - b.order)) {
    if (shape.picture) {
      const { width, height } = context.canvas;
      const picture = shape.picture(width, height);
      context.globalAlpha = 1;
      if (picture !== null) context.drawImage(picture, 0, 0, (width * high) / height, high);
      continue;
    }
    context.globalAlpha = shape.alpha;
    context.beginPath();
    let begins = true;
    for (const point of shape.points) {
      if (point !== null) context[begins ? "moveTo" : "lineTo"](point[0] * inch, high - point[1] * inch);
      begins = point === null;
    }
    if (shape.closed) context.closePath();
    if (shape.face !== null) {
      context.fillStyle = shape.face;
      context.fill();
    }
    if (shape.edge !== null) {
      context.strokeStyle = shape.edge;
      context.lineWidth = (shape.width * inch) / 72;
      context.setLineDash((shape.dashes ?? []).map((length) => length * context.lineWidth));
      context.stroke();
    }
  }
  context.globalAlpha = 1;
  context.setLineDash([]);
}
