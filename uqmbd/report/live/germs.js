// Where the sliders of a page are put: at the means, at a random realisation.

/** Germs at which inputs have their means, one after the other; medians where values are not known. */
export function meanGerms(surrogate) {
  const germs = surrogate.start();
  const order = surrogate.inputs.map((_, k) => k).sort((a, b) => surrogate.inputs[a].sum.length - surrogate.inputs[b].sum.length);
  for (const k of order) {
    if (!surrogate.inputs[k].map) continue;
    const germ = surrogate.germOf(k, surrogate.inputs[k].mean, germs);
    if (Number.isFinite(germ)) germs[k] = nearestGerm(surrogate.germs[k], germ);
  }
  return germs;
}

/** The same germ, or of one with few values the nearest. */
export function nearestGerm(germ, x) {
  return germ.values ? germ.values.reduce((best, v) => (Math.abs(v - x) < Math.abs(best - x) ? v : best)) : x;
}

/** Germs of a random realisation; `random` returns numbers from 0 to 1. */
export function randomGerms(surrogate, random = Math.random) {
  return Float64Array.from(surrogate.germs, (germ, k) => {
    const share = random();
    if (germ.values) return germ.values[Math.min(germ.levels.findIndex((level) => level >= share) >>> 0, germ.values.length - 1)];
    let [low, high] = germ.range;
    for (let n = 0; n < 60; n++) {
      const middle = (low + high) / 2;
      if (surrogate.level(k, middle) < share) low = middle;
      else high = middle;
    }
    return (low + high) / 2;
  });
}
