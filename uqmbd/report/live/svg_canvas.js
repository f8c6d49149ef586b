// What is drawn on a canvas, as a drawing (SVG): for paper, whose pixels are finer than those of screens. Own code: uPlot
// draws on the canvas that it makes itself; here it gets a context that records its calls. The packages
// that do the same (canvas2svg, svgcanvas) are 30 KB and more, for all that a canvas can do.

const SPACE = "http://www.w3.org/2000/svg";
const ANCHORS = { center: "middle", right: "end", end: "end" };
const DROPS = { top: 0.8, hanging: 0.8, middle: 0.35, bottom: -0.2 };
let clips = 0;

const rounded = (value) => String(Math.round(value * 100) / 100);

/** An element of a drawing; attributes that are undefined are left out. */
export function shape(kind, attributes, text) {
  const made = document.createElementNS(SPACE, kind);
  for (const [name, value] of Object.entries(attributes)) if (value !== undefined) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** A path, as text of SVG. */
class Outline {
  constructor(from = "") {
    this.d = typeof from === "string" ? from : from.d;
  }
  add(letter, ...numbers) {
    this.d += letter + numbers.map(rounded).join(" ");
  }
  moveTo(x, y) {
    this.add("M", x, y);
  }
  lineTo(x, y) {
    this.add(this.d ? "L" : "M", x, y);
  }
  bezierCurveTo(...numbers) {
    this.add("C", ...numbers);
  }
  rect(x, y, width, height) {
    this.d += `M${rounded(x)} ${rounded(y)}h${rounded(width)}v${rounded(height)}h${rounded(-width)}Z`;
  }
  /** A whole circle: charts draw no other arcs. */
  arc(x, y, r) {
    this.d += `M${rounded(x - r)} ${rounded(y)}a${rounded(r)} ${rounded(r)} 0 1 0 ${rounded(2 * r)} 0a${rounded(r)} ${rounded(r)} 0 1 0 ${rounded(-2 * r)} 0Z`;
  }
  closePath() {
    this.d += "Z";
  }
}

/** A context as that of a canvas, which draws into an element of SVG. */
export class SvgPen {
  constructor() {
    this.root = shape("g", {});
    this.state = { moves: "", within: this.root };
    this.states = [];
    Object.assign(this, { fillStyle: "#000", strokeStyle: "#000", lineWidth: 1, globalAlpha: 1, font: "", textAlign: "start", textBaseline: "alphabetic", dash: [] });
    this.beginPath();
  }
  save() {
    const { fillStyle, strokeStyle, lineWidth, globalAlpha, font, textAlign, textBaseline, dash } = this;
    this.states.push({ ...this.state, looks: { fillStyle, strokeStyle, lineWidth, globalAlpha, font, textAlign, textBaseline, dash } });
  }
  restore() {
    const { looks, ...state } = this.states.pop();
    this.state = state;
    Object.assign(this, looks);
  }
  translate(x, y) {
    this.state.moves += `translate(${rounded(x)} ${rounded(y)})`;
  }
  rotate(angle) {
    this.state.moves += `rotate(${rounded((angle * 180) / Math.PI)})`;
  }
  setLineDash(dash) {
    this.dash = dash;
  }
  /** The drawing so far; what is drawn later is another one. */
  take() {
    const { root } = this;
    this.clearRect();
    return root;
  }
  /** Of all: charts clear nothing less. */
  clearRect() {
    this.root = this.state.within = shape("g", {});
  }
  beginPath() {
    this.path = new Outline();
  }
  moveTo(x, y) {
    this.path.moveTo(x, y);
  }
  lineTo(x, y) {
    this.path.lineTo(x, y);
  }
  rect(...box) {
    this.path.rect(...box);
  }
  arc(...circle) {
    this.path.arc(...circle);
  }
  clip({ d } = this.path) {
    const id = `uqmbd-clip-${++clips}`;
    const outline = shape("clipPath", { id });
    outline.append(shape("path", { d, transform: this.state.moves || undefined }));
    const within = shape("g", { "clip-path": `url(#${id})` });
    this.state.within.append(outline, within);
    this.state.within = within;
  }
  draw(kind, looks, text) {
    const shared = { transform: this.state.moves || undefined, opacity: this.globalAlpha < 1 ? this.globalAlpha : undefined };
    this.state.within.append(shape(kind, { ...shared, ...looks }, text));
  }
  fill({ d } = this.path) {
    if (d && this.fillStyle !== "transparent") this.draw("path", { d, fill: this.fillStyle });
  }
  stroke({ d } = this.path) {
    if (!d || this.strokeStyle === "transparent" || !this.lineWidth) return;
    const dash = this.dash.length > 0 ? this.dash.map(rounded).join(" ") : undefined;
    this.draw("path", { d, fill: "none", stroke: this.strokeStyle, "stroke-width": rounded(this.lineWidth), "stroke-dasharray": dash, "stroke-linejoin": "round" });
  }
  fillRect(...box) {
    const path = new Outline();
    path.rect(...box);
    this.fill(path);
  }
  strokeRect(...box) {
    const path = new Outline();
    path.rect(...box);
    this.stroke(path);
  }
  fillText(text, x, y) {
    const [size] = /[\d.]+(?=px)/.exec(this.font) ?? ["12"];
    const down = y + (DROPS[this.textBaseline] ?? 0) * size;
    const weight = /^(?:bold|[6-9]00)/.test(this.font) ? 600 : undefined;
    this.draw("text", { x: rounded(x), y: rounded(down), "font-size": size, "font-weight": weight, fill: this.fillStyle, "text-anchor": ANCHORS[this.textAlign] }, text);
  }
}

/** Let `make` draw, and take what it draws on canvases that it makes: returns what it returns. */
export function withPen(pen, make) {
  const { getContext } = HTMLCanvasElement.prototype;
  const { Path2D } = window;
  HTMLCanvasElement.prototype.getContext = () => pen;
  window.Path2D = Outline;
  try {
    return make();
  } finally {
    HTMLCanvasElement.prototype.getContext = getContext;
    window.Path2D = Path2D;
  }
}
