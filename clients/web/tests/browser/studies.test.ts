// A study on the server: a participant goes through all stages, changes the device, reloads, and
// never meets a condition's name; another one withdraws; the researcher's page shows both.

import { readFileSync } from "node:fs";
import type { BrowserContextOptions, Page } from "playwright-core";
import { expect, test } from "vitest";
import { StudyHide, StudyParticipantState, StudyPointer } from "../../src/gen/chefshat/v1/study_pb";
import { inaccessible, PHONE, tooWide } from "./checks";
import { agree, consent, expectNoSecretOn, expectNoSecretSent, newStudy, playGame } from "./participants";
import { clientsOf } from "./rooms";
import { browser, person, server, until, useStage } from "./stage";
import { Tap } from "./tap";

useStage();

/** Opens the page of a study with its key. */
async function researcherOf(study: { studyId: string; ownerToken: string }, options: BrowserContextOptions = {}) {
  const researcher = await person(browser, options);
  await researcher.page.goto(`${server.url}/studies/${study.studyId}`);
  await researcher.page.getByLabel("Owner token").fill(study.ownerToken);
  await researcher.page.getByRole("button", { name: "Use this key" }).click();
  return researcher;
}

async function withdraw(page: Page): Promise<void> {
  await page.getByRole("button", { name: "Withdraw from the study…" }).click();
  await page.getByRole("button", { name: "Withdraw now" }).click();
  await page.getByText("You have withdrawn.").waitFor();
}

test("a participant goes through all stages, on two devices, without meeting a condition", async () => {
  const { studyId, ownerToken } = await newStudy(server, { participants: 2 });
  const tap = await Tap.before(server);
  const added = await clientsOf(server).studies.addStudyParticipants({ studyId, ownerToken, count: 2 });
  const links = added.links.map(({ link }) => `${tap.url}/study/${link}`);
  const first = await person(browser);
  await first.page.goto(links[0] ?? "");
  await first.page.getByRole("heading", { name: "Before you begin" }).waitFor();
  expect(await inaccessible(first.page)).toEqual([]);
  await consent(first.page);
  expect(await first.page.locator('[data-part~="header-nav"]').isVisible()).toBe(false);
  expect(await inaccessible(first.page)).toEqual([]);
  await first.page.reload();
  await first.page.locator("[data-decision]").waitFor();
  // The study hides what the others are, but not that they are there.
  await first.page.getByRole("heading", { name: "Player 3" }).waitFor();
  expect(await playGame(first.page)).toBeGreaterThan(0);
  await first.page.locator("[data-decision]").waitFor();
  await expectNoSecretOn(first.page);

  // A phone takes over in the middle of the game.
  const second = await person(browser, { viewport: PHONE });
  await second.page.goto(links[0] ?? "");
  await first.page.getByRole("heading", { name: "You continue on another device or page" }).waitFor();
  expect(await playGame(second.page)).toBeGreaterThan(0);

  await second.page.getByRole("heading", { name: "About the game" }).waitFor();
  await second.page.getByRole("button", { name: "Send the answers" }).click();
  await second.page.getByText("Please check 3 questions.").first().waitFor();
  expect(await inaccessible(second.page)).toEqual([]);
  expect(await tooWide(second.page)).toEqual([]);
  const kept = second.page.waitForResponse((response) => response.url().endsWith("/SaveAnswers"));
  await second.page.getByRole("radio", { name: "4 of 5" }).check();
  await (await kept).finished();
  // What was entered survives a reload, and goes along to another device.
  const third = await person(browser);
  await third.page.goto(links[0] ?? "");
  await until(() => third.page.getByRole("radio", { name: "4 of 5" }).isChecked());
  await second.page.reload();
  await until(() => second.page.getByRole("radio", { name: "4 of 5" }).isChecked());
  await second.page.getByRole("radio", { name: "6 of 7" }).check();
  await second.page.getByRole("slider").press("ArrowRight");
  await second.page.getByRole("button", { name: "Send the answers" }).click();
  await second.page.getByRole("heading", { name: "About this study" }).waitFor();
  await second.page.getByRole("button", { name: "Continue" }).click();
  await second.page.getByRole("heading", { name: "Thank you for taking part" }).waitFor();
  expect(await inaccessible(second.page)).toEqual([]);
  await expectNoSecretOn(second.page);
  expectNoSecretSent(tap);
  expect([...first.faults, ...second.faults]).toEqual([]);

  // The other participant withdraws.
  const other = await person(browser);
  await other.page.goto(links[1] ?? "");
  await withdraw(other.page);
  await tap.stop();

  // The researcher's page shows both.
  const researcher = await researcherOf({ studyId, ownerToken });
  const rows = researcher.page.locator('[data-part~="participants"] tbody tr');
  await expect.poll(() => rows.allInnerTexts().then((texts) => texts.join())).toMatch(/completed[\s\S]*withdrawn/);
  expect(await inaccessible(researcher.page)).toEqual([]);
  const [saved] = await Promise.all([
    researcher.page.waitForEvent("download"),
    researcher.page.getByRole("button", { name: "Download the data (ZIP)" }).click(),
  ]);
  const archive = readFileSync(await saved.path(), "latin1");
  for (const file of ["participants.csv", "games.csv", "answers.csv", "traces.csv", "records/"])
    expect(archive).toContain(file);
  expect(archive).toContain("cond-");
  expect(researcher.faults).toEqual([]);
});

