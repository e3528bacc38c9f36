// A researcher's studies: creating one from a form or a file, the progress board, data as a ZIP.

import { readFileSync } from "node:fs";
import { resolve } from "node:path";
import { create } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { act } from "preact/test-utils";
import { beforeAll, expect, test, vi } from "vitest";
import { serverApi } from "../src/api/client";
import { AbortPolicy, ParticipantKind } from "../src/gen/chefshat/v1/room_pb";
import { PassScope } from "../src/gen/chefshat/v1/rules_pb";
import { GetServerInfoResponseSchema } from "../src/gen/chefshat/v1/server_service_pb";
import {
  StudyHide,
  StudyLabels,
  StudyLeftOver,
  StudyOrder,
  type StudyParticipant,
  StudyParticipantSchema,
  StudyParticipantState,
  StudyPointer,
  StudySchema,
} from "../src/gen/chefshat/v1/study_pb";
import {
  AddStudyParticipantsResponseSchema,
  CreateStudyResponseSchema,
  DeleteStudyParticipantResponseSchema,
  DeleteStudyResponseSchema,
  ExportStudyResponseSchema,
  FollowStudyResponseSchema,
  ListStudiesResponseSchema,
  ListStudyLinksResponseSchema,
  RemoveStudyParticipantResponseSchema,
} from "../src/gen/chefshat/v1/study_service_pb";
import { setLanguage, startLanguage, t } from "../src/i18n";
import { zipped } from "../src/parts/zip";
import { navigate, route } from "../src/router";
import { byCondition } from "../src/studies/board";
import { studyApi } from "../src/studies/client";
import { NewStudyPage } from "../src/studies/NewStudyPage";
import { OwnStudy, OwnStudyPage } from "../src/studies/OwnStudyPage";
import { createStudy, exportStudy, keepOwnerToken, ownerTokenOf, ownStudies } from "../src/studies/owning";
import { areAllowed, pictureOf, withPicture } from "../src/studies/picture-files";
import { StudiesPage } from "../src/studies/StudiesPage";
import { fileOf, settingsFrom } from "../src/studies/settings-file";
import { emptyForm, faultsOf, NEW_QUESTION, newCondition, type StudyForm, settingsOf } from "../src/studies/study-form";
import { button, eventually, fieldOf, mount, press, root, settle, type } from "./mounted";
import { refused } from "./refusals";

const ID = "5f0c6a4de2b14b7f8a3d9c1e7b60425d";
const TOKEN = "ab".repeat(48);

beforeAll(startLanguage);

const study = create(StudySchema, {
  studyId: ID,
  settings: { name: "Trust 1", participants: 8, conditions: [{ id: "A" }, { id: "B" }] },
  steps: 5,
  completed: 1,
});
const participant = (number: number, state: StudyParticipantState, conditions: string[]): StudyParticipant =>
  create(StudyParticipantSchema, { number, pseudonym: `P0${number}`, state, conditions, step: 2, sessions: 1 });
const participants = [
  participant(1, StudyParticipantState.COMPLETED, ["A"]),
  participant(2, StudyParticipantState.ACTIVE, ["B"]),
  participant(3, StudyParticipantState.INVITED, []),
];
async function openForm() {
  vi.spyOn(serverApi, "getServerInfo").mockResolvedValue(create(GetServerInfoResponseSchema));
  await mount(<NewStudyPage />);
  await settle();
}
const changed = vi.fn<(participant: StudyParticipant) => void>();

