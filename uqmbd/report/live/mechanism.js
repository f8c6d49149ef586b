// A mechanism in its poses, in the data that Python has packed (player_data.py): where its points are, and what is drawn.

import { unpackArray } from "./arrays.js";
import { poseAt, resolvedBy, weightsAt } from "./between.js";
import { hullOf, isKnown, lengthOf, meanOf, minus, plus, turnedBy } from "./geometry.js";
import { nearestIndex } from "./numbers.js";
import { gltfOf } from "./gltf.js";
import { Solids } from "./solids.js";
import { bodyShapes, ghostShape, strokeShape } from "./strokes.js";
import { Surfaces, drawsSurfaces } from "./surfaces.js";

// inches: a mark that is nearer to a joint is left out
const CLEAR = 0.1;

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
    this.solids = data.solids ? new Solids(data.solids, data.owners) : null;
    // points that move in their bodies, by how much, and by what their displacement is magnified
    this.displaced = data.displaced && { ...data.displaced, values: unpackArray(data.displaced.values).values };
    this.magnified = 1;
    if (this.displaced) {
      const all = this.displaced.points.map((_, n) => n);
      this.resolved &&= all.every((n) => resolvedBy(this.times, (frame) => this.displacementOf(0, frame, n), data.dimension, size));
    }
    const listed = (name, stroke) => (name in stroke ? { [name]: data.lists[stroke[name]] } : {});
    this.strokes = data.symbols.map((one) => ({ ...one, ...listed("points", one), ...listed("metres", one), ...listed("tips", one) }));
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

  /** Displacement of a point, by its number among those that move in their bodies, m. */
  displacementOf(realisation, frame, n, values = this.displaced.values) {
    const start = ((realisation * this.times.length + frame) * this.displaced.points.length + n) * this.dimension;
    return Array.from(values.subarray(start, start + this.dimension));
  }

  /** What returns a point in its body, displaced at some frames, from a point without displacement. */
  displacing(realisation, weights, values) {
    const moved = new Map(this.displaced?.points.map((k, n) => [k, n]));
    return (k, still) => {
      if (!moved.has(k)) return still;
      return plus(still, poseAt((frame) => this.displacementOf(realisation, frame, moved.get(k), values), weights, this.dimension), this.magnified);
    };
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
    const displaced = this.displacing(realisation, weights);
    return this.place(
      (b) => poseAt(this.reader(stored, realisation * times.length, b), weights, dimension),
      (k) => {
        const from = (realisation * owners.length + k) * dimension;
        return displaced(k, Array.from(local.subarray(from, from + dimension)));
      },
    );
  }

  /** Those of poses from LivePoses at a time; points that are not known are those of the first realisation. */
  foundAt({ poses, points, displaced }, time) {
    const { local, dimension } = this;
    const weights = this.framesAt(time);
    const moved = displaced ? this.displacing(0, weights, displaced) : (_, still) => still;
    return this.place(
      (b) => poseAt(this.reader(poses, 0, b), weights, dimension),
      (k) => {
        if (points === null) return moved(k, Array.from(local.subarray(k * dimension, (k + 1) * dimension)));
        return moved(k, Array.from(points.subarray(k * (dimension + 1), k * (dimension + 1) + dimension)));
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

  /** Shapes whose roles are colours of a palette; the role "none" is no colour, and a colour stays. */
  painted(shapes, palette) {
    const colour = (role) => (role === null || role === "none" ? null : this.roles[role]?.[palette.dark ? 1 : 0] ?? role);
    return shapes.map((shape) => ({ ...shape, edge: colour(shape.edge), face: colour(shape.face) }));
  }

  /** Return the shapes of one pose. */
  draw(view, points, palette, radii = this.radii) {
    if (!points.every(isKnown)) return [];
    const surfaces = this.solids && this.spatial ? this.surfacesHere() : null;
    const solid = this.solids && (surfaces || !this.spatial) ? this.solids.shaped : new Set();
    const order = this.bodies.map((_, b) => b).filter((b) => this.own[b].length && !solid.has(b));
    if (view.spatial) {
      const depths = this.own.map((own) => (own.length ? view.depth(meanOf(own.map((k) => points[k]))) : 0));
      order.sort((a, b) => depths[b] - depths[a]);
    }
    const shapes = order.flatMap((b, place) => {
      const lines = this.lines?.[b] ?? [];
      if (lines.length) return lines.flatMap((line) => bodyShapes(line.map((k) => view.project(points[k])), this.colours[b], 2 + (0.5 * place) / order.length, true));
      const page = this.own[b].map((k) => view.project(points[k]));
      if (this.boxed.includes(b) && page.every((p) => lengthOf(minus(p, page[0])) < 1e-3)) return [];
      return bodyShapes(page, this.colours[b], 2 + (0.5 * place) / order.length);
    });
    if (surfaces) shapes.push(this.surfacePicture(surfaces, view, points, palette));
    else if (solid.size) shapes.push(...this.solids.draw(view, points, (b) => `pale-${this.colours[b]}`));
    const taken = this.joints.map((k) => view.project(points[k]));
    for (const stroke of this.strokes) {
      const own = stroke.clear && view.project(points[stroke.at[0]]);
      if (own && taken.some((p) => lengthOf(minus(p, own)) <= CLEAR)) continue;
      const shape = strokeShape(view, stroke, points, radii);
      if (shape !== null) shapes.push(shape);
    }
    return this.painted(shapes, palette);
  }

  /** Surfaces in space; null where the browser cannot draw them. */
  surfacesHere() {
    if (!drawsSurfaces()) return null;
    this.surfaces ??= new Surfaces(this.solids);
    return this.surfaces;
  }

  /** Free what is not garbage for the browser; the mechanism may still be drawn afterwards. */
  dispose() {
    this.surfaces?.dispose();
    this.surfaces = null;
  }

  /** A shape that is a picture: the surfaces of one pose, behind the symbols. */
  surfacePicture(surfaces, view, points, palette) {
    const look = (role) => this.roles[role][palette.dark ? 1 : 0];
    const colours = this.colours.map((role) => [look(`pale-${role}`), look(role)]);
    return { order: 2.5, edge: null, face: null, picture: (width, height) => surfaces.picture(view, points, colours, width, height) };
  }

  /** The shapes of one pose as the text of a glTF file; null where there are none. */
  gltf(points) {
    return this.solids && gltfOf(this.solids, points, this.bodies, this.colours.map((role) => this.roles[role][0]));
  }

  /** Return the outlines of the bodies of another realisation. */
  ghosts(view, points, palette, alpha) {
    if (!points.every(isKnown)) return [];
    const outlines = this.corners.flatMap((corners, n) => {
      const b = this.outlined[n];
      const looks = { edge: this.clouds[b][palette.dark ? 1 : 0], alpha };
      return corners.length ? [ghostShape(corners.map((k) => view.project(points[k])), view.spatial, looks, this.lines?.[b].length > 0)] : [];
    });
    return this.painted(outlines, palette);
  }

  /** Return where bodies that are points go: `pointsAt` are the points of a frame. */
  tracks(view, pointsAt, palette) {
    if (!this.pointlike.length) return [];
    const frames = Array.from(this.times, (_, k) => pointsAt(k));
    const tracks = this.pointlike.flatMap((b) => {
      const places = frames.map((points) => points[this.own[b][0]]).filter(isKnown);
      const looks = { edge: this.colours[b], face: null, width: 1, closed: false, dashes: [3, 4], order: 1.5, alpha: 0.8 };
      if (places.length < 2) return [];
      const page = places.map((place) => view.project(place));
      // to and fro along a line: dashes would lie on one another
      const corners = hullOf(page);
      return [{ ...looks, points: corners.length === 2 ? corners : page }];
    });
    return this.painted(tracks, palette);
  }
}
