// The drawing of the viewer: a mechanism in its pose, looked at from any side, nearer or further.

import { element, oncePerPicture } from "./dom.js";
import { hullOf, isKnown } from "./geometry.js";
import { Mechanism } from "./mechanism.js";
import { listenToOrbit } from "./orbit.js";
import { paintShapes } from "./strokes.js";
import { onTheme, palette } from "./theme.js";
import { View } from "./view.js";
import { bodyPose, distanceTo, ellipsoids, gapMarks, highlight, jointAxes } from "./viewer_marks.js";

const [NEAR_JOINT, NEAR_BODY] = [0.14, 0.1];

/** Bounds in the plane with room for discs of inertia, a fifth of the largest extent on all sides. */
function widened([low, high]) {
  if (low.length === 3) return [low, high];
  const room = 0.2 * Math.max(...low.map((x, k) => high[k] - x));
  return [low.map((x) => x - room), high.map((x) => x + room)];
}

/** @param named - is called with the part under the pointer, { kind, name } or null */
export class Stage {
  constructor(holder, named) {
    this.holder = holder;
    this.named = named;
    this.canvas = element("canvas", { role: "img", id: "drawing" });
    this.tip = element("div", { class: "tip", role: "tooltip" });
    this.tip.hidden = true;
    holder.tabIndex = 0;
    holder.append(this.canvas, this.tip);
    this.show = { ellipsoids: true, axes: true };
    this.mechanism = null;
    this.structure = { bodies: [], components: [] };
    this.gaps = [];
    this.marked = null;
    this.time = 0;
    this.cost = 0; // ms of scripts for the last picture, without painting
    this.repaint = oncePerPicture(() => this.paint());
    new ResizeObserver(this.repaint).observe(holder);
    onTheme(this.repaint);
    this.listen();
  }

  /** Draw another mechanism; the view stays where it is, unless `anew`. */
  put(data, found, anew) {
    this.mechanism?.dispose();
    this.mechanism = new Mechanism(data);
    this.found = found;
    this.time = this.mechanism.times[0];
    if (anew || !this.view || this.view.spatial !== this.mechanism.spatial) {
      this.view = new View(widened(data.bounds));
    }
    this.repaint();
  }

  go(time) {
    this.time = time;
    this.repaint();
  }

  /** Points and directions in the world, now. */
  points() {
    return this.mechanism.storedAt(0, this.time);
  }

  look() {
    const [width, height] = [Math.max(this.holder.clientWidth, 100), Math.max(this.holder.clientHeight, 100)];
    this.view.fit(width, height);
    return [width, height];
  }

  paint() {
    if (!this.mechanism) return;
    const begin = performance.now();
    const [width, height] = this.look();
    const colours = palette();
    const points = this.points();
    const { mechanism, view, structure } = this;
    const shapes = mechanism.draw(view, points, colours);
    if (this.show.ellipsoids) shapes.push(...ellipsoids(mechanism, view, this.found, this.time, colours));
    if (this.show.axes) shapes.push(...jointAxes(view, points, structure.components, colours));
    for (const gap of this.gaps) {
      const component = structure.components.find((one) => one.name === gap.component);
      if (component) shapes.push(...gapMarks(view, points, gap, component, colours));
    }
    if (this.marked) shapes.push(...highlight(view, this.placesOf(this.marked, points), colours));
    this.cost = performance.now() - begin;
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.lineCap = context.lineJoin = "round";
    view.paintScale(context, colours);
    paintShapes(context, shapes, view.inch, height);
    this.canvas.dataset.drawn = String(Number(this.canvas.dataset.drawn ?? 0) + 1);
    this.canvas.dataset.cost = this.cost.toFixed(2);
  }

  /** Places of a part in the world: points of a component; the centre of mass of a body, or its points. */
  placesOf({ kind, name }, points) {
    if (kind === "component") {
      const found = this.structure.components.find((one) => one.name === name);
      return (found?.points ?? []).map((k) => points[k]).filter(Boolean);
    }
    const b = this.mechanism.bodies.indexOf(name);
    if (b < 0) return [];
    const own = this.mechanism.own[b].map((k) => points[k]);
    return own.length ? own : [bodyPose(this.mechanism, b, this.time)[0]];
  }

  /** The part at a place on the page, inches: a component near one of its points, otherwise a body near its outline. */
  partAt(place) {
    const { mechanism, view, structure } = this;
    const points = this.points();
    const near = [];
    for (const { name, points: own } of structure.components)
      for (const k of own)
        if (points[k] && isKnown(points[k])) {
          const away = distanceTo(place, [view.project(points[k]), view.project(points[k])]);
          if (away < NEAR_JOINT) near.push({ kind: "component", name, away });
        }
    mechanism.bodies.forEach((name, b) => {
      const page = mechanism.own[b].map((k) => points[k]).filter(isKnown).map((p) => view.project(p));
      if (!page.length) return;
      const corners = hullOf(page);
      const away = Math.min(...corners.map((corner, k) => distanceTo(place, [corner, corners[(k + 1) % corners.length]])));
      if (away < NEAR_BODY) near.push({ kind: "body", name, away: away + NEAR_JOINT });
    });
    return near.sort((a, b) => a.away - b.away)[0] ?? null;
  }

  reset() {
    this.view?.reset();
    this.repaint();
  }

  mark(part) {
    this.marked = part;
    this.repaint();
  }

  listen() {
    const { holder } = this;
    const placeOf = (event) => {
      const box = this.canvas.getBoundingClientRect();
      return [(event.clientX - box.left) / this.view.inch, (box.bottom - event.clientY) / this.view.inch];
    };
    const held = listenToOrbit(holder, () => (this.mechanism ? this.view : null), this.repaint, true);
    holder.addEventListener("pointermove", (event) => {
      if (!this.view || !this.mechanism || held()) return;
      const part = this.partAt(placeOf(event));
      this.named(part);
      this.tip.hidden = part === null;
      if (part) {
        this.tip.textContent = this.describe(part);
        const box = holder.getBoundingClientRect();
        this.tip.style.left = `${Math.min(event.clientX - box.left + 14, box.width - 180)}px`;
        this.tip.style.top = `${event.clientY - box.top + 14}px`;
      }
    });
    holder.addEventListener("pointerleave", () => {
      this.tip.hidden = true;
      this.named(null);
    });
  }

  describe({ kind, name }) {
    if (kind === "body") return `${name} (body)`;
    const found = this.structure.components.find((one) => one.name === name);
    return `${name} (${found.type} of ${found.bodies.join(" and ")})`;
  }
}
