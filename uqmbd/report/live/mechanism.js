// A mechanism in its poses, in the data that Python has packed (player_data.py): where its points are, and what is drawn.

import { unpackArray } from "./arrays.js";
import { poseAt, resolvedBy, weightsAt } from "./between.js";
import { hullOf, isKnown, lengthOf, meanOf, minus, plus, turnedBy } from "./geometry.js";
import { nearestIndex } from "./numbers.js";
import { Pen } from "./symbols.js";

const POINTLIKE = ["hinge", "ball", "universal", "weld", "rod", "spring", "damper", ""];
const BOXED = ["slide", "cylinder"];

/** Mix a colour #rrggbb with another one: `share` of the other. */
export function mixedColours(colour, other, share) {
  const parts = [colour, other].map((c) => [1, 3, 5].map((k) => Number.parseInt(c.slice(k, k + 2), 16)));
  return `#${parts[0].map((x, k) => Math.round((1 - share) * x + share * parts[1][k]).toString(16).padStart(2, "0")).join("")}`;
}

/** Colours of everything but the bodies, on a page of some palette. */
export function penColours(palette) {
  const grey = (share) => mixedColours(palette.ink, palette.paper, share);
  return {
    ink: grey(0.05), dark: grey(0.2), soft: grey(0.4), plate: grey(0.92), paper: palette.paper,
    drive: palette.dark ? "#f0a04b" : "#b45309",
  };
}

export class Mechanism {
  constructor(data) {
    Object.assign(this, data);
    this.times = unpackArray(data.times).values;
    this.stored = unpackArray(data.poses).values;
    this.local = unpackArray(data.local).values;
    this.spatial = data.dimension === 3;
    this.placed = data.kinds.map((kind) => kind !== "direction");
    this.own = data.bodies.map((_, b) => data.owners.flatMap((owner, k) => (owner === b && this.placed[k] ? [k] : [])));
    // how far the points of each body are from its origin, m
    this.reaches = this.own.map((own) => Math.max(0, ...own.map((k) => Math.hypot(...this.local.subarray(k * data.dimension, (k + 1) * data.dimension)))));
    const size = Math.hypot(...data.bounds[0].map((low, axis) => data.bounds[1][axis] - low));
    this.resolved = data.bodies.every((_, b) => resolvedBy(this.times, this.reader(this.stored, 0, b), data.dimension, size));
    // bodies that are drawn as a point; how they move is seen by their tracks
    this.pointlike = data.bodies.flatMap((_, b) => (this.own[b].length && this.reaches[b] < 1e-9 * (size || 1) ? [b] : []));
    this.boxed = new Set(data.parts.filter((p) => BOXED.includes(p.symbol) && p.bodies.length > 1).map((p) => p.bodies[1]));
  }

  /** Points and directions in the world: `pose` of a body (a function of its number), `local` of a point. */
  place(pose, local) {
    const { dimension, owners, placed } = this;
    const poses = this.bodies.map((_, b) => pose(b));
    return owners.map((owner, k) => {
      if (owner < 0) return local(k);
      const turned = turnedBy(poses[owner].slice(dimension), local(k));
      return placed[k] ? plus(turned, poses[owner]) : turned;
    });
  }

  /** What returns the pose of a body at a frame, from those of all frames and bodies; the first frame is at `from`. */
  reader(poses, from, b) {
    const { width, bodies } = this;
    return (frame) => {
      const start = ((from + frame) * bodies.length + b) * width;
      return Array.from(poses.subarray(start, start + width));
    };
  }

  /** The frames of a time, and what they count; of a motion that they do not resolve the nearest one. */
  framesAt(time) {
    return this.resolved ? weightsAt(this.times, time) : [[nearestIndex(this.times, time), 1]];
  }

  /** Those of a realisation that is stored, at a time. */
  storedAt(realisation, time) {
    const { stored, local, dimension, owners, times } = this;
    const weights = this.framesAt(time);
    return this.place(
      (b) => poseAt(this.reader(stored, realisation * times.length, b), weights, dimension),
      (k) => {
        const from = (realisation * owners.length + k) * dimension;
        return Array.from(local.subarray(from, from + dimension));
      },
    );
  }

  /** Those of poses from LivePoses at a time; points that are not known are those of the first realisation. */
  foundAt({ poses, points }, time) {
    const { local, dimension } = this;
    const weights = this.framesAt(time);
    return this.place(
      (b) => poseAt(this.reader(poses, 0, b), weights, dimension),
      (k) => {
        if (points === null) return Array.from(local.subarray(k * dimension, (k + 1) * dimension));
        return Array.from(points.subarray(k * (dimension + 1), k * (dimension + 1) + dimension));
      },
    );
  }

  /** How far the view has moved along with the mechanism. */
  wayOf(points) {
    return meanOf(this.moving.map((k) => points[k]));
  }

  /** Shift points, but no directions. */
  shifted(points, way) {
    return points.map((p, k) => (this.placed[k] ? plus(p, way) : p));
  }

  colourOf(body, palette) {
    return body < 0 ? mixedColours(palette.ink, palette.paper, 0.4) : this.colours[body][palette.dark ? 1 : 0];
  }

