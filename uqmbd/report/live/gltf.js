// The shapes of a mechanism in one pose as a glTF 2.0 file (Khronos Group, 2021), with its data embedded.

const FLOAT = 5126;
const UNSIGNED = 5125;

/** Text of base64 of bytes, in parts that the stack holds. */
function base64Of(bytes) {
  let text = "";
  for (let k = 0; k < bytes.length; k += 0x8000) text += String.fromCharCode(...bytes.subarray(k, k + 0x8000));
  return btoa(text);
}

/** A colour #rrggbb as linear light, as glTF expects. */
const linear = (colour) => [1, 3, 5].map((k) => {
  const x = parseInt(colour.slice(k, k + 2), 16) / 255;
  return x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
});

/**
 * Return the text of a file with a mesh for each body that has shapes; the third axis is upwards in the mechanism, and the
 * second in glTF.
 *
 * @param solids - of mechanism.js; points - of a pose; names - of the bodies; colours - of the bodies, #rrggbb
 */
export function gltfOf(solids, points, names, colours) {
  const places = solids.places(points);
  const parts = [];
  let size = 0;
  const views = [];
  const accessors = [];
  const add = (array, target, accessor) => {
    views.push({ buffer: 0, byteOffset: size, byteLength: array.byteLength, target });
    accessors.push({ bufferView: views.length - 1, count: array.length, type: "SCALAR", ...accessor });
    parts.push(new Uint8Array(array.buffer));
    size += array.byteLength;
    return accessors.length - 1;
  };
  const meshes = [...solids.shaped].sort((a, b) => a - b).map((b) => {
    const numbers = new Map();
    const indices = [];
    solids.bodies.forEach((body, f) => {
      if (body !== b) return;
      for (let k = 0; k < 3; k++) {
        const v = solids.faces[3 * f + k];
        if (!numbers.has(v)) numbers.set(v, numbers.size);
        indices.push(numbers.get(v));
      }
    });
    const positions = new Float32Array(3 * numbers.size);
    for (const [v, n] of numbers) for (let k = 0; k < 3; k++) positions[3 * n + k] = places[3 * v + k];
    const along = [0, 1, 2].map((k) => positions.filter((_, n) => n % 3 === k));
    const [low, high] = [Math.min, Math.max].map((end) => along.map((xs) => xs.reduce((best, x) => end(best, x))));
    const place = add(positions, 34962, { componentType: FLOAT, count: numbers.size, type: "VEC3", min: low, max: high });
    const corners = add(new Uint32Array(indices), 34963, { componentType: UNSIGNED });
    return { name: names[b], body: b, primitives: [{ attributes: { POSITION: place }, indices: corners, material: 0 }] };
  });
  meshes.forEach((mesh, k) => (mesh.primitives[0].material = k));
  const bytes = new Uint8Array(size);
  let place = 0;
  for (const part of parts) {
    bytes.set(part, place);
    place += part.length;
  }
  const turn = Math.SQRT1_2; // a quarter of a turn about the first axis
  return JSON.stringify({
    asset: { version: "2.0", generator: "uqmbd" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ rotation: [-turn, 0, 0, turn], children: meshes.map((_, k) => k + 1) }, ...meshes.map(({ name }, k) => ({ name, mesh: k }))],
    materials: meshes.map(({ body }) => ({ pbrMetallicRoughness: { baseColorFactor: [...linear(colours[body]), 1], metallicFactor: 0, roughnessFactor: 0.7 } })),
    meshes: meshes.map(({ name, primitives }) => ({ name, primitives })),
    accessors,
    bufferViews: views,
    buffers: [{ byteLength: size, uri: `data:application/octet-stream;base64,${base64Of(bytes)}` }],
  });
}
