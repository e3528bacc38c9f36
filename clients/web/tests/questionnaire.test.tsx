// A questionnaire: items that depend on answers, numbers, statements as a table, and texts in Markdown.

import { create } from "@bufbuild/protobuf";
import { Code } from "@connectrpc/connect";
import type { ComponentChild } from "preact";
import { act } from "preact/test-utils";
import { expect, test, vi } from "vitest";
import { StudyShownQuestionnaireSchema } from "../src/gen/chefshat/v1/study_pb";
import { Formatted, FormattedQuestion, plainText } from "../src/studies/Formatted";
import { WithPictures } from "../src/studies/Pictures";
import type { ItemAnswer } from "../src/studies/participating";
import { Questionnaire } from "../src/studies/Questionnaire";
import { eventually, mount, root, type } from "./mounted";
import { AWAY, refused } from "./refusals";

const LIKERT = { case: "likert" as const, value: { points: 5, labels: ["no", "yes"] } };
const AGE = { case: "number" as const, value: { min: 18, max: 99, unit: "years" } };
const GAMES = { case: "choice" as const, value: { options: ["cards", "chess"], multiple: true } };

const show = (what: ComponentChild) => mount(what);
const shownItems = () => [...root.querySelectorAll<HTMLElement>("[data-item]")].map(({ dataset }) => dataset.item);
const field = (item: number, which = "input") => {
  const found = root.querySelector<HTMLInputElement>(`[data-item="${item}"] ${which}`);
  if (!found) throw new Error(`${item} has no ${which}`);
  return found;
};
const enter = (item: number, text: string) => type(field(item), text);
const faults = () => [...root.querySelectorAll('[id$="-fault"]')].map((fault) => fault.textContent);

/** The form of a questionnaire, and what it sends. */
async function shown(items: NonNullable<Parameters<typeof create<typeof StudyShownQuestionnaireSchema>>[1]>["items"]) {
  const sent: ItemAnswer[][] = [];
  const part = {
    progress: () => ({ step: 0, reachedAtMs: 0, saved: [] }),
    save: async () => {},
    answer: async (answers: ItemAnswer[]) => {
      sent.push(answers);
    },
  };
  const questionnaire = create(StudyShownQuestionnaireSchema, { title: "Before", items: items ?? [] });
  await show(<Questionnaire questionnaire={questionnaire} part={part} />);
  const send = () => act(() => root.querySelector<HTMLButtonElement>('button[type="submit"]')?.click());
  const values = () => sent.at(-1)?.map(({ item, value }) => [item, value?.value]);
  return { send, sent, values };
}

test("an item is shown only for the answers that it depends on, and only then asked for and sent", async () => {
  const answers = { options: [0] };
  const { send, values } = await shown([
    { item: 0, text: "What do you play?", optional: true, kind: GAMES },
    { item: 1, text: "How long?", kind: AGE, shownIf: [{ item: 0, answers }] },
    { item: 2, text: "Would you like to?", kind: LIKERT, shownIf: [{ item: 0, answers, not: true }] },
    { item: 3, text: "Since when?", kind: AGE, shownIf: [{ item: 1, answers: { min: 50 } }] },
  ]);
  expect(shownItems()).toEqual(["0", "2"]);
  await act(() => field(0).click());
  expect(shownItems()).toEqual(["0", "1"]);
  await enter(1, "50");
  expect(shownItems()).toEqual(["0", "1", "3"]);
  await send();
  expect(faults()).toEqual(["Please answer this question."]);
  // What it depends on is not shown any more, and so has no answer.
  await act(() => field(0).click());
  expect(shownItems()).toEqual(["0", "2"]);
  await act(() => field(2, 'input[value="4"]').click());
  await send();
  expect(values()).toEqual([[2, 4]]);
});

