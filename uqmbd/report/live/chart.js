// A chart in its figure: methods on and off, zoom, the page's time, keys and fingers, files.

import { takeChosen } from "./chart_chosen.js";
import { boxAt, shadeColour } from "./chart_layers.js";
import { csvText, headsOf, placeAt, rowsAt, sentenceAt } from "./chart_model.js";
import { drawingOf, pixelsOf, svgText } from "./chart_picture.js";
import { chartOptions, limitLook, limitName, seenIn, seriesData } from "./chart_options.js";
import { markLook, markPath, nearestMark } from "./chart_plane.js";
import { button, element } from "./dom.js";
import { fileName, saveBlob } from "./exports.js";
import { onInputs, pageInputs } from "./inputs_bus.js";
import { formatError, formatNumber, formatQuantity, nearestIndex, unbroken } from "./numbers.js";
import { onTheme, palette } from "./theme.js";
import { announceTime, onTime, pageTime, proposeTime } from "./time_bus.js";

const NARROW = 480;
const papers = [];

/** Call `draw` whenever the page is printed. */
export const onPaper = (draw) => papers.push(draw);

/** Draw all charts for paper. */
export const drawForPaper = () => papers.forEach((draw) => draw());

/** The line of a method, as a picture beside its name. */
function lineSample(method) {
  const space = "http://www.w3.org/2000/svg";
  const svg = document.createElementNS(space, "svg");
  const line = document.createElementNS(space, "line");
  const set = (target, values) => Object.entries(values).forEach(([key, value]) => target.setAttribute(key, value));
  set(svg, { width: 34, height: 10, "aria-hidden": "true" });
  const dash = method.dash.map((length) => length * method.width).join(" ");
  const look = method.dots ? { x1: 17, x2: 17, "stroke-width": 7, "stroke-linecap": "round" } : method.bars ? { x1: 4, x2: 30, "stroke-width": 8 } : { x1: 0, x2: 34, "stroke-width": method.width, "stroke-dasharray": dash || "none" };
  set(line, { y1: 5, y2: 5, ...look });
  const mark = document.createElementNS(space, "path");
  if (method.shape) set(mark, { d: markPath(method.shape, 17, 5, Math.min((method.size ?? 7) / 2, 4)) });
  if (method.joined || !method.shape) svg.append(line);
  if (method.shape) svg.append(mark);
  const paint = () => {
    const { dark, paper } = palette();
    const colour = method.colours[dark ? 1 : 0];
    line.setAttribute("stroke", colour);
    const look = markLook(method, colour, paper);
    set(mark, { fill: look.fill, stroke: look.stroke, "stroke-width": look.width });
  };
  paint();
  onTheme(paint);
  return svg;
}

/** What the shades of boxes mean. */
function shadesOf({ name, units, ends }) {
  const bar = element("span", { class: "shades", "aria-hidden": "true" });
  const paint = () => {
    const stops = [0, 0.25, 0.5, 0.75, 1].map((share) => shadeColour(share, palette().dark));
    bar.style.background = `linear-gradient(to right, ${stops.join(", ")})`;
  };
  paint();
  onTheme(paint);
  const [low, high] = ends.map((end) => formatError(end, units));
  return element("p", { class: "beyond lines" }, element("span", {}, `${name}: ${low} `, bar, ` ${high}`));
}

/**
 * Make the chart of a figure, in place of its picture, or of a part of a figure. Over time it has the time of the page;
 * along any other axis a cursor of its own.
 */
