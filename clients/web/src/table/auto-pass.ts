// Passes by itself when nothing else is legal, where the person has switched it on. It waits as long
// as a person would: an instant pass would tell the others that nothing could be played, a pass
// after thinking does not.

import { useEffect, useRef } from "preact/hooks";
import { DecisionKind } from "../gen/chefshat/v1/decision_pb";
import type { Acting } from "./acting";
import { actionOf } from "./model/actions";
import type { OpenDecision } from "./model/live";

/** Bounds of the delay, and those of a person's of whom nothing is known yet, milliseconds. */
const SHORTEST_MS = 1500;
const LONGEST_MS = 9000;
const USUAL_MS = [2000, 5500] as const;
/** At most this share of the time that is left. */
const MOST_OF_TIME = 1 / 3;
/** Number of the person's last decisions that delays are drawn from. */
const REMEMBERED = 20;

/**
 * The delay of a pass: one of the person's own decision times, as often as they occur; `random` is
 * between 0 and 1.
 */
export function passDelayMs(own: readonly number[], timeLeftMs: number, random: number): number {
  const [from, to] = USUAL_MS;
  const drawn = own[Math.floor(random * own.length)] ?? from + random * (to - from);
  const delay = Math.min(LONGEST_MS, Math.max(SHORTEST_MS, drawn));
  return timeLeftMs > 0 ? Math.min(delay, timeLeftMs * MOST_OF_TIME) : delay;
}

/** Whether nothing but a pass is legal at a turn. */
export function mustPass({ kind, legal }: OpenDecision, faces: number): boolean {
  return kind === DecisionKind.TURN && legal.length === 1 && legal[0] === actionOf({ kind: "pass" }, faces);
}

/** Passes while `on`. Returns whether a pass is about to be sent. */
export function useAutoPass({ live, answer }: Acting, on: boolean): boolean {
  const { decision, table, substituted } = live.value;
  const { faces } = table;
  const passing = on && !substituted && decision !== undefined && mustPass(decision, faces);
  const own = useRef<number[]>([]);
  useEffect(() => {
    if (!decision) return;
    const openedMs = performance.now();
    if (!passing) {
      return () => {
        if (decision.kind !== DecisionKind.TURN) return;
        own.current = [...own.current, performance.now() - openedMs].slice(-REMEMBERED);
      };
    }
    const delayMs = passDelayMs(own.current, decision.timeLeftMs, Math.random());
    const timer = setTimeout(() => answer(actionOf({ kind: "pass" }, faces), "auto_pass"), delayMs);
    return () => clearTimeout(timer);
  }, [decision?.id, passing]);
  return passing;
}
