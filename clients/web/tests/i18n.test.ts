// Every language has the same texts as English, and the language is chosen in the documented order.

import { afterEach, beforeEach, describe, expect, test, vi } from "vitest";
import { firstKnown, languages, setLanguage, showLanguage, t } from "../src/i18n";
import * as en from "../src/i18n/en";
import { time } from "../src/i18n/en/time";
import { ordinals, plurals } from "../src/i18n/plural";

/** The paths of all texts; a function counts as one. */
function paths(texts: object, above = ""): string[] {
  return Object.entries(texts).flatMap(([name, text]) =>
    typeof text === "object" && text !== null ? paths(text, `${above}${name}.`) : [`${above}${name}`],
  );
}

/** The paths of empty texts. */
function silent(texts: object, above = ""): string[] {
  return Object.entries(texts).flatMap(([name, text]) => {
    if (typeof text === "string") return text.trim() === "" ? [`${above}${name}`] : [];
    return typeof text === "object" && text !== null ? silent(text, `${above}${name}.`) : [];
  });
}

test.each(languages)(
  "$label has the texts that English has, and none is empty unless the English one is",
  async ({ value }) => {
    await setLanguage(value);
    expect(paths(t()).toSorted()).toEqual(paths(en).toSorted());
    expect(silent(t()).toSorted()).toEqual(silent(en).toSorted());
    expect(paths(en).length).toBeGreaterThan(100);
  },
);

/** The texts of a language by their paths; of functions, what they say of these numbers. */
function said(texts: object, above = ""): [path: string, text: string][] {
  return Object.entries(texts).flatMap(([name, text]): [string, string][] => {
    const path = `${above}${name}`;
    if (typeof text === "string") return [[path, text]];
    if (typeof text === "object" && text !== null) return said(text, `${path}.`);
    try {
      return [[path, String(text(3, 5, 7, 9))]];
    } catch {
      // Of something else than numbers.
      return [];
    }
  });
}

const numbersIn = (text: string): string[] => text.match(/\d+/g) ?? [];

/** The server's sentence, which is English: other languages have one of their own. */
const NOT_SAID = ["table.log.corrected"];

test.each(languages)("in $label, no number is missing", async ({ value }) => {
  await setLanguage(value);
  const texts = new Map(said(t()));
  const missing = said(en).filter(([path, text]) => {
    const numbers = new Set(numbersIn(texts.get(path) ?? ""));
    return !NOT_SAID.includes(path) && numbersIn(text).some((number) => !numbers.has(number));
  });
  expect(missing).toEqual([]);
});

/** What fits in two lines beside the clock, on a phone 390 pixels wide. */
const BESIDE_CLOCK = 46;

test.each(languages)("in $label, hints and reasons at the own turn are short enough for a phone", async ({ value }) => {
  await setLanguage(value);
  const { reasons, actions } = t().table;
  const { openingGolden, openingFace, notRarer, tooFew, notHeld, ...others } = reasons;
  const { pick, pickMust, onlyPass, autoPassing, noPass, mustPlay, ready, sending } = actions;
  const hints = [pick, pickMust, onlyPass, autoPassing, noPass, mustPlay, ready, sending, actions.more(2)];
  const made = [openingGolden(11), openingFace(11), notRarer(11, 10), tooFew(3, 2), notHeld(11), notHeld(undefined)];
  const lines = [...hints, ...made, ...Object.values(others)];
  expect(lines.filter((line) => line.length > BESIDE_CLOCK)).toEqual([]);
});

test("a language without texts is not shown", async () => {
  await setLanguage("it");
  await showLanguage("xx");
  await showLanguage("toString");
  expect(t().common.close).toBe("Chiudi");
  await showLanguage("de");
  expect(t().common.close).toBe("Schließen");
});

describe("texts that come late or not at all", () => {
  beforeEach(() => {
    vi.resetModules();
    vi.stubGlobal("fetch", async () => Promise.reject(new TypeError("no network")));
  });
  afterEach(() => {
    vi.doUnmock("../src/i18n/de");
  });

  test("of two languages the one that was chosen last is shown", async () => {
    const de = await import("../src/i18n/de");
    let arrive = () => {};
    const late = new Promise<void>((resolve) => {
      arrive = resolve;
    });
    vi.doMock("../src/i18n/de", async () => {
      await late;
      return de;
    });
    const i18n = await import("../src/i18n");
    const first = i18n.setLanguage("de");
    await i18n.setLanguage("en");
    arrive();
    await first;
    expect(i18n.language.value).toBe("en");
    expect(i18n.t().common.close).toBe(en.common.close);
  });

  test("that of a study is tried again; a choice fails, and is stored for the next visit", async () => {
    vi.useFakeTimers({ toFake: ["setTimeout"] });
    const load = vi.fn(() => {
      throw new Error("gone");
    });
    vi.doMock("../src/i18n/de", load);
    const i18n = await import("../src/i18n");
    await i18n.setLanguage("en");
    await expect(i18n.setLanguage("de")).rejects.toThrow();
    expect(localStorage.getItem("chefshat.language")).toBe("de");
    expect(i18n.language.value).toBe("en");
    load.mockClear();
    let over = false;
    void i18n.showLanguage("de").then(() => {
      over = true;
    });
    while (!over) await vi.advanceTimersByTimeAsync(1_000);
    expect(load.mock.calls.length).toBeGreaterThan(1);
  });
});

test.each([
  [[null, null, "it-CH", "en"], "it"],
  [["EN", "it"], "en"],
  [["de-AT", "en"], "de"],
  [["fr-FR", "es-419", "it"], "es"],
  [["nl", "fr-FR"], "en"],
  [["xx", "it"], "it"],
  [[], "en"],
])("of %j the language is %s", (candidates, language) => {
  expect(firstKnown(candidates)).toBe(language);
});

describe("numbers", () => {
  test.each([
    ["en", 1, "1 card"],
    ["en", 0, "0 cards"],
    ["en", 1200, "1,200 cards"],
    ["de", 1200, "1.200 cards"],
    ["es", 12000, "12.000 cards"],
    ["es", 1_000_000, "1.000.000 cards"],
  ])("%s %d", (language, count, words) => {
    expect(plurals(language)(count, { one: "# card", other: "# cards" })).toBe(words);
  });

  test.each(languages)("a seat in $label has one point, or several", async ({ value }) => {
    await setLanguage(value);
    const { pointsWord } = t().table;
    expect(pointsWord(0)).toBe(pointsWord(5));
    expect(pointsWord(1)).not.toBe(pointsWord(5));
  });

  test.each([
    [1_000, "1 second"],
    [150_000, "150 seconds"],
    [180_000, "3 minutes"],
    [5_400_000, "90 minutes"],
    [7_200_000, "2 hours"],
  ])("%d milliseconds are %s", (ms, words) => {
    expect(time(ms)).toBe(words);
  });

  test.each([
    [1, "1st"],
    [2, "2nd"],
    [3, "3rd"],
    [4, "4th"],
    [11, "11th"],
  ])("place %d is %s", (place, words) => {
    expect(ordinals("en", { one: "st", two: "nd", few: "rd", other: "th" })(place)).toBe(words);
  });
});
