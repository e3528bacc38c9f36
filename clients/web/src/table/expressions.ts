// What a person can show to the table with one click: a label with valence and arousal as the protocol wants them, reported by the person.
// Their words are in the texts, their drawings in view/Face.tsx.

import { ExpressionSource } from "../gen/chefshat/v1/decision_pb";

/** Labels that have words and a drawing here. Others, of robots and agents, are shown by their label. */
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

/** Where each label lies between unpleasant and pleasant (-1..1) and between calm and excited (-1..1). */
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