test("the form makes the settings of a study, and says what is missing", async () => {
  const form = emptyForm("en");
  expect(Object.keys(faultsOf(form))).toEqual(["name", "title", "consent"]);
  const filled = { ...form, name: "Trust", title: "Cooking", consent: "We record.", godspeed: true, debriefing: "Bye" };
  expect(faultsOf(filled)).toEqual({});
  const settings = await settingsOf(filled);
  expect(settings.order).toBe(StudyOrder.BETWEEN);
  expect(settings.conditions?.map(({ id, labels, seats }) => [id, labels, seats?.length])).toEqual([
    ["A", StudyLabels.PLAYERS, 3],
    ["B", StudyLabels.PLAYERS, 3],
  ]);
  expect(settings.stages?.map(({ stage }) => stage?.case)).toEqual([
    "consent",
    "practice",
    "games",
    "questionnaire",
    "text",
  ]);
  expect(settings.recruiting).toBe(undefined);
  expect([settings.factors, settings.seeds, settings.conditions?.[0]?.policy?.hints]).toEqual([[], [], false]);
  const panel = { openLink: true, idParameter: "PROLIFIC_PID", fullUrl: "https://panel.example/full" };
  const recruited = await settingsOf({ ...filled, ...panel });
  expect(recruited.recruiting).toEqual({ ...panel, completedUrl: "", leftUrl: "" });
  expect(Object.keys(faultsOf({ ...filled, ...panel, fullUrl: "http://x", idParameter: "a b" }))).toEqual([
    "fullUrl",
    "idParameter",
  ]);
  const tomorrow = new Date(Date.now() + 86_400_000).toISOString().slice(0, 16);
  const dated = await settingsOf({ ...filled, closesAt: tomorrow, deletesAt: tomorrow });
  expect([dated.closesAtMs, dated.deletesAtMs]).toEqual(Array(2).fill(BigInt(Date.parse(tomorrow))));
  expect(settings.device).toBe(undefined);
  const onComputers = await settingsOf({ ...filled, device: "fine", minWidth: "1024" });
  expect(onComputers.device).toEqual({ pointer: StudyPointer.FINE, minWidth: 1024 });
  const wide = await settingsOf({ ...filled, minWidth: "600" });
  expect(wide.device).toEqual({ pointer: StudyPointer.UNSPECIFIED, minWidth: 600 });
  const pairs = await settingsOf({ ...filled, people: "2", fill: true, within: true });
  expect(pairs.groups).toEqual({ size: 2, leftOver: StudyLeftOver.AGENTS });
  expect(pairs.conditions?.map(({ seats, policy }) => [seats?.length, policy?.substitute])).toEqual([
    [2, "greedy"],
    [2, "random"],
  ]);
  expect(pairs.stages?.map(({ stage }) => stage?.case)).toEqual([
    "consent",
    "practice",
    "arrival",
    "perCondition",
    "text",
  ]);
  const within = await settingsOf({ ...filled, within: true });
  expect(within.stages?.map(({ stage }) => stage?.case)).toEqual(["consent", "practice", "perCondition", "text"]);
});

test("the form has factors, hints, robots, seeds and questions", async () => {
  const condition = (id: string, robot: string) => ({
    ...newCondition(id, "greedy"),
    levels: { robot, forgotten: "x" },
    hints: id === "A",
    robot: true,
    behaviour: `${robot} nods`,
  });
  const question = { ...NEW_QUESTION, text: " How was it? " };
  const form: StudyForm = {
    ...emptyForm("de"),
    name: "Trust",
    title: "Cooking",
    consent: "We record.",
    factors: "robot",
    conditions: [condition("A", "warm"), condition("B", "cold"), condition("C", "warm")],
    seeds: `${"0a".repeat(32)}\n\n${"0B".repeat(32)}\n`,
    questions: [
      question,
      { ...question, when: "before", kind: "choice", options: "never\n often", optional: true },
      { ...question, kind: "number" },
      { ...question, when: "before", kind: "words" },
    ],
    within: true,
  };
  expect(faultsOf(form)).toEqual({});
  const settings = await settingsOf(form);
  expect(settings.factors).toEqual([{ name: "robot", levels: ["warm", "cold"] }]);
  expect(settings.seeds).toEqual([new Uint8Array(32).fill(10), new Uint8Array(32).fill(11)]);
  const robot = { filledBy: { case: "reservedFor", value: ParticipantKind.ROBOT } };
  const agent = { filledBy: { case: "builtInAgent", value: "greedy" } };
  expect(settings.conditions?.[1]).toMatchObject({
    levels: { robot: "cold" },
    policy: { hints: false, substitute: "greedy" },
    robotBehaviour: "cold nods",
    seats: [robot, agent, agent],
  });
  expect(settings.conditions?.map(({ policy }) => policy?.hints)).toEqual([true, false, false]);
  const [, before, , block] = settings.stages?.map(({ stage }) => stage) ?? [];
  expect(before).toEqual({
    case: "questionnaire",
    value: {
      id: "before",
      title: "Über Sie",
      items: [
        {
          id: "q2",
          text: "How was it?",
          optional: true,
          kind: { case: "choice", value: { options: ["never", "often"] } },
        },
        { id: "q4", text: "How was it?", optional: false, kind: { case: "freeText", value: { maxCharacters: 2000 } } },
      ],
    },
  });
  const after = block?.case === "perCondition" ? block.value.stages?.[1]?.stage : undefined;
  const kinds = after?.case === "questionnaire" ? after.value.items?.map(({ kind }) => kind) : [];
  expect(kinds).toEqual([
    { case: "likert", value: { points: 7, labels: ["Stimme gar nicht zu", "Stimme völlig zu"] } },
    { case: "number", value: { min: 0, max: 1_000_000 } },
  ]);
  // A robot needs a seat that no person has.
  const four = await settingsOf({ ...form, people: "4" });
  expect(four.conditions?.[0]).toMatchObject({ seats: [] });
  expect(four.conditions?.[0]).not.toHaveProperty("robotBehaviour");
});