test("a number that is none, or too small or large, is corrected before it is sent", async () => {
  const { send, sent, values } = await shown([{ item: 0, text: "Your age?", optional: true, kind: AGE }]);
  for (const wrong of ["17", "100", "old", "20.5", "2e1", "-20"]) {
    await enter(0, wrong);
    await send();
    expect(faults(), wrong).toEqual(["This is none of the numbers that can be answered."]);
    expect(field(0).getAttribute("aria-invalid"), wrong).toBe("true");
  }
  expect(sent).toEqual([]);
  // Without an answer it is left out.
  await enter(0, "");
  expect(faults()).toEqual([]);
  await enter(0, " 20 ");
  await send();
  expect(values()).toEqual([[0, 20]]);
});

test("a wrong number is forgotten when its item is not shown any more", async () => {
  const { send, values } = await shown([
    { item: 0, text: "What do you play?", optional: true, kind: GAMES },
    { item: 1, text: "How long?", optional: true, kind: AGE, shownIf: [{ item: 0, answers: { options: [0] } }] },
  ]);
  await act(() => field(0).click());
  await enter(1, "old");
  await act(() => field(0).click());
  await act(() => field(0).click());
  expect(field(1).value).toBe("");
  await send();
  expect(values()).toEqual([[0, { options: [0] }]]);
});

test("the field that lets another item appear keeps the focus", async () => {
  await shown([
    ...[0, 1].map((item) => ({ item, text: `Statement ${item}`, kind: LIKERT })),
    { item: 2, text: "Statement 2", kind: LIKERT, shownIf: [{ item: 1, answers: { min: 4 } }] },
  ]);
  expect(shownItems()).toEqual(["0", "1"]);
  const point = field(1, 'input[value="4"]');
  point.focus();
  await act(() => point.click());
  expect(shownItems()).toEqual(["0", "1", "2"]);
  expect(document.activeElement).toBe(point);
});

test("statements with the same points are a table with one head, and groups of their own for a screen reader", async () => {
  const other = { case: "likert" as const, value: { points: 5, labels: ["never", "often"] } };
  await shown([
    ...[0, 1, 2].map((item) => ({ item, text: `Statement ${item}`, kind: LIKERT })),
    ...[3, 4].map((item) => ({ item, text: `Statement ${item}`, kind: other })),
  ]);
  const tables = root.querySelectorAll('[data-part="item-table"]');
  expect(tables).toHaveLength(1);
  expect(tables[0]?.querySelectorAll("fieldset")).toHaveLength(3);
  expect(tables[0]?.querySelector('[aria-hidden="true"]')?.textContent).toBe("noyes");
  expect(field(2, 'input[value="5"]').getAttribute("aria-label")).toBe("5 of 5: yes");
  expect(root.querySelectorAll("fieldset")).toHaveLength(5);
});

test("a text is Markdown, in which nothing runs", async () => {
  const text = [
    "# Welcome",
    "You *may* **stop**,\nat any `time`.",
    "1. one\n2. two\n\n- [site](https://example.org/a?b=c), [script](javascript:alert(1)), [named][n]",
    "[n]: https://example.com/",
    '<img src="x" onerror="alert(1)"> <script>alert(1)</script>',
    "![a card](https://example.org/card.png)",
    "> said\n\n---",
  ].join("\n\n");
  await show(<Formatted text={text} />);
  expect(root.querySelector("h2")?.textContent).toBe("Welcome");
  expect(root.querySelector("em")?.textContent).toBe("may");
  expect(root.querySelector("p")?.textContent).toBe("You may stop,\nat any time.");
  expect(root.querySelectorAll("ol li")).toHaveLength(2);
  const links = [...root.querySelectorAll("a")];
  expect(links.map(({ href, textContent }) => [href, textContent])).toEqual([
    ["https://example.org/a?b=c", "site"],
    ["https://example.com/", "named"],
  ]);
  expect(links.every(({ target, rel }) => target === "_blank" && rel.includes("noopener"))).toBe(true);
  expect(root.textContent).toContain("script");
  expect(root.querySelectorAll("img, script")).toHaveLength(0);
  expect(root.textContent).toContain('<img src="x" onerror="alert(1)">');
  expect(root.textContent).toContain("a card");
  expect(root.querySelector("blockquote")?.textContent).toBe("said");
});

