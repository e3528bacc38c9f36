// Checks of any page: accessibility, and whether it fits a phone.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import type Axe from "axe-core";
import type { Page } from "playwright-core";
import { expect } from "vitest";
import { languages } from "../../src/i18n";

const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

/** As narrow as the smallest phone, or a computer whose page is enlarged to 400 %. */
export const PHONE = { width: 320, height: 740 };

/** Whether the long tests are run. */
const SLOW = process.env.CHEFSHAT_SLOW !== undefined;

/** Phones, the smallest first, and one on its side; in long tests, also usual ones. */
const USUAL = [
  { width: 375, height: 667 },
  { width: 390, height: 664 },
];
export const PHONES = [PHONE, ...(SLOW ? USUAL : []), { width: 667, height: 375 }];

/** The languages in which pages are looked at: all in long tests, otherwise the one with the longest texts. */
export const LANGUAGES = languages.filter(({ value }) => SLOW || value === "de");

/**
 * Everything that axe-core finds in the light theme, with any impact, also against best practice, and
 * what depends on colours in the dark one.
 */
export async function inaccessible(page: Page): Promise<string[]> {
  const found: string[] = [];
  for (const [colorScheme, rules] of [
    ["light", []],
    ["dark", COLOR_RULES],
  ] as const) {
    await page.emulateMedia({ colorScheme });
    found.push(...(await findings(page, rules)).map((finding) => `${colorScheme}: ${finding}`));
  }
  await page.emulateMedia({ colorScheme: "light" });
  return found;
}

/** The rules whose outcome depends on colours. */
const COLOR_RULES = ["color-contrast", "link-in-text-block"];

/** The rules whose outcome depends on texts. */
const TEXT_RULES = [
  "aria-command-name",
  "aria-dialog-name",
  "aria-input-field-name",
  "aria-meter-name",
  "aria-progressbar-name",
  "aria-toggle-field-name",
  "button-name",
  "document-title",
  "empty-heading",
  "empty-table-header",
  "html-has-lang",
  "html-lang-valid",
  "image-alt",
  "input-button-name",
  "label",
  "label-title-only",
  "landmark-unique",
  "link-name",
  "page-has-heading-one",
  "role-img-alt",
  "select-name",
  "summary-name",
  "svg-img-alt",
  "table-duplicate-name",
];

/** What axe-core finds with the rules whose outcome depends on texts. */
export async function unnamed(page: Page): Promise<string[]> {
  return findings(page, TEXT_RULES);
}

/** Tags of rules that the page does not follow: WCAG's level AAA, and what axe-core itself has given up. */
const NOT_FOLLOWED = ["wcag2aaa", "deprecated"];

/** With the rules given, or with all that the page follows, of which axe-core leaves out some by default. */
async function findings(page: Page, named: readonly string[] = []): Promise<string[]> {
  if (!(await page.evaluate(() => "axe" in globalThis))) await page.evaluate(AXE);
  const found = await page.evaluate(
    async ([named, notFollowed]) => {
      const { axe } = globalThis as unknown as { axe: Pick<typeof Axe, "run" | "getRules"> };
      const followed = axe.getRules().filter(({ tags }) => !tags.some((tag) => notFollowed.includes(tag)));
      const values = named.length > 0 ? named : followed.map(({ ruleId }) => ruleId);
      return axe.run({ runOnly: { type: "rule", values: [...values] }, resultTypes: ["violations"] });
    },
    [named, NOT_FOLLOWED] as const,
  );
  expect(found.passes.length + found.incomplete.length).toBeGreaterThan(0);
  return found.violations.flatMap(({ id, nodes }) =>
    nodes.map(({ target, failureSummary }) => `${id}: ${target} ${failureSummary}`),
  );
}

/** The elements that make the page scroll horizontally. */
export async function tooWide(page: Page): Promise<string[]> {
  return page.evaluate(() => {
    const { scrollWidth, clientWidth } = document.documentElement;
    if (scrollWidth <= clientWidth) return [];
    const wide = [...document.querySelectorAll("body *")].filter(
      (element) => element.getBoundingClientRect().right > clientWidth + 1,
    );
    return [`${scrollWidth} > ${clientWidth}`, ...wide.slice(0, 5).map((element) => element.outerHTML.slice(0, 120))];
  });
}
