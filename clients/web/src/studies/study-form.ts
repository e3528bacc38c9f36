// The form for the common study: conditions that differ in the opponents, what is said about them,
// and hints; questions before and after one block of games. Everything else needs a file.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import {
  type StudyItemSchema,
  StudyLabels,
  StudyLeftOver,
  StudyOrder,
  StudyPointer,
  type StudySettingsSchema,
  type StudyStageSchema,
} from "../gen/chefshat/v1/study_pb";
import { fromHex } from "../hex";
import { type Language, t, textsIn } from "../i18n";
import { areAllowed, MAX_BYTES_IN_ALL, MAX_PICTURE_BYTES, MAX_PICTURES, type PictureFile } from "./picture-files";

/** A condition in the form. */
export interface ConditionForm {
  readonly id: string;
  /** The built-in agent in all other seats, and in place of a participant or robot that is missing. */
  readonly agent: string;
  readonly labels: "asTheyAre" | "kinds" | "players";
  /** Its levels, by factor. */
  readonly levels: Readonly<Record<string, string>>;
  /** Whether participants may ask for hints. */
  readonly hints: boolean;
  /** Whether a robot has one of the other seats. */
  readonly robot: boolean;
  /** The text for it. */
  readonly behaviour: string;
}

/** A question in the form. */
export interface QuestionForm {
  readonly text: string;
  readonly when: "before" | "after";
  readonly kind: "agree" | "choice" | "number" | "words";
  /** The options of a choice, one in each line. */
  readonly options: string;
  readonly optional: boolean;
}

/** The form, as typed. */
export interface StudyForm {
  readonly name: string;
  readonly title: string;
  readonly language: Language;
  readonly participants: string;
  /** Number of participants in a game. */
  readonly people: string;
  /** Whether agents play in place of those who do not come. */
  readonly fill: boolean;
  readonly within: boolean;
  /** Names of factors, separated by commas. */
  readonly factors: string;
  readonly conditions: readonly ConditionForm[];
  readonly games: string;
  readonly shifts: string;
  /** Seeds of the games in hexadecimal digits, one in each line. */
  readonly seeds: string;
  readonly practice: boolean;
  readonly consent: string;
  readonly version: string;
  readonly questions: readonly QuestionForm[];
  readonly godspeed: boolean;
  readonly nasaTlx: boolean;
  readonly ueqS: boolean;
  readonly external: string;
  readonly debriefing: string;
  readonly pictures: readonly PictureFile[];
  readonly traces: boolean;
  /** The device that participants need. */
  readonly device: "any" | "fine" | "coarse";
  /** Least width of the page, in CSS pixels, or empty. */
  readonly minWidth: string;
  /** When the study closes and when it is deleted, as date fields have them: local time, or empty. */
  readonly closesAt: string;
  readonly deletesAt: string;
  readonly openLink: boolean;
  readonly idParameter: string;
  readonly completedUrl: string;
  readonly leftUrl: string;
  readonly fullUrl: string;
}

/** The addresses of a panel, by their names in the form and in the protocol. */
export const PANEL_URLS = ["completedUrl", "leftUrl", "fullUrl"] as const;

/** The dates of a study. */
export const DATES = ["closesAt", "deletesAt"] as const;

/** The questionnaires that the server has: their names there, and the languages of their texts. */
export const TEMPLATES = {
  godspeed: { name: "godspeed", languages: ["en", "it"] },
  nasaTlx: { name: "nasa_tlx", languages: ["en", "it"] },
  ueqS: { name: "ueq_s", languages: ["en", "de"] },
} as const satisfies Record<string, { name: string; languages: readonly Language[] }>;

export type Template = keyof typeof TEMPLATES;

/** Whether a questionnaire has texts in this language. */
export function hasTexts(template: Template, language: Language): boolean {
  return TEMPLATES[template].languages.some((one) => one === language);
}

/** A condition at first. */
export function newCondition(id: string, agent: string): ConditionForm {
  return { id, agent, labels: "players", levels: {}, hints: false, robot: false, behaviour: "" };
}

/** A question at first. */
export const NEW_QUESTION: QuestionForm = { text: "", when: "after", kind: "agree", options: "", optional: false };

/** The factors that are named. */
export function factorsOf(form: StudyForm): readonly string[] {
  return partsOf(form.factors, ",");
}

/** Whether participants leave a seat to others. */
export function hasOtherSeats(form: StudyForm): boolean {
  return Number(form.people) < PLAYERS;
}

/** The form at first. */
export function emptyForm(language: Language): StudyForm {
  return {
    name: "",
    title: "",
    language,
    participants: "24",
    people: "1",
    fill: false,
    within: false,
    factors: "",
    conditions: [newCondition("A", "greedy"), newCondition("B", "random")],
    games: "3",
    shifts: "3",
    seeds: "",
    practice: true,
    consent: "",
    version: "1",
    questions: [],
    godspeed: false,
    nasaTlx: false,
    ueqS: false,
    external: "",
    debriefing: "",
    pictures: [],
    traces: false,
    device: "any",
    minWidth: "",
    closesAt: "",
    deletesAt: "",
    openLink: false,
    idParameter: "",
    completedUrl: "",
    leftUrl: "",
    fullUrl: "",
  };
}

