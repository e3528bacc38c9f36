// Settings of a study from a file: TOML as docs/studies.md describes it, or JSON of the same form.
// The names are those of StudySettings; values of enums may be short ("players"), seeds are in
// hexadecimal digits, times of TOML may be dates, and texts and pictures may be in files that are chosen
// with it. The server checks the values.

import { fromJson, type JsonValue, toJson } from "@bufbuild/protobuf";
import { base64Encode } from "@bufbuild/protobuf/wire";
import { type StudySettings, StudySettingsSchema } from "../gen/chefshat/v1/study_pb";
import { fromHex } from "../hex";
import { t } from "../i18n";

const problems = () => t().studies.make.fileProblems;

/** The contents of files, by name. */
type Files = ReadonlyMap<string, Uint8Array>;

/** Whether this is a file with settings, and none that it names. */
export function hasSettings(name: string): boolean {
  return /\.(toml|json)$/i.test(name);
}

/**
 * Reads settings; throws an error that says what is wrong with the text. `files`: those that it may name,
 * as `file` of a picture or `text_file`.
 */
export async function settingsFrom(text: string, name: string, files: Files = new Map()): Promise<StudySettings> {
  const value: unknown = name.toLowerCase().endsWith(".toml")
    ? (await import("smol-toml")).parse(text)
    : JSON.parse(text);
  const settings = fromJson(StudySettingsSchema, inProtocolForm(withFiles(value as JsonValue, files)));
  if (settings.conditions.length === 0) throw new Error(problems().noConditions);
  return settings;
}

/** The settings of a study as a file that creates the same study again, in the JSON form of the protocol. */
export function fileOf(settings: StudySettings): string {
  return `${JSON.stringify(toJson(StudySettingsSchema, settings, { useProtoFieldName: true }), null, 2)}\n`;
}

/** What the names of an enum's values begin with, by the field. */
const ENUMS: Readonly<Record<string, string>> = {
  left_over: "STUDY_LEFT_OVER_",
  pointer: "STUDY_POINTER_",
  order: "STUDY_ORDER_",
  labels: "STUDY_LABELS_",
  hide: "STUDY_HIDE_",
  opening: "OPENING_",
  pass_scope: "PASS_SCOPE_",
  abort: "ABORT_POLICY_",
  reward_scheme: "REWARD_SCHEME_",
  reserved_for: "PARTICIPANT_KIND_",
  kind: "PARTICIPANT_KIND_",
  durability: "DURABILITY_",
};
const SEEDS = ["assignment_seed", "seeds"];

/** The value with the contents of the files that it names. */
function withFiles(value: JsonValue, files: Files): JsonValue {
  if (Array.isArray(value)) return value.map((item) => withFiles(item, files));
  if (typeof value !== "object" || value === null || value instanceof Date) return value;
  const contents = (named: JsonValue | undefined) => {
    // The browser gives the file, but not its folder.
    const name = String(named).split("/").at(-1) ?? "";
    const found = files.get(name);
    if (!found) throw new Error(problems().notChosen(name));
    return found;
  };
  const fields = Object.entries(value).map(([name, item]): [string, JsonValue] => {
    // By the names of factors, which are not fields.
    if (name === "levels") return [name, item];
    if (name === "file") return ["data", base64Encode(contents(item))];
    if (name === "text_file") return ["text", new TextDecoder().decode(contents(item)).trim()];
    return [name, withFiles(item ?? null, files)];
  });
  return Object.fromEntries(fields);
}

/** A date of TOML in milliseconds since the Unix epoch. */
function timeOf(time: Date, field: string): string {
  if (!field.endsWith("_at_ms")) throw new Error(problems().noTime(field));
  if (!/(Z|[+-]\d\d:\d\d)$/.test(time.toISOString())) throw new Error(problems().noZone(field));
  return String(time.getTime());
}

/** The value in the JSON form of the protocol; a table of TOML may have dates. */
function inProtocolForm(value: JsonValue | Date, field = ""): JsonValue {
  // The labels of a scale are texts, too, but a list of them.
  if (Array.isArray(value)) return value.map((item) => inProtocolForm(item, field === "labels" ? "" : field));
  if (value instanceof Date) return timeOf(value, field);
  // By the names of factors, which are not fields.
  if (field === "levels") return value;
  if (typeof value === "object" && value !== null)
    return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, inProtocolForm(item, name)]));
  if (typeof value !== "string") return value;
  const prefix = ENUMS[field];
  if (prefix !== undefined && !value.startsWith(prefix)) return prefix + value.toUpperCase().replaceAll("-", "_");
  if (SEEDS.includes(field) && /^[0-9a-f]{64}$/i.test(value)) return base64Encode(fromHex(value));
  return value;
}
