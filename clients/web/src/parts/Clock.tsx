// The time left for a decision as a shrinking bar and in seconds: the decision's own time, then the
// seat's time bank. The server's clock decides; this one extrapolates from what the server sent.

import { useEffect, useState } from "preact/hooks";
import { t } from "../i18n";
import { announce } from "./Announcer";
import css from "./Clock.module.css";

interface ClockProps {
  /** Milliseconds left for the decision at `sinceMs`. */
  timeLeftMs: number;
  /** Milliseconds left in the time bank at `sinceMs`. */
  bankLeftMs: number;
  /** The reference time, by performance.now(). */
  sinceMs: number;
  /** Milliseconds of a full decision, for the length of the bar. */
  wholeMs: number;
}

const REFRESH_MS = 200;
/** Total seconds left at which the clock warns. */
const HURRY_SECONDS = 10;

export function Clock({ timeLeftMs, bankLeftMs, sinceMs, wholeMs }: ClockProps) {
  const [nowMs, setNowMs] = useState(() => performance.now());
  useEffect(() => {
    const timer = setInterval(() => setNowMs(performance.now()), REFRESH_MS);
    return () => clearInterval(timer);
  }, []);
  const passedMs = Math.max(0, nowMs - sinceMs);
  const ownMs = Math.max(0, timeLeftMs - passedMs);
  const bankMs = Math.max(0, bankLeftMs - Math.max(0, passedMs - timeLeftMs));
  const leftSeconds = Math.ceil((ownMs + bankMs) / 1000);
  const hurry = leftSeconds <= HURRY_SECONDS;
  useEffect(() => {
    if (hurry && leftSeconds > 0) announce(t().table.clock.hurry(leftSeconds));
  }, [hurry]);
  const words = t().table.clock;
  const onBank = ownMs === 0;
  const share = onBank ? (bankLeftMs > 0 ? bankMs / bankLeftMs : 0) : ownMs / Math.max(1, wholeMs, timeLeftMs);
  return (
    <div
      class={`${css.clock} ${onBank ? css.bank : ""} ${hurry ? css.hurry : ""}`}
      data-part="clock"
      role="timer"
      aria-label={words.label}
    >
      <span class={css.bar} aria-hidden="true">
        <span style={{ transform: `scaleX(${Math.min(1, share).toFixed(3)})` }} />
      </span>
      <span class={`${css.words} number`}>
        <strong>{clockTime(onBank ? bankMs : ownMs)}</strong>{" "}
        <span class="soft">{onBank ? words.onBank : bankMs > 0 ? words.bank(clockTime(bankMs)) : ""}</span>
      </span>
    </div>
  );
}

/** Seconds, or minutes and seconds above 99 s. */
function clockTime(leftMs: number): string {
  const seconds = Math.ceil(leftMs / 1000);
  if (seconds < 100) return `${seconds}\u00a0s`;
  return `${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, "0")}`;
}
