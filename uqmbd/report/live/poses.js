// Poses of a mechanism's bodies from germs, in the data that Python has packed (poses.py).  Nothing here touches the page.
import { LiveSurrogate } from "./surrogate.js";

/**
 * Poses of all bodies at all frames.
 *
 * bodies: their names; times: of the frames, s; width: numbers of a body's pose, the first `dimension` of which are its
 * position, the others a unit quaternion, body to world, scalar first (in the plane the cosine and sine of an angle).
 */
export class LivePoses {
  constructor(data) {
    this.bodies = data.bodies;
    this.coordinates = new LiveSurrogate(data.coordinates);
    this.points = data.points && new LiveSurrogate(data.points);
    this.times = this.coordinates.times;
    this.size = data.size;
    // what moves on a line is drawn in the plane
    this.shift = data.dimension === 1 ? data.upright : 0;
    this.dimension = Math.max(data.dimension, 2);
    this.width = Math.max(data.size, 2);
    this.poses = new Float64Array(this.times.length * this.bodies.length * this.width);
    // number of points that move in their bodies; index and axis of each of their displacements
    this.moving = data.moving;
    this.moved = data.moved;
    this.displaced = this.moving ? new Float64Array(this.times.length * this.moving * this.dimension) : null;
  }

  /**
   * Evaluate at germs.
   *
   * Returns { poses, points, displaced, outside, unverified }: poses (frame, body, width), overwritten by the next call;
   * points (point, dimension + 1) in the frames of their bodies, with radii, m, or null; displaced (frame, moving point,
   * dimension), m, or null; the others as LiveSurrogate.evaluate.
   */
  evaluate(germs) {
    const { poses, size, width, dimension } = this;
    const frames = this.times.length;
    const count = this.bodies.length;
    const { values, outside, unverified } = this.coordinates.evaluate(germs);
    for (let b = 0; b < count; b++)
      for (let t = 0; t < frames; t++) {
        const to = (t * count + b) * width;
        let square = 0;
        for (let c = 0; c < size; c++) {
          const value = values[(b * size + c) * frames + t];
          poses[to + c + this.shift] = value;
          if (c >= dimension) square += value * value;
        }
        for (let c = dimension; c < size; c++) poses[to + c] /= Math.sqrt(square);
      }
    this.moved.forEach(([n, axis], k) => {
      for (let t = 0; t < frames; t++)
        this.displaced[(t * this.moving + n) * dimension + axis + this.shift] = values[(count * size + k) * frames + t];
    });
    const points = this.points && this.points.evaluate(germs).values;
    return { poses, points, displaced: this.displaced, outside, unverified };
  }

  /**
   * The largest stated error of a point, in m, as a root mean square; null where none is known.
   *
   * @param reaches - how far points of each body are from its origin, m: errors of turns move them by as much
   * @param magnified - what displacements of points in their bodies are multiplied by
   */
  largestError(reaches, magnified = 1) {
    const { statedRms, count } = this.coordinates;
    if (statedRms === null) return null;
    let largest = 0;
    for (let b = 0; b < this.bodies.length; b++)
      for (let t = 0; t < count; t++) {
        let moved = 0;
        let turned = 0;
        for (let c = 0; c < this.size; c++) {
          const rms = statedRms[(b * this.size + c) * count + t];
          if (c < this.dimension) moved += rms * rms;
          else turned += rms * rms;
        }
        // a unit quaternion, or half-angle pair, that is off by e turns by 2 e
        largest = Math.max(largest, Math.sqrt(moved) + 2 * Math.sqrt(turned) * reaches[b] || 0);
      }
    return largest + magnified * this.largestDisplacementError();
  }

  /** The largest stated error of a displacement in a body, in m, as a root mean square. */
  largestDisplacementError() {
    const { statedRms, count } = this.coordinates;
    const squares = new Float64Array(this.moving * count);
    this.moved.forEach(([n], k) => {
      for (let t = 0; t < count; t++) squares[n * count + t] += statedRms[(this.bodies.length * this.size + k) * count + t] ** 2 || 0;
    });
    return Math.sqrt(squares.reduce((a, b) => Math.max(a, b), 0));
  }
}
