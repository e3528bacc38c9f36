// A seat that a person plays: the updates it has received and the commands it sends with Act. The
// updates come from a seat's stream (session.ts) or a tournament participant's
// (tournaments/participation.ts).

import { batch, computed, type ReadonlySignal, type Signal, signal } from "@preact/signals";
import { askUntilAnswered } from "../api/asking";
import { playApi } from "../api/client";
import { type Fault, inWords, isPassing, wordsOf } from "../api/faults";
import { AnswerStatus } from "../gen/chefshat/v1/decision_pb";
import type { Hint, SeatUpdate } from "../gen/chefshat/v1/play_service_pb";
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
 * Deadline of a call with an answer: on a connection that has died it is called again. The server
 * counts an answer that it receives twice once.
 */
const ANSWER_LIMIT_MS = 5_000;
/** Longest pause before an answer is sent again while its decision is open. */
const LONGEST_PAUSE_MS = 2_000;

/** Expressions that wait for a slow connection; further ones would arrive long after they were meant. */
const MAX_UNSENT = 5;

/** An answer as it is sent. */
interface Answer {
  decisionId: bigint;
  action: number;
  annotations?: { extra: Record<string, string> };
}

/** A hint for a decision. */
export interface GivenHint {
  readonly decision: bigint;
  /** Undefined while it is being computed. */
  readonly hint: Hint | undefined;
}

export interface Acting {
  readonly live: Signal<LiveState>;
  /** Whether an answer to the open decision is being sent. */
  readonly sending: ReadonlySignal<boolean>;
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
  /** Shows an expression to the table, after those shown before it; resolves to whether it was sent. */
  express(gesture: Gesture): Promise<boolean>;
  /** Takes the seat back from a substitute. */
  resume(): void;
}

/** Starts acting with a seat's ticket; `timed` sends the decision time with each answer. */
export function startActing(ticket: string, table: TableState, seat: number | undefined, timed = false): Acting {
  const live = signal(startLive(table, seat));
  /** The decision to which an answer is being sent. */
  const answering = signal<bigint | undefined>(undefined);
  const sending = computed(() => answering.value !== undefined && live.value.decision?.id === answering.value);
  const trouble = signal("");
  const hint = signal<GivenHint | undefined>(undefined);
  /** Ends when the last expression has been sent. */
  let expressed = Promise.resolve();
  let unsent = 0;
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
    if (!decision || sending.peek()) return;
    const tookMs = shown.id === decision.id ? Math.round(performance.now() - shown.atMs) : undefined;
    const extra = {
      ...(timed && tookMs !== undefined ? { [PERSON_TIME_KEY]: String(tookMs) } : {}),
      ...(automatic ? { [AUTOMATIC_KEY]: automatic } : {}),
    };
    const noted = timed || automatic !== undefined;
    const value: Answer = { decisionId: decision.id, action, ...(noted ? { annotations: { extra } } : {}) };
    answering.value = decision.id;
    trouble.value = "";
    const problem = await delivered(value);
    // Another decision may be open by now, and be answered.
    if (answering.peek() !== decision.id) return;
    answering.value = undefined;
    trouble.value = problem;
  };

  /**
   * Sends an answer until the server has it or its decision is gone. Returns what is wrong with it,
   * in words.
   */
  const delivered = async (value: Answer): Promise<string> => {
    // On a new stream none is open until the server has requested it again.
    const mayBeOpen = () => (live.peek().decision?.id ?? value.decisionId) === value.decisionId;
    const command = { case: "answer" as const, value };
    let isFirst = true;
    let problem = "";
    const send = () => playApi.act({ ticket, command }, { timeoutMs: ANSWER_LIMIT_MS });
    const onFault = (fault: Fault) => {
      isFirst = false;
      if (!mayBeOpen()) return;
      if (isPassing(fault)) trouble.value = wordsOf(fault);
      else problem = wordsOf(fault);
    };
    const result = (await askUntilAnswered(send, mayBeOpen, onFault, LONGEST_PAUSE_MS))?.result;
    if (!result) return problem;
    apply([{ $typeName: "chefshat.v1.SeatUpdate", handle: 0, update: { case: "result", value: result } }]);
    // What closed the decision may be the answer itself, whose response was lost.
    return isFirst || result.status === AnswerStatus.INVALID ? answerWords(result) : "";
  };

  const askHint = async () => {
    const { decision } = live.peek();
    const last = hint.peek();
    if (!decision || (last?.decision === decision.id && !last.hint)) return;
    trouble.value = "";
    hint.value = { decision: decision.id, hint: undefined };
    try {
      const command = { case: "hint" as const, value: { decisionId: decision.id } };
      const reply = await playApi.act({ ticket, command });
      hint.value = { decision: decision.id, hint: reply.hint };
    } catch (thrown) {
      hint.value = last;
      trouble.value = inWords(thrown);
    }
  };

  /** Sends a command once; returns whether it arrived. */
  const send = async (command: NonNullable<Parameters<typeof playApi.act>[0]["command"]>) => {
    try {
      await playApi.act({ ticket, command });
      return true;
    } catch (thrown) {
      trouble.value = inWords(thrown);
      return false;
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
    express: (gesture) => {
      trouble.value = "";
      if (unsent >= MAX_UNSENT) return Promise.resolve(false);
      unsent += 1;
      // One after the other: of calls made together the second may arrive first.
      const sent = expressed.then(() => send({ case: "express", value: gesture }));
      expressed = sent.then(() => {
        unsent -= 1;
      });
      return sent;
    },
    resume: () => {
      trouble.value = "";
      void send({ case: "resume", value: {} });
    },
  };
}
