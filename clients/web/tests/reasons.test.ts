// Every reason that the server's sources contain has a text on the page, or stands below with why a
// person at the page never reads it. A new reason fails here until it is in one of the two.

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { expect, test } from "vitest";
import * as en from "../src/i18n/en";

/** The crates of the server that name reasons. */
const SERVER = ["admission", "gateway", "hosting", "store", "vector", "wire"].map((part) =>
  join(import.meta.dirname, "../../../server", part, "src"),
);

/** Reasons without a text on the page. */
const WITHOUT_TEXT: Record<string, readonly string[]> = {
  "forms show the server's sentence at the field": [
    "BRANCH_REFUSED",
    "POLICY_REFUSED",
    "REPORT_REFUSED",
    "RULE_SET_REFUSED",
    "SEATS_REFUSED",
    "SETTINGS_REFUSED",
  ],
  "the page joins the room that somebody else was faster to offer": ["NEXT_ROOM_SET"],
  "the page of a study shows the newest step, or drops the traces and what it could not save": [
    "STEP_MISMATCH",
    "STEP_OVER",
    "TOO_MANY_SAVES",
    "TOO_MANY_TRACES",
    "TRACES_REFUSED",
  ],
  "the page of a study shows the words of the picture": ["PICTURE_UNKNOWN"],
  "the page repeats the request": ["FOLLOWER_TOO_SLOW", "SPECTATOR_TOO_SLOW"],
  "the page sends no such value": [
    "COMMAND_MISSING",
    "ENTROPY_REFUSED",
    "EXPRESSION_REFUSED",
    "FILTER_REFUSED",
    "KIND_REFUSED",
    "MAX_GAMES_REFUSED",
    "MESSAGE_MALFORMED",
    "MESSAGE_TOO_LARGE",
    "MESSAGE_TOO_SLOW",
    "NAME_KEY_REFUSED",
    "PAGE_TOKEN_REFUSED",
    "REPORT_ID_USED",
    "REQUEST_ID_REFUSED",
    "REQUEST_ID_USED",
    "SCRIPT_REFUSED",
    "SECRETS_REFUSED",
    "SEED_REFUSED",
    "SNAPSHOT_DELAYED",
    "STATE_REFUSED",
    "TOO_MANY_ELEMENTS",
  ],
  "only programs make these calls: Play, vectors, imports, operating": [
    "ACTIONS_REFUSED",
    "ANALYSIS_REFUSED",
    "CALLS_NOT_TAKEN",
    "UPDATES_NOT_TAKEN",
    "CLIENT_IDLE",
    "CLIENT_TOO_SLOW",
    "CLIENT_UNKNOWN",
    "FACES_OUT_OF_RANGE",
    "MARKER_REFUSED",
    "PARTICIPANT_PLAYING",
    "SAMPLES_OFF",
    "SAMPLES_REFUSED",
    "TOO_MANY_SAMPLES",
    "TOO_MANY_MARKERS",
    "GAME_KNOWN",
    "HANDLE_UNKNOWN",
    "ILLEGAL_ACTION",
    "IMPORT_OFF",
    "IMPORT_TOO_SLOW",
    "PRUNE_REFUSED",
    "RECORDS_TOO_LONG",
    "RECORD_REFUSED",
    "RECORD_TOO_LARGE",
    "RESET_REFUSED",
    "SETUP_MISSING",
    "SETUP_REFUSED",
    "SETUP_TOO_LATE",
    "STATES_REFUSED",
    "STATES_TOO_LARGE",
    "STREAM_SILENT",
    "TOO_MANY_ANALYSES",
    "TOO_MANY_COMMANDS",
    "TOO_MANY_SEATS",
    "TOO_MANY_VECTOR_GAMES",
    "TOO_MANY_VECTOR_STREAMS",
  ],
  "the connection is closed; the reason is only counted": [
    "ANSWERS_NOT_READ",
    "OUT_OF_DESCRIPTORS",
    "STREAMS_NOT_READ",
    "TOO_MANY_CONNECTIONS",
    "TOO_MANY_HANDSHAKES",
  ],
  "it asks the page to join first": ["LINK_OPEN"],
  "only nodes of a cluster send it to each other": ["NOT_OWNER"],
  "environment variables": ["CARGO_MANIFEST_DIR", "CARGO_PKG_VERSION", "CHEFSHAT_PAIRS"],
};

test("each reason of the server has a text, or a cause not to have one", () => {
  const files = SERVER.flatMap((folder) =>
    readdirSync(folder, { recursive: true, encoding: "utf8" }).map((path) => join(folder, path)),
  );
  const sources = files.filter((path) => path.endsWith(".rs")).map((path) => readFileSync(path, "utf8"));
  const found = sources.flatMap((text) => [...text.matchAll(/"([A-Z]+(?:_[A-Z]+)+|INTERNAL)"/g)].map(([, it]) => it));
  const handled = [...Object.keys(en.faults.byReason), ...Object.values(WITHOUT_TEXT).flat()];
  expect(handled.toSorted()).toEqual([...new Set(found)].toSorted());
});
