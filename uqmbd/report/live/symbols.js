// Bodies, joints, springs, drivers and loads as shapes on the page; the same signs as in the pictures of Python
// (uqmbd/report/mechanisms/symbols.py).  Places on the page are in inches, y upwards, points and axes in the world in m.

import { acrossOf, dot, footOf, hullOf, isKnown, lengthOf, minus, normalsOf, plus, scaled, unitOf } from "./geometry.js";

const PIN = 0.06;
const THICK = 4.2;
// a body that is a point
const POINT = 9;
const PUSH = [0.5, 0.8];
const circle = (radius, corners = 33) =>
  Array.from({ length: corners }, (_, k) => {
    const turn = (2 * Math.PI * k) / (corners - 1);
    return [radius * Math.cos(turn), radius * Math.sin(turn)];
  });
const DISC = circle(1);
const ROUND = circle(1, 97);
const linear = (from, to, count) => Array.from({ length: count }, (_, k) => from + ((to - from) * k) / (count - 1));
const ringAbout = (axis) => {
  const [b, c] = normalsOf(axis);
  return DISC.map(([x, y]) => plus(scaled(b, x), c, y));
};
const leftOf = ([x, y]) => [-y, x];

/**
 * Collects shapes: { points, edge, face, width, closed, dash, order, alpha }; a null among the points breaks a line.
 *
 * @param view - { project, depth, unit (metres to an inch), spatial }
 * @param colours - { ink, soft, faint, plate, paper, drive, bad }
 */
export class Pen {
  constructor(view, colours) {
    this.view = view;
    this.colours = colours;
    this.shapes = [];
  }

  add(points, { edge = null, face = null, width = 1, closed = false, dash = null, order = 4, alpha = 1 }) {
    if (points.every((p) => p === null || isKnown(p))) this.shapes.push({ points, edge, face, width, closed, dash, order, alpha });
  }

  at(point) {
    return this.view.project(point);
  }

  // -- bodies
  body(points, colour, light, order) {
    const rounded = points.map((p) => this.at(p).map((x) => Math.round(1e3 * x) / 1e3));
    const corners = hullOf(rounded.filter((p, k) => rounded.findIndex((q) => q[0] === p[0] && q[1] === p[1]) === k));
    const closed = corners.length > 2;
    const shown = corners.length > 1 ? corners : [plus(corners[0], [-1e-3, 0]), plus(corners[0], [1e-3, 0])];
    const width = corners.length > 1 ? THICK : POINT;
    this.add(shown, { edge: colour, face: closed ? colour : null, width, closed, order });
    this.add(shown, { edge: light, face: closed ? light : null, width: 0.8 * width, closed, order: order + 1e-3 });
  }

  /** A body of another realisation: its outline only. */
  ghost(points, colour, alpha) {
    const page = points.map((p) => this.at(p));
    const corners = this.view.spatial && page.length > 3 ? hullOf(page) : page;
    if (corners.length === 1) this.add([corners[0], plus(corners[0], [1e-3, 0])], { edge: colour, width: 0.6 * POINT, order: 1.9, alpha });
    else this.add(corners, { edge: colour, width: 0.8, closed: corners.length > 2, order: 1.9, alpha });
  }

  centreOfMass(point) {
    const centre = this.at(point);
    const ring = DISC.map((p) => plus(centre, p, 0.045));
    this.add(ring, { edge: this.colours.ink, face: this.colours.paper, width: 0.7, closed: true, order: 5 });
    for (const first of [0, 16]) this.add([centre, ...ring.slice(first, first + 9)], { face: this.colours.ink, closed: true, order: 5.1 });
  }

  // -- the ground
  support(point) {
    const { soft, plate } = this.colours;
    const centre = this.at(point);
    const foot = [[0, 0], [-0.11, -0.17], [0.11, -0.17]].map((p) => plus(centre, p));
    this.add(foot, { edge: soft, face: plate, width: 0.9, closed: true, order: 1 });
    this.hatch(plus(centre, [-0.17, -0.17]), plus(centre, [0.17, -0.17]));
  }

