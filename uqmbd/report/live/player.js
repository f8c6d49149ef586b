// The player of a mechanism: its motion at the means of the inputs, or at those that are chosen, before other realisations.

import { LIGHT } from "./colours.js";
import { button, element, oncePerPicture } from "./dom.js";
import { fileName, saveBlob } from "./exports.js";
import { onInputs, pageInputs } from "./inputs_bus.js";
import { Mechanism } from "./mechanism.js";
import { formatError, formatNumber, nearestIndex } from "./numbers.js";
import { listenToOrbit } from "./orbit.js";
import { LivePoses } from "./poses.js";
import { speedsOf } from "./speeds.js";
import { paintShapes } from "./strokes.js";
import { onTheme, palette } from "./theme.js";
import { announceTime, beginAt, onTime } from "./time_bus.js";
import { View } from "./view.js";

const REST = 0.7;

/**
 * Make a player.
 *
 * @param figure - where; its picture stays for paper. One that is small, as on the first screen, has few controls.
 */
export function makePlayer(figure, data) {
  const small = figure.classList.contains("small");
  const mechanism = new Mechanism(data);
  const live = data.live && new LivePoses(data.live);
  const view = new View(data.bounds);
  const { times } = mechanism;
  const [begin, end] = [times[0], times[times.length - 1]];
  const digits = Math.min(Math.max(Math.ceil(1 - Math.log10((end - begin) / 400)), 0), 12);
  const clock = (time) => `${time.toFixed(digits)} s`.replace("-", "−");
  let time = beginAt(times[data.start]);
  let playing = false;
  let found = null;
  let cloud = data.realisations > 1;
  let earlier = null;
  // the named realisation that is drawn; null: at the inputs of the page
  let named = null;

  const canvas = element("canvas", { role: "img" });
  const stage = element("div", { class: "stage", role: "group", "aria-label": `The mechanism ${data.mechanism}` }, canvas);
  const play = button("", "Play or pause (space)", () => (playing ? pause() : start()));
  const scrub = element("input", { type: "range", min: 0, max: times.length - 1, step: 1, "aria-label": "Time of the mechanism" });
  const told = element("output", { class: "clock" });
  const { natural, speeds } = speedsOf(end - begin);
  const speed = element("select", { title: "Seconds of motion per second" });
  for (const x of speeds) speed.append(element("option", { value: x }, x === 1 ? "real time" : `${formatNumber(x)} ×`));
  speed.value = String(natural);
  const controls = element("div", { class: "controls" }, play, scrub, told);
  if (!small) controls.append(element("span", { class: "row" }), element("label", {}, "Speed ", speed));
  if (data.realisations > 1 && !small) {
    const others = element("input", { type: "checkbox" });
    others.checked = true;
    others.addEventListener("change", () => {
      cloud = others.checked;
      repaint();
    });
    controls.append(element("label", {}, others, ` ${data.realisations - 1} realisation${data.realisations > 2 ? "s" : ""}`));
  }
  const pose = element("select", { title: "Realisation that is drawn" });
  const poseNames = ["at the means of the inputs", ...data.named.map((one) => one.name)];
  pose.append(...poseNames.map((name, k) => element("option", { value: k }, name)));
  pose.addEventListener("change", () => showNamed(Number(pose.value) - 1));
  if (data.named.length && !small) controls.append(element("label", {}, "Pose ", pose));
  const deformed = mechanism.displaced;
  if (deformed && !small) {
    const scale = element("select", { title: "Scale of the deformation in the drawing" });
    const scales = deformed.factor > 1 ? [1, deformed.factor, 0] : [1, 0];
    scale.append(...scales.map((x) => element("option", { value: x }, x === 0 ? "none" : x === 1 ? "true scale" : `× ${formatNumber(x)}`)));
    scale.addEventListener("change", () => {
      mechanism.magnified = Number(scale.value);
      say();
      repaint();
    });
    controls.append(element("label", {}, "Deformation ", scale));
  }
  if (view.spatial) {
    stage.tabIndex = 0;
    stage.classList.add("turns");
    stage.title = "Drag to rotate, Shift and drag to move, Ctrl and wheel to enlarge. Keys: ← → ↑ ↓ rotate, with Shift they move; + and − enlarge and reduce; 0 resets the view; space plays.";
    if (!small) controls.append(button("Reset view", "Reset the view (key 0)", resetView));
  }
  if (!small && mechanism.solids) controls.append(button("glTF", "Save the shapes in this pose for three-dimensional programs", saveShapes));
  if (!small) controls.append(button("PNG", "Save the view as a picture", save));
  const status = small ? figure.querySelector("figcaption") : element("p", { class: "state", role: "status" });
  const atMeans = small ? status.textContent : "At the means of the inputs.";
  const holder = element("div", { class: "chart stage-holder" }, stage, controls);
  if (!small) holder.append(status, element("p", { class: "state" }, data.caption));
  figure.prepend(holder);
  figure.classList.add("live");

  const frame = () => nearestIndex(times, time);
  let seen = false;
  let drawn = false;
  let stale = false;
  const repaint = oncePerPicture(() => {
    // pictures of the whole page have the mechanism, too: it is drawn once before it is seen
    if (!seen && drawn) return;
    drawn = stage.clientWidth > 0;
    if (stale) evaluate();
    paint(canvas, palette());
  });

  /** Points of the drawn realisation at a time. */
  function drawnAt(at) {
    if (named !== null) return mechanism.storedAt(data.realisations + named, at);
    return found ? mechanism.foundAt(found, at) : mechanism.storedAt(0, at);
  }

  function shapesOf(colours) {
    const shapes = [];
    const means = named === null && !found;
    const way = data.followed ? minusWay(mechanism.storedAt(0, time)) : null;
    const moved = (points) => (way ? mechanism.shifted(points, way) : points);
    if (!data.followed) shapes.push(...mechanism.tracks(view, (k) => drawnAt(times[k]), colours));
    if (cloud || !means) {
      const alpha = Math.min(Math.max(5 / Math.max(data.realisations - 1, 1), 0.15), 0.6);
      const from = means ? 1 : 0;
      const to = cloud ? data.realisations : 1;
      for (let r = from; r < to; r++) shapes.push(...mechanism.ghosts(view, moved(mechanism.storedAt(r, time)), colours, r ? alpha : 0.9));
    }
    const radii = named === null && found?.points ? mechanism.owners.map((_, n) => Math.abs(found.points[(n + 1) * (data.dimension + 1) - 1])) : mechanism.radii;
    shapes.push(...mechanism.draw(view, moved(drawnAt(time)), colours, radii));
    return shapes;
  }

  function minusWay(points) {
    const first = mechanism.wayOf(mechanism.storedAt(0, begin));
    return mechanism.wayOf(points).map((x, k) => first[k] - x);
  }

  function paint(target, colours, ratio = window.devicePixelRatio || 1) {
    const width = Math.max(stage.clientWidth, 200);
    const height = Math.round(view.fit(width, small ? Math.max(stage.clientHeight, 120) : null));
    target.width = Math.round(width * ratio);
    target.height = Math.round(height * ratio);
    target.style.height = `${height}px`;
    const context = target.getContext("2d");
    context.scale(ratio, ratio);
    context.lineCap = context.lineJoin = "round";
    if (target !== canvas) {
      context.fillStyle = colours.paper;
      context.fillRect(0, 0, width, height);
    }
    view.paintScale(context, colours);
    paintShapes(context, shapesOf(colours), view.inch, height);
    tell();
  }

  function tell() {
    const k = frame();
    told.textContent = clock(time);
    if (Number(scrub.value) !== k) scrub.value = k;
    scrub.setAttribute("aria-valuetext", clock(time));
    canvas.setAttribute("aria-label", `The mechanism ${data.mechanism} at ${clock(time)}, ${words()}.`);
  }

  const words = () => (named !== null ? poseNames[named + 1] : found ? "at the chosen inputs" : "at the means of the inputs");

  // what a picture is that stands still while the time runs
  const held = mechanism.resolved ? "" : ` The motion is too fast to be interpolated between ${times.length} times; the nearest time is shown.`;

  function say() {
    tellInputs();
    const flat = mechanism.solids && view.spatial && !mechanism.surfacesHere();
    status.textContent += tellScale() + held + (flat ? " WebGL is not available: bodies are drawn as outlines." : "");
  }

  /** State the scale of deformations in the drawing. */
  function tellScale() {
    if (!deformed) return "";
    if (found && !found.displaced && named === null) return " Flexible bodies are undeformed: the results are older and do not contain their deformation.";
    if (mechanism.magnified === 0) return " Flexible bodies are undeformed.";
    if (mechanism.magnified === 1) return " Deformations are at true scale.";
    return ` Deformations are magnified by ${formatNumber(mechanism.magnified)}; joints of flexible bodies are therefore open.`;
  }

  function tellInputs() {
    if (named !== null) status.textContent = `Drawn: ${poseNames[named + 1]}. The outline is the mechanism at the means of the inputs.`;
    else if (!pageInputs()) status.textContent = atMeans;
    else if (!found) status.textContent = `At the means of the inputs, not at the chosen ones: ${data.reason}`;
    else {
      const rms = live.largestError(mechanism.reaches, mechanism.magnified);
      const error = rms === null ? "its error is unknown" : `stated error of the drawn points at most ${formatError(rms, "m")}`;
      const beyond = found.unverified.length || found.outside.length ? " These inputs are outside the verification realisations." : "";
      status.textContent = `At the chosen inputs, by the surrogate: ${error}.${beyond}`;
    }
  }

  function go(to, announced = true) {
    time = Math.min(Math.max(to, begin), end);
    repaint();
    if (announced) announceTime(time, holder);
  }

  /** Draw a named realisation at its time; -1: draw the inputs of the page. */
  function showNamed(k) {
    named = k < 0 ? null : k;
    pose.value = String(k + 1);
    say();
    named === null ? repaint() : go(data.named[k].time);
  }

  function start() {
    playing = true;
    earlier = null;
    if (time >= end) time = begin;
    mark();
    requestAnimationFrame(tick);
  }

  function pause() {
    playing = false;
    mark();
  }

  function mark() {
    play.textContent = playing ? "❚❚ Pause" : "▶ Play";
    play.setAttribute("aria-pressed", String(playing));
  }

  let rested = 0;
  function tick(now) {
    if (!playing) return;
    const passed = earlier === null ? 0 : Math.min((now - earlier) / 1000, 0.25);
    earlier = now;
    if (time >= end) {
      rested += passed;
      if (rested > REST) go(begin);
    } else {
      rested = 0;
      go(time + passed * Number(speed.value));
    }
    requestAnimationFrame(tick);
  }

  function resetView() {
    view.reset();
    repaint();
  }

  async function save() {
    const made = document.createElement("canvas");
    paint(made, LIGHT, 2);
    made.toBlob((blob) => saveBlob(blob, fileName(`${data.mechanism}-${clock(time)}`, "png")));
  }

  function saveShapes() {
    const text = mechanism.gltf(drawnAt(time));
    saveBlob(new Blob([text], { type: "model/gltf+json" }), fileName(`${data.mechanism}-${clock(time)}`, "gltf"));
  }

  scrub.addEventListener("input", () => {
    pause();
    go(times[Number(scrub.value)]);
  });
  holder.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key !== " " || (event.target !== stage && event.target !== scrub)) return;
    playing ? pause() : start();
    event.preventDefault();
  });
  if (view.spatial) listenToOrbit(stage, () => view, repaint, false);
  onTime(holder, (to) => {
    if (playing) pause();
    go(to, false);
  });
  function evaluate() {
    stale = false;
    found = live && pageInputs() ? live.evaluate(pageInputs().germs) : null;
    pose.options[0].textContent = found ? "at the chosen inputs" : "at the means of the inputs";
    named = null;
    pose.value = "0";
    say();
  }
  function follow() {
    stale = true;
    repaint();
  }
  onInputs(follow);
  onTheme(repaint);
  new ResizeObserver(repaint).observe(stage);
  // what is not in the window is not drawn
  const near = new IntersectionObserver((entries) => {
    seen = entries[entries.length - 1].isIntersecting;
    repaint();
  });
  near.observe(stage);
  mark();
  evaluate();
}

/** Begin: what has the data of a mechanism, or names where they are, becomes a player. */
export function startPlayers() {
  for (const place of document.querySelectorAll(".player")) {
    const source = place.dataset.of ? document.getElementById(place.dataset.of) : place;
    const data = source && source.querySelector('script[type="application/json"]');
    if (data) makePlayer(place, JSON.parse(data.textContent));
  }
}