test.each([
  ["it", "Informazioni su questo studio", "nasa_tlx"],
  ["de", "Über diese Studie", "ueq_s"],
] as const)(
  "a study in %s has its texts in it, and templates that have texts in it",
  async (language, title, template) => {
    const form = { ...emptyForm(language), debriefing: "…", nasaTlx: true, ueqS: true };
    const stages = (await settingsOf(form)).stages?.map(({ stage }) => stage);
    expect(stages?.find((stage) => stage?.case === "text")?.value?.title).toBe(title);
    const questionnaires = stages?.flatMap((stage) => (stage?.case === "questionnaire" ? [stage.value.template] : []));
    expect(questionnaires).toEqual([template]);
  },
);

test.each([
  [{ participants: "0" }, "participants"],
  [{ minWidth: "3841" }, "minWidth"],
  [{ minWidth: "wide" }, "minWidth"],
  [{ games: "many" }, "games"],
  [{ people: "5" }, "people"],
  [{ participants: "25", people: "2" }, "participants"],
  [{ external: "http://forms.example" }, "external"],
  [{ closesAt: "2020-05-01T18:00" }, "closesAt"],
  [{ closesAt: "2931-05-01T18:00", deletesAt: "2930-05-01T18:00" }, "deletesAt"],
  [
    {
      conditions: [newCondition("A", "greedy"), newCondition("A", "random")],
    },
    "condition.1",
  ],
  [{ conditions: [newCondition("two words", "greedy")] }, "condition.0"],
  [
    { factors: "strength, strength", conditions: [{ ...newCondition("A", "greedy"), levels: { strength: "weak" } }] },
    "factors",
  ],
  [{ factors: "strength", conditions: [newCondition("A", "greedy")] }, "level.0.strength"],
  [{ seeds: "0a0b" }, "seeds"],
  [{ questions: [NEW_QUESTION] }, "question.0"],
  [{ questions: [{ ...NEW_QUESTION, text: "Which?", kind: "choice" as const, options: "one\none" }] }, "options.0"],
])("%j is refused", (changed, field) => {
  const form = { ...emptyForm("en"), name: "Trust", title: "Cooking", consent: "We record.", ...changed };
  expect(Object.keys(faultsOf(form))).toEqual([field]);
});

const HEX = "0a".repeat(32);

test.each([
  [
    "study.json",
    `{"name": "Trust", "seeds": ["${HEX}"], "conditions": [{"id": "A", "labels": "STUDY_LABELS_KINDS", "hide": ["log"]}]}`,
  ],
  ["study.toml", `name = "Trust"\nseeds = ["${HEX}"]\n[[conditions]]\nid = "A"\nlabels = "kinds"\nhide = ["log"]\n`],
])("settings are read from %s", async (name, text) => {
  const settings = await settingsFrom(text, name);
  const [condition] = settings.conditions;
  expect([settings.name, condition?.id, condition?.labels, condition?.hide]).toEqual([
    "Trust",
    "A",
    StudyLabels.KINDS,
    [StudyHide.LOG],
  ]);
  expect(settings.seeds).toEqual([new Uint8Array(32).fill(10)]);
});

test("removing the last question moves the focus to the button that adds one", async () => {
  await openForm();
  const removing = () =>
    [...root.querySelectorAll("button")].filter((one) => one.textContent?.startsWith("Remove this question"));
  for (const _ of [1, 2]) await press("Add a question");
  expect(removing()).toHaveLength(2);
  for (const left of [1, 0]) {
    removing().at(-1)?.focus();
    await press(`Remove this question Question ${left + 1}`);
    expect(removing()).toHaveLength(left);
    await eventually(() => expect(document.activeElement?.textContent).toBe("Add a question"));
  }
});

test("a number with letters is not taken for an empty field", async () => {
  await openForm();
  const width = fieldOf(t().studies.make.minWidth);
  await type(width, "1024px");
  await press(t().studies.make.submit);
  expect(width?.getAttribute("aria-invalid")).toBe("true");
});

