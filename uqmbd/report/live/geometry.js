// Vectors of two or three numbers, in metres or on a page, as plain arrays.

// without a loop, because drawings add thousands of them in a frame
export const plus = (a, b, s = 1) => (a.length === 3 ? [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]] : [a[0] + s * b[0], a[1] + s * b[1]]);
export const minus = (a, b) => plus(a, b, -1);
export const scaled = (a, s) => a.map((x) => s * x);
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + (a.length === 3 ? a[2] * b[2] : 0);
export const lengthOf = (a) => Math.sqrt(dot(a, a));
export const unitOf = (a) => scaled(a, 1 / (lengthOf(a) || 1));
export const isKnown = (a) => a.every(Number.isFinite);
export const meanOf = (points) => scaled(points.reduce((sum, p) => plus(sum, p)), 1 / points.length);

export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

/** Two unit vectors perpendicular to an axis in space and to each other. */
export function normalsOf(axis) {
  const unit = unitOf(axis);
  const least = unit.reduce((best, x, k) => (Math.abs(x) < Math.abs(unit[best]) ? k : best), 0);
  const b = unitOf(cross(unit, [0, 1, 2].map((k) => (k === least ? 1 : 0))));
  return [b, cross(unit, b)];
}

export const leftOf = ([x, y]) => [-y, x];

/** Unit vectors along an axis, and across it; in the plane on its left. */
export const axesOf = (axis) => (axis.length === 3 ? [unitOf(axis), ...normalsOf(axis)] : [unitOf(axis), leftOf(unitOf(axis))]);

/** A vector turned by a half-angle pair (plane) or a quaternion (space), scalar first; by nothing where there is none. */
export function turnedBy(e, vector) {
  if (e.length === 0) return vector;
  if (e.length === 2) {
    const c = e[0] * e[0] - e[1] * e[1];
    const s = 2 * e[0] * e[1];
    return [c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]];
  }
  const axis = [e[1], e[2], e[3]];
  const once = scaled(cross(axis, vector), 2);
  return plus(plus(vector, once, e[0]), cross(axis, once));
}

/** Corners of the convex hull of points on the page, anticlockwise; of points on a line its two ends. */
export function hullOf(points, slack = 1e-4) {
  const ordered = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  if (ordered.length < 3) return ordered;
  const ends = [];
  const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
  for (const chain of [ordered, [...ordered].reverse()]) {
    const kept = [];
    for (const point of chain) {
      while (kept.length > 1 && turn(kept[kept.length - 2], kept[kept.length - 1], point) <= slack) kept.pop();
      kept.push(point);
    }
    ends.push(...kept.slice(0, -1));
  }
  return ends;
}
