// What the choices of a recorded game were worth, the decisions among several actions: the server
// estimates one after the other, from what its seat knew.

import { Code } from "@connectrpc/connect";
import { analysisApi } from "../api/client";
import { faultOf, isPassing } from "../api/faults";
import type { ActionEstimate } from "../gen/chefshat/v1/analysis_service_pb";
import { legalActions } from "../table/model/actions";
import type { Film } from "./frames";

/** Computing time of an estimate, milliseconds: a game of a hundred choices takes half a minute. */
const TIME_MS = 250;
/** Points of a Shift that a choice must have cost or won to be worth a word. */
const NOTEWORTHY = 0.2;
/** Standard errors that the difference must be larger than. */
const SURE = 2;

/** Attempts at an estimate that the server may soon give, and the pause before each further one, milliseconds. */
const ATTEMPTS = 5;
const PAUSE_MS = 1000;

/** A decision among several actions. */
export interface Choice {
  /** Decisions of the game before it. */
  readonly decisions: number;
  /** The moment of the film in which it is open. */
  readonly frame: number;
  readonly shift: number;
  readonly seat: number;
  /** The action taken. */
  readonly taken: number;
}

/** A choice, and what it was worth. */
export interface EstimatedChoice extends Choice {
  /** Mean points of the Shift after the action taken. */
  readonly points: number;
  /** The best action that was not taken. */
  readonly other: number;
  /** Points that the choice won over it; negative if it would have been better. */
  readonly won: number;
  /** Whether `won` is more than chance and more than a trifle. */
  readonly noteworthy: boolean;
}

/** The choices of a game, of one seat or of all. */
export function choices(film: Film, seat?: number): Choice[] {
  return Array.from({ length: film.length }, (_, frame) => ({ frame, ...film.at(frame) })).flatMap(
    ({ frame, table, open, decisions }) => {
      if (!open || legalActions(open.actionMask).length < 2 || (seat !== undefined && open.seat !== seat)) return [];
      return [{ decisions, frame, shift: table.shift, seat: open.seat, taken: open.action }];
    },
  );
}

/**
 * Has choices estimated in turn; undefined for one that the server cannot estimate. Its work ends
 * with `signal`.
 */
export async function* estimatedChoices(
  gameId: string,
  asked: readonly Choice[],
  signal: AbortSignal,
): AsyncGenerator<EstimatedChoice | undefined> {
  for (const choice of asked) yield compared(choice, await estimated(gameId, choice, signal));
}

/** The actions of a choice; none if the server cannot estimate them. */
async function estimated(gameId: string, choice: Choice, signal: AbortSignal): Promise<readonly ActionEstimate[]> {
  const value = { gameId, decisions: BigInt(choice.decisions) };
  const request = { position: { case: "moment" as const, value }, timeMs: TIME_MS };
  for (let attempt = 1; ; attempt += 1) {
    try {
      let actions: readonly ActionEstimate[] = [];
      for await (const answer of analysisApi.evaluate(request, { signal })) actions = answer.actions;
      return actions;
    } catch (thrown) {
      const fault = faultOf(thrown);
      if (fault.code === Code.InvalidArgument) return [];
      if (signal.aborted || attempt === ATTEMPTS || !isPassing(fault)) throw thrown;
      await new Promise((resume) => setTimeout(resume, fault.retryMs ?? PAUSE_MS));
    }
  }
}

/** Compares an action with the best other one; undefined if there is none. */
export function compared(choice: Choice, actions: readonly ActionEstimate[]): EstimatedChoice | undefined {
  const taken = actions.find(({ action }) => action === choice.taken);
  const [other] = actions.filter(({ action }) => action !== choice.taken).sort((a, b) => b.points - a.points);
  if (!taken || !other) return undefined;
  const won = taken.points - other.points;
  // All actions were tried in the same deals, so the error of the difference is smaller than this.
  const error = Math.hypot(taken.standardError, other.standardError);
  const noteworthy = Math.abs(won) >= NOTEWORTHY && Math.abs(won) >= SURE * error;
  return { ...choice, points: taken.points, other: other.action, won, noteworthy };
}

/** The noteworthy choices that cost most, the worst first. */
export function costliest(estimated: readonly EstimatedChoice[], most: number): EstimatedChoice[] {
  return estimated
    .filter(({ noteworthy, won }) => noteworthy && won < 0)
    .sort((a, b) => a.won - b.won)
    .slice(0, most);
}

/** The noteworthy choice that won most; undefined if there is none. */
export function finest(estimated: readonly EstimatedChoice[]): EstimatedChoice | undefined {
  return estimated.filter(({ noteworthy, won }) => noteworthy && won > 0).sort((a, b) => b.won - a.won)[0];
}