test("values of enums are written in short, as for the command", async () => {
  const text = `
    groups = { size = 2, left_over = "agents" }
    device = { pointer = "fine", min_width = 1024 }
    [[conditions]]
    id = "A"
    levels = { pointer = "shown" }
    policy = { abort = "never", reward_scheme = "paper", clocks = [{ kind = "human", decision_time_ms = 60_000 }] }
    rules = { opening = "golden", pass_scope = "turn" }
    seats = [{ reserved_for = "robot" }]`;
  const { groups, device, conditions } = await settingsFrom(text, "study.toml");
  expect([device?.pointer, device?.minWidth]).toEqual([StudyPointer.FINE, 1024]);
  // A name of a factor is not a field.
  expect(conditions[0]?.levels).toEqual({ pointer: "shown" });
  expect(groups?.leftOver).toBe(StudyLeftOver.AGENTS);
  expect(conditions[0]?.rules?.passScope).toBe(PassScope.TURN);
  expect(conditions[0]?.policy?.abort).toBe(AbortPolicy.NEVER);
  expect(conditions[0]?.policy?.clocks[0]?.kind).toBe(ParticipantKind.HUMAN);
});

test("those of a study with groups may be added together, in whole groups", async () => {
  keepOwnerToken(ID, TOKEN);
  const add = vi.spyOn(studyApi, "addStudyParticipants").mockResolvedValue(create(AddStudyParticipantsResponseSchema));
  const settings = { participants: 8, conditions: [{ id: "A" }, { id: "B" }], groups: { size: 2 } };
  const inPairs = create(StudySchema, { studyId: ID, settings, steps: 5 });
  const paired = [
    participant(1, StudyParticipantState.LEFT_OVER, []),
    create(StudyParticipantSchema, { number: 2, pseudonym: "P02", state: StudyParticipantState.ACTIVE, group: 7 }),
  ];
  await mount(<OwnStudy study={inPairs} participants={paired} onChanged={changed} />);
  expect(root.querySelector('[data-part="conditions"]')?.textContent).toContain("left over");
  expect(root.querySelector('[data-part="participants"]')?.textContent).toContain("group 7");
  const form = root.querySelector('[data-part="add-participants"]');
  const count = form?.querySelector<HTMLInputElement>('input[inputmode="numeric"]');
  const together = form?.querySelector<HTMLInputElement>('input[type="checkbox"]');
  await act(() => together?.click());
  await type(count, "3");
  await press("Add");
  expect(form?.textContent).toContain("Add a multiple of 2.");
  expect(add).not.toHaveBeenCalled();
  await type(count, "4");
  add.mockRejectedValueOnce(refused("STUDY_CLOSED"));
  await press("Add");
  expect(form?.textContent).not.toContain("Perhaps they have been added");
  add.mockRejectedValueOnce(new ConnectError("lost", Code.Unavailable));
  await press("Add");
  expect(form?.textContent).toContain("Perhaps they have been added");
  await press("Add");
  expect(form?.textContent).not.toContain("Perhaps they have been added");
  expect(add.mock.calls[0]?.[0]).toMatchObject({ count: 4, together: true });
});

test("the settings of a study make a file that gives the same ones", async () => {
  const path = resolve(import.meta.dirname, "../../../docs/studies/pairs.toml");
  const settings = await settingsFrom(readFileSync(path, "utf8"), path);
  settings.seeds = [new Uint8Array(32).fill(7)];
  expect(await settingsFrom(fileOf(settings), "pairs-pilot.json")).toEqual(settings);
});

test("the device that a study needs is said", async () => {
  const settings = { participants: 8, device: { pointer: StudyPointer.FINE, minWidth: 1024 } };
  const needing = create(StudySchema, { studyId: ID, settings });
  await mount(<OwnStudy study={needing} participants={[]} onChanged={changed} />);
  expect(root.textContent).toContain(
    "Device that participants need: computer. Least width of the page, in pixels: 1024",
  );
});

