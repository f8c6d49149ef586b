// A stored surrogate, evaluated: outputs at all times from germs, in the data that Python has packed (surrogates.py).
// Nothing here touches the page.
import { unpackArray } from "./arrays.js";

/** Value at x of a table of equally spaced knots with slopes; the last straight lines go on beyond its ends. */
function tableValue(table, x) {
  const { begin, end, values, slopes } = table;
  const cells = values.length - 1;
  const width = (end - begin) / cells;
  if (!(x > begin)) return values[0] + (x - begin) * slopes[0];
  if (x >= end) return values[cells] + (x - end) * slopes[cells];
  const cell = Math.min(Math.floor((x - begin) / width), cells - 1);
  const t = (x - begin) / width - cell;
  const rise = values[cell + 1] - values[cell];
  const first = slopes[cell] * width;
  const last = slopes[cell + 1] * width;
  return values[cell] + t * (first + t * (3 * rise - 2 * first - last + t * (first + last - 2 * rise)));
}

/** Where an increasing function has a value, between two ends. */
function inverted(f, value, low, high) {
  for (let k = 0; k < 100; k++) {
    const middle = (low + high) / 2;
    if (middle === low || middle === high) break;
    if (f(middle) < value) low = middle;
    else high = middle;
  }
  return (low + high) / 2;
}

function clamped(x, bounds) {
  const above = bounds[0] === null ? x : Math.max(x, bounds[0]);
  return bounds[1] === null ? above : Math.min(above, bounds[1]);
}

function unpackTable(table) {
  return table && { ...table, values: unpackArray(table.values).values, slopes: unpackArray(table.slopes).values };
}

/** Value of an input from its standard variable. */
function valueOf(map, z) {
  if (map.kind === "affine") return map.shift + map.scale * z;
  if (map.kind === "exponential") return map.shift + map.scale * Math.exp(map.mu + map.sigma * z);
  return clamped(tableValue(map.table, z), map.bounds);
}

/** Standard variable of an input from its value; NaN where it has none. */
function standardOf(map, value) {
  if (map.kind === "affine") return (value - map.shift) / map.scale;
  if (map.kind === "exponential") return (Math.log((value - map.shift) / map.scale) - map.mu) / map.sigma;
  return inverted((z) => tableValue(map.table, z), value, map.table.begin, map.table.end);
}

/** Coefficients of some elements: a base, and products of few components, by outputs. */
class Field {
  constructor(data, terms) {
    const bases = data.outputs.map((one) => unpackArray(one.base).values);
    this.terms = terms;
    this.columns = bases.length ? bases[0].length : 0;
    this.base = Float64Array.from(bases.flatMap((base) => Array.from(base)));
    this.outputs = data.outputs.map((one) => {
      const left = unpackArray(one.left);
      return { left: left.values, rank: left.shape[2], right: one.right && unpackArray(one.right).values };
    });
  }

  /** Put sums of an element's coefficients times the basis into (O, C). */
  combine(element, basis, found) {
    const { terms, columns } = this;
    found.set(this.base);
    for (let o = 0; o < this.outputs.length; o++) {
      const { left, rank, right } = this.outputs[o];
      const row = o * columns;
      const from = element * terms * rank;
      if (right === null) {
        for (let p = 0; p < terms; p++) {
          const b = basis[p];
          const at = from + p * rank;
          for (let c = 0; c < columns; c++) found[row + c] += b * left[at + c];
        }
        continue;
      }
      for (let r = 0; r < rank; r++) {
        let sum = 0;
        for (let p = 0; p < terms; p++) sum += basis[p] * left[from + p * rank + r];
        const at = r * columns;
        for (let c = 0; c < columns; c++) found[row + c] += sum * right[at + c];
      }
    }
  }
}

/** Sum over the terms of coefficients (P, N) times the basis. */
function summed(coefficients, basis, count) {
  const found = new Float64Array(count);
  for (let p = 0; p < basis.length; p++)
    for (let n = 0; n < count; n++) found[n] += basis[p] * coefficients[p * count + n];
  return found;
}

/** Outputs that are polynomials of the germs at each time. */
class Polynomial {
  constructor(data, terms) {
    this.field = new Field(data.field, terms);
    this.values = new Float64Array(this.field.base.length);
  }

  evaluate(element, basis) {
    this.field.combine(element, basis, this.values);
    return this.values;
  }
}

/** Outputs from landmark to landmark, in each segment Chebyshev polynomials of its normalised time. */
class Segments {
  constructor(data, terms, times) {
    this.times = times;
    this.slack = 1e-12 * times.reduce((most, t) => Math.max(most, Math.abs(t)), 0);
    this.elements = data.elements.map((one) => {
      const field = new Field(one.field, terms);
      const edges = unpackArray(one.edges).values;
      return { edges, count: one.segments, powers: one.powers, field, local: new Float64Array(field.base.length) };
    });
    this.values = new Float64Array(data.outputs.length * times.length);
  }

