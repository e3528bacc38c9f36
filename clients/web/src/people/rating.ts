// Ratings as they are shown: a mean, and how far it may be off.

import type { Rating } from "../gen/chefshat/v1/tournament_pb";
import { decimal } from "../i18n";

/** The skill is within so many deviations of the mean with a confidence of 95%. */
const NINETY_FIVE = 1.96;

/** The mean and the half width of the range of 95%. */
export function ratingWords(rating: Rating): string {
  return `${decimal(rating.mean, 1)} ± ${decimal(NINETY_FIVE * rating.deviation, 1)}`;
}

/** The two ends of the range of 95%. */
export function ratingRange(rating: Rating): { from: number; to: number } {
  const half = NINETY_FIVE * rating.deviation;
  return { from: rating.mean - half, to: rating.mean + half };
}