test("texts and pictures are read from the files that are chosen with the settings", async () => {
  const text = `
    [[conditions]]
    id = "A"
    levels = { file = "weak" }
    [[pictures]]
    name = "hand"
    file = "pictures/hand.gif"
    [[stages]]
    consent = { version = "1", text_file = "consent.md" }`;
  const bytes = (words: string) => new TextEncoder().encode(words);
  const files = new Map([
    ["hand.gif", bytes("GIF89a")],
    ["consent.md", bytes("We record.\n")],
  ]);
  const settings = await settingsFrom(text, "study.toml", files);
  expect(settings.pictures.map(({ name, data }) => [name, data])).toEqual([["hand", bytes("GIF89a")]]);
  expect(settings.stages[0]?.stage.value).toMatchObject({ text: "We record.", version: "1" });
  // A name of a factor is not a field.
  expect(settings.conditions[0]?.levels).toEqual({ file: "weak" });
  expect(await settingsFrom(fileOf(settings), "again.json")).toEqual(settings);
  await expect(settingsFrom(text, "study.toml", new Map())).rejects.toThrow("choose hand.gif together");
});

test("pictures of the same name get different ones, and the same picture is there once", async () => {
  const picture = (bytes: string) => pictureOf(new File([bytes], "手.png"));
  const [first, second] = await Promise.all([picture("GIF89a"), picture("GIF87a")]);
  const both = withPicture(withPicture([], first), second);
  expect(both.map(({ name }) => name)).toEqual(["-.png", "2--.png"]);
  expect(withPicture(both, second)).toEqual([...both]);
  expect((await pictureOf(new File(["GIF89a"], `${"x".repeat(10)}${".".repeat(63)}a`))).name).toBe("a");
});

test("pictures have names that texts can have", async () => {
  const file = new File(["GIF89a"], ".Two Hands.GIF");
  const picture = await pictureOf(file);
  expect(picture.name).toBe("two-hands.gif");
  expect(areAllowed([picture])).toBe(true);
  expect(areAllowed([{ ...picture, data: new TextEncoder().encode("<svg/>") }])).toBe(false);
  expect(areAllowed([{ ...picture, data: new Uint8Array(262_145) }])).toBe(false);
  expect(areAllowed(Array(17).fill(picture))).toBe(false);
  const form = { ...emptyForm("en"), name: "Trust", title: "Cooking", consent: "We record.", pictures: [picture] };
  expect(faultsOf(form)).toEqual({});
  expect((await settingsOf(form)).pictures).toEqual([picture]);
  const faults = faultsOf({ ...form, pictures: Array(17).fill(picture) });
  expect(faults.pictures).toContain("16 PNG, JPEG, GIF or WebP files, of 256 KiB each and 512 KiB together");
});

test("a time of TOML may be a date with its zone", async () => {
  const closing = (time: string) => settingsFrom(`closes_at_ms = ${time}\n[[conditions]]\nid = "A"\n`, "study.toml");
  expect((await closing("2031-05-01T18:00:00.5+02:00")).closesAtMs).toBe(1_935_417_600_500n);
  expect((await closing("2031-05-01T18:00+02:00")).closesAtMs).toBe(1_935_417_600_000n);
  expect((await closing("1_935_417_600_500")).closesAtMs).toBe(1_935_417_600_500n);
  await expect(closing("2031-05-01T18:00:00")).rejects.toThrow("with its zone");
  await expect(closing("2031-05-01")).rejects.toThrow("with its zone");
});

test("the example of the documentation is read", async () => {
  const path = resolve(import.meta.dirname, "../../../docs/studies/example.toml");
  const settings = await settingsFrom(readFileSync(path, "utf8"), path);
  expect(settings.order).toBe(StudyOrder.BETWEEN);
  expect(settings.conditions.map(({ labels }) => labels)).not.toContain(StudyLabels.UNSPECIFIED);
  const scales = settings.stages.flatMap(({ stage }) => (stage.case === "questionnaire" ? stage.value.items : []));
  expect(scales.flatMap(({ kind }) => (kind.case === "likert" ? kind.value.labels : []))[0]).not.toMatch(/^STUDY_/);
});

test.each([
  ["study.json", "{"],
  ["study.json", '{"nome": "x"}'],
  ["study.json", '{"name": "x"}'],
  ["study.toml", "name ="],
])("a file that cannot be used says why: %s %s", async (name, text) => {
  await expect(settingsFrom(text, name)).rejects.toThrow(/./);
});

test("what is wrong with a file is said in the language of the page", async () => {
  await setLanguage("de");
  const problem = (text: string) => settingsFrom(text, "study.toml").catch((thrown: Error) => thrown.message);
  expect(await problem('name = "x"')).toBe("sie hat keine Bedingungen.");
  expect(await problem('[[pictures]]\nfile = "a.png"')).toBe("wähle a.png zusammen mit dieser Datei aus.");
  expect(await problem("closes_at_ms = 2031-05-01")).toContain("mit ihrer Zone");
  expect(await problem("name = 2031-05-01T18:00:00Z")).toBe("name ist keine Zeit.");
  await setLanguage("en");
});

