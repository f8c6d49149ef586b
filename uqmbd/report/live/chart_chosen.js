// The line of the chosen inputs in a chart: what the stored surrogate says at them.

import { DARK, LIGHT } from "./colours.js";
import { nearestIndex } from "./numbers.js";

/** A chart's line at the chosen inputs; it has no values before any are chosen, or where no surrogate has the output. */
export const chosenLine = () => ({ label: "at the chosen inputs", width: 2.4, dash: [], colours: [LIGHT.ink, DARK.ink], shown: true, values: null, rms: null });

/** Take the values of an output at the times of a chart; null where they are not known. */
export function takeChosen(line, times, found) {
  line.values = line.rms = null;
  if (!found || !found.times) return;
  const own = found.times;
  const slack = 1e-9 * Math.abs(own[own.length - 1] - own[0]);
  const places = times.map((time) => {
    const k = nearestIndex(own, time);
    return Math.abs(own[k] - time) <= slack ? k : -1;
  });
  const at = (values) => places.map((k) => (k < 0 || Number.isNaN(values[k]) ? null : values[k]));
  line.values = at(found.values);
  line.rms = found.rms && at(found.rms);
}
