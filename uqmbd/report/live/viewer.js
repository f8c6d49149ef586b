// The page of `uqmbd view`: messages of the server, and requests to it.

import { button, element } from "./dom.js";
import { fileName, saveBlob } from "./exports.js";
import { formatNumber } from "./numbers.js";
import { speedsOf } from "./speeds.js";
import { findingRows, nameRow, showFindings, showInputs, showTree } from "./viewer_panel.js";
import { Stage } from "./viewer_stage.js";

const REST_AT_END = 0.5;

export function startViewer() {
  const part = (name) => document.getElementById(name);
  const [status, banner, findings, tree, inputs, controls] = ["status", "banner", "findings", "tree", "inputs", "controls"].map(part);
  const stage = new Stage(part("stage"), (found) => nameRow(tree, found));
  const mark = (found) => stage.mark(found);
  let scene = null;
  let facts = null;
  let values = {};
  let mode = "pose";
  let motion = null;
  let number = 0;
  let over = false;

  // -- requests -------------------------------------------------------------------------------------------------------
  const asked = { pose: null, motion: null };
  async function ask(request) {
    try {
      await fetch("ask", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(request) });
    } catch {
      // the server has ended; the stream of events reports it
    }
  }
  function want(kind) {
    number += 1;
    asked[kind] = number;
    ask({ do: kind, values, number });
  }

  // -- controls -------------------------------------------------------------------------------------------------------
  const play = button("▶ Simulate", "Simulate the motion at these inputs, and play it (space)", () => (motion ? toggle() : begin()));
  const scrub = element("input", { type: "range", min: 0, max: 1, step: "any", "aria-label": "Time" });
  const clock = element("output", { class: "clock" });
  const speed = element("select", { title: "Seconds of motion per second", "aria-label": "Speed" });
  const drawn = element("input", { type: "checkbox", id: "as-drawn" });
  const boxes = [["ellipsoids", "inertia ellipsoids"], ["axes", "joint axes"]].map(([key, text]) => {
    const box = element("input", { type: "checkbox" });
    box.checked = stage.show[key];
    box.addEventListener("change", () => {
      stage.show[key] = box.checked;
      stage.repaint();
    });
    return element("label", {}, box, ` ${text}`);
  });
  drawn.addEventListener("change", () => {
    mode = "pose";
    pause();
    show(false);
  });
  const reset = button("Reset view", "Reset the view (key 0)", () => stage.reset());
  const shapes = button("glTF", "Save the shapes in this pose for three-dimensional programs", () =>
    saveBlob(new Blob([stage.mechanism.gltf(stage.points())], { type: "model/gltf+json" }), fileName(scene.mechanism, "gltf")));
  shapes.hidden = true;
  controls.append(play, scrub, clock, speed, element("label", { title: "The pose that the bodies state, before the assembly" }, drawn, " given pose"), ...boxes, reset, shapes);

  let playing = false;
  let earlier = null;
  let rested = 0;
  function begin() {
    play.disabled = true;
    play.textContent = "Simulating …";
    want("motion");
  }
  function toggle() {
    mode = "motion";
    drawn.checked = false;
    if (playing) return pause();
    playing = true;
    earlier = null;
    if (stage.time >= ends()[1]) stage.go(ends()[0]);
    tellPlay();
    requestAnimationFrame(tick);
  }
  function pause() {
    playing = false;
    tellPlay();
  }
  const ends = () => [stage.mechanism.times[0], stage.mechanism.times[stage.mechanism.times.length - 1]];
  function tellPlay() {
    play.disabled = !scene?.times;
    play.title = scene?.times ? "Simulate the motion at these inputs, and play it (space)" : "There are no output times: define a study with times, or view(times=...)";
    play.textContent = motion ? (playing ? "❚❚ Pause" : "▶ Play") : "▶ Simulate";
    scrub.hidden = speed.hidden = clock.hidden = !motion || mode !== "motion";
  }
  function tick(now) {
    if (!playing || mode !== "motion") return;
    const passed = earlier === null ? 0 : Math.min((now - earlier) / 1000, 0.25);
    earlier = now;
    const [first, last] = ends();
    if (stage.time >= last) {
      rested += passed;
      if (rested > REST_AT_END) goTo(first);
    } else {
      rested = 0;
      goTo(Math.min(stage.time + passed * Number(speed.value), last));
    }
    requestAnimationFrame(tick);
  }
  function goTo(time) {
    stage.go(time);
    scrub.value = time;
    clock.textContent = `${time.toFixed(3)} s`;
  }
  scrub.addEventListener("input", () => {
    pause();
    goTo(Number(scrub.value));
  });

  // -- what is shown --------------------------------------------------------------------------------------------------
  function show(anew) {
    if (!scene) return;
    if (mode === "motion" && motion) {
      stage.put(motion.player, motion.ellipsoids, false);
      stage.gaps = [];
      const [first, last] = ends();
      Object.assign(scrub, { min: first, max: last });
      const { natural, speeds } = speedsOf(last - first);
      speed.replaceChildren(...speeds.map((x) => element("option", { value: x }, x === 1 ? "real time" : `${formatNumber(x)} ×`)));
      speed.value = String(natural);
      goTo(first);
    } else {
      const stated = drawn.checked || scene.note !== "";
      stage.put(stated ? scene.stated : scene.player, scene.ellipsoids, anew);
      stage.gaps = stated ? scene.gaps : scene.gaps.filter(({ closed }) => !closed);
      clock.textContent = "";
    }
    stage.structure = scene;
    shapes.hidden = stage.mechanism.solids === null;
    tellPlay();
    showFindings(findings, findingRows(scene, facts), mark, facts !== null);
    part("mobility").textContent = facts?.mobility == null ? "" : `${facts.mobility} degree${facts.mobility === 1 ? "" : "s"} of freedom`;
  }

  function choose(chosen) {
    values = chosen;
    motion = null;
    if (mode === "motion") mode = "pose";
    pause();
    want("pose");
  }

  const receive = {
    status({ state, message, line, seconds }) {
      document.body.dataset.state = state;
      status.textContent = state === "loading" ? "Loading …" : state === "shown" ? `Loaded in ${seconds.toFixed(2)} s` : "Error";
      banner.hidden = state !== "error";
      if (state === "error") {
        const place = line === null ? "" : `Line ${line}: `;
        banner.textContent = `${place}${message}${scene ? "\nThe last good state is shown." : ""}`;
      }
    },
    scene(found) {
      const anew = scene === null || scene.mechanism !== found.mechanism || scene.space !== found.space;
      scene = found;
      facts = null;
      motion = null;
      mode = "pose";
      pause();
      const chosen = showInputs(inputs, scene.inputs, values, choose);
      const changed = scene.inputs.some(({ name, mean }) => chosen[name] !== mean);
      values = chosen;
      document.title = `${scene.mechanism} – uqmbd view`;
      part("title").textContent = scene.study ?? scene.mechanism;
      stage.structure = scene;
      showTree(tree, scene, mark);
      show(anew);
      if (changed) want("pose");
    },
    findings(found) {
      facts = found;
      show(false);
    },
    pose(found) {
      if (found.number !== asked.pose || !scene) return;
      scene = { ...scene, ...found };
      refusal("");
      show(false);
    },
    motion(found) {
      if (found.number !== asked.motion || !scene) return;
      motion = found;
      refusal(found.stopped ? `The motion stopped: ${found.stopped}` : "");
      mode = "motion";
      drawn.checked = false;
      show(false);
      toggle();
    },
    refused({ of, number: its, message }) {
      if (of in asked && its !== asked[of]) return;
      refusal(message);
      tellPlay();
    },
    ended() {
      over = true;
      events.close();
      status.textContent = "Ended";
      document.body.dataset.state = "ended";
    },
  };
  function refusal(text) {
    part("refusal").textContent = text;
    part("refusal").hidden = text === "";
  }

  const events = new EventSource("events");
  events.addEventListener("message", (event) => {
    const message = JSON.parse(event.data);
    receive[message.kind]?.(message);
  });
  events.addEventListener("error", () => {
    if (!over) status.textContent = "No connection to uqmbd view; it may have ended.";
  });
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") ask({ do: "end" });
    else if (event.key === " " && !["INPUT", "BUTTON", "SELECT"].includes(event.target.tagName)) {
      event.preventDefault();
      play.click();
    }
  });
  tellPlay();
}
