// Every figure of the page that has data becomes a chart: those near the window first, then all that are not folded.

import { drawForPaper, makeChart } from "./chart.js";
import { chartModel } from "./chart_model.js";
import { completeViews, makeViews } from "./chart_views.js";

/** Call `act` when the browser has nothing else to do, or soon. */
const whenIdle = (act) => (window.requestIdleCallback ? requestIdleCallback(act, { timeout: 100 }) : setTimeout(act, 30));

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
  // pictures of the whole page have all charts, too; a folded one is made when it is unfolded
  const makeNext = () => {
    const next = [...waiting].find((figure) => !figure.closest("details:not([open])"));
    if (!next) return;
    make(next);
    whenIdle(makeNext);
  };
  whenIdle(makeNext);
  part.addEventListener("toggle", () => whenIdle(makeNext), true);
  // paper has what the browser draws, what was far from the window, too
  window.addEventListener("beforeprint", () => {
    [...waiting].forEach(make);
    completeViews();
    drawForPaper();
  });
}
