// Ratings as they are shown: mean and uncertainty.

import type { Rating } from "../gen/chefshat/v1/tournament_pb";
import { decimal } from "../i18n";

/** Standard deviations on each side of a 95% confidence interval. */
const NINETY_FIVE = 1.96;

/** The mean and the half width of the 95% interval. */
export function ratingWords(rating: Rating): string {
  return `${decimal(rating.mean, 1)} ± ${decimal(NINETY_FIVE * rating.deviation, 1)}`;
}

/** The bounds of the 95% interval. */
export function ratingRange(rating: Rating): { from: number; to: number } {
  const half = NINETY_FIVE * rating.deviation;
  return { from: rating.mean - half, to: rating.mean + half };
}
