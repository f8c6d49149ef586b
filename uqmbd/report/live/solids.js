// Triangles of the shapes of bodies, relative to the corners of the boxes around them (solids.py does the same on paper).

import { unpackArray } from "./arrays.js";
import { isKnown } from "./geometry.js";

export class Solids {
  /** @param owners - the number of the body of each point */
  constructor(data, owners) {
    this.owners = owners;
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

  /** Shapes of the triangles in the plane; `colour(body)` is a role. Returns [] where a point is unknown. */
  draw(view, points, colour) {
    if (!points.every(isKnown)) return [];
    const places = this.places(points);
    const page = Array.from(this.corners, (_, v) => view.project([places[3 * v], places[3 * v + 1]]));
    const shapes = [];
    const { faces } = this;
    for (let f = 0; 3 * f < faces.length; f++) {
      const [a, b, c] = [page[faces[3 * f]], page[faces[3 * f + 1]], page[faces[3 * f + 2]]];
      const area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
      const role = colour(this.bodies[f]);
      if (area > 0) shapes.push({ points: [a, b, c], edge: role, face: role, width: 0.4, closed: true, dashes: null, order: 2, alpha: 1 });
    }
    return shapes;
  }
}
