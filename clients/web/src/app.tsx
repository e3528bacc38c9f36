// Draws the page that the address names inside the common frame. Each page's code is loaded on the
// first visit, so that the lobby does not wait for the table.

import type { ComponentType } from "preact";
import { useEffect, useErrorBoundary, useLayoutEffect, useState } from "preact/hooks";
import { reloadsForNewVersion } from "./api/update";
import { t } from "./i18n";
import { Button } from "./parts/Button";
import { ErrorPage } from "./parts/ErrorPage";
import { Layout } from "./parts/Layout";
import { Notice } from "./parts/Notice";
import { type PageProps, type Route, restoreScroll, route, startRouter } from "./router";

type Pages = { [Name in Route["page"]]: () => Promise<ComponentType<PageProps<Name>>> };

const pages: Pages = {
  lobby: async () => (await import("./lobby/Lobby")).Lobby,
  new: async () => (await import("./lobby/NewRoom")).NewRoom,
  join: async () => (await import("./lobby/Join")).Join,
  room: async () => (await import("./table/RoomPage")).RoomPage,
  attend: async () => (await import("./attend/AttendPage")).AttendPage,
  watch: async () => (await import("./table/WatchPage")).WatchPage,
  replay: async () => (await import("./replay/ReplayPage")).ReplayPage,
  tournaments: async () => (await import("./tournaments/TournamentsPage")).TournamentsPage,
  newTournament: async () => (await import("./tournaments/NewTournament")).NewTournament,
  tournament: async () => (await import("./tournaments/TournamentPage")).TournamentPage,
  results: async () => (await import("./tournaments/ResultsPage")).ResultsPage,
  study: async () => (await import("./studies/StudyPage")).StudyPage,
  studies: async () => (await import("./studies/StudiesPage")).StudiesPage,
  newStudy: async () => (await import("./studies/NewStudyPage")).NewStudyPage,
  ownStudy: async () => (await import("./studies/OwnStudyPage")).OwnStudyPage,
  leaderboard: async () => (await import("./people/LeaderboardPage")).LeaderboardPage,
  person: async () => (await import("./people/PersonPage")).PersonPage,
  tutorial: async () => (await import("./tutorial/TutorialPage")).TutorialPage,
  rules: async () => (await import("./rules/RulesPage")).RulesPage,
  unknown: async () => (await import("./parts/NotFound")).NotFound,
};

/**
 * A loaded page and its route. Each visit has a number of its own, so that visiting a page again
 * starts it afresh.
 */
interface Shown {
  visit: number;
  route: Route;
  Page: ComponentType<{ route: Route }>;
}

/** The root component. */
export function App() {
  useEffect(startRouter, []);
  const here = route.value;
  const [shown, setShown] = useState<Shown | null>(null);
  const [failed, setFailed] = useState(false);
  useEffect(() => {
    let current = true;
    setFailed(false);
    // `pages` pairs each page with its route; TypeScript cannot follow that through an index.
    const load = pages[here.page] as () => Promise<Shown["Page"]>;
    load().then(
      (Page) => current && setShown((before) => ({ visit: (before?.visit ?? 0) + 1, route: here, Page })),
      async () => {
        const reloads = await reloadsForNewVersion();
        if (current && !reloads) setFailed(true);
      },
    );
    return () => {
      current = false;
    };
  }, [here]);
  useLayoutEffect(restoreScroll, [shown?.visit]);
  return (
    <Layout here={here}>
      {failed ? (
        <Notice kind="fault">{t().common.pageNotLoaded}</Notice>
      ) : (
        shown && <Guarded key={shown.visit} {...shown} />
      )}
    </Layout>
  );
}

/** A page; where an exception ends it, what to do about that. */
function Guarded({ Page, route }: Shown) {
  const [error] = useErrorBoundary((thrown) => console.error(thrown));
  if (error === undefined) return <Page route={route} />;
  const words = t().common.pageBroken;
  return (
    <ErrorPage title={words.title} words={words.text}>
      <Button look="main" onClick={() => location.reload()}>
        {words.reload}
      </Button>
    </ErrorPage>
  );
}