test("two people wait for each other, play together, and one goes on with agents when the other leaves", async () => {
  const stages = [
    { stage: { case: "consent" as const, value: { text: "We record your games.", version: "1" } } },
    { stage: { case: "arrival" as const, value: { text: "Your **partner** comes soon." } } },
    { stage: { case: "games" as const, value: { count: 2 } } },
    { stage: { case: "text" as const, value: { title: "About this study", text: "Thank you." } } },
  ];
  const { studyId, ownerToken } = await newStudy(server, { participants: 2, groups: { size: 2 }, stages });
  const tap = await Tap.before(server);
  const added = await clientsOf(server).studies.addStudyParticipants({ studyId, ownerToken, count: 2 });
  const [first, second] = [await person(browser, { viewport: PHONE }), await person(browser)];
  const links = added.links.map(({ link }) => `${tap.url}/study/${link}`);
  await first.page.goto(links[0] ?? "");
  await agree(first.page);
  await first.page.getByRole("heading", { name: "Waiting for the others" }).waitFor();
  // It is read out as well, with the step.
  await first.page.getByText("1 of 2 people are here", { exact: true }).waitFor();
  expect(await inaccessible(first.page)).toEqual([]);
  expect(await tooWide(first.page)).toEqual([]);
  // Whoever closes the page does not count until it is open again.
  await first.page.reload();
  await second.page.goto(links[1] ?? "");
  await agree(second.page);
  const leave = () => withdraw(second.page);
  const [taken] = await Promise.all([playGame(first.page), playGame(second.page, 1).then(leave)]);
  expect(taken).toBeGreaterThan(0);
  // The next game has an agent in the place of the other.
  expect(await playGame(first.page)).toBeGreaterThan(0);
  await first.page.getByRole("heading", { name: "About this study" }).waitFor();
  await first.page.getByRole("button", { name: "Continue" }).click();
  await first.page.getByRole("heading", { name: "Thank you for taking part" }).waitFor();
  for (const { page } of [first, second]) await expectNoSecretOn(page);
  expectNoSecretSent(tap);
  await tap.stop();
  expect([...first.faults, ...second.faults]).toEqual([]);
  const { participants } = await clientsOf(server).studies.getStudy({ studyId, ownerToken });
  expect(participants.map(({ group, games }) => [group, games.length])).toEqual([
    [1, 2],
    [1, 1],
  ]);
});

/** The parts of the table that a condition can hide. */
const HIDDEN_BY: [StudyHide, string][] = [
  [StudyHide.LOG, "log"],
  [StudyHide.LOOKUP, "tool-lookup"],
  [StudyHide.EXPRESSIONS, "expressions"],
  [StudyHide.PLAYED, "played"],
];

