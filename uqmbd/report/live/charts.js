// Every figure of the page that has data becomes a chart, as soon as it comes near the window.

import { drawForPaper, makeChart } from "./chart.js";
import { chartModel } from "./chart_model.js";
import { completeViews, makeViews } from "./chart_views.js";

/** Begin: figures of a part of the page that have data are watched, and each becomes a chart once. */
export function startCharts(part = document) {
  const waiting = new Set(part.querySelectorAll("figure.charted"));
  const make = (figure) => {
    near.unobserve(figure);
    if (!waiting.delete(figure)) return;
    try {
      const data = JSON.parse(figure.querySelector('script[type="application/json"]').textContent);
      if (data.views) makeViews(figure, data);
      else makeChart(figure, chartModel(data));
    } catch (error) {
      // its picture stands; others are charts none the less
      console.error(error);
    }
  };
  const near = new IntersectionObserver(
    (entries) => entries.filter((entry) => entry.isIntersecting).forEach(({ target }) => make(target)),
    { rootMargin: "400px" },
  );
  // that of the first screen at once: the page begins at its time
  waiting.forEach((figure) => (figure.classList.contains("small") ? make(figure) : near.observe(figure)));
  // paper has what the browser draws, what was far from the window, too
  window.addEventListener("beforeprint", () => {
    [...waiting].forEach(make);
    completeViews();
    drawForPaper();
  });
}
