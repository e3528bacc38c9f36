// The page that the address names, inside the frame that all pages have. Pages are loaded when they are first gone to, so that the
// lobby does not wait for the table.

import type { ComponentType } from "preact";
import { useEffect, useState } from "preact/hooks";
import { t } from "./i18n";
import { Layout } from "./parts/Layout";
import { Notice } from "./parts/Notice";
import { type Route, route, startRouter } from "./router";

/** What every page gets: its own route. */
export interface PageProps<Name extends Route["page"]> {
  route: Extract<Route, { page: Name }>;
}

type Pages = { [Name in Route["page"]]: () => Promise<ComponentType<PageProps<Name>>> };

const pages: Pages = {
  lobby: async () => (await import("./lobby/Lobby")).Lobby,
  new: async () => (await import("./lobby/NewRoom")).NewRoom,
  join: async () => (await import("./lobby/Join")).Join,
  room: async () => (await import("./table/RoomPage")).RoomPage,
  watch: async () => (await import("./table/WatchPage")).WatchPage,
  replay: async () => (await import("./replay/ReplayPage")).ReplayPage,
  tournaments: async () => (await import("./tournaments/TournamentsPage")).TournamentsPage,
  newTournament: async () => (await import("./tournaments/NewTournament")).NewTournament,
  tournament: async () => (await import("./tournaments/TournamentPage")).TournamentPage,
  leaderboard: async () => (await import("./people/LeaderboardPage")).LeaderboardPage,
  person: async () => (await import("./people/PersonPage")).PersonPage,
  tutorial: async () => (await import("./tutorial/TutorialPage")).TutorialPage,
  unknown: async () => (await import("./parts/NotFound")).NotFound,
};

/** A page that has been loaded, with the route that it is for. Going to a page again begins it anew: so each has a number. */
interface Shown {
  visit: number;
  route: Route;
  Page: ComponentType<{ route: Route }>;
}

/** Everything. */
export function App() {
  useEffect(startRouter, []);
  const here = route.value;
  const [shown, setShown] = useState<Shown | null>(null);
  const [failed, setFailed] = useState(false);
  useEffect(() => {
    let current = true;
    setFailed(false);
    // The table of pages says that page and route belong together; TypeScript cannot follow that through an index.
    const load = pages[here.page] as () => Promise<Shown["Page"]>;
    load().then(
      (Page) => current && setShown((before) => ({ visit: (before?.visit ?? 0) + 1, route: here, Page })),
      () => current && setFailed(true),
    );
    return () => {
      current = false;
    };
  }, [here]);
  return (
    <Layout here={here}>
      {failed ? (
        <Notice kind="fault">{t().common.pageNotLoaded}</Notice>
      ) : (
        shown && <shown.Page key={shown.visit} route={shown.route} />
      )}
    </Layout>
  );
}