test.each([
  ["what a condition hides is hidden in the whole game, also after a reload", HIDDEN_BY.map(([hide]) => hide), []],
  ["what no condition hides is seen", [], HIDDEN_BY.map(([, part]) => part)],
])("%s", async (_, hide, expected) => {
  const condition = {
    id: "one",
    rules: { preset: "paper", faces: 5, stop: { case: "targetShifts" as const, value: 1 } },
    policy: { decisionTimeMs: 3_600_000, paceMs: 0 },
    seats: Array.from({ length: 3 }, () => ({ filledBy: { case: "builtInAgent" as const, value: "random" } })),
    hide,
  };
  const stages = [{ stage: { case: "games" as const, value: { count: 1 } } }];
  const study = await newStudy(server, { participants: 1, factors: [], conditions: [condition], stages });
  const { links } = await clientsOf(server).studies.addStudyParticipants({ ...study, count: 1 });
  const { page, faults } = await person(browser);
  const seen = new Set<string>();
  const look = async () => {
    for (const [, part] of HIDDEN_BY)
      if (await page.locator(`[data-part~="${part}"]`).first().isVisible()) seen.add(part);
  };
  await page.goto(`${server.url}/study/${links[0]?.link}`);
  await page.locator("[data-decision]").waitFor();
  await look();
  await page.reload();
  await page.locator("[data-decision]").waitFor();
  do await look();
  while ((await playGame(page, 1)) === 1);
  expect([...seen]).toEqual(expected);
  expect(faults).toEqual([]);
});

