// How many of a game's choices have been estimated, or why no more are.

import { t } from "../i18n";
import { Button } from "../parts/Button";
import css from "./EstimatingProgress.module.css";
import type { Estimates } from "./hooks";

export function EstimatingProgress({ estimates, all }: { estimates: Estimates; all: number }) {
  const words = t().replay.graph;
  const { looked, fault, resume } = estimates;
  return (
    <div class={css.progress}>
      {fault && <p role="alert">{fault}</p>}
      {fault && <Button onClick={resume}>{words.resume}</Button>}
      {!fault && <progress value={looked} max={Math.max(all, 1)} aria-label={words.title} />}
      <span class="small soft number">{words.progress(looked, all)}</span>
    </div>
  );
}
