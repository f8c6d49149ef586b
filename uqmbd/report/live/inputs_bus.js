// The inputs that the reader has chosen, for the whole page.

const INPUTS = "uqmbd-inputs";

let chosen = null;

/** The choice of the last call of `announceInputs`; null before the first. */
export const pageInputs = () => chosen;

/**
 * Tell all others which inputs are chosen.
 *
 * @param detail - germs: a Float64Array; words: of where they are; outputs: a map from the name of an output to its
 *   { times, values, rms }, the latter two typed arrays, rms null where it is not known
 */
export function announceInputs(detail) {
  chosen = detail;
  document.dispatchEvent(new CustomEvent(INPUTS, { detail }));
}

/** Call `listener(detail)` whenever other inputs are chosen. */
export function onInputs(listener) {
  document.addEventListener(INPUTS, ({ detail }) => listener(detail));
}
