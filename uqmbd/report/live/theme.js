// Which colours there are now: those of a light or a dark page.

import { DARK, LIGHT } from "./colours.js";

const wantsDark = window.matchMedia("(prefers-color-scheme: dark)");

export const palette = () => (wantsDark.matches ? DARK : LIGHT);

/** Call `repaint` when the page becomes dark or light. */
export const onTheme = (repaint) => wantsDark.addEventListener("change", repaint);
