// The line of the chosen inputs in a chart: what the stored surrogate says at them.

import { DARK, LIGHT } from "./colours.js";
import { nearestIndex } from "./numbers.js";

/** A chart's line at the chosen inputs; it has no values before any are chosen, or where no surrogate has the output. */
export const chosenLine = () => ({ label: "at the chosen inputs", width: 2.4, dash: [], colours: [LIGHT.ink, DARK.ink], shown: true, values: null, rms: null });

/** Take the values of an output at the times of a chart, between stored times of a realisation on a straight line; null where they are not known. */
export function takeChosen(line, times, found) {
  line.values = line.rms = null;
  if (!found || !found.times) return;
  line.label = found.nearest ? "nearest realisation" : "at the chosen inputs";
  line.note = found.nearest ? "a stored realisation" : "its error is unknown";
  const own = found.times;
  const last = own.length - 1;
  const slack = 1e-9 * Math.abs(own[last] - own[0]);
  const places = times.map((time) => {
    const k = nearestIndex(own, time);
    return Math.abs(own[k] - time) <= slack ? k : -1;
  });
  const between = (values, time) => {
    const k = Math.min(Math.max(own.findIndex((one) => one > time), 1), last);
    const share = (time - own[k - 1]) / (own[k] - own[k - 1]);
    return share < 0 || share > 1 ? NaN : values[k - 1] + share * (values[k] - values[k - 1]);
  };
  const value = (values, k, n) => (k >= 0 ? values[k] : found.nearest ? between(values, times[n]) : NaN);
  const at = (values) => places.map((k, n) => value(values, k, n)).map((x) => (Number.isNaN(x) ? null : x));
  line.values = at(found.values);
  line.rms = found.rms && at(found.rms);
}