  evaluate(element, basis) {
    const { edges, count, powers, field, local } = this.elements[element];
    const { times, values } = this;
    const outputs = field.outputs.length;
    const at = summed(edges, basis, count + 1);
    for (let s = 1; s <= count; s++) at[s] = Math.max(at[s], at[s - 1]);
    field.combine(0, basis, local);
    const polynomials = new Float64Array(powers);
    let s = 0;
    for (let t = 0; t < times.length; t++) {
      while (s < count - 1 && !(times[t] < at[s + 1])) s++;
      if (s === count - 1 && times[t] > at[count] + this.slack) {
        for (let o = 0; o < outputs; o++) values[o * times.length + t] = NaN;
        continue;
      }
      const scale = at[s + 1] > at[s] ? 2 / (at[s + 1] - at[s]) : 0;
      const x = Math.min(Math.max((times[t] - at[s]) * scale - 1, -1), 1);
      polynomials[0] = 1;
      if (powers > 1) polynomials[1] = x;
      for (let n = 2; n < powers; n++) polynomials[n] = 2 * x * polynomials[n - 1] - polynomials[n - 2];
      for (let o = 0; o < outputs; o++) {
        const from = (o * count + s) * powers;
        let sum = 0;
        for (let n = 0; n < powers; n++) sum += local[from + n] * polynomials[n];
        values[o * times.length + t] = sum;
      }
    }
    return values;
  }
}

/** Outputs that are sums of harmonics of few frequencies. */
class Waves {
  constructor(data, terms, times) {
    const lattice = unpackArray(data.lattice);
    this.times = times.map((t) => t - data.origin);
    this.lattice = lattice.values;
    [this.harmonics, this.bases] = lattice.shape;
    this.elements = data.elements.map((one) => {
      const field = new Field(one.field, terms);
      const [frequencies, constants, drifts] = [one.frequencies, one.constants, one.drifts].map((x) => unpackArray(x).values);
      return { frequencies, constants, drifts, field, local: new Float64Array(field.base.length) };
    });
    this.values = new Float64Array(data.outputs.length * times.length);
  }

  evaluate(element, basis) {
    const { frequencies, constants, drifts, field, local } = this.elements[element];
    const { times, values, lattice, harmonics, bases } = this;
    const outputs = field.outputs.length;
    const count = times.length;
    const own = summed(frequencies, basis, bases);
    const constant = summed(constants, basis, outputs);
    const drift = summed(drifts, basis, outputs);
    field.combine(0, basis, local);
    for (let o = 0; o < outputs; o++)
      for (let t = 0; t < count; t++) values[o * count + t] = constant[o] + drift[o] * times[t];
    const cosines = new Float64Array(count);
    const sines = new Float64Array(count);
    for (let h = 0; h < harmonics; h++) {
      let frequency = 0;
      for (let m = 0; m < bases; m++) frequency += lattice[h * bases + m] * own[m];
      for (let t = 0; t < count; t++) {
        cosines[t] = Math.cos(frequency * times[t]);
        sines[t] = Math.sin(frequency * times[t]);
      }
      for (let o = 0; o < outputs; o++) {
        const a = local[2 * o * harmonics + h];
        const b = local[(2 * o + 1) * harmonics + h];
        if (a === 0 && b === 0) continue;
        const row = o * count;
        for (let t = 0; t < count; t++) values[row + t] += a * cosines[t] + b * sines[t];
      }
    }
    return values;
  }
}

const SURROGATE_KINDS = { polynomial: Polynomial, segments: Segments, waves: Waves };

/** A surrogate of one kind, for some of the outputs. */
class Part {
  constructor(data, times) {
    const degrees = unpackArray(data.degrees);
    const recurrences = unpackArray(data.recurrences);
    this.outputs = data.outputs;
    this.used = data.used && unpackArray(data.used).values;
    this.degrees = degrees.values;
    [this.terms, this.dimension] = degrees.shape;
    this.recurrences = recurrences.values;
    this.length = recurrences.shape[3];
    this.elements = recurrences.shape[0];
    this.lower = unpackArray(data.lower).values;
    this.upper = unpackArray(data.upper).values;
    this.polynomials = new Float64Array(this.dimension * this.length);
    this.basis = new Float64Array(this.terms);
    this.surrogate = new SURROGATE_KINDS[data.kind](data, this.terms, times);
  }

  /** Number of the element that holds the germs; -1: none. */
  locate(germs) {
    const d = this.dimension;
    for (let e = 0; e < this.elements; e++) {
      let inside = true;
      for (let k = 0; k < d && inside; k++)
        inside = germs[k] > this.lower[e * d + k] && germs[k] <= this.upper[e * d + k];
      if (inside) return e;
    }
    return -1;
  }