test("creating a study stores its owner token", async () => {
  vi.spyOn(studyApi, "createStudy").mockResolvedValue(create(CreateStudyResponseSchema, { study, ownerToken: TOKEN }));
  expect(await createStudy({ name: "Trust" })).toBe(ID);
  expect(ownerTokenOf(ID)).toBe(TOKEN);
});

test("the board counts participants by condition and state", () => {
  expect(byCondition(study, participants)).toEqual([
    { condition: "A", counts: [0, 0, 1, 0, 0, 0, 0] },
    { condition: "B", counts: [0, 1, 0, 0, 0, 0, 0] },
    { condition: undefined, counts: [1, 1, 1, 0, 0, 0, 0] },
  ]);
});

test("the page shows progress, adds participants, shows links, and asks before it removes or deletes", async () => {
  keepOwnerToken(ID, TOKEN);
  const add = vi.spyOn(studyApi, "addStudyParticipants").mockResolvedValue(create(AddStudyParticipantsResponseSchema));
  const link = "Xk3_abcdefghijklmnopqrstuvwxy1";
  vi.spyOn(studyApi, "listStudyLinks").mockResolvedValue(
    create(ListStudyLinksResponseSchema, { links: [{ number: 3, pseudonym: "P03", link }] }),
  );
  const remove = vi
    .spyOn(studyApi, "removeStudyParticipant")
    .mockResolvedValue(create(RemoveStudyParticipantResponseSchema));
  const erase = vi
    .spyOn(studyApi, "deleteStudyParticipant")
    .mockResolvedValue(create(DeleteStudyParticipantResponseSchema));
  await mount(<OwnStudy study={study} participants={participants} onChanged={changed} />);
  expect(root.textContent).toContain("1 of 8 completed");
  const rows = [...root.querySelectorAll('[data-part="participants"] tbody tr')];
  expect(rows.map((row) => row.querySelectorAll("td")[2]?.textContent)).toEqual([
    "completed",
    "taking part",
    "not begun",
  ]);

  await press("Add");
  expect(add).not.toHaveBeenCalled();
  expect(root.querySelector('[data-part="add-participants"] [role="alert"]')).not.toBeNull();
  await type(root.querySelector('[data-part="add-participants"] textarea'), "P10-P12");
  await press("Add");
  expect(add.mock.calls[0]?.[0]).toMatchObject({ ownerToken: TOKEN, count: 0, pseudonyms: ["P10", "P11", "P12"] });

  await press("Show the links");
  await eventually(() => {
    expect(root.querySelector('[data-part="links"]')?.textContent).toContain(`/study/${link}`);
  });
  // They stay when somebody joins.
  const joined = create(StudyParticipantSchema, { number: 4, pseudonym: "P04" });
  await mount(<OwnStudy study={study} participants={[...participants, joined]} onChanged={changed} />);
  expect(root.querySelector('[data-part="links"]')?.textContent).toContain(`/study/${link}`);

  // The first row has ended: it can only be deleted.
  await press("Delete data…");
  expect(root.querySelector('[data-part="question"]')?.textContent).toContain("P01");
  await press("Delete now");
  expect(erase.mock.calls[0]?.[0]).toMatchObject({ ownerToken: TOKEN, number: 1 });
  await press("Remove…");
  await press("Remove now");
  expect(remove.mock.calls[0]?.[0]).toEqual({ studyId: ID, ownerToken: TOKEN, number: 2 });
});

const OTHER = "0123456789abcdef0123456789abcdef";
const OTHER_TOKEN = "cd".repeat(48);

test("a study is deleted after a confirmation, and this device forgets its key", async () => {
  keepOwnerToken(ID, TOKEN);
  keepOwnerToken(OTHER, OTHER_TOKEN);
  navigate({ page: "ownStudy", studyId: ID });
  const erase = vi.spyOn(studyApi, "deleteStudy").mockResolvedValue(create(DeleteStudyResponseSchema));
  await mount(<OwnStudy study={study} participants={participants} onChanged={changed} />);
  await press("Delete the study…");
  expect(root.querySelector('[data-part="question"]')?.textContent).toMatch(/cannot be restored/);
  await press("Cancel");
  expect(erase).not.toHaveBeenCalled();
  await press("Delete the study…");
  await press("Delete everything now");
  expect(erase.mock.calls.map(([request]) => request)).toEqual([{ studyId: ID, ownerToken: TOKEN, force: false }]);
  expect([ownerTokenOf(ID), ownerTokenOf(OTHER)]).toEqual([null, OTHER_TOKEN]);
  expect(route.value).toEqual({ page: "studies" });

  const list = vi.spyOn(studyApi, "listStudies").mockResolvedValue(create(ListStudiesResponseSchema));
  await mount(<StudiesPage />);
  expect(list.mock.calls[0]?.[0]).toEqual({ ownerTokens: [OTHER_TOKEN] });
});

