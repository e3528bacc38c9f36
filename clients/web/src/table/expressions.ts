// The expressions that a person can show with one click: label, valence and arousal as in the
// protocol, reported by the person. The words are in the texts, the drawings in view/Face.tsx.

import { ExpressionSource } from "../gen/chefshat/v1/decision_pb";

/** Labels with words and a drawing. Other labels, of robots and agents, are shown as they are. */
export const LABELS = ["joy", "amusement", "surprise", "concentration", "annoyance", "sadness"] as const;
export type Label = (typeof LABELS)[number];

/** An expression as it is sent. */
export interface Gesture {
  label: string;
  /** -1..1 */
  valence: number;
  /** -1..1 */
  arousal: number;
  source: ExpressionSource;
}

/** Valence (-1..1, unpleasant to pleasant) and arousal (-1..1, calm to excited) of each label. */
const PLACES: Record<Label, readonly [valence: number, arousal: number]> = {
  joy: [0.8, 0.5],
  amusement: [0.6, 0.7],
  surprise: [0.1, 0.8],
  concentration: [0, 0.2],
  annoyance: [-0.6, 0.6],
  sadness: [-0.7, -0.4],
};

export function gesture(label: Label): Gesture {
  const [valence, arousal] = PLACES[label];
  return { label, valence, arousal, source: ExpressionSource.SELF_REPORT };
}

export function isLabel(label: string): label is Label {
  return LABELS.some((known) => known === label);
}
