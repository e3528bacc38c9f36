// Studies of researchers: the owner tokens that this device stores, and calls with them.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { Code, ConnectError } from "@connectrpc/connect";
import { isSecret } from "../api/secrets";
import type { Study, StudyLink, StudySettingsSchema } from "../gen/chefshat/v1/study_pb";
import { pathOf } from "../router";
import { recallObject, remember, remembered } from "../store";
import { studyApi } from "./client";

const STORED = "own-study.";
/** Most tokens of a call. */
const MAX_TOKENS = 100;

/** The owner token of a study, if this device has it. */
export function ownerTokenOf(studyId: string): string | null {
  return recallObject(STORED + studyId, ({ ownerToken }) => (typeof ownerToken === "string" ? ownerToken : null));
}

/** Whether a text may be the owner token of a study: it begins with the study's id. */
export function mayOwn(studyId: string, text: string): boolean {
  return isSecret(text) && text.startsWith(studyId);
}

/** Stores the owner token of a study. */
export function keepOwnerToken(studyId: string, ownerToken: string): void {
  remember(STORED + studyId, JSON.stringify({ ownerToken }));
}

/** The studies whose owner tokens this device has, newest first. */
export async function ownStudies(signal: AbortSignal): Promise<Study[]> {
  const ids = [...remembered().keys()].flatMap((key) => (key.startsWith(STORED) ? key.slice(STORED.length) : []));
  const all = ids.flatMap((id) => ownerTokenOf(id) ?? []);
  const calls = Array.from({ length: Math.max(1, Math.ceil(all.length / MAX_TOKENS)) }, (_, call) => {
    const ownerTokens = all.slice(call * MAX_TOKENS, (call + 1) * MAX_TOKENS);
    return studyApi.listStudies({ ownerTokens }, { signal });
  });
  // The operator gets all studies with each call.
  const found = new Map(
    (await Promise.all(calls)).flatMap(({ studies }) => studies.map((study) => [study.studyId, study])),
  );
  return [...found.values()].sort((one, other) => Number(other.createdAtMs - one.createdAtMs));
}

/** Creates a study and stores its owner token; returns its id. */
export async function createStudy(settings: MessageInitShape<typeof StudySettingsSchema>): Promise<string> {
  const { study, ownerToken } = await studyApi.createStudy({ settings });
  if (!study) throw new Error("the server did not say which study it is");
  keepOwnerToken(study.studyId, ownerToken);
  return study.studyId;
}

/**
 * Deletes a study with all its data, and its owner token on this device. Refused with STUDY_RUNNING
 * while participants are in the middle of it, unless `force` removes them.
 */
export async function deleteStudy(studyId: string, force: boolean): Promise<void> {
  // No deadline: the server answers when all records are deleted.
  await studyApi.deleteStudy({ ...ownership(studyId), force }, { timeoutMs: 0 });
  remember(STORED + studyId, null);
}

/** Without it an export is incomplete. */
const LAST_FILE = "datapackage.json";

/**
 * The data of a study, or those of its test participants, as files in the order of the server; `onFiles`
 * is called with their number.
 */
export async function exportStudy(
  studyId: string,
  test: boolean,
  onFiles: (count: number) => void,
): Promise<Map<string, Uint8Array[]>> {
  const files = new Map<string, Uint8Array[]>();
  for await (const { file, data } of studyApi.exportStudy({ ...ownership(studyId), test })) {
    const parts = files.get(file);
    if (parts) parts.push(data);
    else {
      files.set(file, [data]);
      onFiles(files.size);
    }
  }
  if (!files.has(LAST_FILE)) throw new ConnectError("the export ended before it was complete", Code.Unavailable);
  return files;
}

/** The secrets of calls about a study. */
export function ownership(studyId: string) {
  return { studyId, ownerToken: ownerTokenOf(studyId) ?? "" };
}

/** The address to hand to a participant. */
export function addressOf({ link }: Pick<StudyLink, "link">): string {
  return `${location.origin}${pathOf({ page: "study", link })}`;
}