const LABELS = {
  asTheyAre: StudyLabels.AS_THEY_ARE,
  kinds: StudyLabels.KINDS,
  players: StudyLabels.PLAYERS,
};
const MAX_PARTICIPANTS = 10_000;
const MAX_GAMES = 100;
const MAX_SHIFTS = 100;
const MAX_WIDTH = 3840;
const MAX_FACTORS = 8;
const MAX_SEEDS = 1000;
const MAX_OPTIONS = 50;
/** Points of agreement. */
const POINTS = 7;
/** The highest number that a question can have as its answer. */
const MAX_NUMBER = 1_000_000;
/** Most characters of an answer in words. */
const MAX_WORDS = 2000;
const ID = /^[A-Za-z0-9_.-]{1,64}$/;
const SEED = /^[0-9a-f]{64}$/i;
/** Players of a game; participants have some of the seats. */
const PLAYERS = 4;

/** What is wrong, by field; those of a condition and of a question have its index. */
export type StudyFaults = Readonly<Record<string, string>>;

/** What must be corrected before the study can be created. */
export function faultsOf(form: StudyForm): StudyFaults {
  const words = t().studies.make.problems;
  const faults: Record<string, string> = {};
  for (const field of ["name", "title", "consent", "version"] as const)
    if (form[field].trim() === "") faults[field] = words.missing;
  const bounds = {
    participants: MAX_PARTICIPANTS,
    people: PLAYERS,
    games: MAX_GAMES,
    shifts: MAX_SHIFTS,
    ...(form.minWidth !== "" && { minWidth: MAX_WIDTH }),
  };
  for (const [field, most] of Object.entries(bounds)) {
    const typed = form[field as keyof typeof bounds];
    if (!/^\d{1,6}$/.test(typed) || Number(typed) < 1 || Number(typed) > most) faults[field] = words.number(1, most);
  }
  if (!faults.participants && !faults.people && Number(form.participants) % Number(form.people) !== 0)
    faults.participants = words.wholeGroups(Number(form.people));
  const factors = factorsOf(form);
  if (factors.length > MAX_FACTORS || new Set(factors).size < factors.length) faults.factors = words.factors;
  else if (!factors.every((name) => ID.test(name))) faults.factors = words.id;
  form.conditions.forEach(({ id, levels }, index) => {
    if (!ID.test(id)) faults[`condition.${index}`] = words.id;
    else if (form.conditions.findIndex((other) => other.id === id) < index) faults[`condition.${index}`] = words.twice;
    for (const factor of factors) if (!ID.test(levels[factor] ?? "")) faults[`level.${index}.${factor}`] = words.id;
  });
  const seeds = linesOf(form.seeds);
  if (seeds.length > MAX_SEEDS || !seeds.every((seed) => SEED.test(seed))) faults.seeds = words.seeds(MAX_SEEDS);
  if (!areAllowed(form.pictures))
    faults.pictures = words.pictures(MAX_PICTURES, MAX_PICTURE_BYTES / 1024, MAX_BYTES_IN_ALL / 1024);
  form.questions.forEach(({ text, kind, options }, index) => {
    if (text.trim() === "") faults[`question.${index}`] = words.missing;
    const offered = linesOf(options);
    const areEnough = offered.length >= 2 && offered.length <= MAX_OPTIONS && new Set(offered).size === offered.length;
    if (kind === "choice" && !areEnough) faults[`options.${index}`] = words.options(MAX_OPTIONS);
  });
  const addresses = ["external", ...(form.openLink ? PANEL_URLS : [])] as const;
  for (const field of addresses)
    if (form[field] !== "" && !form[field].startsWith("https://")) faults[field] = words.address;
  for (const field of DATES)
    if (form[field] !== "" && !(Date.parse(form[field]) > Date.now())) faults[field] = words.passed;
  if (!faults.deletesAt && Date.parse(form.closesAt) > Date.parse(form.deletesAt))
    faults.deletesAt = words.deletedFirst;
  if (form.openLink && form.idParameter !== "" && !ID.test(form.idParameter)) faults.idParameter = words.id;
  return faults;
}

