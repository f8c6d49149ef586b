// Numbers as `uqmbd.wording.format_number` writes them, with as many digits as what they are compared with needs.

const SUPERSCRIPTS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

const superscript = (whole) => String(whole).replace(/./g, (c) => SUPERSCRIPTS[c]);
const withMinus = (text) => text.replace("-", "−");
const inPowers = (text) => withMinus(text.replace(/e([+-]\d+)$/, (_, power) => ` × 10${superscript(Number(power))}`));

/**
 * Write a number for reading: four digits, or as many as show a hundredth of its spread; at most fourteen, and none of
 * the last ones where they are `zeros`, unless these are wanted. What is not a number is "–".
 */
export function formatNumber(value, spread = 0, zeros = false) {
  if (value === null || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const exponent = Math.floor(Math.log10(Math.abs(value)));
  const wanted = spread > 0 ? exponent - Math.floor(Math.log10(spread)) + 3 : 0;
  const digits = Math.min(Math.max(4, wanted), 14);
  // where all digits mean something, larger numbers are plain, too
  if (exponent >= -3 && exponent < (digits > exponent ? 10 : 5)) return withMinus(String(Number(value.toPrecision(Math.max(digits, exponent + 1)))));
  const written = value.toExponential(digits - 1);
  return inPowers(zeros ? written : written.replace(/\.?0*e/, "e"));
}

/**
 * Write numbers of one quantity with the same digits behind the point, so many as show a hundredth of its spread;
 * what is far below that is zero. Very small and very large ones share the power of ten of the largest of them, or of
 * others (`most`). Without a spread each number has its own digits.
 */
export function alike(values, spread, most = 0) {
  const known = values.filter((v) => Number.isFinite(v) && v !== null);
  const largest = Math.max(...known.map(Math.abs), spread || 0, most);
  if (!(spread > 0)) return withSamePower(values);
  const power = largest >= 1e-3 && largest < 1e10 ? 0 : Math.floor(Math.log10(largest));
  const wanted = power + 2 - Math.floor(Math.log10(spread));
  const places = Math.max(Math.min(Math.max(wanted, 0), 13 + power - Math.floor(Math.log10(largest)), 100), 0);
  return values.map((v) => (v === null || !Number.isFinite(v) ? formatNumber(v) : scaledText(v, power, places)));
}

/** Write a number over a power of ten with so many decimals, then that power; zero has no power. */
function scaledText(value, power, places) {
  const text = (value / 10 ** power).toFixed(places);
  if (Number(text) === 0) return text.replace("-", "");
  return withMinus(text) + (power ? ` × 10${superscript(power)}` : "");
}

/**
 * Write numbers, as the ends of an interval, each as `formatNumber` does, but all with the power of ten of the largest.
 * Numbers that differ by more than four decades keep a power of ten each.
 */
export function withSamePower(values, spread = 0) {
  const isFound = (v) => v !== null && Number.isFinite(v) && v !== 0;
  const texts = values.map((v) => formatNumber(v, spread));
  const sizes = values.filter(isFound).map(Math.abs);
  const largest = Math.max(...sizes);
  if (!texts.some((text) => text.includes("×")) || Math.min(...sizes) < 1e-4 * largest) return texts;
  const exponentOf = (v) => Number(v.toExponential(3).split("e")[1]);
  const power = formatNumber(largest, spread).includes("×") ? exponentOf(largest) : 0;
  return values.map((v, k) => {
    if (!isFound(v)) return texts[k];
    const wanted = spread > 0 ? exponentOf(v) - Math.floor(Math.log10(spread)) + 3 : 0;
    const places = Math.max(Math.min(Math.max(4, wanted), 14) - 1 - exponentOf(v) + power, 0);
    return scaledText(v, power, places).replace(/^([^.]*)\.(\d*?)0+(?!\d)/, (_, whole, rest) => (rest ? `${whole}.${rest}` : whole));
  });
}

/** Write a number with its units, if it has any. */
export function formatQuantity(value, units, spread = 0) {
  const text = formatNumber(value, spread);
  return text === "–" || units === "" ? text : `${text} ${units}`;
}

/** A name with its units in brackets, if it has any. */
export const withUnits = (name, units) => (units === "" ? name : `${name} [${units}]`);

/** The power of ten that an axis is divided by: 0 where plain numbers are short. */
export function axisPower(low, high) {
  const largest = Math.max(Math.abs(low), Math.abs(high));
  if (!(largest > 0) || high - low < 1e-4 * largest) return 0;
  const exponent = Math.floor(Math.log10(largest) + 1e-9);
  return exponent >= -3 && exponent < 4 ? 0 : exponent;
}

/** Label ticks that are a step apart, divided by a power of ten: all with the same decimals. */
export function tickLabels(ticks, step, power = 0) {
  const scaled = step / 10 ** power;
  let decimals = 0;
  const short = (digits) => {
    const shifted = scaled * 10 ** digits;
    return shifted > 0.5 && Math.abs(shifted - Math.round(shifted)) < 1e-3;
  };
  while (decimals < 15 && !short(decimals)) decimals++;
  return ticks.map((tick) => {
    if (tick === null) return "";
    const text = (tick / 10 ** power).toFixed(decimals);
    return withMinus(Number(text) === 0 ? text.replace("-", "") : text);
  });
}

/** A number on a logarithmic axis: a power of ten alone where it is one that is written with it. */
export const powerText = (value) => formatNumber(value, value >= 1 ? 1 : 0).replace(/^1 × /, "");

/** Where a logarithmic axis has ticks, not more than some: at 1, 2 and 5 of decades or at decades; equal steps between. */
export function decadeTicks(low, high, most, fine = true) {
  const first = Math.floor(Math.log10(low) - 1e-9);
  const last = Math.ceil(Math.log10(high) + 1e-9);
  const within = (values) => values.filter((v) => v >= low * (1 - 1e-9) && v <= high * (1 + 1e-9));
  const decades = Array.from({ length: last - first + 1 }, (_, k) => Number(`1e${first + k}`));
  const parts = within(decades.flatMap((ten) => [ten, 2 * ten, 5 * ten]));
  const full = within(decades);
  if (fine && parts.length <= most && parts.length > 2) return parts;
  if (full.length > 1) {
    const every = Math.ceil(full.length / most);
    return full.filter((_, k) => (full.length - 1 - k) % every === 0);
  }
  const rough = (high - low) / Math.max(Math.min(most, 5), 1);
  const ten = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * ten).find((size) => size >= rough);
  const start = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - start + 1 }, (_, k) => Number(((start + k) * step).toPrecision(12)));
}

