// The line that says whom the game waits for: how long it still waits for a seat that is away, how
// long it has waited for one that is connected.

import { useEffect, useState } from "preact/hooks";
import { t } from "../../i18n";
import { type AwaitedSeat, awaitedSeconds } from "../model/awaited";
import type { TableState } from "../model/state";
import { distinctName } from "../words";

const REFRESH_MS = 250;

interface AwaitedLineProps {
  table: TableState;
  awaited: AwaitedSeat;
}

export function AwaitedLine({ table, awaited }: AwaitedLineProps) {
  const [nowMs, setNowMs] = useState(() => performance.now());
  useEffect(() => {
    const timer = setInterval(() => setNowMs(performance.now()), REFRESH_MS);
    return () => clearInterval(timer);
  }, []);
  const seconds = awaitedSeconds(awaited, Math.max(nowMs, awaited.receivedAtMs));
  const words = t().table.now;
  const name = distinctName(table, awaited.seat);
  const line = awaited.away ? words.awaitedAway(name, seconds) : seconds !== undefined && words.awaited(name, seconds);
  if (!line) return null;
  return (
    <p class="number" data-part="awaited" data-away={awaited.away ? "" : undefined}>
      {line}
    </p>
  );
}
