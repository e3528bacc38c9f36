// Decisions that were compared, in words.

import { t } from "../i18n";
import { moveOf } from "../table/model/actions";
import { moveWords } from "../table/words";
import type { EstimatedChoice } from "./choices";

/** What was done, and what the best other action was worth beside it. */
export function choiceWords({ taken, other, won }: EstimatedChoice, faces: number): string {
  const { cost, gained, gift, pass } = t().replay.graph;
  const words = (action: number) => {
    const move = moveOf(action, faces);
    if (!move) return String(action);
    if (move.kind === "pass") return pass;
    return move.kind === "give" || move.kind === "giveJoker" ? gift(moveWords(move)) : moveWords(move);
  };
  return won < 0 ? cost(words(taken), words(other), -won) : gained(words(taken), words(other), won);
}
