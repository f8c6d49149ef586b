// An output of a notebook: its charts, with a style and a time of their own, beside other outputs on the same page.

import { startCharts } from "./charts.js";
import { followNotebook } from "./theme.js";
import { ownTime } from "./time_bus.js";

/** Make the output with this mark alive; of one that is shown twice, the part that has not begun. */
export function startCell(mark, style) {
  const places = document.querySelectorAll(`.uqmbd-cell[data-mark="${mark}"]`);
  const place = Array.from(places).find((one) => one.shadowRoot === null);
  if (place === undefined) return;
  ownTime();
  followNotebook((dark) => (place.dataset.theme = dark ? "dark" : "light"));
  const content = document.createElement("div");
  content.className = "cell";
  content.append(...place.childNodes);
  const sheet = document.createElement("style");
  sheet.textContent = style;
  place.attachShadow({ mode: "open" }).append(sheet, content);
  startCharts(content);
}