test("a researcher tests a study: every page, without answering and playing, apart from all counts", async () => {
  const statements = ["They played well.", "I trusted them.", "I was bored."].map((text, index) => ({
    id: `s${index}`,
    text,
    kind: { case: "likert" as const, value: { points: 5, labels: ["not at all", "very much"] } },
    shownIf: index === 2 ? [{ item: "age", answers: { min: 30 } }] : [],
  }));
  const age = {
    id: "age",
    text: "How *old* are you?",
    kind: { case: "number" as const, value: { min: 18, max: 99, unit: "years" } },
  };
  const before = {
    id: "before",
    title: "Before the game",
    instructions: "Choose **one**:\n\n- a\n- b",
    items: [age, ...statements],
  };
  const only = { shownIf: [{ questionnaire: "before", item: "age", answers: { min: 30 } }] };
  const { studyId, ownerToken } = await newStudy(server, {
    participants: 2,
    stages: [
      { stage: { case: "consent", value: { text: "# Study\n\nSee [our page](https://example.org).", version: "1" } } },
      { stage: { case: "questionnaire", value: before } },
      { stage: { case: "text", value: { title: "For some", text: "You are over 30." } }, ...only },
      { stage: { case: "games", value: { count: 1 } } },
      { stage: { case: "text", value: { title: "About this study", text: "Thank you." } } },
    ],
  });
  const researcher = await researcherOf({ studyId, ownerToken }, { viewport: PHONE });
  await researcher.page.getByLabel("Number of test participants").fill("2");
  await researcher.page.getByRole("button", { name: "Add test participants" }).click();
  await researcher.page.getByRole("button", { name: "Download the data of test participants (ZIP)" }).waitFor();
  expect(await inaccessible(researcher.page)).toEqual([]);
  expect(await tooWide(researcher.page)).toEqual([]);

  const { links } = await clientsOf(server).studies.listStudyLinks({ studyId, ownerToken });
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/study/${links[0]?.link}`);
  await page.getByText("Test participation").waitFor();
  await page.getByRole("link", { name: "our page" }).waitFor();
  expect(await inaccessible(page)).toEqual([]);
  await agree(page);
  await page.getByRole("textbox", { name: "How old are you?" }).fill("3");
  await page.getByRole("button", { name: "Send the answers" }).click();
  await page.getByText("This is none of the numbers that can be answered.").waitFor();
  expect(await page.getByRole("group", { name: "I was bored." }).count()).toBe(0);
  await page.getByRole("textbox", { name: "How old are you?" }).fill("30");
  await page.getByRole("group", { name: "I was bored." }).waitFor();
  expect(await inaccessible(page)).toEqual([]);
  await page.setViewportSize(PHONE);
  expect(await tooWide(page)).toEqual([]);
  for (const point of await page.getByRole("radio", { name: "4 of 5" }).all()) await point.check();
  await page.getByRole("button", { name: "Send the answers" }).click();
  await page.getByRole("heading", { name: "For some" }).waitFor();
  await page.getByRole("button", { name: "Continue" }).click();
  await page.locator("[data-decision]").waitFor();
  await page.getByRole("button", { name: "End the game" }).click();
  await page.locator('[data-part~="study-game"]').getByRole("button", { name: "Continue" }).click();
  await page.getByRole("heading", { name: "About this study" }).waitFor();

  // The other one skips the questions, and so is not over 30.
  const other = await person(browser);
  await other.page.goto(`${server.url}/study/${links[1]?.link}`);
  await agree(other.page);
  await other.page.getByRole("button", { name: "Skip the questions" }).click();
  await other.page.locator("[data-decision]").waitFor();

  const { study, participants } = await clientsOf(server).studies.getStudy({ studyId, ownerToken });
  expect([study?.added, study?.active, study?.testParticipants]).toEqual([0, 0, 2]);
  expect(participants.map(({ pseudonym, test }) => [pseudonym, test])).toEqual([
    ["T01", true],
    ["T02", true],
  ]);
  expect([...faults, ...other.faults, ...researcher.faults]).toEqual([]);
});

test("a researcher deletes a study with a participant in the middle of it, and its link and key are gone", async () => {
  const { studyId, ownerToken } = await newStudy(server, { participants: 2 });
  const { links } = await clientsOf(server).studies.addStudyParticipants({ studyId, ownerToken, count: 1 });
  const participant = await person(browser);
  await participant.page.goto(`${server.url}/study/${links[0]?.link}`);
  await consent(participant.page);

  const { page, faults } = await researcherOf({ studyId, ownerToken }, { viewport: PHONE });
  await page.getByRole("button", { name: "Delete the study…" }).press("Enter");
  await page.getByRole("button", { name: "Delete everything now" }).press("Enter");
  await page.getByText("Participants are in the middle of this study.").waitFor();
  await page.getByRole("button", { name: "Remove the participants and delete…" }).press("Enter");
  expect(await inaccessible(page)).toEqual([]);
  expect(await tooWide(page)).toEqual([]);
  await page.getByRole("button", { name: "Remove them and delete everything now" }).press("Enter");
  await page.getByText("This device has no studies.").waitFor();
  expect(new URL(page.url()).pathname).toBe("/studies");
  await page.goto(`${server.url}/studies/${studyId}`);
  await page.getByText("This device has no key of this study.").waitFor();
  await participant.page.goto(`${server.url}/study/${links[0]?.link}`);
  await participant.page.getByRole("alert").waitFor();
  expect(faults).toEqual([]);
});

test("people of a panel take part by the open link, once each, and go on where the panel says", async () => {
  const stages = [
    { stage: { case: "consent" as const, value: { text: "We record your games.", version: "1" } } },
    { stage: { case: "text" as const, value: { title: "About this study", text: "Thank you." } } },
  ];
  const recruiting = {
    openLink: true,
    idParameter: "PROLIFIC_PID",
    completedUrl: "https://panel.example/done?id={id}",
    leftUrl: "https://panel.example/left",
    fullUrl: "https://panel.example/full",
  };
  const condition = {
    id: "one",
    rules: { preset: "paper", faces: 5 },
    seats: Array.from({ length: 3 }, () => ({ filledBy: { case: "builtInAgent" as const, value: "random" } })),
  };
  const deletesAtMs = BigInt(Date.UTC(2031, 11, 30, 11));
  const plan = { participants: 1, factors: [], conditions: [condition], stages, recruiting, deletesAtMs };
  const { studyId, ownerToken } = await newStudy(server, plan);
  const researcher = await researcherOf({ studyId, ownerToken });
  await researcher.page.getByText("The study is deleted with all its data on ").waitFor();
  const shown = researcher.page.locator('[data-part~="open-link"] [data-part~="invite-link"]');
  const asked = ((await shown.textContent()) ?? "").trim();
  const openLink = asked.replace("?PROLIFIC_PID=", "");
  expect(asked).not.toBe(openLink);
  expect(await inaccessible(researcher.page)).toEqual([]);

  const ada = await person(browser, { viewport: PHONE });
  await ada.page.goto(openLink);
  await ada.page.getByText("The link has no valid id.").waitFor();
  await ada.page.goto(`${openLink}?PROLIFIC_PID=ada`);
  await ada.page.getByRole("heading", { name: "Before you begin" }).waitFor();
  const own = ada.page.url();
  expect(own).not.toContain("PROLIFIC_PID");
  expect(own).not.toContain(openLink);
  expect(await inaccessible(ada.page)).toEqual([]);
  expect(await tooWide(ada.page)).toEqual([]);
  const [copy] = await Promise.all([
    ada.page.waitForEvent("download"),
    ada.page.getByRole("button", { name: "Save a copy of this text" }).click(),
  ]);
  const kept = readFileSync(await copy.path(), "utf8");
  expect(kept).toContain("We record your games.");
  expect(kept).toContain("2031 at the latest.");
  // The panel's link leads the same browser to the same participation.
  await ada.page.goto(`${openLink}?PROLIFIC_PID=ada`);
  await until(() => ada.page.url() === own);
  const elsewhere = await person(browser);
  await elsewhere.page.goto(`${openLink}?PROLIFIC_PID=ada`);
  await elsewhere.page.getByText("Somebody with this id already takes part.").waitFor();

  const slow = await person(browser);
  await slow.page.goto(`${openLink}?PROLIFIC_PID=dee`);
  await slow.page.getByRole("heading", { name: "Before you begin" }).waitFor();

  // Bo does not agree, and nothing of him stays.
  const bo = await person(browser);
  await bo.page.goto(`${openLink}?PROLIFIC_PID=bo`);
  await bo.page.getByRole("button", { name: "I do not agree…" }).click();
  await bo.page.getByRole("button", { name: "I do not take part" }).click();
  await bo.page.getByText("your data were deleted").waitFor();
  expect(await bo.page.evaluate(() => Object.keys(localStorage).join())).not.toContain("study-join");
  const onward = ({ page }: typeof bo) => page.locator('[data-part~="go-on"]').getAttribute("href");
  expect(await onward(bo)).toBe("https://panel.example/left");

  await agree(ada.page);
  await ada.page.getByRole("button", { name: "Continue" }).click();
  await ada.page.getByRole("link", { name: "Go on to panel.example" }).waitFor();
  expect(await onward(ada)).toBe("https://panel.example/done?id=ada");
  expect(await inaccessible(ada.page)).toEqual([]);

  // Somebody who has read the text meanwhile finds no place.
  await agree(slow.page);
  await slow.page.getByText("All places in this study are taken.").waitFor();
  expect(await onward(slow)).toBe("https://panel.example/full");
  const late = await person(browser);
  await late.page.goto(`${openLink}?PROLIFIC_PID=cy`);
  await late.page.getByText("All places in this study are taken.").waitFor();
  expect(await onward(late)).toBe("https://panel.example/full");
  const rows = researcher.page.locator('[data-part~="participants"] tbody tr');
  await expect.poll(() => rows.allInnerTexts()).toHaveLength(3);
  expect((await rows.allInnerTexts()).join()).toMatch(/ada[\s\S]*completed/);
});

test("a study that needs a computer begins there, and on a phone says so", async () => {
  const device = { pointer: StudyPointer.FINE, minWidth: 1024 };
  const owned = await newStudy(server, { participants: 1, device });
  const added = await clientsOf(server).studies.addStudyParticipants({ ...owned, count: 1 });
  const address = `${server.url}/study/${added.links[0]?.link}`;
  const begun = async () => {
    const { participants } = await clientsOf(server).studies.getStudy(owned);
    return participants.map(({ state, sessions }) => [state, sessions]);
  };
  const phone = await person(browser, { viewport: PHONE, hasTouch: true, isMobile: true });
  await phone.page.goto(address);
  const needed = phone.page.getByRole("heading", { name: "This study needs another device" });
  await needed.waitFor();
  await phone.page.getByText("It runs on a computer with a mouse or touchpad.").waitFor();
  expect(await phone.page.locator('[data-part="invite-link"]').textContent()).toBe(address);
  expect(await inaccessible(phone.page)).toEqual([]);
  expect(await tooWide(phone.page)).toEqual([]);
  expect(await begun()).toEqual([[StudyParticipantState.INVITED, 0]]);

  // A window that is too narrow becomes wide enough.
  const computer = await person(browser, { viewport: { width: 1000, height: 800 } });
  await computer.page.goto(address);
  await computer.page.getByText("Here it is 1000 pixels wide.").waitFor();
  await computer.page.setViewportSize({ width: 1280, height: 800 });
  await computer.page.getByRole("heading", { name: "Before you begin" }).waitFor();
  expect(await begun()).toEqual([[StudyParticipantState.ACTIVE, 1]]);

  // The phone takes nothing over, but can withdraw.
  await phone.page.getByRole("button", { name: "Try again" }).click();
  await needed.waitFor();
  expect(await begun()).toEqual([[StudyParticipantState.ACTIVE, 1]]);
  await agree(computer.page);
  await withdraw(phone.page);
  await computer.page.getByText("You have withdrawn.").waitFor();
  expect([...phone.faults, ...computer.faults]).toEqual([]);
});

test("a date of which only a part is entered is no study without one", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/studies/new`);
  const form = page.locator('[data-part="study-form"]');
  await form.getByLabel("Name for researchers").fill("dated");
  await form.getByLabel("Title that participants see").fill("Cooking together");
  await form.getByLabel("Consent text", { exact: true }).fill("We record your games.");
  const date = form.getByLabel("All data are deleted on");
  await date.pressSequentially("3012");
  await form.getByRole("button", { name: "Create the study" }).click();
  const asked = form.getByText("Enter the day and the time, or leave the field empty.");
  await asked.waitFor();
  await date.fill("2031-12-30T12:00");
  await asked.waitFor({ state: "hidden" });
  await form.getByRole("button", { name: "Create the study" }).click();
  await page.getByText("The study is deleted with all its data on ").waitFor();
  expect(faults).toEqual([]);
});