  hatch(start, end) {
    const { soft } = this.colours;
    this.add([start, end], { edge: soft, width: 1.2, order: 0.9 });
    const length = lengthOf(minus(end, start));
    if (!(length > 1e-6)) return;
    const along = unitOf(minus(end, start));
    const down = [along[1], -along[0]];
    const strokes = [];
    for (let s = 0.04; s < length; s += 0.06) {
      const top = plus(start, along, s);
      strokes.push(top, plus(plus(top, down, 0.05), along, -0.04), null);
    }
    this.add(strokes, { edge: soft, width: 0.7, order: 0.8 });
  }

  // -- joints
  disc(point, radius, face = this.colours.paper, order = 4) {
    const centre = this.at(point);
    this.add(DISC.map((p) => plus(centre, p, radius)), { edge: this.colours.ink, face, width: 1.3, closed: true, order });
  }

  hinge(point, axis) {
    if (!this.view.spatial || !axis) return this.disc(point, PIN);
    this.axis(point, axis, 0.26);
    const { ink, paper } = this.colours;
    const ring = ringAbout(axis).map((p) => this.at(plus(point, p, 1.5 * PIN * this.view.unit)));
    this.add(ring, { edge: ink, face: paper, width: 1.3, closed: true });
  }

  ball(point) {
    this.disc(point, 1.35 * PIN);
    this.disc(point, 0.55 * PIN, this.colours.ink, 4.2);
  }

  universal(point, axes) {
    this.disc(point, 1.5 * PIN);
    for (const axis of axes) this.axis(point, axis, 1.5 * PIN, null);
  }

  polygon(point, corners, face, width) {
    const centre = this.at(point);
    this.add(corners.map((p) => plus(centre, p, PIN)), { edge: this.colours.ink, face, width, closed: true });
  }

  weld(point) {
    this.polygon(point, [[-1.1, -1.1], [1.1, -1.1], [1.1, 1.1], [-1.1, 1.1]], this.colours.soft, 1);
  }

  diamond(point) {
    this.polygon(point, [[-1.2, 0], [0, -1.2], [1.2, 0], [0, 1.2]], this.colours.paper, 1.1);
  }

  dot(point) {
    this.disc(point, 0.6 * PIN, this.colours.ink);
  }

