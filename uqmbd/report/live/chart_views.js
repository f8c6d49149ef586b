// Several charts of one figure, of which one is seen on the screen, and all are on paper.

import { makeChart, onPaper } from "./chart.js";
import { chartModel } from "./chart_model.js";
import { legendOf } from "./chart_picture.js";
import { button, element } from "./dom.js";

const unseen = [];

/** Make what nobody has looked at, for paper. */
export const completeViews = () => unseen.splice(0).forEach((make) => make());

/** What the legend of a chart shows; charts with limits or boxes have one of their own. */
const legendText = ({ methods, limits, boxes, title }) =>
  JSON.stringify([methods.map(({ label, colours, dash, shape, lines, bands }) => [label, colours, dash, shape, [...lines, ...bands].map(({ name }) => name)]), limits?.length || boxes ? title : ""]);

/** Make the charts of a figure: data are `choose` (what is chosen), `seen` (which is first) and `views`, each with a title. */
export function makeViews(figure, { choose, seen, views }) {
  const described = figure.dataset.alt ?? figure.querySelector("img")?.alt ?? "";
  const small = figure.classList.contains("small") ? " small" : "";
  const sharesLegend = new Set(views.map(legendText)).size === 1 && views.length > 1;
  const parts = views.map((view, k) => {
    const part = element("div", { class: `view${small}`, "data-alt": `${described} ${view.title}.` });
    let made = false;
    const make = () => {
      if (!made) makeChart(part, { ...chartModel(view), sharesLegend });
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
  const legend = element("div", { class: "legend", "aria-hidden": "true" });
  if (sharesLegend) onPaper(() => legend.replaceChildren(legendOf(chartModel(views[0]))));
  figure.prepend(...(parts.length > 1 ? [bar] : []), legend, element("div", { class: "parts" }, ...parts.map(({ part }) => part)));
  figure.classList.add("live", "several");
  show(seen);
}
