// How a mechanism is looked at: from metres to inches of the page, in the plane, or in space from a side.

import { dot, lengthOf, minus, plus, scaled } from "./geometry.js";
import { formatNumber } from "./numbers.js";
import { paintShapes } from "./strokes.js";

const MARGIN = 0.5;
const WIDE = 6.4;
// what is narrower than this share of its height is beside empty paper: it is drawn lower
const SLENDER = 0.5;
const SIDE = { azimuth: -58, elevation: 24 };
const degrees = Math.PI / 180;
const clip = (x, low, high) => Math.min(Math.max(x, low), high);

export class View {
  /** @param bounds - the ends [low, high] of what it must hold, m */
  constructor(bounds) {
    const [low, high] = bounds;
    this.spatial = low.length === 3;
    this.centre = scaled(plus(low, high), 0.5);
    this.extent = minus(high, low);
    this.reset();
  }

  /** Look from where it is looked from at first. */
  reset() {
    this.zoom = 1;
    this.shift = this.centre.map(() => 0);
    this.look(SIDE.azimuth, SIDE.elevation);
  }

  /** Rotate by degrees; in the plane nothing rotates. */
  turn([across, up]) {
    if (this.spatial) this.look(this.azimuth + across, this.elevation + up);
  }

  /** Enlarge the drawing. */
  enlarge(factor) {
    this.zoom = clip(this.zoom * factor, 0.05, 200);
  }

  /** Move the drawing by pixels. */
  pan(right, down) {
    const metres = this.unit / this.inch;
    const [along, up] = this.spatial ? [this.right, this.up] : [[1, 0], [0, 1]];
    this.shift = plus(plus(this.shift, along, -right * metres), up, down * metres);
  }

  look(azimuth, elevation) {
    this.azimuth = ((((azimuth + 180) % 360) + 360) % 360) - 180;
    this.elevation = clip(elevation, -90, 90);
    const [a, e] = [this.azimuth * degrees, this.elevation * degrees];
    this.right = [-Math.sin(a), Math.cos(a), 0];
    this.up = [-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e)];
    this.towards = [Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e)];
  }

  /** Choose the scale for a width in pixels, and the height where it is not given; returns the height. */
  fit(width, height = null) {
    this.inch = clip(Math.min(width / WIDE, height === null ? Infinity : height / 2.6), 42, 110);
    this.wide = width / this.inch;
    const room = this.wide - 2 * MARGIN;
    const largest = Math.max(...this.extent);
    if (this.spatial) {
      this.high = height === null ? clip(0.72 * this.wide, 2.6, 4.8) : height / this.inch;
      this.unit = (lengthOf(this.extent) || 1) / (Math.min(this.wide, this.high) - 0.8 * MARGIN);
    } else {
      const [across, up] = this.extent;
      this.unit = Math.max(across, largest > 0 ? 0.25 * largest : 0.5) / room;
      this.high = height === null ? clip(up / this.unit + 2 * MARGIN, 1.9, across < SLENDER * up ? 3.6 : 4.8) : height / this.inch;
      this.unit = Math.max(this.unit, up / (this.high - 2 * MARGIN));
    }
    this.unit /= this.zoom;
    this.middle = plus(this.centre, this.shift);
    return this.high * this.inch;
  }

  project(point) {
    const { middle, unit, wide, high } = this;
    const from = minus(point, middle);
    const [x, y] = this.spatial ? [dot(this.right, from), dot(this.up, from)] : from;
    return [wide / 2 + x / unit, high / 2 + y / unit];
  }

  /** Distance behind the page. */
  depth(point) {
    return this.spatial ? -dot(this.towards, point) : 0;
  }

  /** Draw a length in metres, and in space the directions of the axes. */
  paintScale(context, palette) {
    const longest = 1.3 * this.unit;
    const power = 10 ** Math.floor(Math.log10(longest));
    const length = power * [5, 2, 1].find((x) => x * power <= longest);
    const [left, low, tick] = [0.15, 0.16, 0.05];
    const end = left + length / this.unit;
    const looks = { face: null, closed: false, dashes: null, order: 0, alpha: 1, edge: palette.soft, width: 1 };
    const shapes = [{ ...looks, points: [[left, low + tick], [left, low], [end, low], [end, low + tick]] }];
    const letters = [[`${formatNumber(length)} m`, [end + 0.08, low]]];
    if (this.spatial) {
      const foot = [0.5, 0.75];
      ["x", "y", "z"].forEach((letter, k) => {
        const along = [this.right[k], this.up[k]];
        shapes.push({ ...looks, points: [foot, plus(foot, along, 0.3)] });
        letters.push([letter, plus(plus(foot, along, 0.4), [-0.03, 0])]);
      });
    }
    paintShapes(context, shapes, this.inch, this.high * this.inch);
    context.fillStyle = palette.soft;
    context.font = "12px system-ui, sans-serif";
    context.textBaseline = "middle";
    for (const [text, [x, y]] of letters) context.fillText(text, x * this.inch, (this.high - y) * this.inch);
  }
}