  slide(point, direction, light, round) {
    const { unit, spatial } = this.view;
    const { ink } = this.colours;
    const long = 0.19 * unit;
    const high = 0.1 * unit;
    const axis = unitOf(direction);
    if (!spatial) {
      const across = leftOf(axis);
      const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => this.at(plus(plus(point, axis, a * long), across, b * high)));
      return this.add(corners, { edge: ink, face: light, width: 1.2, closed: true, order: 2.8 });
    }
    const [b, c] = normalsOf(axis);
    const square = [[1, 1], [-1, 1], [-1, -1], [1, -1]].map(([x, y]) => plus(scaled(b, 0.85 * x), c, 0.85 * y));
    const ends = [-1, 1].map((s) => plus(point, axis, s * long));
    const both = ends.map((end) => (round ? ringAbout(axis) : square).map((p) => this.at(plus(end, p, high))));
    this.add(hullOf(both.flat()), { edge: ink, face: light, width: 1.1, closed: true, order: 2.8 });
    const near = this.view.depth(ends[0]) <= this.view.depth(ends[1]) ? 0 : 1;
    this.add(both[near], { edge: ink, face: light, width: 0.9, closed: true, order: 2.9 });
  }

  guide(origin, direction, [low, high], grounded) {
    const axis = unitOf(direction);
    const more = 0.36 * this.view.unit;
    const ends = [plus(origin, axis, low - more), plus(origin, axis, high + more)];
    if (this.view.spatial || !grounded) return this.broken(ends, [7, 2, 1, 2]);
    let across = [axis[1], -axis[0]];
    if (across[1] > 1e-9 || (Math.abs(across[1]) <= 1e-9 && across[0] > 0)) across = scaled(across, -1);
    const [a, b] = ends.map((end) => plus(this.at(end), across, 0.115));
    const along = minus(b, a);
    if (along[1] * across[0] - along[0] * across[1] > 0) this.hatch(a, b);
    else this.hatch(b, a);
  }

  broken(ends, dash) {
    this.add(ends.map((end) => this.at(end)), { edge: this.colours.soft, width: 1, dash, order: 0.7 });
  }

  line(origin, direction, [low, high]) {
    const axis = unitOf(direction);
    const more = 0.3 * this.view.unit;
    this.broken([plus(origin, axis, low - more), plus(origin, axis, high + more)], [5, 2]);
  }

  plane(origin, normal, point) {
    const foot = footOf(origin, normal, point);
    if (!this.view.spatial) return this.line(foot, leftOf(normal), [0, 0]);
    const [b, c] = normalsOf(normal).map((x) => scaled(x, 0.35 * this.view.unit));
    this.patch([plus(plus(foot, b), c), plus(minus(foot, b), c), minus(minus(foot, b), c), minus(plus(foot, b), c)]);
  }

  patch(corners) {
    const { soft, plate } = this.colours;
    this.add(corners.map((p) => this.at(p)), { edge: soft, face: plate, width: 0.8, closed: true, order: 0.6, alpha: 0.6 });
  }

  /** What bodies hit or lie on, as far as `reaches` say along each vector of the plane. */
  ground(origin, normal, reaches) {
    const more = 0.45 * this.view.unit;
    const along = acrossOf(normal);
    const ends = reaches.map(([low, high], k) => [low - more, high + more].map((s) => scaled(along[k], s)));
    const first = ends[0].map((s) => plus(origin, s));
    if (!this.view.spatial) return this.hatch(this.at(first[0]), this.at(first[1]));
    const [low, high] = ends[1];
    this.patch([plus(first[0], low), plus(first[1], low), plus(first[1], high), plus(first[0], high)]);
  }

  /** What may touch: centres of circles with their radii; a point of the plane comes first, if there is a normal. */
  contact(places, radii, colours, normal, reaches, turning) {
    if (normal) this.ground(places[0], normal, reaches);
    for (let k = normal ? 1 : 0; k < places.length; k++) this.circle(places[k], radii[k], colours[k], turning);
  }

  circle(point, radius, colour, axis) {
    const inches = radius / this.view.unit;
    if (inches < 0.6 * PIN) return this.dot(point);
    const centre = this.at(point);
    const flat = this.view.spatial && axis;
    const line = flat ? ringAbout(axis).map((p) => this.at(plus(point, p, radius))) : ROUND.map((p) => plus(centre, p, inches));
    this.add(line, { edge: colour, width: 1.3, closed: true, order: 3.2 });
    this.add(line, { face: colour, closed: true, order: 1.5, alpha: 0.15 });
  }

  blade(point, axis) {
    const step = scaled(unitOf(axis), 0.22 * this.view.unit);
    this.add([this.at(minus(point, step)), this.at(plus(point, step))], { edge: this.colours.ink, width: 3.2, order: 4.1 });
  }

  rod(first, second) {
    this.add([this.at(first), this.at(second)], { edge: this.colours.dark, width: 2.2, order: 2.5 });
    this.disc(first, 0.7 * PIN);
    this.disc(second, 0.7 * PIN);
  }

  link(first, second) {
    this.add([this.at(first), this.at(second)], { edge: this.colours.soft, width: 1, dash: [2, 2], order: 2.5 });
  }

  // -- springs, drivers, loads
  spring(first, second) {
    const [start, end] = [this.at(first), this.at(second)];
    const along = minus(end, start);
    const length = lengthOf(along);
    const looks = { edge: this.colours.dark, width: 1.2, order: 3.5 };
    if (length < 0.2) this.add(DISC.map((p) => plus(start, p, 0.1)), { ...looks, closed: true });
    else {
      const across = scaled(leftOf(along), Math.min(0.075, 0.2 * length) / length);
      const turns = Math.min(Math.max(Math.trunc(length / 0.16), 4), 12);
      const s = [0, ...linear(0.14, 0.86, 2 * turns + 1), 1];
      this.add(s.map((x, k) => plus(plus(start, along, x), across, k < 2 || k > 2 * turns ? 0 : k % 2 ? -1 : 1)), looks);
    }
    this.disc(first, 0.45 * PIN, this.colours.ink);
    this.disc(second, 0.45 * PIN, this.colours.ink);
  }

  damper(first, second) {
    const [start, end] = [this.at(first), this.at(second)];
    const length = lengthOf(minus(end, start));
    if (length < 0.2) return this.spring(first, second);
    const along = unitOf(minus(end, start));
    const side = scaled(leftOf(along), Math.min(0.075, 0.2 * length));
    const middle = scaled(plus(start, end), 0.5);
    const half = scaled(along, Math.min(0.16, 0.25 * length));
    const [behind, ahead] = [minus(middle, half), plus(middle, half)];
    const looks = { edge: this.colours.dark, width: 1.2, order: 3.5 };
    this.add([start, behind], looks);
    this.add([ahead, end], looks);
    this.add([plus(ahead, side), plus(behind, side), minus(behind, side), minus(ahead, side)], looks);
    this.add([plus(middle, side, -0.8), plus(middle, side, 0.8)], { ...looks, width: 2.2 });
    this.disc(first, 0.45 * PIN, this.colours.ink);
    this.disc(second, 0.45 * PIN, this.colours.ink);
  }

  coil(point, axis) {
    const turns = linear(0, 5 * Math.PI, 60);
    this.around(point, axis, turns.map((turn) => [0.07 + (0.09 * turn) / turns[59], turn]), this.colours.soft, 1);
  }

  arc(point, axis) {
    const turns = linear(-Math.PI / 6, (215 * Math.PI) / 180, 40);
    const path = this.around(point, axis, turns.map((turn) => [0.19, turn]), this.colours.drive, 1.6);
    this.head(path[37], path[39]);
  }

  arrow(first, second) {
    this.add([first, second], { edge: this.colours.drive, width: 1.6, order: 4.4 });
    this.head(first, second);
  }

  force(point, direction) {
    const head = this.at(point);
    const tail = direction ? this.at(plus(point, unitOf(direction), -0.55 * this.view.unit)) : plus(head, [0, 0.5]);
    this.arrow(tail, head);
  }

  push(first, second, axis) {
    let from = first;
    if (axis) {
      const { unit } = this.view;
      const along = unitOf(axis);
      const way = dot(minus(second, first), along);
      const length = Math.min(Math.max(Math.abs(way), PUSH[0] * unit), PUSH[1] * unit);
      from = plus(second, along, way < 0 ? length : -length);
    }
    this.arrow(this.at(from), this.at(second));
  }

  // -- parts of signs
  around(point, axis, spiral, edge, width) {
    const { spatial, unit } = this.view;
    let path;
    if (spatial && axis) {
      const [b, c] = normalsOf(axis);
      path = spiral.map(([r, turn]) => this.at(plus(plus(point, b, unit * r * Math.cos(turn)), c, unit * r * Math.sin(turn))));
    } else {
      const centre = this.at(point);
      path = spiral.map(([r, turn]) => plus(centre, [r * Math.cos(turn), r * Math.sin(turn)]));
    }
    this.add(path, { edge, width, order: 4.4 });
    return path;
  }

  head(before, tip) {
    const along = unitOf(minus(tip, before));
    const across = leftOf(along);
    const back = plus(tip, along, -0.11);
    const corners = [plus(tip, along, 0.02), plus(back, across, 0.05), plus(back, across, -0.05)];
    this.add(corners, { edge: this.colours.drive, face: this.colours.drive, width: 0.6, closed: true, order: 4.5 });
  }

  axis(point, axis, half, dash = [7, 2, 1, 2]) {
    const step = scaled(unitOf(axis), half * this.view.unit);
    this.add([this.at(minus(point, step)), this.at(plus(point, step))], { edge: this.colours.ink, width: 0.9, dash, order: 4.3 });
  }
}

/** Put shapes on a canvas, from the back to the front; `inch`: pixels of an inch, `high`: of the canvas. */
export function paintShapes(context, shapes, inch, high) {
  for (const shape of [...shapes].sort((a, b) => a.order - b.order)) {
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
      context.setLineDash((shape.dash ?? []).map((length) => length * context.lineWidth));
      context.stroke();
    }
  }
  context.globalAlpha = 1;
  context.setLineDash([]);
}
