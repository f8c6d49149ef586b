// Colours of what scripts draw, on a light and on a dark page.

export const LIGHT = { dark: false, ink: "#1b1f24", soft: "#57606a", grid: "#e3e7ec", paper: "#ffffff", limit: "#b00020", shades: ["#eef4f9", "#9cc5e3", "#3b83b8", "#0b3c5d"] };
export const DARK = { dark: true, ink: "#e6e9ed", soft: "#a3adb8", grid: "#333b44", paper: "#14181d", limit: "#ff6b81", shades: ["#1d2a36", "#2f5f86", "#6aa9db", "#d8ecfb"] };
