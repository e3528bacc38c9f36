// Draws the icons of the installed page as PNG from public/icons/icon.svg, with Chromium:
// node tools/icons.mjs. Run it after a change of the drawing, and commit the result.

import { readFileSync, writeFileSync } from "node:fs";
import { chromium } from "playwright-core";

const folder = new URL("../public/icons/", import.meta.url);
const svg = readFileSync(new URL("icon.svg", folder), "utf8");
// A launcher cuts a maskable icon to its own shape: the background fills it, without round corners.
const maskable = svg.replace(' rx="10"', "");
const icons = [
  ["icon-192.png", svg, 192],
  ["icon-512.png", svg, 512],
  ["apple-touch-icon.png", maskable, 180],
  ["maskable-512.png", maskable, 512],
];

const browser = await chromium.launch({
  executablePath: process.env.CHEFSHAT_CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--disable-gpu"],
});
const page = await browser.newPage();
for (const [name, drawing, size] of icons) {
  await page.setViewportSize({ width: size, height: size });
  await page.setContent(`<style>body { margin: 0 } svg { display: block; width: 100vw }</style>${drawing}`);
  writeFileSync(new URL(name, folder), await page.screenshot({ omitBackground: true }));
}
await browser.close();
