// The colours of both themes: the dark one has no bright areas, and texts can be read on every area.

import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { expect, test } from "vitest";

const SRC = resolve(import.meta.dirname, "../src");
// On paper both themes are white.
const sheets = ["theme.css", "lobby/QuickGame.module.css"].map(
  (name) => readFileSync(resolve(SRC, name), "utf8").split("@media print")[0] ?? "",
);

/** Each token with its colour in the light and the dark theme. Later sheets override earlier ones. */
const tokens = new Map(
  [...sheets.join("").matchAll(/--([\w-]+): (?:light-dark\((#\w{6}), (#\w{6})\)|(#\w{6}));/g)].map(
    ([, name = "", light, dark, both]) => [name, { light: light ?? both ?? "", dark: dark ?? both ?? "" }],
  ),
);

/** Areas that text of the page lies on. */
const AREAS = ["ground", "paper", "paper-raised", "paper-dim", "accent-wash", "warm-wash", "gold-wash", "cheese"];
const CARDS = ["card", "card-golden", "card-joker"];
type Theme = "light" | "dark";

/** Relative luminance by WCAG 2, from 0 to 1. */
function luminance(name: string, theme: Theme): number {
  const hex = tokens.get(name)?.[theme] ?? "";
  const [red = Number.NaN, green = Number.NaN, blue = Number.NaN] = [1, 3, 5].map((at) => {
    const value = Number.parseInt(hex.slice(at, at + 2), 16) / 255;
    return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
  });
  return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}

function contrast(one: string, other: string, theme: Theme): number {
  const [dark = 0, light = 0] = [luminance(one, theme), luminance(other, theme)].sort((a, b) => a - b);
  return (light + 0.05) / (dark + 0.05);
}

test.each([...AREAS, "header"])("%s does not dazzle in the dark theme", (area) => {
  expect(luminance(area, "dark")).toBeLessThan(0.06);
});

test.each(CARDS)("%s is dimmed in the dark theme, and its number is readable", (card) => {
  expect(luminance(card, "dark")).toBeLessThan(0.75);
  expect(contrast("card-ink", card, "dark")).toBeGreaterThan(7);
});

test.each(AREAS)("text on %s has enough contrast in both themes", (area) => {
  for (const theme of ["light", "dark"] as const) {
    expect(contrast("ink", area, theme)).toBeGreaterThan(7);
    expect(contrast("ink-soft", area, theme)).toBeGreaterThan(4.5);
  }
});
