// Stored realisations in place of a surrogate: the outputs of the one whose inputs are nearest to the chosen ones.
// It has the interface of LiveSurrogate; the germs are the inputs themselves. Nothing here touches the page.

import { unpackArray } from "./arrays.js";

const NEIGHBOURS = 5;

export class NearestRealisation {
  constructor(data) {
    const values = (packed) => packed && unpackArray(packed).values;
    this.nearest = true;
    this.outputs = data.outputs;
    this.times = values(data.times);
    this.count = this.times ? this.times.length : 1;
    this.inputs = data.inputs;
    this.germs = data.germs.map((one) => ({ ...one, values: values(one.values), levels: values(one.levels), knots: values(one.knots) }));
    this.numbers = values(data.numbers);
    this.points = values(data.points);
    this.scales = data.scales;
    this.origin = values(data.origin);
    this.responses = values(data.responses);
    this.statedRms = null;
    this.values = new Float64Array(this.origin.length);
    this.row = 0;
    this.near = [0];
  }

  start() {
    return Float64Array.from(this.germs, (germ) => germ.start);
  }

  /** Distance of a stored realisation from inputs, in standard deviations. */
  distance(row, germs) {
    const width = germs.length;
    let sum = 0;
    for (let k = 0; k < width; k++) if (this.scales[k] > 0) sum += ((this.points[row * width + k] - germs[k]) / this.scales[k]) ** 2;
    return Math.sqrt(sum);
  }

  /** Find the nearest realisation; the values (O, T) are its outputs. */
  evaluate(germs) {
    const distances = Array.from(this.numbers, (_, row) => this.distance(row, germs));
    this.near = Array.from(this.numbers.keys()).sort((a, b) => distances[a] - distances[b]).slice(0, NEIGHBOURS);
    [this.row] = this.near;
    for (let at = 0; at < this.values.length; at++) this.values[at] = this.valueOf(this.row, at);
    return { values: this.values, outside: [], unverified: [] };
  }

  valueOf(row, at) {
    return this.origin[at] + this.responses[row * this.origin.length + at];
  }

  /** The smallest and the largest value of the nearest realisations at a place (O, T). */
  rangeAt(at) {
    const found = this.near.map((row) => this.valueOf(row, at));
    return [Math.min(...found), Math.max(...found)];
  }

  /** Inputs of the nearest realisation. */
  get point() {
    const width = this.inputs.length;
    return this.points.subarray(this.row * width, (this.row + 1) * width);
  }

  inputsAt(germs) {
    return Float64Array.from(germs);
  }

  germOf(k, value) {
    return value;
  }

  /** Share of the realisations with input k at most x. */
  level(k, x) {
    const { values, levels, knots } = this.germs[k];
    if (values) {
      let found = 0;
      for (let n = 0; n < values.length && values[n] <= x; n++) found = levels[n];
      return found;
    }
    const cells = knots.length - 1;
    if (!(x > knots[0])) return 0;
    if (x >= knots[cells]) return 1;
    const cell = knots.findIndex((knot) => knot > x) - 1;
    return (cell + (x - knots[cell]) / (knots[cell + 1] - knots[cell])) / cells;
  }
}
