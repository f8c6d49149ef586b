// Which colours there are now: those of a light or a dark page.

import { DARK, LIGHT } from "./colours.js";

const wantsDark = window.matchMedia("(prefers-color-scheme: dark)");
const listeners = [];
const tellAll = () => listeners.forEach((repaint) => repaint());
wantsDark.addEventListener("change", tellAll);

// what the page around says of itself; null: nothing, and the system decides
let around = () => null;

export const isDark = () => around() ?? wantsDark.matches;

export const palette = () => (isDark() ? DARK : LIGHT);

/** Call `repaint` when the page becomes dark or light. */
export const onTheme = (repaint) => listeners.push(repaint);

/** Whether the notebook around is dark, as JupyterLab, VS Code and Colab tell; null where it tells nothing. */
export function notebookIsDark({ body, documentElement } = document) {
  const { jpThemeLight, vscodeThemeKind } = body.dataset;
  if (jpThemeLight !== undefined) return jpThemeLight === "false";
  const kind = vscodeThemeKind ?? [...body.classList].find((name) => /^vscode-(light|dark|high-contrast)/.test(name));
  if (kind !== undefined) return !kind.endsWith("light");
  return documentElement.hasAttribute("theme") ? documentElement.getAttribute("theme") === "dark" : null;
}

/** Be as dark as the notebook around; `show(dark)` is called now, and whenever it changes. */
export function followNotebook(show) {
  around = notebookIsDark;
  onTheme(() => show(isDark()));
  const changes = new MutationObserver(tellAll);
  for (const one of [document.body, document.documentElement]) {
    changes.observe(one, { attributes: true, attributeFilter: ["class", "theme", "data-jp-theme-light", "data-vscode-theme-kind"] });
  }
  show(isDark());
}
