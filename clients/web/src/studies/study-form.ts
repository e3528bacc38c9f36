// The form for the common study: conditions that differ in the opponents and what is said about
// them, one block of games, questionnaires after it. Everything else needs a file.

import type { MessageInitShape } from "@bufbuild/protobuf";
import {
  StudyLabels,
  StudyLeftOver,
  StudyOrder,
  StudyPointer,
  type StudySettingsSchema,
  type StudyStageSchema,
} from "../gen/chefshat/v1/study_pb";
import { type Language, t, textsIn } from "../i18n";

/** A condition in the form. */
export interface ConditionForm {
  readonly id: string;
  /** The built-in agent in all other seats, and in place of a participant who is missing. */
  readonly agent: string;
  readonly labels: "asTheyAre" | "kinds" | "players";
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
  readonly conditions: readonly ConditionForm[];
  readonly games: string;
  readonly shifts: string;
  readonly practice: boolean;
  readonly consent: string;
  readonly version: string;
  readonly godspeed: boolean;
  readonly nasaTlx: boolean;
  readonly external: string;
  readonly debriefing: string;
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

/** Whether the questionnaires Godspeed and NASA-TLX have texts in this language. */
export function hasTemplates(language: Language): boolean {
  return language === "en" || language === "it";
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
    conditions: [
      { id: "A", agent: "greedy", labels: "players" },
      { id: "B", agent: "random", labels: "players" },
    ],
    games: "3",
    shifts: "3",
    practice: true,
    consent: "",
    version: "1",
    godspeed: false,
    nasaTlx: false,
    external: "",
    debriefing: "",
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
const ID = /^[A-Za-z0-9_.-]{1,64}$/;
/** Players of a game; participants have some of the seats. */
const PLAYERS = 4;

/** What is wrong, by field; that of a condition has its index. */
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
  form.conditions.forEach(({ id }, index) => {
    if (!ID.test(id)) faults[`condition.${index}`] = words.id;
    else if (form.conditions.findIndex((other) => other.id === id) < index) faults[`condition.${index}`] = words.twice;
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
  const templates = hasTemplates(form.language);
  type Stage = MessageInitShape<typeof StudyStageSchema>;
  const inBlock: Stage[] = [{ stage: { case: "games", value: { count: Number(form.games) } } }];
  if (form.godspeed && templates) inBlock.push({ stage: { case: "questionnaire", value: { template: "godspeed" } } });
  if (form.nasaTlx && templates) inBlock.push({ stage: { case: "questionnaire", value: { template: "nasa_tlx" } } });
  const stages: Stage[] = [
    { stage: { case: "consent", value: { text: form.consent.trim(), version: form.version.trim() } } },
  ];
  if (form.practice) stages.push({ stage: { case: "practice", value: {} } });
  const people = Number(form.people);
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
    factors: [],
    conditions: form.conditions.map(({ id, agent, labels }) => ({
      id,
      rules: { preset: "paper", stop: { case: "targetShifts" as const, value: Number(form.shifts) } },
      seats: Array.from({ length: PLAYERS - people }, () => ({
        filledBy: { case: "builtInAgent" as const, value: agent },
      })),
      labels: LABELS[labels],
      ...(people > 1 && { policy: { substitute: agent } }),
    })),
    stages,
    traces: form.traces,
    closesAtMs: millisecondsOf(form.closesAt),
    deletesAtMs: millisecondsOf(form.deletesAt),
    ...(people > 1 && { groups: groupsOf(form) }),
    ...(form.openLink && { recruiting: recruitingOf(form) }),
    ...((form.device !== "any" || form.minWidth !== "") && { device: deviceOf(form) }),
  };
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
