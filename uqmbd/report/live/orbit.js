// Pointer, wheel and keys rotate, move and enlarge a view.

const TURN = 10;
const TURNS = { ArrowLeft: [TURN, 0], ArrowRight: [-TURN, 0], ArrowUp: [0, TURN], ArrowDown: [0, -TURN] };

// pixels of a step by a key
const STEP_ASIDE = 20;

/** Perform the action of a key; returns whether the key has one. */
function pressed(view, key, shift) {
  if (Object.hasOwn(TURNS, key)) {
    const [across, up] = TURNS[key];
    if (shift) view.pan((-across / TURN) * STEP_ASIDE, (-up / TURN) * STEP_ASIDE);
    else view.turn([across, up]);
  }
  else if (key === "+" || key === "-") view.enlarge(key === "+" ? 1.25 : 0.8);
  else if (key === "0") view.reset();
  else return false;
  return true;
}

/**
 * Listen to an element.
 *
 * @param viewOf - returns the view, or null; changed - is called after each change; whole - whether the wheel enlarges
 *   without the control key, because the page does not scroll
 * @returns a function that tells whether the pointer holds the drawing
 */
export function listenToOrbit(holder, viewOf, changed, whole) {
  let grip = null;
  holder.addEventListener("pointerdown", (event) => {
    // the page's menu takes the release of another button
    if (viewOf() === null || (event.button !== 0 && !whole)) return;
    grip = [event.clientX, event.clientY, event.button !== 0 || event.shiftKey || !viewOf().spatial];
    holder.setPointerCapture(event.pointerId);
  });
  holder.addEventListener("pointermove", (event) => {
    if (event.buttons === 0) grip = null;
    if (grip === null) return;
    const [right, down] = [event.clientX - grip[0], event.clientY - grip[1]];
    if (grip[2]) viewOf().pan(right, down);
    else viewOf().turn([-0.5 * right, 0.5 * down]);
    grip = [event.clientX, event.clientY, grip[2]];
    changed();
  });
  for (const over of ["pointerup", "pointercancel"]) holder.addEventListener(over, () => (grip = null));
  if (whole) holder.addEventListener("contextmenu", (event) => event.preventDefault());
  holder.addEventListener("wheel", (event) => {
    if (viewOf() === null || !(whole || event.ctrlKey)) return;
    event.preventDefault();
    viewOf().enlarge(Math.exp(-0.0015 * event.deltaY));
    changed();
  }, { passive: false });
  holder.addEventListener("keydown", (event) => {
    if (viewOf() === null || event.ctrlKey || event.metaKey || event.altKey || event.target !== holder) return;
    if (!pressed(viewOf(), event.key, event.shiftKey)) return;
    event.preventDefault();
    changed();
  });
  return () => grip !== null;
}
