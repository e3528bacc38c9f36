// A person's seat in a room: follows what the seat is told over Watch and acts for it over Act. What the updates mean is in model/live.ts, how
// it looks in view/. The ticket comes from what this device remembers and stays here.

import { batch, type Signal, signal } from "@preact/signals";
import { CALL_LIMIT_MS, playApi } from "../api/client";
import { faultOf, inWords, isPassing } from "../api/faults";
import { type Following, follow } from "../api/follow";
import type { HeldSeat } from "../lobby/seat";
import { recall } from "../store";
import type { Gesture } from "./expressions";
import { applyUpdate, type LiveState, startLive } from "./model/live";
import type { TableState } from "./model/state";

/** Name of the annotation that holds how long the person took, in whole milliseconds by the person's own clock. */
export const PERSON_TIME_KEY = "person_decision_time_ms";

/** Whether decisions in a room are sent with the time that the person took, measured here: only where the host of an experiment asked for it. */
export function asksForTimes(roomId: string): boolean {
  return recall(`timed.${roomId}`) !== null;
}

/** How often an answer that did not get through is sent again while its decision is open. */
const MAX_ATTEMPTS = 5;
const RETRY_MS = 400;

export interface Session {
  readonly live: Signal<LiveState>;
  readonly following: Signal<Following>;
  /** The action that is on its way; undefined if none is. */
  readonly sending: Signal<number | undefined>;
  /** What went wrong last, in words; empty if nothing did. */
  readonly trouble: Signal<string>;
  /** Answers the open decision. */
  answer(action: number): void;
  /** Shows an expression to the table. */
  express(gesture: Gesture): void;
  /** Plays for itself again after a substitute has. */
  resume(): void;
  /** Takes the seat back from another page that has taken it. */
  takeBack(): void;
  stop(): void;
}

/** Sits down on a seat. */
export function startSession(held: HeldSeat, table: TableState): Session {
  const { ticket } = held;
  const timed = asksForTimes(table.roomId);
  const live = signal(startLive(table, held.seat));
  const sending = signal<number | undefined>(undefined);
  const trouble = signal("");
  /** When the open decision was first drawn. */
  let shown = { id: 0n, atMs: 0 };

  const attach = () =>
    follow(
      (abort) =>
        playApi.watch({ seats: [{ ticket, fromSequence: BigInt(live.peek().table.nextSequence) }] }, { signal: abort }),
      ({ updates }) => {
        const nowMs = performance.now();
        batch(() => {
          for (const update of updates) live.value = applyUpdate(live.value, update, nowMs);
        });
        const { decision, attachment } = live.peek();
        if (decision && decision.id !== shown.id) {
          const { id } = decision;
          requestAnimationFrame((atMs) => {
            shown = { id, atMs };
          });
        }
        return attachment.kind === "none" || attachment.kind === "attached";
      },
    );
  const following = signal(attach());

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
            const update = {
              $typeName: "chefshat.v1.SeatUpdate",
              handle: 0,
              update: { case: "result", value: result },
            } as const;
            live.value = applyUpdate(live.peek(), update, performance.now());
            trouble.value = result.detail;
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
    following,
    sending,
    trouble,
    answer: (action) => void answer(action),
    express: (gesture) => void tell({ case: "express", value: gesture }),
    resume: () => void tell({ case: "resume", value: {} }),
    takeBack: () => {
      following.peek().stop();
      live.value = { ...live.peek(), attachment: { kind: "none" } };
      following.value = attach();
    },
    stop: () => following.peek().stop(),
  };
}
