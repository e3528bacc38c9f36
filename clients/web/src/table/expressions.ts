// The expressions that a person can show with one click: feelings, with label, valence and arousal as
// in the protocol, reported by the person; and quick phrases. The words are in the texts, the
// drawings in view/Face.tsx.

import { ExpressionSource } from "../gen/chefshat/v1/decision_pb";

/** Labels with words and a drawing. Other labels, of robots and agents, are shown as they are. */
export const LABELS = ["joy", "amusement", "surprise", "concentration", "annoyance", "sadness"] as const;
export type Label = (typeof LABELS)[number];

/** An expression as it is sent. */
export interface Gesture {
  label: string;
  /** -1..1 */
  valence?: number;
  /** -1..1 */
  arousal?: number;
  /** The words of a line, as a data URL. */
  media?: string;
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

/**
 * Quick phrases by id. The label of one is its id and this text: pages show it in their reader's
 * language, everything else can show the text.
 */
export const PHRASES = {
  "good-luck": "Good luck!",
  "well-played": "Well played!",
  thanks: "Thank you!",
  "so-close": "That was close!",
  oops: "Oops!",
  sorry: "Sorry!",
  thinking: "Let me think…",
  "good-game": "Good game!",
} as const;
export type Phrase = keyof typeof PHRASES;

const SAYS = "say:";

/** A line, and a robot's request for help: the words are in `media`. */
const SPOKEN = ["say", "help"];
const WORDS = "data:,";
/** The longest `media` that the protocol allows, bytes. */
const MAX_MEDIA = 256;

/** Longest line that is typed, characters. */
export const MAX_LINE = 80;

/** The expression for a line, by default as a robot's program sends it. A text that does not fit is cut off. */
export function lineGesture(text: string, source = ExpressionSource.MODEL): Gesture {
  const characters = Array.from(text);
  let media = WORDS + encodeURIComponent(text);
  while (media.length > MAX_MEDIA) {
    characters.pop();
    media = WORDS + encodeURIComponent(`${characters.join("").trimEnd()}…`);
  }
  return { label: "say", media, source };
}

/** The label under which the page shows an expression: that of a robot's line has its words. */
export function shownLabel({ label, media }: { label: string; media: string }): string {
  if (!SPOKEN.includes(label) || !media.startsWith(WORDS)) return label;
  try {
    return `${SAYS}line ${decodeURIComponent(media.slice(WORDS.length))}`;
  } catch {
    return label;
  }
}

export function phraseGesture(phrase: Phrase): Gesture {
  return { label: `${SAYS}${phrase} ${PHRASES[phrase]}`, source: ExpressionSource.UNSPECIFIED };
}

/** The phrase of a label: its id if the page knows it, and its text; undefined for other labels. */
export function phraseOf(label: string): { readonly id: Phrase | undefined; readonly text: string } | undefined {
  if (!label.startsWith(SAYS)) return undefined;
  const space = label.indexOf(" ");
  const id = label.slice(SAYS.length, space < 0 ? undefined : space);
  const known = Object.keys(PHRASES).find((phrase) => phrase === id) as Phrase | undefined;
  return { id: known, text: space < 0 ? id : label.slice(space + 1) };
}

export function isLabel(label: string): label is Label {
  return LABELS.some((known) => known === label);
}
