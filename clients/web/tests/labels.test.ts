// The names that a study gives the other seats, in the language of the page.

import { afterEach, expect, test } from "vitest";
import { setLanguage } from "../src/i18n";
import { labelled, shownName } from "../src/table/labels";

afterEach(async () => {
  labelled.value = false;
  await setLanguage("en");
});

test("the server's names of other seats are said in the language of the page", async () => {
  labelled.value = true;
  await setLanguage("de");
  const names = ["Agent 2", "Player 2", "Robot 2", "Model 2"].map((name) => shownName(1, name));
  expect(names).toEqual(["Agent 2", "Spieler 2", "Roboter 2", "Modell 2"]);
  // The participant's own name may be any.
  expect(shownName(0, "Player 2")).toBe("Player 2");
  expect(shownName(0, "Greta")).toBe("Greta");
});

test("names are as they are where a study does not replace them", async () => {
  await setLanguage("de");
  expect(shownName(1, "Player 2")).toBe("Player 2");
});
