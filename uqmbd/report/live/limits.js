// Requirements at the chosen inputs.

import { formatError, formatNumber, formatQuantity } from "./numbers.js";

/**
 * Say whether an output stays within a limit, by which margin, and when it is nearest.
 *
 * @param limit - { limit, end }: the highest or the lowest value that is allowed
 * @param found - { values, times, rms }: of the output; times and rms may be null
 * @returns { kind, words }: kind "met", "violated", "near" (nearer to the limit than its stated error), or "unknown"
 */
export function limitAt({ limit, end }, { values, times, rms }, units) {
  if (values.length === 0 || values.some(Number.isNaN)) return { kind: "unknown", words: "unknown at some times" };
  const margins = Array.from(values, (v) => (end === "highest" ? limit - v : v - limit));
  const k = margins.reduce((least, margin, n) => (margin < margins[least] ? n : least), 0);
  const margin = margins[k];
  const when = times ? ` at ${formatNumber(times[k], (times[times.length - 1] - times[0]) / 10)} s` : "";
  const value = `${formatQuantity(values[k], units, Math.abs(margin))}${when}`;
  if (rms && Math.abs(margin) < rms[k]) return { kind: "near", words: `undecided, nearer than the stated error: ${value}` };
  return margin >= 0
    ? { kind: "met", words: `met by ${formatError(margin, units)}: ${value}` }
    : { kind: "violated", words: `violated by ${formatError(-margin, units)}: ${value}` };
}

/**
 * Say whether a requirement is met, by its margin, which is below zero where it is violated, and the error of that.
 *
 * @param rms - the stated error of the margin; null where it is not known
 * @param units - units of the margin; empty where they are not known
 * @returns as of `limitAt`
 */
export function marginAt(margin, rms, units = "") {
  if (!Number.isFinite(margin)) return { kind: "unknown", words: "unknown" };
  const by = formatError(Math.abs(margin), units);
  const error = rms === null ? "error unknown" : `stated error ${formatError(rms, units)}`;
  if (rms !== null && Math.abs(margin) < rms) return { kind: "near", words: `undecided: ${error}` };
  return margin >= 0 ? { kind: "met", words: `met by ${by}; ${error}` } : { kind: "violated", words: `violated by ${by}; ${error}` };
}
