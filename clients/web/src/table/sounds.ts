// The sounds of the table, synthesized on demand. They can be turned off, and everything they
// signal is also visible and read out.

import { signal } from "@preact/signals";
import { recall, remember } from "../store";
import type { LogLine } from "./model/state";

/** Whether sounds are on; stored on this device. */
export const soundOn = signal(recall("sound") !== "off");

export function setSound(on: boolean): void {
  soundOn.value = on;
  remember("sound", on ? null : "off");
  if (on) play("play");
}

/** A tone: pitch in hertz, start and length in seconds, volume from 0 to 1. */
interface Tone {
  hertz: number;
  at: number;
  length: number;
  loud: number;
  wave: OscillatorType;
}

const tone = (hertz: number, at: number, length: number, loud: number, wave: OscillatorType = "sine"): Tone => {
  return { hertz, at, length, loud, wave };
};

/** When a card that is laid meets the board, in seconds; as in view/Board.module.css. */
const LAID_S = 0.33;

const SOUNDS = {
  /** Cards slide over the table, one after the other. */
  dealt: [0, 1, 2, 3, 4, 5].map((nth) => tone(150 + 12 * nth, nth * 0.09, 0.07, 0.2, "triangle")),
  /** A card is played. */
  play: [tone(190, 0, 0.09, 0.5, "triangle"), tone(95, 0.01, 0.12, 0.5)],
  pass: [tone(240, 0, 0.06, 0.16, "triangle")],
  pizzaDone: [tone(523, 0, 0.18, 0.2), tone(659, 0.09, 0.22, 0.2)],
  finished: [tone(659, 0, 0.14, 0.22), tone(784, 0.1, 0.14, 0.22), tone(1047, 0.2, 0.3, 0.22)],
  shiftOver: [
    tone(523, 0, 0.2, 0.22),
    tone(659, 0.14, 0.2, 0.22),
    tone(784, 0.28, 0.2, 0.22),
    tone(1047, 0.42, 0.45, 0.22),
  ],
  declared: [
    tone(392, 0, 0.14, 0.24, "triangle"),
    tone(523, 0.1, 0.14, 0.24, "triangle"),
    tone(784, 0.2, 0.5, 0.26, "triangle"),
  ],
  /** The rules do not allow it. */
  violated: [tone(330, 0, 0.16, 0.24, "triangle"), tone(247, 0.14, 0.3, 0.24, "triangle")],
  yourTurn: [tone(880, 0, 0.16, 0.24), tone(1175, 0.11, 0.3, 0.24)],
} as const satisfies Record<string, readonly Tone[]>;

export type Sound = keyof typeof SOUNDS;

let context: AudioContext | undefined;
/** The browser refuses to resume, for example during a call on a phone: then nothing is heard. */
const unheard = () => {};
/** How many tones sound or are about to. */
let sounding = 0;

/**
 * Plays a sound, if sounds are on and the reader has clicked or typed: browsers allow none before.
 * Between sounds the context is suspended: a running one computes silence, and keeps a phone awake.
 */
export function play(sound: Sound): void {
  if (!soundOn.peek() || typeof AudioContext === "undefined" || !navigator.userActivation?.hasBeenActive) return;
  context ??= new AudioContext();
  const audio = context;
  const moves = !matchMedia("(prefers-reduced-motion: reduce)").matches;
  const begin = audio.currentTime + (sound === "play" && moves ? LAID_S : 0);
  // Also if it is running: it may be about to be suspended.
  audio.resume().catch(unheard);
  for (const { hertz, at, length, loud, wave } of SOUNDS[sound]) {
    const start = begin + at;
    const oscillator = new OscillatorNode(audio, { type: wave, frequency: hertz });
    const gain = new GainNode(audio, { gain: 0 });
    gain.gain.setValueAtTime(0, start);
    gain.gain.linearRampToValueAtTime(loud * 0.5, start + 0.008);
    gain.gain.exponentialRampToValueAtTime(0.0001, start + length);
    sounding += 1;
    oscillator.onended = () => {
      sounding -= 1;
      if (sounding === 0) audio.suspend().catch(unheard);
    };
    oscillator.connect(gain).connect(audio.destination);
    oscillator.start(start);
    oscillator.stop(start + length + 0.02);
  }
}

/** The sound of an event. */
export function soundOf({ entry }: LogLine): Sound | undefined {
  switch (entry.kind) {
    case "played":
      return "play";
    case "passed":
      return "pass";
    case "dealt":
    case "declared":
    case "pizzaDone":
    case "violated":
    case "finished":
    case "shiftOver":
      return entry.kind;
    case "gameOver":
      return "shiftOver";
    default:
      return undefined;
  }
}
