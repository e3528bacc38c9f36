// Estimates of the actions of a decision, in the order and with the marks in which they are shown.

import type { EvaluateResponse } from "../gen/chefshat/v1/analysis_service_pb";

/** An action with what it is worth. */
export interface Estimate {
  readonly action: number;
  /** Mean points of the Shift. */
  readonly points: number;
  readonly standardError: number;
  /** `points` and the ends of the standard error as parts of the scale, 0 to 1. */
  readonly part: number;
  readonly from: number;
  readonly to: number;
  readonly best: boolean;
  readonly taken: boolean;
}

/** The best actions, and the one that was taken if it is not among them. */
export interface Ranking {
  readonly estimates: readonly Estimate[];
  /** Number of actions that are not listed. */
  readonly others: number;
}

/** Ranks actions by their points. The scale ends at the most points that any estimate reaches. */
export function ranked({ actions }: Pick<EvaluateResponse, "actions">, taken: number, most: number): Ranking {
  const ordered = [...actions].sort((a, b) => b.points - a.points || a.action - b.action);
  const scale = Math.max(...ordered.map(({ points, standardError }) => points + standardError), Number.MIN_VALUE);
  const part = (points: number) => Math.min(1, Math.max(0, points / scale));
  const listed = ordered.filter(({ action }, place) => place < most || action === taken);
  return {
    estimates: listed.map(({ action, points, standardError }) => ({
      action,
      points,
      standardError,
      part: part(points),
      from: part(points - standardError),
      to: part(points + standardError),
      best: action === ordered[0]?.action,
      taken: action === taken,
    })),
    others: ordered.length - listed.length,
  };
}
