// A seat that a person plays: what it has been told so far, and what it does over Act. Where the updates come from is not its concern: the
// stream of a seat (session.ts) or that of a participant of a tournament, whom the server seats (tournaments/participation.ts).

import { batch, type Signal, signal } from "@preact/signals";
import { CALL_LIMIT_MS, playApi } from "../api/client";
import { faultOf, inWords, isPassing } from "../api/faults";
import type { SeatUpdate } from "../gen/chefshat/v1/play_service_pb";
import { recall } from "../store";
import type { Gesture } from "./expressions";
import { applyUpdate, type LiveState, startLive } from "./model/live";
import type { TableState } from "./model/state";
import { answerWords } from "./words";

/** Name of the annotation that holds how long the person took, in whole milliseconds by the person's own clock. */
export const PERSON_TIME_KEY = "person_decision_time_ms";

/**
 * Whether decisions in a room or a tournament are sent with the time that the person took, measured here: only where the host of an experiment
 * asked for it.
 */
export function asksForTimes(id: string): boolean {
  return recall(`timed.${id}`) !== null;
}

/** How often an answer that did not get through is sent again while its decision is open. */
const MAX_ATTEMPTS = 5;
const RETRY_MS = 400;

export interface Acting {
  readonly live: Signal<LiveState>;
  /** The action that is on its way; undefined if none is. */
  readonly sending: Signal<number | undefined>;
  /** What went wrong last, in words; empty if nothing did. */
  readonly trouble: Signal<string>;
  /** Takes in what the seat is told. */
  hear(updates: readonly SeatUpdate[]): void;
  /** Answers the open decision. */
  answer(action: number): void;
  /** Shows an expression to the table. */
  express(gesture: Gesture): void;
  /** Plays for itself again after a substitute has. */
  resume(): void;
}

/** Begins to act with a seat's ticket; `timed` if decisions are sent with the time that the person took. */
export function startActing(ticket: string, table: TableState, seat: number, timed: boolean): Acting {
  const live = signal(startLive(table, seat));
  const sending = signal<number | undefined>(undefined);
  const trouble = signal("");
  /** When the open decision was first drawn. */
  let shown = { id: 0n, atMs: 0 };

  const hear = (updates: readonly SeatUpdate[]) => {
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

  const answer = async (action: number) => {
    const { decision } = live.peek();
    if (!decision || sending.peek() !== undefined) return;
    const tookMs = shown.id === decision.id ? Math.round(performance.now() - shown.atMs) : undefined;
    const extra: Record<string, string> = tookMs === undefined ? {} : { [PERSON_TIME_KEY]: String(tookMs) };
    const value = { decisionId: decision.id, action, ...(timed ? { annotations: { extra } } : {}) };
    sending.value = action;
    trouble.value = "";
    try {
      for (let attempt = 1; live.peek().decision?.id === decision.id; attempt += 1) {
        try {
          const reply = await playApi.act({ ticket, command: { case: "answer", value } }, { timeoutMs: CALL_LIMIT_MS });
          const { result } = reply;
          if (result) {
            hear([{ $typeName: "chefshat.v1.SeatUpdate", handle: 0, update: { case: "result", value: result } }]);
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

  const tell = async (command: Parameters<typeof playApi.act>[0]["command"]) => {
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
    hear,
    answer: (action) => void answer(action),
    express: (gesture) => void tell({ case: "express", value: gesture }),
    resume: () => void tell({ case: "resume", value: {} }),
  };
}
