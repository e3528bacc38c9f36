// The state of a room or tournament, as a sign and a word.

import css from "./StateChip.module.css";

/** A state: still open, under way, paused, finished, or ended early. */
export type ChipState = "open" | "playing" | "paused" | "finished" | "ended";

const SIGNS: Record<ChipState, string> = { open: "◔", playing: "▶", paused: "‖", finished: "✓", ended: "×" };

/** The state as a chip. */
export function StateChip({ state, word }: { state: ChipState; word: string }) {
  return (
    <span class={css.stateChip} data-part="state-chip" data-state={state}>
      <span aria-hidden="true">{SIGNS[state]}</span> {word}
    </span>
  );
}
