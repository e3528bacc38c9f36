// Settings of a study from a file: TOML as docs/studies.md describes it, or JSON of the same form.
// The names are those of StudySettings; values of enums may be short ("players"), and seeds are in
// hexadecimal digits. The server checks the values.

import { fromJson, type JsonValue } from "@bufbuild/protobuf";
import { base64Encode } from "@bufbuild/protobuf/wire";
import { type StudySettings, StudySettingsSchema } from "../gen/chefshat/v1/study_pb";
import { fromHex } from "../hex";

/** Reads settings; throws an error that says what is wrong with the text. */
export async function settingsFrom(text: string, name: string): Promise<StudySettings> {
  const value: unknown = name.toLowerCase().endsWith(".toml")
    ? (await import("smol-toml")).parse(text)
    : JSON.parse(text);
  const settings = fromJson(StudySettingsSchema, inProtocolForm(value as JsonValue));
  if (settings.conditions.length === 0) throw new Error("it has no conditions");
  return settings;
}

/** What the names of an enum's values begin with, by the field. */
const ENUMS: Readonly<Record<string, string>> = {
  order: "STUDY_ORDER_",
  labels: "STUDY_LABELS_",
  hide: "STUDY_HIDE_",
  reserved_for: "PARTICIPANT_KIND_",
};
const SEEDS = ["assignment_seed", "seeds"];

/** The value in the JSON form of the protocol. */
function inProtocolForm(value: JsonValue, field = ""): JsonValue {
  // The labels of a scale are texts, too, but a list of them.
  if (Array.isArray(value)) return value.map((item) => inProtocolForm(item, field === "labels" ? "" : field));
  if (typeof value === "object" && value !== null)
    return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, inProtocolForm(item, name)]));
  if (typeof value !== "string") return value;
  const prefix = ENUMS[field];
  if (prefix !== undefined && !value.startsWith(prefix)) return prefix + value.toUpperCase().replaceAll("-", "_");
  if (SEEDS.includes(field) && /^[0-9a-f]{64}$/i.test(value)) return base64Encode(fromHex(value));
  return value;
}
