// Interface traces of a game: what the participant picks, puts back, hovers and focuses, and when
// the page is left. Collected only if the study asks for it, and sent in batches.

import { effect, type Signal } from "@preact/signals";
import { faultOf, isPassing } from "../api/faults";
import { StudyTraceKind } from "../gen/chefshat/v1/study_pb";
import type { LiveState } from "../table/model/live";
import type { Trace } from "./participating";

/** Interval of sending, milliseconds. */
const EVERY_MS = 5_000;
/** How often the rest is sent, if the server cannot be reached. */
const LAST_TRIES = 6;
/** Most traces of a call. */
const MAX_SENT = 500;
/** Most traces that wait; if the server cannot be reached for long, the oldest are dropped. */
const MAX_WAITING = 5_000;
/** Hovering for less is passing by, milliseconds. */
const SHORTEST_HOVER_MS = 100;
/** Longest name of a target. */
const MAX_TARGET = 64;

/** Traces being collected. */
export interface Tracing {
  /** A card was picked or put back. */
  pick(card: string, picked: boolean): void;
  /** The answer was sent. */
  answered(action: number): void;
  /** Sends what is left, and stops. */
  stop(): void;
}

/** Collects the traces of a game within an element. */
export function startTracing(
  within: HTMLElement,
  live: Signal<LiveState>,
  send: (traces: Trace[]) => Promise<void>,
): Tracing {
  const sinceMs = performance.now();
  let waiting: Trace[] = [];
  /** The call under way, if any. */
  let sending: Promise<void> | undefined;

  const add = (kind: StudyTraceKind, target = "", fromMs = performance.now(), durationMs = 0) => {
    const atMs = BigInt(Math.max(0, Math.round(fromMs - sinceMs)));
    const decisionId = live.peek().decision?.id ?? 0n;
    waiting.push({ kind, atMs, decisionId, target: target.slice(0, MAX_TARGET), durationMs: Math.round(durationMs) });
    if (waiting.length > MAX_WAITING) waiting = waiting.slice(-MAX_WAITING);
  };
  const sendSome = async () => {
    const batch = waiting.splice(0, MAX_SENT);
    try {
      await send(batch);
    } catch (thrown) {
      // Tried again with the next batch, unless the server does not want them.
      if (isPassing(faultOf(thrown))) waiting.unshift(...batch);
    } finally {
      sending = undefined;
    }
  };
  const flush = () => {
    if (waiting.length > 0) sending ??= sendSome();
  };
  /** Sends all that is left. While the server cannot be reached, tries again a few times. */
  const sendRest = async () => {
    for (let failures = 0; failures < LAST_TRIES; ) {
      await sending;
      const before = waiting.length;
      if (before === 0) return;
      flush();
      await sending;
      if (waiting.length < before) continue;
      failures += 1;
      await new Promise((resolve) => setTimeout(resolve, EVERY_MS));
    }
  };
  const timer = setInterval(flush, EVERY_MS);

  /** Something that lasts: it is known when it ends. */
  const spans = (kind: StudyTraceKind, shortestMs: number) => {
    let now: { target: string; atMs: number } | undefined;
    return (target: string | undefined) => {
      if (now?.target === target) return;
      const atMs = performance.now();
      if (now && atMs - now.atMs >= shortestMs) add(kind, now.target, now.atMs, atMs - now.atMs);
      now = target === undefined ? undefined : { target, atMs };
    };
  };
  const hover = spans(StudyTraceKind.HOVER, SHORTEST_HOVER_MS);
  const focus = spans(StudyTraceKind.FOCUS, 0);

  let away = false;
  const watchAway = () => {
    const left = document.visibilityState === "hidden" || !document.hasFocus();
    if (left === away) return;
    away = left;
    add(left ? StudyTraceKind.PAGE_LEFT : StudyTraceKind.PAGE_RETURNED);
    if (left) flush();
  };
  const listeners: [EventTarget, string, (event: Event) => void][] = [
    [within, "pointerover", ({ target }) => hover(targetOf(target))],
    [within, "pointerleave", () => hover(undefined)],
    [within, "focusin", ({ target }) => focus(targetOf(target))],
    [within, "focusout", () => focus(undefined)],
    [document, "visibilitychange", watchAway],
    [window, "blur", watchAway],
    [window, "focus", watchAway],
  ];
  for (const [on, name, listener] of listeners) on.addEventListener(name, listener);
  let shown: bigint | undefined;
  const unwatch = effect(() => {
    const { decision } = live.value;
    if (!decision || decision.id === shown) return;
    shown = decision.id;
    add(StudyTraceKind.DECISION_SHOWN);
  });

  return {
    pick: (card, picked) => add(picked ? StudyTraceKind.CARD_PICKED : StudyTraceKind.CARD_PUT_BACK, `card:${card}`),
    answered: (action) => add(StudyTraceKind.ANSWER_SENT, `action:${action}`),
    stop: () => {
      hover(undefined);
      focus(undefined);
      clearInterval(timer);
      unwatch();
      for (const [on, name, listener] of listeners) on.removeEventListener(name, listener);
      void sendRest();
    },
  };
}

/** The name of what an element belongs to: a card, a button or a part of the page. */
export function targetOf(target: EventTarget | null): string | undefined {
  const element = target instanceof Element ? target : null;
  const card = element?.closest<HTMLElement>("[data-card]")?.dataset.card;
  if (card !== undefined) return `card:${card}`;
  const action = element?.closest<HTMLElement>("[data-action]")?.dataset.action;
  if (action !== undefined) return action;
  const seat = element?.closest<HTMLElement>("[data-seat]")?.dataset.seat;
  if (seat !== undefined) return `seat:${seat}`;
  const part = element?.closest<HTMLElement>(NAMED_PARTS)?.dataset.part?.split(" ").at(-1);
  return part === undefined ? undefined : `part:${part}`;
}

/** The parts of the table with a name of their own in traces. */
const NAMED_PARTS = ["log", "board", "played", "tool", "expressions", "own", "actions"]
  .map((part) => `[data-part~="${part}"]`)
  .join(",");