export function makeChart(figure, model) {
  const { linked } = model.across;
  const announce = (time) => linked && announceTime(time, holder);
  const files = [model.output, model.title].filter(Boolean).join(" ");
  const described = figure.dataset.alt ?? figure.querySelector("img")?.alt ?? "";
  const small = figure.classList.contains("small");
  const { plane } = model;
  const whole = plane ? plane.right : model.whole;
  if (small && linked) proposeTime(model.time[model.start]);
  let index = !linked || pageTime() === null ? model.start : nearestIndex(model.time, pageTime());

  // the table of values, which is the legend, too
  const several = model.methods.length > 1;
  const at = element("caption");
  const heads = headsOf(model);
  const head = element("tr", {}, ...["", ...heads].map((text) => element("th", { scope: "col" }, text)));
  const rows = model.methods.map((method, k) => {
    const toggle = button("", several ? "Show or hide this method" : "Show or hide", () => {
      method.shown = !method.shown;
      toggle.setAttribute("aria-pressed", String(method.shown));
      plot.batch(() => {
        let first = 1;
        for (const other of model.methods.slice(0, k)) first += other.lines.length;
        if (!plane) method.lines.forEach((_, j) => plot.setSeries(first + j, { show: method.shown }));
      });
      plot.redraw(false);
      refresh();
    });
    toggle.setAttribute("aria-pressed", "true");
    toggle.append(lineSample(method), element("span", {}, method.label));
    const cells = heads.map(() => element("td", { class: "number" }));
    return { row: element("tr", {}, element("th", { scope: "row" }, toggle), ...cells), cells };
  });
  // of the chosen inputs, as soon as any are chosen
  const { chosen } = model;
  const seen = button("", "Show or hide the line at the chosen inputs", () => {
    chosen.shown = !chosen.shown;
    seen.setAttribute("aria-pressed", String(chosen.shown));
    plot.setSeries(plot.series.length - 1, { show: chosen.shown });
    refresh();
  });
  seen.setAttribute("aria-pressed", "true");
  const chosenName = element("span", {}, chosen.label);
  seen.append(lineSample(chosen), chosenName);
  const chosenValue = element("td", { class: "number" });
  const chosenError = element("td", { class: "number", colspan: heads.length - 1 || 1 });
  const chosenRow = element("tr", {}, element("th", { scope: "row" }, seen), chosenValue, chosenError);
  const body = element("tbody", {}, ...rows.map(({ row }) => row));
  const table = element("table", {}, at, element("thead", {}, head), body);

  const space = element("div", {
    class: "plot",
    tabindex: "0",
    role: "slider",
    "aria-label": `${model.across.name[0].toUpperCase()}${model.across.name.slice(1)} in the chart of ${files}`,
    "aria-valuemin": model.at[0],
    "aria-valuemax": model.at[model.at.length - 1],
    title: `Drag to zoom in, double-click to show all. Keys: ← → move the ${linked ? "time" : "cursor"}, + − zoom, 0 shows all. Ctrl and the wheel also zoom.`,
  });
  const all = button(linked && !plane ? "Show all times" : "Show all", "Undo the zoom (double-click, or key 0)", () => zoom(...whole));
  all.hidden = true;
  const tools = element(
    "div",
    { class: "tools" },
    all,
    button("+", linked ? "Zoom in at the time of the cursor" : "Zoom in at the cursor", () => zoomBy(0.5)),
    button("−", "Zoom out", () => zoomBy(2)),
    button("CSV", `Save the numbers of this chart (${model.time.length} ${linked ? "times" : "places"})`, () =>
      saveBlob(new Blob([csvText(model)], { type: "text/csv" }), fileName(files, "csv"))),
    button("PNG", "Save the visible part of this chart as a picture", () =>
      pixelsOf(model, seenIn(plot)).toBlob((blob) => saveBlob(blob, fileName(files, "png")))),
    button("SVG", "Save the visible part of this chart as a vector drawing", () =>
      saveBlob(new Blob([svgText(drawingOf(model, seenIn(plot)))], { type: "image/svg+xml" }), fileName(files, "svg"))),
  );
  const reading = small ? element("p", { class: "now" }) : element("div", { class: "wide readout" }, table);
  const holder = element("div", { class: "chart", role: "group", "aria-label": described }, ...(small ? [reading, space, all] : [space, tools, reading]));
  if (small && several) {
    const lines = model.methods.map((method) => element("span", {}, lineSample(method), ` ${method.label}`));
    holder.append(element("p", { class: "beyond lines" }, ...lines));
  }
  if (model.limits?.length) {
    const limits = model.limits.map((limit) => element("span", {}, lineSample(limitLook(limit)), ` ${limitName(limit, model.units)}`));
    space.after(element("p", { class: "beyond lines limits" }, ...limits));
  }
  if (model.boxes) space.after(shadesOf(model.boxes));
  if (model.beyond.length) {
    const list = model.beyond.map(({ name, value }) => `${name} (${formatQuantity(value, model.units)})`).join(", ");
    holder.append(element("p", { class: "beyond" }, `Outside the chart: the limit of ${list}.`));
  }
  figure.prepend(holder);
  figure.classList.add("live");

  const size = () => {
    const width = Math.max(space.clientWidth, 240);
    // on the first screen as high as the style says
    return { width, height: small ? Math.max(space.clientHeight, 160) : width < NARROW ? 250 : 320 };
  };
  let told = false;
  const options = chartOptions(model, size(), palette);
  options.hooks = {
    ...options.hooks,
    setCursor: [
      (u) => {
        if (told || u.cursor.idx == null || u.cursor.left < 0) return;
        index = plane ? nearestMark(model, [u.cursor.left, u.cursor.top], markAt, index) : model.boxes ? u.cursor.idxs[1] ?? index : u.cursor.idx;
        if (plane) place();
        refresh();
        announce(model.time[index]);
      },
    ],
    setScale: [(u, key) => (key === "x" || plane) && zoomed(u)],
    ...(plane ? { draw: [...options.hooks.draw, () => place()] } : {}),
    ready: [() => place()],
  };
  const markAt = (x, y) => [plot.valToPos(x, "x"), plot.valToPos(y, "y")];
  if (model.boxes) {
    // the pointer is in a box, not merely over a place of the axis
    options.cursor.dataIdx = (u, _, nearest) => boxAt(model, u.posToVal(u.cursor.left, "x"), u.posToVal(u.cursor.top, "y")) ?? nearest;
  }
  const plot = new uPlot(options, seriesData(model), space);
  plot.root.setAttribute("aria-hidden", "true");
  // in a plane the cursor is a ring about the mark of each method
  const rings = plane ? model.methods.map(() => element("div", { class: "ring" })) : [];
  plot.over.append(...rings);

  function zoomed(u) {
    const { min, max } = u.scales.x;
    const { y } = u.scales;
    all.hidden = min <= whole[0] && max >= whole[1] && (!plane || (y.min <= plane.up[0] && y.max >= plane.up[1]));
  }

  function refresh() {
    at.textContent = `At ${placeAt(model, index)}${model.units === "" || plane ? "" : `, in ${model.units}`}`;
    rowsAt(model, index).forEach((texts, k) => {
      const { row, cells } = rows[k];
      row.classList.toggle("hidden-method", !model.methods[k].shown);
      texts.forEach((text, j) => (cells[j].textContent = unbroken(text)));
    });
    if (chosen.values) {
      const spread = model.methods[0].columns[0].values[index];
      chosenRow.classList.toggle("hidden-method", !chosen.shown);
      chosenValue.textContent = formatNumber(chosen.values[index], spread);
      chosenError.textContent = chosen.rms ? `stated error ${unbroken(formatError(chosen.rms[index], model.units))}` : chosen.note;
    }
    space.setAttribute("aria-valuenow", model.at[index]);
    space.setAttribute("aria-valuetext", sentenceAt(model, index));
    if (small) reading.textContent = sentenceAt({ ...model, methods: model.methods.map((method, k) => ({ ...method, shown: k === 0 })) }, index).replaceAll(" × ", "\u00a0×\u00a0");
  }

  function placeRings() {
    const { x, y } = plot.scales;
    model.methods.forEach((method, k) => {
      const [across, up] = [method.positions[index], method.lines[0].values[index]];
      const inside = (value, { min, max }) => value !== null && value >= min && value <= max;
      rings[k].hidden = !(method.shown && !method.quiet && inside(across, x) && inside(up, y));
      if (rings[k].hidden) return;
      const colour = method.colours[palette().dark ? 1 : 0];
      Object.assign(rings[k].style, { left: `${plot.valToPos(across, "x")}px`, top: `${plot.valToPos(up, "y")}px`, borderColor: colour });
    });
  }

  /** Put the cursor at the time of the page. */
  function place() {
    if (plane) return placeRings();
    const { min, max } = plot.scales.x;
    const time = model.time[index];
    const inside = time >= min && time <= max;
    told = true;
    const top = model.boxes ? plot.valToPos(model.methods[0].lines[0].values[index], "y") : 0;
    plot.setCursor(inside ? { left: plot.valToPos(time, "x"), top } : { left: -10, top: -10 });
    told = false;
  }

  function move(to) {
    index = Math.min(Math.max(to, 0), model.time.length - 1);
    const { min, max } = plot.scales.x;
    const time = model.time[index];
    if (!plane && time < min) zoom(time, time + max - min);
    else if (!plane && time > max) zoom(time - max + min, time);
    place();
    if (plane && !all.hidden && rings.every((ring) => ring.hidden)) zoom(...whole);
    refresh();
    announce(time);
  }

  function zoom(low, high) {
    const smallest = (whole[1] - whole[0]) / (plane ? 1000 : Math.max(model.time.length / 4, 2));
    const width = Math.min(Math.max(high - low, smallest), whole[1] - whole[0]);
    const from = Math.min(Math.max((low + high - width) / 2, whole[0]), whole[1] - width);
    plot.setScale("x", { min: from, max: from + width });
  }

  function zoomBy(factor, about = plane ? null : model.time[index]) {
    const { min, max } = plot.scales.x;
    if (plane) return zoomPlane(factor, about);
    const centre = about >= min && about <= max ? about : (min + max) / 2;
    zoom(centre - (centre - min) * factor, centre + (max - centre) * factor);
  }

  /** Zoom along both axes, about a place or about the ring that is seen. */
  function zoomPlane(factor, about) {
    const ring = rings.find((one) => !one.hidden);
    const { width, height } = plot.over.getBoundingClientRect();
    const left = about !== null ? plot.valToPos(about, "x") : ring ? parseFloat(ring.style.left) : width / 2;
    const top = ring ? parseFloat(ring.style.top) : height / 2;
    const value = (pixel, key) => plot.posToVal(pixel, key);
    const x = [value(left * (1 - factor), "x"), value(left + (width - left) * factor, "x")];
    const y = [value(top + (height - top) * factor, "y"), value(top * (1 - factor), "y")];
    const within = ([low, high], [least, most]) => ({ min: Math.max(low, least), max: Math.min(high, most) });
    if (x[1] - x[0] < (whole[1] - whole[0]) / 1000) return;
    plot.batch(() => {
      plot.setScale("x", within(x, whole));
      plot.setScale("y", within(y, plane.up));
    });
  }

  const step = (event) => (event.shiftKey ? 10 : 1);
  const keys = {
    ArrowLeft: (event) => move(index - step(event)),
    ArrowDown: (event) => move(index - step(event)),
    ArrowRight: (event) => move(index + step(event)),
    ArrowUp: (event) => move(index + step(event)),
    PageDown: () => move(index - 20),
    PageUp: () => move(index + 20),
    Home: () => move(0),
    End: () => move(model.time.length - 1),
    "+": () => zoomBy(0.5),
    "=": () => zoomBy(0.5),
    "-": () => zoomBy(2),
    0: () => zoom(...whole),
    Escape: () => zoom(...whole),
  };
  space.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || !Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    keys[event.key](event);
  });

  const timeAt = (event) => plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x");
  space.addEventListener(
    "wheel",
    (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      zoomBy(2 ** Math.sign(event.deltaY), timeAt(event));
    },
    { passive: false },
  );

  // one finger moves the time, two zoom; up and down scrolls the page (touch-action of the style)
  const fingers = new Map();
  const indexAt = (event) => {
    if (!plane) return nearestIndex(model.time, timeAt(event));
    const { left, top } = plot.over.getBoundingClientRect();
    return nearestMark(model, [event.clientX - left, event.clientY - top], markAt, index);
  };
  const reach = () => {
    const places = [...fingers.values()].map(timeAt);
    return [Math.min(...places), Math.max(...places)];
  };
  space.addEventListener("pointerdown", (event) => event.pointerType === "touch" && fingers.set(event.pointerId, event));
  space.addEventListener("pointermove", (event) => {
    if (!fingers.has(event.pointerId)) return;
    const before = reach();
    fingers.set(event.pointerId, event);
    if (fingers.size === 1) return move(indexAt(event));
    const after = reach();
    if (fingers.size > 2 || after[1] - after[0] <= 0) return;
    const { min, max } = plot.scales.x;
    const factor = (before[1] - before[0]) / (after[1] - after[0]);
    const from = before[0] - (after[0] - min) * factor;
    zoom(from, from + (max - min) * factor);
  });
  for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
    space.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }

  if (linked) {
    onTime(holder, (time) => {
      index = nearestIndex(model.time, time);
      place();
      refresh();
    });
  }
  function follow(inputs) {
    takeChosen(chosen, model.time, inputs && inputs.outputs.get(model.output));
    chosenName.textContent = chosen.label;
    if (chosen.values === null) chosenRow.remove();
    else body.append(chosenRow);
    // before it is drawn for the first time it has no scale
    const min = plot.scales.x.min ?? whole[0];
    const max = plot.scales.x.max ?? whole[1];
    plot.batch(() => {
      plot.setData(seriesData(model), false);
      // the same times again: the vertical axis finds its ends
      plot.setScale("x", { min, max });
    });
    refresh();
  }
  // a chart of other data does not follow, whatever its name
  if (model.follows) onInputs(follow);
  onTheme(() => plot.redraw(false));
  new ResizeObserver(() => {
    const wanted = size();
    if (space.clientWidth > 0 && wanted.width !== plot.width) {
      plot.setSize(wanted);
      place();
    }
  }).observe(space);
  const paper = element("div", { class: "paper", role: "img", "aria-label": described });
  holder.after(paper);
  onPaper(() => paper.replaceChildren(drawingOf(model, seenIn(plot), true)));
  if (model.follows && pageInputs()) follow(pageInputs());
  else refresh();
  return plot;
}
