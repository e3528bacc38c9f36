// A room as spectators see it: public events, with hands if the room shows them.

import { wordsOf } from "../api/faults";
import { t } from "../i18n";
import { ErrorPage } from "../parts/ErrorPage";
import { Notice } from "../parts/Notice";
import { useStarted } from "../parts/started";
import type { PageProps } from "../router";
import { useAnnounced } from "./following";
import { type Spectating, startSpectating } from "./spectating";
import { Caption } from "./view/Caption";
import { TableView } from "./view/TableView";
import { WaitingRoom } from "./view/WaitingRoom";

/** The page. */
export function WatchPage({ route }: PageProps<"watch">) {
  const spectating = useStarted(() => startSpectating(route.roomId), route.roomId);
  return spectating ? <Watched spectating={spectating} /> : <p class="soft">{t().common.loading}</p>;
}

function Watched({ spectating }: { spectating: Spectating }) {
  const table = spectating.table.value;
  const { link, fault } = spectating.following;
  useAnnounced(table, undefined, undefined);
  if (link.value === "failed" && fault.value) return <ErrorPage title={t().table.title} words={wordsOf(fault.value)} />;
  if (table.seats.length === 0) return <p class="soft">{t().common.loading}</p>;
  const banner = link.value === "lost" ? <Notice kind="fault">{t().table.link.lost}</Notice> : null;
  if (table.phase === "waiting") return <WaitingRoom table={table} own={undefined} banner={banner} />;
  return (
    <TableView
      table={table}
      own={undefined}
      awaited={spectating.awaited.value}
      banner={banner}
      caption={<Caption table={table} watched />}
    />
  );
}
