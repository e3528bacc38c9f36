// How many of a game's choices have been judged.

import { t } from "../i18n";
import css from "./JudgingProgress.module.css";

export function JudgingProgress({ done, all }: { done: number; all: number }) {
  const words = t().replay.graph;
  return (
    <p class={css.progress}>
      <progress value={done} max={all} aria-label={words.title} />
      <span class="small soft number">{words.progress(done, all)}</span>
    </p>
  );
}