export const powerLabel = (power) => (power === 0 ? "" : ` × 10${superscript(power)}`);

/** The index of the time that is nearest to one. */
export function nearestIndex(times, time) {
  let low = 0;
  let high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return time - times[low] <= times[high] - time ? low : high;
}

/** A number, or a range of them, that breaks beside "to" and "±" only. */
export const unbroken = (text) => text.replace(/(?<!\bto|±) (?!to |± )/g, "\u00a0");

/** Write an error: two digits are enough, and the second one is written where it is zero, too. */
export function formatError(value, units = "") {
  const known = value === null ? NaN : Number(value.toPrecision(2));
  if (!Number.isFinite(known) || known === 0) return formatQuantity(known, units);
  const exponent = Math.floor(Math.log10(Math.abs(known)));
  const plain = exponent >= -3 && exponent < 5;
  const text = plain ? withMinus(known.toFixed(Math.max(1 - exponent, 0))) : inPowers(known.toExponential(1));
  return units === "" ? text : `${text} ${units}`;
}

/** A number as people and programs write it into a field, with the digits that mean something beside a spread. */
export function plainNumber(value, spread = 0) {
  if (!Number.isFinite(value)) return "";
  // a mean that is zero but for rounding
  if (Math.abs(value) < 1e-12 * spread) return "0";
  const digits = spread > 0 && value !== 0 ? Math.ceil(Math.log10(Math.abs(value) / spread)) + 3 : 0;
  return String(Number(value.toPrecision(Math.min(Math.max(digits, 4), 14))));
}

/** How to round the sums of numbers and distances that have seven digits: to a hundredth of the last one. */
export function rounding(distances) {
  const largest = distances.reduce((most, v) => Math.max(most, Math.abs(v ?? 0)), 0);
  const decimals = largest > 0 ? 9 - Math.floor(Math.log10(largest)) : 100;
  return decimals >= 0 && decimals < 100 ? (v) => Number(v.toFixed(decimals)) : (v) => v;
}
