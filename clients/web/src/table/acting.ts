// A seat that a person plays: the updates it has received and the commands it sends with Act. The
// updates come from a seat's stream (session.ts) or a tournament participant's
// (tournaments/participation.ts).

import { batch, type Signal, signal } from "@preact/signals";
import { CALL_LIMIT_MS, playApi } from "../api/client";
import { faultOf, inWords, isPassing } from "../api/faults";
import type { Hint, SeatUpdate } from "../gen/chefshat/v1/play_service_pb";
import { recall } from "../store";
import type { Gesture } from "./expressions";
import { applyUpdate, type LiveState, startLive } from "./model/live";
import type { TableState } from "./model/state";
import { answerWords } from "./words";

/**
 * Key of the annotation with the person's decision time, in whole milliseconds by this device's
 * clock.
 */
export const PERSON_TIME_KEY = "person_decision_time_ms";

/** Key of the annotation of an answer that the page sent for the person, as they had asked it to. */
export const AUTOMATIC_KEY = "person_automatic";
/** Passed because nothing else was legal, or chosen before the turn. */
export type Automatic = "auto_pass" | "planned";

/**
 * Whether decisions in a room or tournament are sent with the time measured here: only if the host
 * of a study asked for it.
 */
export function asksForTimes(id: string): boolean {
  return recall(`timed.${id}`) !== null;
}

/** Attempts to send an answer while its decision is open, and the delay between them. */
const MAX_ATTEMPTS = 5;
const RETRY_MS = 400;

/** A hint for a decision. */
export interface GivenHint {
  readonly decision: bigint;
  /** Undefined while it is being computed. */
  readonly hint: Hint | undefined;
}

export interface Acting {
  readonly live: Signal<LiveState>;
  /** The action being sent; undefined if none is. */
  readonly sending: Signal<number | undefined>;
  /** The last error in words; empty if there is none. */
  readonly trouble: Signal<string>;
  /** The last hint. */
  readonly hint: Signal<GivenHint | undefined>;
  /** Applies updates of the seat. */
  apply(updates: readonly SeatUpdate[]): void;
  /** Answers the open decision; `automatic` if the person did not do so now. */
  answer(action: number, automatic?: Automatic): void;
  /** Asks for a hint for the open decision. */
  askHint(): void;
  /** Shows an expression to the table. */
  express(gesture: Gesture): void;
  /** Takes the seat back from a substitute. */
  resume(): void;
}

/** Starts acting with a seat's ticket; `timed` sends the decision time with each answer. */
export function startActing(ticket: string, table: TableState, seat: number | undefined, timed: boolean): Acting {
  const live = signal(startLive(table, seat));
  const sending = signal<number | undefined>(undefined);
  const trouble = signal("");
  const hint = signal<GivenHint | undefined>(undefined);
  /** The open decision and when it was first rendered. */
  let shown = { id: 0n, atMs: 0 };

  const apply = (updates: readonly SeatUpdate[]) => {
    const nowMs = performance.now();
    batch(() => {
      for (const update of updates) live.value = applyUpdate(live.value, update, nowMs);
    });
    const { decision } = live.peek();
    if (decision && decision.id !== shown.id) {
      const { id } = decision;
      requestAnimationFrame((atMs) => {
        shown = { id, atMs };
      });
    }
  };

  const answer = async (action: number, automatic?: Automatic) => {
    const { decision } = live.peek();
    if (!decision || sending.peek() !== undefined) return;
    const tookMs = shown.id === decision.id ? Math.round(performance.now() - shown.atMs) : undefined;
    const extra = {
      ...(timed && tookMs !== undefined ? { [PERSON_TIME_KEY]: String(tookMs) } : {}),
      ...(automatic ? { [AUTOMATIC_KEY]: automatic } : {}),
    };
    const noted = timed || automatic !== undefined;
    const value = { decisionId: decision.id, action, ...(noted ? { annotations: { extra } } : {}) };
    sending.value = action;
    trouble.value = "";
    try {
      for (let attempt = 1; live.peek().decision?.id === decision.id; attempt += 1) {
        try {
          const reply = await playApi.act({ ticket, command: { case: "answer", value } }, { timeoutMs: CALL_LIMIT_MS });
          const { result } = reply;
          if (result) {
            apply([{ $typeName: "chefshat.v1.SeatUpdate", handle: 0, update: { case: "result", value: result } }]);
            trouble.value = answerWords(result);
          }
          return;
        } catch (thrown) {
          if (!isPassing(faultOf(thrown)) || attempt >= MAX_ATTEMPTS) throw thrown;
          await new Promise((resolve) => setTimeout(resolve, RETRY_MS * attempt));
        }
      }
    } catch (thrown) {
      trouble.value = inWords(thrown);
    } finally {
      sending.value = undefined;
    }
  };

  const askHint = async () => {
    const { decision } = live.peek();
    const last = hint.peek();
    if (!decision || (last?.decision === decision.id && !last.hint)) return;
    trouble.value = "";
    hint.value = { decision: decision.id, hint: undefined };
    try {
      const command = { case: "hint" as const, value: { decisionId: decision.id } };
      const reply = await playApi.act({ ticket, command }, { timeoutMs: CALL_LIMIT_MS });
      hint.value = { decision: decision.id, hint: reply.hint };
    } catch (thrown) {
      hint.value = last;
      trouble.value = inWords(thrown);
    }
  };

  const send = async (command: Parameters<typeof playApi.act>[0]["command"]) => {
    if (!command) return;
    try {
      await playApi.act({ ticket, command }, { timeoutMs: CALL_LIMIT_MS });
      trouble.value = "";
    } catch (thrown) {
      trouble.value = inWords(thrown);
    }
  };

  return {
    live,
    sending,
    trouble,
    hint,
    apply,
    answer: (action, automatic) => void answer(action, automatic),
    askHint: () => void askHint(),
    express: (gesture) => void send({ case: "express", value: gesture }),
    resume: () => void send({ case: "resume", value: {} }),
  };
}
