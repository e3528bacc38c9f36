// CSS modules: every class that a component uses exists, and every class is used.

import { readdirSync, readFileSync } from "node:fs";
import { dirname, join, resolve } from "node:path";
import { expect, test } from "vitest";

const SRC = resolve(import.meta.dirname, "../src");
const files = readdirSync(SRC, { recursive: true, encoding: "utf8" });
const read = (name: string) => readFileSync(join(SRC, name), "utf8");
const camel = (name: string) => name.replaceAll(/-([a-z0-9])/g, (_, letter: string) => letter.toUpperCase());

/** Classes by module, in camel case. */
const sheets = new Map(
  files
    .filter((name) => name.endsWith(".module.css"))
    .map((name) => {
      const text = read(name).replaceAll(/\/\*[\s\S]*?\*\/|:global\([^)]*\)|\{[^{}]*\}/g, " ");
      return [
        join(SRC, name),
        new Set([...text.matchAll(/\.([a-zA-Z][\w-]*)/g)].map(([, found = ""]) => camel(found))),
      ];
    }),
);
const used = new Map([...sheets.keys()].map((sheet) => [sheet, new Set<string>()]));
const unknown: string[] = [];
for (const name of files.filter((file) => file.endsWith(".tsx"))) {
  const text = read(name);
  for (const [, local = "", path = ""] of text.matchAll(/import (\w+) from "([^"]+\.module\.css)"/g)) {
    const sheet = resolve(SRC, dirname(name), path);
    for (const [, found = ""] of text.matchAll(new RegExp(`\\b${local}\\.(\\w+)`, "g"))) {
      if (!sheets.get(sheet)?.has(found)) unknown.push(`${name}: ${found}`);
      used.get(sheet)?.add(found);
    }
    // Access by a value, such as the kind of a card, may use any class.
    if (text.includes(`${local}[`)) for (const any of sheets.get(sheet) ?? []) used.get(sheet)?.add(any);
  }
}

const sheetTexts = files.filter((name) => name.endsWith(".css")).map(read);
const components = files.filter((name) => name.endsWith(".tsx")).map(read);

test("every class that a component uses exists", () => expect(unknown).toEqual([]));

test("every class is used", () => {
  const unused = [...sheets].flatMap(([sheet, classes]) =>
    [...classes]
      .filter((found) => !used.get(sheet)?.has(found))
      .map((found) => `${sheet.slice(SRC.length + 1)}: ${found}`),
  );
  expect(sheets.size).toBeGreaterThan(30);
  expect(unused).toEqual([]);
});

test("every data-part in a style sheet or test exists", () => {
  const parts = new Set(
    components.flatMap((text) =>
      [...text.matchAll(/data-part=(?:"([^"]*)"|\{([^}]*)\})/g)].flatMap(([, plain, dynamic = ""]) =>
        plain === undefined ? [...dynamic.matchAll(/"([\w-]+)"/g)].map(([, part = ""]) => part) : plain.split(" "),
      ),
    ),
  );
  const tests = resolve(SRC, "../tests/browser");
  const texts = [...sheetTexts, ...readdirSync(tests).map((name) => readFileSync(join(tests, name), "utf8"))];
  const named = texts.flatMap((text) => [...text.matchAll(/data-part~?="?([\w-]+)/g)].map(([, part = ""]) => part));
  expect([...new Set(named)].filter((part) => !parts.has(part))).toEqual([]);
});

test("no style of the whole page uses :has()", () => {
  // The browser would compute the styles of the whole page after each change: see parts/marks.ts.
  const found = sheetTexts.flatMap((text) =>
    [...text.matchAll(/[^{}]*\{/g)].flatMap(([selectors]) => selectors.split(/,\n/)),
  );
  const whole = /(?::root|html|body|\.layout|\[data-part~="layout"\])(?![\w-])\S*:has\(/;
  expect(found.length).toBeGreaterThan(500);
  expect(found.filter((selector) => whole.test(selector))).toEqual([]);
});

test("every mark of the document in a style sheet is set by a part", () => {
  const set = components.flatMap((text) => [...text.matchAll(/<Shows what="([\w-]+)"/g)].map(([, what = ""]) => what));
  const used = sheetTexts.flatMap((text) => [...text.matchAll(/data-shows~="([\w-]+)"/g)].map(([, what = ""]) => what));
  expect([...new Set(used)].toSorted()).toEqual([...new Set(set)].toSorted());
});
