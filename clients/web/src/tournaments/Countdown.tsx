// The time until a tournament starts by itself.

import { useEffect, useState } from "preact/hooks";
import { aheadMs } from "../api/server";
import { type Tournament, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import css from "./Countdown.module.css";

/** The countdown; null without a start time, and after the start. */
export function Countdown({ tournament }: { tournament: Tournament }) {
  const atMs = Number(tournament.settings?.startAtMs ?? 0n);
  const waits = tournament.state === TournamentState.OPEN && atMs > 0;
  const [browserMs, setBrowserMs] = useState(Date.now);
  const [ahead, setAhead] = useState(0);
  const nowMs = browserMs + ahead;
  useEffect(() => {
    if (!waits) return;
    // The server starts it, whose clock may not be that of this device.
    void aheadMs().then(setAhead);
    const timer = setInterval(() => setBrowserMs(Date.now()), 1_000);
    return () => clearInterval(timer);
  }, [waits]);
  if (!waits) return null;
  const words = t().tournaments.countdown;
  if (nowMs >= atMs) return <p class={css.countdown}>{words.due}</p>;
  return (
    <p class={css.countdown} data-part="countdown" role="timer">
      {words.label} <b class="number">{clockOf(atMs - nowMs)}</b>
    </p>
  );
}

/** A duration as days, hours, minutes and seconds, without leading zeros: `1 d 02:03:04`, `3:04`. */
export function clockOf(ms: number): string {
  const seconds = Math.ceil(ms / 1_000);
  const two = (count: number) => String(count).padStart(2, "0");
  const [days, hours, minutes] = [
    Math.floor(seconds / 86_400),
    Math.floor(seconds / 3_600) % 24,
    Math.floor(seconds / 60) % 60,
  ];
  const clock = `${two(minutes)}:${two(seconds % 60)}`;
  if (days > 0) return t().tournaments.countdown.days(days, `${two(hours)}:${clock}`);
  return hours > 0 ? `${hours}:${clock}` : clock.replace(/^0/, "");
}
