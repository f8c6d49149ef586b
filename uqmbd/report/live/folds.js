// Folded parts of the page: all are unfolded at once by a button, and on paper.

import { button } from "./dom.js";

const folded = () => [...document.querySelectorAll("main details:not([open])")];

/** Begin: a button among the contents unfolds everything, or folds it again; paper has every part. */
export function startFolds() {
  const contents = document.querySelector("main > nav");
  let opened = [];
  const toggle = button("Unfold all details", "Show the folded charts and tables of the whole page", () => {
    const unfold = opened.length === 0;
    const parts = unfold ? folded() : opened;
    opened = unfold ? parts : [];
    parts.forEach((part) => (part.open = unfold));
    toggle.textContent = unfold ? "Fold details" : "Unfold all details";
    toggle.setAttribute("aria-pressed", String(unfold));
  });
  toggle.setAttribute("aria-pressed", "false");
  toggle.className = "unfold";
  if (folded().length) contents?.append(toggle);
  // browsers differ in what they print of a folded part
  let printed = [];
  window.addEventListener("beforeprint", () => {
    printed = folded();
    printed.forEach((part) => (part.open = true));
  });
  window.addEventListener("afterprint", () => printed.splice(0).forEach((part) => (part.open = false)));
}