test("a text has the pictures of the study, each asked for once, and the words of others", async () => {
  const asked: string[] = [];
  const load = async (name: string) => {
    asked.push(name);
    if (name === "lost.png") throw refused("PICTURE_UNKNOWN", Code.NotFound);
    // The server is away for a moment.
    if (name === "card.gif" && asked.length === 1) throw refused("SHUTTING_DOWN", Code.Unavailable);
    return name === "card.gif" ? new TextEncoder().encode("GIF89a") : new TextEncoder().encode("<svg/>");
  };
  const text = "![a card](card.gif) ![again](card.gif) ![a chart](chart.svg)\n\n![lost][it]\n\n[it]: lost.png";
  await show(
    <WithPictures load={load}>
      <Formatted text={text} />
      <FormattedQuestion text="Which? ![the same](card.gif)" />
    </WithPictures>,
  );
  await eventually(() => expect(root.querySelectorAll("img")).toHaveLength(3));
  const pictures = [...root.querySelectorAll("img")];
  expect(pictures.map(({ alt }) => alt)).toEqual(["a card", "again", "the same"]);
  expect(new Set(pictures.map(({ src }) => src))).toEqual(new Set(["data:image/gif;base64,R0lGODlh"]));
  expect(root.textContent).toContain("a chart");
  expect(root.textContent).toContain("lost");
  expect(asked.toSorted()).toEqual(["card.gif", "card.gif", "chart.svg", "lost.png"]);
});

test("a question has markup, and its field a name without", async () => {
  const text = "1. How *sure*\n\nare [you](https://example.org),  \n*really*?";
  await show(<FormattedQuestion text={text} />);
  expect(root.querySelectorAll("p, ol")).toHaveLength(0);
  expect(root.querySelector("em")?.textContent).toBe("really");
  // Blocks other than paragraphs stand as they are written.
  expect(root.textContent).toContain("1. How *sure*");
  expect(plainText(text)).toBe("1. How *sure* are you, really?");
});

/** A questionnaire with a number, and the numbers that it saves; `save` answers each. */
async function saving(save: () => Promise<void>) {
  vi.useFakeTimers({ toFake: ["setTimeout", "clearTimeout"] });
  const saves: [step: number, values: unknown[]][] = [];
  const part = {
    progress: () => ({ step: 3, reachedAtMs: 0, saved: [] }),
    save: (answers: ItemAnswer[], step: number) => {
      saves.push([step, answers.map(({ value }) => value?.value)]);
      return save();
    },
    answer: async () => {},
  };
  const questionnaire = create(StudyShownQuestionnaireSchema, { items: [{ item: 0, text: "How old?", kind: AGE }] });
  await show(<Questionnaire questionnaire={questionnaire} part={part} />);
  return saves;
}

test("what was entered without a connection is saved when it is back, as it is then", async () => {
  let isCut = true;
  const saves = await saving(async () => {
    if (isCut) throw AWAY;
  });
  await enter(0, "20");
  await vi.advanceTimersByTimeAsync(60_000);
  const before = saves.length;
  expect(before).toBeGreaterThan(1);
  await enter(0, "21");
  await vi.advanceTimersByTimeAsync(60_000);
  expect(new Set(saves.slice(before).map(([, [age]]) => age))).toEqual(new Set([21]));
  isCut = false;
  await vi.advanceTimersByTimeAsync(60_000);
  const after = saves.length;
  expect(saves.at(-1)).toEqual([3, [21]]);
  await vi.advanceTimersByTimeAsync(60_000);
  expect(saves).toHaveLength(after);
});

test("what is still to be saved when the questionnaire is over is not saved in the next one", async () => {
  let fail = (_: Error) => {};
  const save = () =>
    new Promise<void>((_, reject) => {
      fail = reject;
    });
  const saves = await saving(save);
  for (const age of ["20", "21"]) {
    await enter(0, age);
    await vi.advanceTimersByTimeAsync(500);
  }
  await mount(null);
  fail(new Error("too late"));
  await vi.advanceTimersByTimeAsync(0);
  expect(saves).toEqual([[3, [20]]]);
});
