// Surfaces of the shapes of bodies, relative to the corners of the boxes around them (solids.py does the same on paper).

import { unpackArray } from "./arrays.js";
import { isKnown } from "./geometry.js";

const LEVELS = 8;
const SHADE = 0.75;

export class Solids {
  /** @param owners - the number of the body of each point */
  constructor(data, owners) {
    this.shares = unpackArray(data.vertices).values;
    this.corners = unpackArray(data.corners).values;
    this.faces = unpackArray(data.faces).values;
    this.bodies = Array.from({ length: this.faces.length / 3 }, (_, f) => owners[this.corners[this.faces[3 * f]]]);
    this.shaped = new Set(this.bodies);
  }

  /** The vertices in the world, three numbers each; in the plane the third is 0. */
  places(points) {
    const { shares, corners } = this;
    const found = new Float64Array(3 * corners.length);
    for (let v = 0; v < corners.length; v++) {
      const first = points[corners[v]];
      for (let k = 0; k < first.length; k++) {
        let x = first[k];
        for (let axis = 0; axis < 3; axis++) x += shares[3 * v + axis] * (points[corners[v] + (1 << axis)][k] - first[k]);
        found[3 * v + k] = x;
      }
    }
    return found;
  }

  /** Shapes of the visible faces; `colour(body, level)` is the colour of a shade. Returns [] where a point is unknown. */
  draw(view, points, colour) {
    if (!points.every(isKnown)) return [];
    const places = this.places(points);
    const count = this.corners.length;
    const page = new Array(count);
    const behind = new Float64Array(count);
    for (let v = 0; v < count; v++) {
      const place = view.spatial ? [places[3 * v], places[3 * v + 1], places[3 * v + 2]] : [places[3 * v], places[3 * v + 1]];
      page[v] = view.project(place);
      behind[v] = view.depth(place);
    }
    const seen = [];
    const { faces } = this;
    for (let f = 0; 3 * f < faces.length; f++) {
      const [a, b, c] = [faces[3 * f], faces[3 * f + 1], faces[3 * f + 2]];
      const area = (page[b][0] - page[a][0]) * (page[c][1] - page[a][1]) - (page[b][1] - page[a][1]) * (page[c][0] - page[a][0]);
      if (!(area > 0)) continue;
      let level = 0;
      if (view.spatial) {
        const side = (p, q) => [0, 1, 2].map((k) => places[3 * q + k] - places[3 * p + k]);
        const [u, w] = [side(a, b), side(a, c)];
        const whole = Math.hypot(u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]);
        level = Math.round((LEVELS - 1) * (1 - Math.min((area * view.unit ** 2) / (whole || 1), 1)));
      }
      seen.push({ f, level, far: behind[a] + behind[b] + behind[c] });
    }
    seen.sort((one, other) => other.far - one.far);
    return seen.map(({ f, level }, k) => {
      const paint = colour(this.bodies[f], level);
      return { points: [page[faces[3 * f]], page[faces[3 * f + 1]], page[faces[3 * f + 2]]], edge: paint, face: paint, width: 0.4, closed: true, dashes: null, order: 2 + (0.5 * k) / seen.length, alpha: 1 };
    });
  }
}

const parts = (colour) => [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));

/** Colour of a shade: from the pale colour of a body to its own one. */
export function shadeOf(pale, own, level) {
  const share = (SHADE * level) / (LEVELS - 1);
  const [from, to] = [parts(pale), parts(own)];
  return `#${from.map((x, k) => Math.round((1 - share) * x + share * to[k]).toString(16).padStart(2, "0")).join("")}`;
}
