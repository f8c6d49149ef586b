// Speeds of the player.

const LASTING = 4;

/** Speeds to choose from, and that with which a motion takes some seconds. */
export function speedsOf(span) {
  const power = Math.floor(Math.log10(span / LASTING) + 1e-9);
  const all = [-2, -1, 0, 1, 2].flatMap((k) => [1, 2, 5].map((x) => Number(`${x}e${power + k}`)));
  const natural = all.filter((x) => x <= (span / LASTING) * (1 + 1e-9)).pop();
  return { natural, speeds: all.filter((x) => x >= natural / 11 && x <= natural * 11) };
}