  /** Values (O, T) of its outputs, or null where no element holds the germs. */
  evaluate(germs) {
    const element = this.locate(germs);
    if (element < 0) return null;
    const { dimension, length, polynomials, degrees, basis } = this;
    for (let k = 0; k < dimension; k++) {
      const alpha = (element * dimension + k) * 2 * length;
      const norm = alpha + length;
      const row = k * length;
      polynomials[row] = 1;
      for (let n = 0; n + 1 < length; n++) {
        // a germ of few values has no polynomials of higher degrees
        const size = this.recurrences[norm + n + 1];
        let next = (germs[k] - this.recurrences[alpha + n]) * polynomials[row + n];
        if (n) next -= this.recurrences[norm + n] * polynomials[row + n - 1];
        polynomials[row + n + 1] = size > 0 ? next / size : 0;
      }
    }
    for (let p = 0; p < this.terms; p++) {
      let product = 1;
      for (let k = 0; k < dimension; k++) {
        const degree = degrees[p * dimension + k];
        if (degree) product *= polynomials[k * length + degree];
      }
      basis[p] = product;
    }
    return this.surrogate.evaluate(element, basis);
  }
}

/**
 * The surrogate of a page.
 *
 * outputs, inputs, germs: what is known of them, with their names; times: a Float64Array, or null for outputs without.
 * statedRms, in the units of the outputs: an array (O, T), or null.
 */
export class LiveSurrogate {
  constructor(data) {
    this.outputs = data.outputs;
    this.times = data.times && unpackArray(data.times).values;
    this.count = this.times ? this.times.length : 1;
    this.inputs = data.inputs.map((one) => ({
      ...one,
      map: one.map && { ...one.map, table: unpackTable(one.map.table) },
    }));
    this.germs = data.germs.map((one) => ({
      ...one,
      values: one.values && unpackArray(one.values).values,
      levels: one.levels && unpackArray(one.levels).values,
      table: unpackTable(one.table),
    }));
    this.parts = data.parts.map((one) => new Part(one, this.times));
    this.statedRms = data.stated_rms && unpackArray(data.stated_rms).values;
    this.values = new Float64Array(this.outputs.length * this.count);
  }

  /** Germs at which all sliders start: the medians. */
  start() {
    return Float64Array.from(this.germs, (germ) => germ.start);
  }

  /**
   * Evaluate at germs.
   *
   * Returns { values, outside, unverified }: values (O, T), overwritten by the next call, NaN where the surrogate is not
   * known; outside: numbers of the germs that are beyond their support; unverified: numbers of those beyond the
   * realisations by which its error is stated.
   */
  evaluate(germs) {
    const { values, count } = this;
    for (const part of this.parts) {
      const found = part.evaluate(germs);
      part.outputs.forEach((output, row) => {
        for (let t = 0; t < count; t++) {
          const at = row * count + t;
          if (!part.used || part.used[at]) values[output * count + t] = found ? found[at] : NaN;
        }
      });
    }
    const beyond = (ends, x) => ends && ((ends[0] !== null && x < ends[0]) || (ends[1] !== null && x > ends[1]));
    const outside = [];
    const unverified = [];
    this.germs.forEach((germ, k) => {
      if (Number.isNaN(germs[k]) || beyond(germ.support, germs[k])) outside.push(k);
      else if (beyond(germ.verified, germs[k])) unverified.push(k);
    });
    return { values, outside, unverified };
  }

  /** Values of all inputs, in their units; NaN where the map is not known (inputs[k].reason says why). */
  inputsAt(germs) {
    return Float64Array.from(this.inputs, (input) => {
      if (!input.map) return NaN;
      return valueOf(input.map, this._standard(input, germs));
    });
  }

  /** The germ with which input k has a value, while the other germs stay; NaN where there is none. */
  germOf(k, value, germs) {
    const input = this.inputs[k];
    if (!input.map) return NaN;
    const own = input.sum.find(([germ]) => germ === k)[1];
    return (standardOf(input.map, value) - this._standard(input, germs, k)) / own;
  }

  /** Probability that germ k is at most x: the place in the distribution of its input, given those before it. */
  level(k, x) {
    const { values, levels, table } = this.germs[k];
    if (table) return Math.min(Math.max(tableValue(table, x), 0), 1);
    let found = 0;
    for (let n = 0; n < values.length && values[n] <= x; n++) found = levels[n];
    return found;
  }

  _standard(input, germs, without = -1) {
    let sum = 0;
    for (const [germ, weight] of input.sum) if (germ !== without) sum += weight * germs[germ];
    return sum;
  }
}
