// Several charts of one figure, of which one is seen on the screen, and all are on paper.

import { makeChart } from "./chart.js";
import { chartModel } from "./chart_model.js";
import { button, element } from "./dom.js";

const unseen = [];

/** Make what nobody has looked at, for paper. */
export const completeViews = () => unseen.splice(0).forEach((make) => make());

/** Make the charts of a figure: data are `choose` (what is chosen), `seen` (which is first) and `views`, each with a title. */
export function makeViews(figure, { choose, seen, views }) {
  const described = figure.dataset.alt ?? "";
  const small = figure.classList.contains("small") ? " small" : "";
  const parts = views.map((view, k) => {
    const part = element("div", { class: `view${small}`, "data-alt": `${described} ${view.title}.` });
    let made = false;
    const make = () => {
      if (!made) makeChart(part, chartModel(view));
      made = true;
    };
    const toggle = button(view.title, `Show the chart of ${view.title}`, () => show(k));
    unseen.push(make);
    return { part, toggle, make };
  });
  function show(chosen) {
    parts.forEach(({ part, toggle }, k) => {
      part.classList.toggle("away", k !== chosen);
      toggle.setAttribute("aria-pressed", String(k === chosen));
    });
    parts[chosen].make();
  }
  const bar = element("div", { class: "views", role: "group", "aria-label": choose }, ...parts.map(({ toggle }) => toggle));
  figure.prepend(...(parts.length > 1 ? [bar] : []), element("div", { class: "parts" }, ...parts.map(({ part }) => part)));
  figure.classList.add("live", "several");
  show(seen);
}