test("all studies of this device are listed, however many, newest first", async () => {
  const ids = Array.from({ length: 150 }, (_, index) => index.toString(16).padStart(32, "0"));
  for (const id of ids) keepOwnerToken(id, `${id}${"ab".repeat(32)}`);
  vi.spyOn(studyApi, "listStudies").mockImplementation(async ({ ownerTokens = [] }) => {
    expect(ownerTokens.length).toBeLessThanOrEqual(100);
    const studies = ownerTokens.map((token) => ({
      studyId: token.slice(0, 32),
      createdAtMs: BigInt(Number.parseInt(token.slice(0, 32), 16)),
    }));
    return create(ListStudiesResponseSchema, { studies });
  });
  const listed = await ownStudies(new AbortController().signal);
  expect(listed.map(({ studyId }) => studyId)).toEqual(ids.toReversed());
});

test("participants in the middle of a study are removed only after the server has refused", async () => {
  keepOwnerToken(ID, TOKEN);
  navigate({ page: "ownStudy", studyId: ID });
  const erase = vi.spyOn(studyApi, "deleteStudy").mockImplementation(async ({ force }) => {
    if (!force) throw refused("STUDY_RUNNING");
    return create(DeleteStudyResponseSchema);
  });
  await mount(<OwnStudy study={study} participants={participants} onChanged={changed} />);
  expect(button("Remove the participants and delete…")).toBeUndefined();
  await press("Delete the study…");
  await press("Delete everything now");
  expect(root.querySelector('[role="alert"]')?.textContent).toContain("in the middle of this study");
  expect([ownerTokenOf(ID), route.value.page]).toEqual([TOKEN, "ownStudy"]);
  await press("Remove the participants and delete…");
  expect([...root.querySelectorAll('[data-part="question"]')].at(-1)?.textContent).toMatch(
    /removed.*cannot be restored/,
  );
  await press("Remove them and delete everything now");
  expect(erase.mock.calls.map(([{ force }]) => force)).toEqual([false, true]);
  expect([ownerTokenOf(ID), route.value.page]).toEqual([null, "studies"]);
});

test("a study that cannot be deleted stays, and says why", async () => {
  keepOwnerToken(ID, TOKEN);
  vi.spyOn(studyApi, "deleteStudy").mockRejectedValue(refused("STORE_FAILED", Code.Unavailable));
  await mount(<OwnStudy study={study} participants={participants} onChanged={changed} />);
  await press("Delete the study…");
  await press("Delete everything now");
  expect(root.querySelector('[role="alert"]')).not.toBeNull();
  expect(button("Remove the participants and delete…")).toBeUndefined();
  expect(ownerTokenOf(ID)).toBe(TOKEN);
});

test("a form with wrong fields says so beside its button, and goes to the first of them each time", async () => {
  await openForm();
  const form = root.querySelector('[data-part="study-form"]');
  expect(form?.querySelector('[role="alert"]')).toBeNull();
  for (const _ of [1, 2]) {
    await act(() => root.querySelector<HTMLElement>('[data-part="study-form"] button[type="submit"]')?.focus());
    await press("Create the study");
    expect(form?.textContent).toContain("Some fields need correcting");
    expect(document.activeElement).toBe(form?.querySelector('[aria-invalid="true"]'));
  }
});

test("a closed study is shown whole, and a deletion in it as soon as it is done", async () => {
  const key = ID + "ab".repeat(32);
  keepOwnerToken(ID, key);
  const closed = create(StudySchema, { ...study, closed: true, active: 0 });
  const follow = vi.spyOn(studyApi, "followStudy").mockImplementation(async function* () {
    yield create(FollowStudyResponseSchema, { study: closed, participants: participants.slice(0, 2) });
    yield create(FollowStudyResponseSchema, { participants: participants.slice(2) });
  });
  const left = create(StudyParticipantSchema, { number: 1, dataDeleted: true });
  vi.spyOn(studyApi, "deleteStudyParticipant").mockResolvedValue(
    create(DeleteStudyParticipantResponseSchema, { participant: left }),
  );
  await mount(<OwnStudyPage route={{ page: "ownStudy", studyId: ID }} />);
  await settle();
  const rows = () => [...root.querySelectorAll('[data-part="participants"] tbody tr')];
  await eventually(() => expect(rows().length).toBe(3));
  await press("Delete data");
  await press("Delete now");
  await eventually(() => expect(rows()[0]?.textContent).toContain("deleted"));
  expect(follow).toHaveBeenCalledTimes(1);
});

