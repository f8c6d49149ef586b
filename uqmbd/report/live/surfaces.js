// Surfaces of the shapes of bodies in space, drawn by three.js: the library sorts them by depth for each pixel.

import { plus } from "./geometry.js";

// irradiance of a face towards the viewer, and of faces in shade; a Lambert surface reflects 1 / pi of it
const [LIT, SHADED] = [0.62 * Math.PI, 0.42 * Math.PI];
// share of the own colour of a body in its surface; the rest is its pale colour
const OWN = 0.45;

let renderer = null;
let withoutRenderer = false;

/** The renderer of all drawings of a page, because browsers limit their number; null without WebGL. */
function rendererOf(width, height) {
  if (withoutRenderer) return null;
  try {
    if (renderer?.getContext().isContextLost()) {
      renderer.dispose();
      renderer = null;
    }
    renderer ??= new THREE.WebGLRenderer({ alpha: true, antialias: true });
  } catch {
    withoutRenderer = true;
    return null;
  }
  const size = [renderer.domElement.width, renderer.domElement.height];
  if (size[0] !== width || size[1] !== height) renderer.setSize(width, height, false);
  return renderer;
}

/** Whether surfaces can be drawn here; false after the loss of WebGL. */
export const drawsSurfaces = () => typeof THREE !== "undefined" && rendererOf(...sizeNow()) !== null;

const sizeNow = () => [renderer?.domElement.width ?? 1, renderer?.domElement.height ?? 1];

export class Surfaces {
  /** @param solids - of solids.js */
  constructor(solids) {
    this.solids = solids;
    const count = solids.corners.length;
    this.places = new THREE.BufferAttribute(new Float32Array(3 * count), 3);
    this.colours = new THREE.BufferAttribute(new Float32Array(3 * count), 3);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", this.places);
    geometry.setAttribute("color", this.colours);
    geometry.setIndex(new THREE.BufferAttribute(Uint32Array.from(solids.faces), 1));
    const material = new THREE.MeshLambertMaterial({ vertexColors: true, flatShading: true, side: THREE.DoubleSide });
    const mesh = new THREE.Mesh(geometry, material);
    mesh.frustumCulled = false;
    this.resources = [geometry, material];
    this.light = new THREE.DirectionalLight("#ffffff", LIT);
    this.camera = new THREE.OrthographicCamera();
    this.camera.matrixAutoUpdate = false;
    this.scene = new THREE.Scene().add(mesh, this.light, new THREE.AmbientLight("#ffffff", SHADED));
  }

  /** Free the memory of the graphics library. */
  dispose() {
    for (const one of this.resources) one.dispose();
  }

  /**
   * Return a canvas with the surfaces of a pose; null without WebGL.
   *
   * @param view - of view.js; points - in the world, m; colours - of each body, [pale, own]; width, height - pixels
   */
  picture(view, points, colours, width, height) {
    const painter = rendererOf(width, height);
    if (painter === null) return null;
    this.place(view, points);
    this.paint(colours);
    this.look(view);
    painter.render(this.scene, this.camera);
    return painter.domElement;
  }

  /** Move the vertices, relative to the middle of the view: single precision suffices there. */
  place(view, points) {
    const places = this.solids.places(points);
    const { array } = this.places;
    let square = 0;
    for (let v = 0; v < array.length; v += 3) {
      let from = 0;
      for (let k = 0; k < 3; k++) {
        array[v + k] = places[v + k] - view.middle[k];
        from += array[v + k] ** 2;
      }
      square = Math.max(square, from);
    }
    this.reach = Math.sqrt(square) || 1;
    this.places.needsUpdate = true;
  }

  paint(colours) {
    const { corners, owners } = this.solids;
    const linear = colours.map(([pale, own]) => new THREE.Color(pale).lerp(new THREE.Color(own), OWN));
    corners.forEach((corner, v) => linear[owners[corner]].toArray(this.colours.array, 3 * v));
    this.colours.needsUpdate = true;
  }

  look(view) {
    const { camera, light } = this;
    const vector = (a) => new THREE.Vector3(...a);
    camera.matrix.makeBasis(vector(view.right), vector(view.up), vector(view.towards));
    camera.matrixWorldNeedsUpdate = true;
    camera.right = (view.wide * view.unit) / 2;
    camera.top = (view.high * view.unit) / 2;
    [camera.left, camera.bottom] = [-camera.right, -camera.top];
    [camera.near, camera.far] = [-1.01 * this.reach, 1.01 * this.reach];
    camera.updateProjectionMatrix();
    // from above and from the left of the viewer
    light.position.copy(vector(plus(plus(view.towards, view.up, 0.5), view.right, -0.35)));
  }
}
