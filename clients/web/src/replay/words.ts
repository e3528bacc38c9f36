// Decisions that were judged, in words.

import { t } from "../i18n";
import { moveOf } from "../table/model/actions";
import { moveWords } from "../table/words";
import type { Judgement } from "./judging";

/** What was done, and what the best other action was worth beside it. */
export function judgementWords({ taken, other, won }: Judgement, faces: number): string {
  const words = (action: number) => {
    const move = moveOf(action, faces);
    return move ? moveWords(move) : String(action);
  };
  const { cost, gained } = t().replay.graph;
  return won < 0 ? cost(words(taken), words(other), -won) : gained(words(taken), words(other), won);
}