/** A picture of one pixel. */
const DOT = Buffer.from("R0lGODlhAQABAIAAAAAAAP///yH5BAEAAAAALAAAAAABAAEAAAIBRAA7", "base64");

test("a study from the form has factors, hints, a robot's seat, pictures and questions", async () => {
  const { page, faults } = await person(browser);
  await page.goto(`${server.url}/studies/new`);
  const form = page.locator('[data-part="study-form"]');
  await form.getByLabel("Name for researchers").fill("made with the form");
  await form.getByLabel("Title that participants see").fill("Cooking together");
  await form.getByLabel("Factors of the design").fill("robot");
  await form.getByLabel("Level of “robot”").nth(0).fill("warm");
  await form.getByLabel("Level of “robot”").nth(1).fill("cold");
  await form.getByLabel("Participants may ask for hints").nth(0).check();
  await form.getByLabel("A robot has one of the other seats").nth(1).check();
  await form.getByLabel("Text for it").fill("nods");
  await form.getByLabel("Pictures in texts").setInputFiles({ name: "A Dot.gif", mimeType: "image/gif", buffer: DOT });
  await form.getByText("![what it shows](a-dot.gif)").waitFor();
  await form.getByLabel("Consent text", { exact: true }).fill("We record this:\n\n![a dot](a-dot.gif)");
  await form.getByRole("button", { name: "Add a question" }).click();
  await form.getByLabel("Question or statement").fill("How often do you play?");
  await form.getByLabel("When it is asked").selectOption("before the games");
  await form.getByLabel("How it is answered").selectOption("one of several options");
  await form.getByLabel("Options, one in each line").fill("never\noften");
  expect(await inaccessible(page)).toEqual([]);
  await form.getByRole("button", { name: "Create the study" }).click();
  await page.locator('[data-part="own-study"]').waitFor();

  const studyId = new URL(page.url()).pathname.split("/").at(-1) ?? "";
  const stored = await page.evaluate((id) => localStorage.getItem(`chefshat.own-study.${id}`), studyId);
  const { ownerToken } = JSON.parse(stored ?? "{}");
  const owned = { studyId, ownerToken };
  const { settings } = (await clientsOf(server).studies.getStudy(owned)).study ?? {};
  expect(settings?.factors.map(({ name, levels }) => [name, levels])).toEqual([["robot", ["warm", "cold"]]]);
  expect(settings?.conditions.map(({ policy }) => policy?.hints)).toEqual([true, false]);
  expect(settings?.conditions.map(({ robotBehaviour }) => robotBehaviour)).toEqual(["", "nods"]);
  expect(settings?.pictures.map(({ data }) => Buffer.from(data))).toEqual([DOT]);
  const saved = page.waitForEvent("download");
  await page.getByRole("button", { name: "Download the settings" }).click();
  const file = await (await saved).path();
  expect(JSON.parse(readFileSync(file, "utf8")).pictures).toEqual([
    { name: "a-dot.gif", data: DOT.toString("base64") },
  ]);

  const added = await clientsOf(server).studies.addStudyParticipants({ ...owned, count: 1 });
  const participant = await person(browser);
  await participant.page.goto(`${server.url}/study/${added.links[0]?.link}`);
  const picture = participant.page.getByRole("img", { name: "a dot" });
  await picture.waitFor();
  await until(() => picture.evaluate((shown: HTMLImageElement) => shown.naturalWidth === 1));
  expect(await inaccessible(participant.page)).toEqual([]);
  await agree(participant.page);
  await participant.page.getByRole("heading", { name: "About you" }).waitFor();
  await participant.page.getByRole("radio", { name: "often" }).waitFor();
  expect([...faults, ...participant.faults]).toEqual([]);
});
