// Every figure of the page that has data becomes a chart, as soon as it comes near the window.

import { makeChart } from "./chart.js";
import { chartModel } from "./chart_model.js";

/** Begin: figures of a part of the page that have data are watched, and each becomes a chart once. */
export function startCharts(part = document) {
  const near = new IntersectionObserver(
    (entries) => {
      for (const { target, isIntersecting } of entries) {
        if (!isIntersecting) continue;
        near.unobserve(target);
        try {
          const data = target.querySelector('script[type="application/json"]');
          makeChart(target, chartModel(JSON.parse(data.textContent)));
        } catch (error) {
          // its picture stands; others are charts none the less
          console.error(error);
        }
      }
    },
    { rootMargin: "400px" },
  );
  for (const figure of part.querySelectorAll("figure.charted")) near.observe(figure);
}
