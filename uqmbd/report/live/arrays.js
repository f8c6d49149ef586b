// Arrays that Python has packed: { kind, shape, base64 } of little-endian numbers.

const KINDS = {
  float32: [Float32Array, "getFloat32"],
  float64: [Float64Array, "getFloat64"],
  int32: [Int32Array, "getInt32"],
};

const LITTLE_ENDIAN = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** Return { shape, values } with a typed array of all values, the last axis running fastest. */
export function unpackArray(packed) {
  const [Type, read] = KINDS[packed.kind];
  const text = atob(packed.base64);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = text.charCodeAt(k);
  if (LITTLE_ENDIAN) return { shape: packed.shape, values: new Type(bytes.buffer) };
  const view = new DataView(bytes.buffer);
  const values = new Type(bytes.length / Type.BYTES_PER_ELEMENT);
  for (let k = 0; k < values.length; k++) values[k] = view[read](k * Type.BYTES_PER_ELEMENT, true);
  return { shape: packed.shape, values };
}
