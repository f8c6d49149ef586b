// What the viewer draws over a mechanism: ellipsoids of inertia, axes of joints, distances of joint points, highlights.

import { poseAt } from "./between.js";
import { dot, isKnown, lengthOf, minus, plus, scaled, turnedBy, unitOf } from "./geometry.js";

// cosines and sines of a turn
const ROUND = Array.from({ length: 97 }, (_, k) => [Math.cos((2 * Math.PI * k) / 96), Math.sin((2 * Math.PI * k) / 96)]);

/** Points of an ellipse on the page about a middle, from two conjugate semi-axes; many are drawn in every frame. */
const ellipse = ([x, y], [ax, ay], [bx, by]) => ROUND.map(([c, s]) => [x + ax * c + bx * s, y + ay * c + by * s]);
const circle = (middle, radius) => ellipse(middle, [radius, 0], [0, radius]);

const lineOf = (points, edge, looks = {}) => ({ points, edge, face: null, width: 1.2, closed: false, dashes: null, order: 6, alpha: 1, ...looks });

/** The pose of body b at a time: [position, rest]; the rest is a half-angle pair or a quaternion. */
export function bodyPose(mechanism, b, time) {
  const pose = poseAt(mechanism.reader(mechanism.stored, 0, b), mechanism.framesAt(time), mechanism.dimension);
  return [pose.slice(0, mechanism.dimension), pose.slice(mechanism.dimension)];
}

/** Outline of an ellipsoid, and its principal circles; `axes` are its semi-axes in the world, m. */
function ellipsoidLines(view, centre, axes, edge, looks) {
  const middle = view.project(centre);
  const page = axes.map((axis) => minus(view.project(plus(centre, axis)), middle));
  const [xx, xy, yy] = [[0, 0], [0, 1], [1, 1]].map(([i, j]) => page.reduce((sum, a) => sum + a[i] * a[j], 0));
  const first = Math.sqrt(xx);
  const across = first > 0 ? xy / first : 0;
  const rest = Math.sqrt(Math.max(yy - across * across, 0));
  const outline = ellipse(middle, [first, across], [0, rest]);
  const lines = [lineOf(outline, edge, { face: edge, closed: true, alpha: 0.12, width: 0, order: 5.5, ...looks }), lineOf(outline, edge, { closed: true, ...looks })];
  if (axes.length < 3) return lines;
  for (const [i, j] of [[0, 1], [0, 2], [1, 2]])
    lines.push(lineOf(ellipse(middle, page[i], page[j]), edge, { width: 0.6, closed: true, alpha: 0.6 }));
  return lines;
}

/** Ellipsoids of inertia: solids of uniform density with the mass and the inertia of each body. */
export function ellipsoids(mechanism, view, found, time, palette) {
  return found.flatMap((one, b) => {
    if (one === null || one.axes === null) return [];
    const [position, turn] = bodyPose(mechanism, b, time);
    const centre = plus(position, turnedBy(turn, one.com));
    const axes = one.axes[0].map((_, k) => turnedBy(turn, one.axes.map((row) => row[k])));
    if (![centre, ...axes].every(isKnown)) return [];
    return ellipsoidLines(view, centre, axes, mechanism.roles[mechanism.colours[b]][palette.dark ? 1 : 0]);
  });
}

/** Axes of joints in space, 0.6 inches to both sides. */
export function jointAxes(view, points, components, palette) {
  return components.flatMap(({ points: own, directions }) => {
    const at = points[own[own.length - 1]];
    if (!at || at.length < 3) return [];
    return directions.filter((k) => isKnown(points[k])).map((k) => {
      const along = scaled(unitOf(points[k]), 0.6 * view.unit);
      return lineOf([view.project(minus(at, along)), view.project(plus(at, along))], palette.ink, { dashes: [7, 2, 1, 2], width: 1 });
    });
  });
}

/** A line between the points of a joint that are apart, and a ring about each. */
export function gapMarks(view, points, gap, component, palette) {
  const [first, last] = [component.points[0], component.points[component.points.length - 1]].map((k) => points[k]);
  if (!first || !last || !isKnown(first) || !isKnown(last)) return [];
  const ring = (at) => lineOf(circle(view.project(at), 0.12), palette.limit, { width: 2, closed: true, order: 8 });
  const line = lineOf([view.project(first), view.project(last)], palette.limit, { width: 2, dashes: [4, 2.5], order: 8 });
  return [line, ring(first), ring(last)];
}

/** Rings about the points of a part that the pointer or the tree names. */
export function highlight(view, places, palette) {
  return places.filter(isKnown).map((at) =>
    lineOf(circle(view.project(at), 0.1), palette.ink, { width: 2.4, closed: true, order: 9, alpha: 0.8 }));
}

/** Distance of a place on the page from a line between two others, inches. */
export function distanceTo(place, [a, b]) {
  const along = minus(b, a);
  const share = Math.min(Math.max(dot(minus(place, a), along) / (dot(along, along) || 1), 0), 1);
  return lengthOf(minus(place, plus(a, along, share)));
}
