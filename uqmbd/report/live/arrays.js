// Arrays that Python has packed (arrays.py): little-endian numbers, whole numbers of steps, or the ends of a range.

const KINDS = {
  float32: [Float32Array, "getFloat32"],
  float64: [Float64Array, "getFloat64"],
  int32: [Int32Array, "getInt32"],
};

const LITTLE_ENDIAN = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

let shared = null;

/** Return the text of an array; a number is that of a text that several arrays of the page have. */
function textOf(base64) {
  if (typeof base64 === "string") return base64;
  shared ??= JSON.parse(document.getElementById("shared-arrays").textContent);
  return shared[base64];
}

function bytesOf(base64) {
  const text = atob(textOf(base64));
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = text.charCodeAt(k);
  return bytes;
}

/** The number of some bits, the lowest first, that begin at a place. */
function numberAt(bytes, place, count) {
  let number = 0;
  for (let done = 0; done < count; ) {
    const offset = (place + done) & 7;
    const more = Math.min(8 - offset, count - done);
    number += ((bytes[(place + done) >> 3] >> offset) & (2 ** more - 1)) * 2 ** done;
    done += more;
  }
  return number;
}

/**
 * Fill an array with whole numbers of steps; with `lag`, of differences. The first byte is how many bits a width has. Then
 * come the widths of blocks of eight numbers, then the blocks; the lowest bit of a number is its sign.
 */
function fillSteps(values, bytes, steps, lag) {
  const whole = new Float64Array(values.length);
  const [size, blocks] = [bytes[0], Math.ceil(values.length / 8)];
  let place = 8 + 8 * Math.ceil((blocks * size) / 8);
  for (let k = 0, width = 0; k < values.length; k++) {
    if (k % 8 === 0) width = numberAt(bytes, 8 + (k / 8) * size, size);
    const folded = numberAt(bytes, place, width);
    place += width;
    whole[k] = folded % 2 ? -(folded + 1) / 2 : folded / 2;
    if (lag && k >= lag) whole[k] += whole[k - lag];
    values[k] = whole[k] * steps[k % steps.length];
  }
}

/** Powers of the eighth root of two. */
const stepsOf = (powers) => Array.from(powers, (power) => 2 ** (power / 8));

/** Return { shape, values } with a typed array of all values, the last axis running fastest. */
export function unpackArray({ kind, shape, ends, of, chosen, lag, eighths, unknown = [], base64 }) {
  const [Type, read] = KINDS[kind];
  if (chosen) {
    const { values } = unpackArray({ kind, shape: [of], ends });
    return { shape, values: Type.from(unpackArray(chosen).values, (k) => values[k]) };
  }
  if (ends || lag !== undefined) {
    const values = new Type(shape.reduce((a, b) => a * b, 1));
    if (!ends) fillSteps(values, bytesOf(base64), eighths ? stepsOf(unpackArray(eighths).values) : [1], lag);
    else {
      const between = (ends[1] - ends[0]) / (values.length - 1);
      for (let k = 0; k < values.length; k++) values[k] = ends[0] + k * between;
      values[values.length - 1] = ends[1];
    }
    for (let k = 0; k < unknown.length; k += 2) values.fill(NaN, unknown[k], unknown[k + 1]);
    return { shape, values };
  }
  const bytes = bytesOf(base64);
  if (LITTLE_ENDIAN) return { shape, values: new Type(bytes.buffer) };
  const view = new DataView(bytes.buffer);
  const values = new Type(bytes.length / Type.BYTES_PER_ELEMENT);
  for (let k = 0; k < values.length; k++) values[k] = view[read](k * Type.BYTES_PER_ELEMENT, true);
  return { shape, values };
}