test("a key of another study is not taken, and one that the server does not know can be replaced", async () => {
  const right = ID + "01".repeat(32);
  keepOwnerToken(ID, TOKEN);
  vi.spyOn(studyApi, "followStudy").mockImplementation(async function* ({ ownerToken }) {
    if (ownerToken !== right) throw refused("STUDY_UNKNOWN", Code.NotFound);
    yield create(FollowStudyResponseSchema, { study: { ...study, closed: true }, participants });
  });
  await mount(<OwnStudyPage route={{ page: "ownStudy", studyId: ID }} />);
  await eventually(() => expect(button("Use this key")).toBeDefined());
  await type(root.querySelector("input"), OTHER_TOKEN);
  await press("Use this key");
  expect(ownerTokenOf(ID)).toBe(TOKEN);
  await type(root.querySelector("input"), ` ${right} `);
  await press("Use this key");
  expect(ownerTokenOf(ID)).toBe(right);
  await eventually(() => expect(root.textContent).toContain("Trust 1"));
});

test("an export that the server ended early is none", async () => {
  keepOwnerToken(ID, TOKEN);
  vi.spyOn(studyApi, "exportStudy").mockImplementation(async function* () {
    yield create(ExportStudyResponseSchema, { file: "participants.csv", data: new Uint8Array(3) });
  });
  await expect(exportStudy(ID, false, () => {})).rejects.toThrow("before it was complete");
});

test("the data are one ZIP with the files of the server", async () => {
  keepOwnerToken(ID, TOKEN);
  vi.spyOn(studyApi, "exportStudy").mockImplementation(async function* () {
    const part = (file: string, text: string) =>
      create(ExportStudyResponseSchema, { file, data: new TextEncoder().encode(text) });
    yield part("participants.csv", "1234");
    yield part("participants.csv", "56789");
    yield part("records/ä.jsonl", "{}");
    yield part("datapackage.json", "{}");
  });
  const counted: number[] = [];
  const files = await exportStudy(ID, false, (count) => counted.push(count));
  expect(counted).toEqual([1, 2, 3]);
  const bytes = new Uint8Array(await zipped(files).arrayBuffer());
  const view = new DataView(bytes.buffer);
  expect(view.getUint32(0, true)).toBe(0x04034b50);
  // The check value of CRC-32.
  expect(view.getUint32(14, true)).toBe(0xcbf43926);
  expect([view.getUint32(18, true), view.getUint16(26, true)]).toEqual([9, "participants.csv".length]);
  const end = bytes.length - 22;
  expect(view.getUint32(end, true)).toBe(0x06054b50);
  expect(view.getUint16(end + 10, true)).toBe(3);
  const central = view.getUint32(end + 16, true);
  expect(view.getUint32(central, true)).toBe(0x02014b50);
  // The second entry points to its local header.
  const second = central + 46 + "participants.csv".length;
  const local = view.getUint32(second + 42, true);
  expect(view.getUint32(local, true)).toBe(0x04034b50);
  const name = new TextDecoder().decode(bytes.slice(local + 30, local + 30 + view.getUint16(local + 26, true)));
  expect(name).toBe("records/ä.jsonl");
});

test("a ZIP has more files than its end can count", async () => {
  const count = 65_536;
  const files = new Map(Array.from({ length: count }, (_, file) => [`${file}`, []]));
  const bytes = new Uint8Array(await zipped(files).arrayBuffer());
  const view = new DataView(bytes.buffer);
  const end = bytes.length - 22;
  expect(view.getUint16(end + 10, true)).toBe(0xffff);
  const locator = end - 20;
  expect(view.getUint32(locator, true)).toBe(0x07064b50);
  const large = Number(view.getBigUint64(locator + 8, true));
  expect(view.getUint32(large, true)).toBe(0x06064b50);
  expect(view.getBigUint64(large + 32, true)).toBe(BigInt(count));
  expect(view.getUint32(Number(view.getBigUint64(large + 48, true)), true)).toBe(0x02014b50);
});
