// What the decisions of a recorded game were worth: the server estimates each one that was a choice,
// one after the other, from what its seat knew.

import { Code, ConnectError } from "@connectrpc/connect";
import { analysisApi } from "../api/client";
import type { ActionEstimate } from "../gen/chefshat/v1/analysis_service_pb";
import { legalActions } from "../table/model/actions";
import type { Film } from "./frames";

/** Computing time of an estimate, milliseconds: a game of a hundred choices takes half a minute. */
const TIME_MS = 250;
/** Points of a Shift that a decision must have cost or won to be worth a word. */
const NOTEWORTHY = 0.2;
/** Standard errors that the difference must be larger than. */
const SURE = 2;

/** A choice among several actions, and what it was worth. */
export interface Judgement {
  /** Decisions of the game before it. */
  readonly decisions: number;
  /** The moment of the film in which it is open. */
  readonly frame: number;
  readonly shift: number;
  readonly seat: number;
  /** The action taken, and its mean points of the Shift. */
  readonly taken: number;
  readonly points: number;
  /** The best action that was not taken. */
  readonly other: number;
  /** Points that the decision won over it; negative if it would have been better. */
  readonly won: number;
  /** Whether `won` is more than chance and more than a trifle. */
  readonly noteworthy: boolean;
}

/** A decision that is to be judged. */
export interface Choice {
  readonly decisions: number;
  readonly frame: number;
  readonly shift: number;
  readonly seat: number;
  readonly taken: number;
}

/** The decisions of a game in which there was a choice, of one seat or of all. */
export function choices(film: Film, seat?: number): Choice[] {
  return Array.from({ length: film.length }, (_, frame) => ({ frame, ...film.at(frame) })).flatMap(
    ({ frame, table, open, decisions }) => {
      if (!open || legalActions(open.actionMask).length < 2 || (seat !== undefined && open.seat !== seat)) return [];
      return [{ decisions, frame, shift: table.shift, seat: open.seat, taken: open.action }];
    },
  );
}

/**
 * Judges choices in turn; undefined for one that the server cannot estimate. Its work ends with
 * `signal`.
 */
export async function* judgedChoices(
  gameId: string,
  asked: readonly Choice[],
  signal: AbortSignal,
): AsyncGenerator<Judgement | undefined> {
  for (const choice of asked) {
    const value = { gameId, decisions: BigInt(choice.decisions) };
    const request = { position: { case: "moment" as const, value }, timeMs: TIME_MS };
    let actions: readonly ActionEstimate[] = [];
    try {
      for await (const answer of analysisApi.evaluate(request, { signal })) actions = answer.actions;
    } catch (thrown) {
      if (ConnectError.from(thrown).code !== Code.InvalidArgument) throw thrown;
    }
    yield judged(choice, actions);
  }
}

/** Compares an action with the best other one; undefined if there is none. */
export function judged(choice: Choice, actions: readonly ActionEstimate[]): Judgement | undefined {
  const taken = actions.find(({ action }) => action === choice.taken);
  const [other] = actions.filter(({ action }) => action !== choice.taken).sort((a, b) => b.points - a.points);
  if (!taken || !other) return undefined;
  const won = taken.points - other.points;
  // All actions were tried in the same deals, so the error of the difference is smaller than this.
  const error = Math.hypot(taken.standardError, other.standardError);
  const noteworthy = Math.abs(won) >= NOTEWORTHY && Math.abs(won) >= SURE * error;
  return { ...choice, points: taken.points, other: other.action, won, noteworthy };
}

/** The noteworthy decisions that cost most, the worst first. */
export function costliest(judgements: readonly Judgement[], most: number): Judgement[] {
  return judgements
    .filter(({ noteworthy, won }) => noteworthy && won < 0)
    .sort((a, b) => a.won - b.won)
    .slice(0, most);
}

/** The noteworthy decision that won most; undefined if there is none. */
export function finest(judgements: readonly Judgement[]): Judgement | undefined {
  return judgements.filter(({ noteworthy, won }) => noteworthy && won > 0).sort((a, b) => b.won - a.won)[0];
}