/** The settings of the study that the form describes, with texts in the participants' language. */
export async function settingsOf(form: StudyForm): Promise<MessageInitShape<typeof StudySettingsSchema>> {
  const words = (await textsIn(form.language)).studies.make;
  type Stage = MessageInitShape<typeof StudyStageSchema>;
  const questions = questionsOf(form, words);
  const questionnaire = (id: QuestionForm["when"], title: string): Stage[] => {
    const items = questions.filter(({ when }) => when === id).map(({ item }) => item);
    return items.length === 0 ? [] : [{ stage: { case: "questionnaire", value: { id, title, items } } }];
  };
  const inBlock: Stage[] = [
    { stage: { case: "games", value: { count: Number(form.games) } } },
    ...questionnaire("after", words.afterTitle),
  ];
  for (const template of Object.keys(TEMPLATES) as Template[])
    if (form[template] && hasTexts(template, form.language))
      inBlock.push({ stage: { case: "questionnaire", value: { template: TEMPLATES[template].name } } });
  const stages: Stage[] = [
    { stage: { case: "consent", value: { text: form.consent.trim(), version: form.version.trim() } } },
    ...questionnaire("before", words.beforeTitle),
  ];
  if (form.practice) stages.push({ stage: { case: "practice", value: {} } });
  const [people, factors] = [Number(form.people), factorsOf(form)];
  if (people > 1) stages.push({ stage: { case: "arrival", value: {} } });
  if (form.within) stages.push({ stage: { case: "perCondition", value: { stages: inBlock } } });
  else stages.push(...inBlock);
  if (form.external !== "")
    stages.push({
      stage: { case: "externalQuestionnaire", value: { text: words.externalText, url: form.external } },
    });
  if (form.debriefing.trim() !== "")
    stages.push({
      stage: { case: "text", value: { title: words.debriefingTitle, text: form.debriefing.trim() } },
    });
  return {
    name: form.name.trim(),
    title: form.title.trim(),
    language: form.language,
    participants: Number(form.participants),
    order: form.within ? StudyOrder.WITHIN : StudyOrder.BETWEEN,
    factors: factors.map((name) => ({ name, levels: levelsOf(form, name) })),
    seeds: linesOf(form.seeds).map(fromHex),
    conditions: form.conditions.map(({ id, agent, labels, levels, hints, robot, behaviour }) => ({
      id,
      levels: Object.fromEntries(factors.map((name) => [name, levels[name] ?? ""])),
      rules: { preset: "paper", stop: { case: "targetShifts" as const, value: Number(form.shifts) } },
      seats: Array.from({ length: PLAYERS - people }, (_, index) => ({
        filledBy:
          robot && index === 0
            ? { case: "reservedFor" as const, value: ParticipantKind.ROBOT }
            : { case: "builtInAgent" as const, value: agent },
      })),
      ...(robot && hasOtherSeats(form) && { robotBehaviour: behaviour }),
      labels: LABELS[labels],
      policy: { hints, substitute: agent },
    })),
    stages,
    pictures: [...form.pictures],
    traces: form.traces,
    closesAtMs: millisecondsOf(form.closesAt),
    deletesAtMs: millisecondsOf(form.deletesAt),
    ...(people > 1 && { groups: groupsOf(form) }),
    ...(form.openLink && { recruiting: recruitingOf(form) }),
    ...((form.device !== "any" || form.minWidth !== "") && { device: deviceOf(form) }),
  };
}

/** The questions with their items. `words`: those of the participants' language. */
function questionsOf(form: StudyForm, words: { disagree: string; agree: string }) {
  type Item = MessageInitShape<typeof StudyItemSchema>;
  const kindOf = ({ kind, options }: QuestionForm): NonNullable<Item["kind"]> => {
    switch (kind) {
      case "agree":
        return { case: "likert", value: { points: POINTS, labels: [words.disagree, words.agree] } };
      case "choice":
        return { case: "choice", value: { options: linesOf(options) } };
      case "number":
        return { case: "number", value: { min: 0, max: MAX_NUMBER } };
      case "words":
        return { case: "freeText", value: { maxCharacters: MAX_WORDS } };
    }
  };
  return form.questions.map((question, index) => {
    const { when, text, optional } = question;
    const item: Item = { id: `q${index + 1}`, text: text.trim(), optional, kind: kindOf(question) };
    return { when, item };
  });
}

/** The levels of a factor that conditions have, each once. */
function levelsOf(form: StudyForm, factor: string): string[] {
  return [...new Set(form.conditions.map(({ levels }) => levels[factor] ?? ""))];
}

/** The lines of a text that are not empty. */
function linesOf(text: string): string[] {
  return partsOf(text, "\n");
}

/** The parts of a text between separators that are not empty. */
function partsOf(text: string, separator: string): string[] {
  return text
    .split(separator)
    .map((part) => part.trim())
    .filter((part) => part !== "");
}

function groupsOf({ people, fill }: StudyForm) {
  return { size: Number(people), leftOver: fill ? StudyLeftOver.AGENTS : StudyLeftOver.DISMISS };
}

const POINTERS = { any: StudyPointer.UNSPECIFIED, fine: StudyPointer.FINE, coarse: StudyPointer.COARSE };

function deviceOf({ device, minWidth }: StudyForm) {
  return { pointer: POINTERS[device], minWidth: Number(minWidth) };
}

/** A date field in milliseconds since the Unix epoch; 0 if it is empty. */
function millisecondsOf(typed: string): bigint {
  return typed === "" ? 0n : BigInt(Date.parse(typed));
}

function recruitingOf({ idParameter, completedUrl, leftUrl, fullUrl }: StudyForm) {
  return { openLink: true, idParameter, completedUrl, leftUrl, fullUrl };
}