  /** Return the shapes of one pose. */
  draw(view, points, palette, radii = this.radii) {
    const pen = new Pen(view, penColours(palette));
    if (!points.every(isKnown)) return [];
    const order = this.bodies.map((_, b) => b).filter((b) => this.own[b].length);
    if (view.spatial) {
      const depths = this.own.map((own) => (own.length ? view.depth(meanOf(own.map((k) => points[k]))) : 0));
      order.sort((a, b) => depths[b] - depths[a]);
    }
    order.forEach((b, place) => {
      const mine = this.own[b].map((k) => points[k]);
      const page = mine.map((p) => view.project(p));
      if (this.boxed.has(b) && page.every((p) => lengthOf(minus(p, page[0])) < 1e-3)) return;
      const colour = this.colourOf(b, palette);
      pen.body(mine, colour, mixedColours(colour, palette.paper, 0.72), 2 + (0.5 * place) / order.length);
    });
    for (const part of this.parts) this.component(pen, part, points, palette, radii);
    const taken = this.parts.flatMap((part) => part.points).map((k) => view.project(points[k]));
    this.kinds.forEach((kind, k) => {
      if (kind !== "com" && kind !== "observed") return;
      const own = view.project(points[k]);
      if (taken.some((p) => lengthOf(minus(p, own)) <= 0.1)) return;
      if (kind === "com") pen.centreOfMass(points[k]);
      else pen.dot(points[k]);
    });
    return pen.shapes;
  }

  /** Return the outlines of the bodies of another realisation. */
  ghosts(view, points, palette, alpha) {
    const pen = new Pen(view, penColours(palette));
    if (!points.every(isKnown)) return [];
    this.corners.forEach((corners, b) => {
      if (corners.length) pen.ghost(corners.map((k) => points[k]), mixedColours(this.colourOf(b, palette), palette.ink, 0.3), alpha);
    });
    return pen.shapes;
  }

  /** Return where bodies that are points go: `pointsAt` are the points of a frame. */
  tracks(view, pointsAt, palette) {
    if (!this.pointlike.length) return [];
    const frames = Array.from(this.times, (_, k) => pointsAt(k));
    return this.pointlike.flatMap((b) => {
      const places = frames.map((points) => points[this.own[b][0]]).filter(isKnown);
      const looks = { edge: this.colourOf(b, palette), face: null, width: 1, closed: false, dash: [3, 4], order: 1.5, alpha: 0.8 };
      if (places.length < 2) return [];
      const page = places.map((place) => view.project(place));
      // to and fro along a line: dashes would lie on one another
      const corners = hullOf(page);
      return [{ ...looks, points: corners.length === 2 ? corners : page }];
    });
  }

  component(pen, part, points, palette, radii) {
    const places = part.points.map((k) => points[k]);
    const axes = part.directions.map((k) => points[k]);
    const [axis] = axes;
    const [first] = places;
    const last = places[places.length - 1];
    const at = part.anchor === null ? null : points[part.anchor];
    const light = () => mixedColours(this.colourOf(part.bodies[part.bodies.length - 1], palette), palette.paper, 0.72);
    if (POINTLIKE.includes(part.symbol)) for (const k of part.points) if (this.owners[k] < 0) pen.support(points[k]);
    const pair = last !== undefined;
    const guided = pair && axis !== undefined;
    const reach = () => pen.guide(first, axis, part.reach, part.bodies[0] < 0);
    const touch = (turning) => {
      const colours = part.points.map((k) => this.colourOf(this.owners[k], palette));
      pen.contact(places, part.points.map((k) => radii[k]), colours, part.planes.length ? axis : null, part.planes, turning);
    };
    // what each sign needs, and how it is drawn
    const signs = {
      contact: [pair, () => touch(null)],
      wheel: [pair, () => touch(axes[1] ?? null)],
      hinge: [pair, () => pen.hinge(last, axis)],
      ball: [pair, () => pen.ball(last)],
      universal: [pair, () => pen.universal(last, axes)],
      weld: [pair, () => pen.weld(last)],
      slide: [guided, () => (reach(), pen.slide(last, axis, light(), false))],
      cylinder: [guided, () => (reach(), pen.slide(last, axis, light(), true))],
      line: [guided, () => (pen.line(first, axis, part.reach), pen.dot(last))],
      skate: [guided, () => pen.blade(last, axis)],
      plane: [guided, () => (pen.plane(first, axis, last), pen.dot(last))],
      rod: [pair, () => pen.rod(first, last)],
      spring: [pair, () => pen.spring(first, last)],
      damper: [pair, () => pen.damper(first, last)],
      coil: [at !== null, () => pen.coil(at, axis)],
      driver: [places.length > 1 || at !== null, () => (places.length > 1 ? pen.push(first, last, axis) : pen.arc(at, axis))],
      torque: [at !== null, () => pen.arc(at, axis)],
      force: [at !== null, () => pen.force(at, axis)],
    };
    const [ready, sign] = Object.hasOwn(signs, part.symbol) ? signs[part.symbol] : [false];
    if (ready) return sign();
    if (places.length > 1) pen.link(first, last);
    else if (!places.length && part.ends.length > 1) pen.link(points[part.ends[0]], points[part.ends[part.ends.length - 1]]);
    if (places.length) pen.diamond(last);
  }
}
