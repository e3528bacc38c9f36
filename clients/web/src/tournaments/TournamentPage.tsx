// A tournament: state, standings, bracket or rounds. Participants of this device play here, its
// organiser starts it here. With ?wall it is shown as a wall view.

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { wordsOf } from "../api/faults";
import { type Tournament, TournamentFormat, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { languageOf, t } from "../i18n";
import { WhichOne } from "../lobby/WhichOne";
import { ButtonLink } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { isWall, type PageProps, pathOf, readdress } from "../router";
import { Bracket } from "./Bracket";
import { Countdown } from "./Countdown";
import { Entrants } from "./Entrants";
import {
  type FollowedTournament,
  type LiveTournament,
  MAX_GAMES,
  useConfidence,
  useGames,
  useTournament,
} from "./following";
import { hostedTournament } from "./hosting";
import { JoinTournament } from "./JoinTournament";
import { Organiser } from "./Organiser";
import { Participation } from "./Participation";
import { decidePlace, type HeldPlace, heldPlace, placeFromLink } from "./place";
import { Rounds } from "./Rounds";
import { Confidence, Standings, standingsTitle } from "./Standings";
import { isEnded, participantOf } from "./structure";
import tournamentsCss from "./Tournaments.module.css";
import { Wall } from "./Wall";
import { dealsWords, inShort, playWords, TournamentStateChip } from "./words";

/** The page. */
export function TournamentPage({ route }: PageProps<"tournament">) {
  // Before anything is requested: a private tournament is shown only to those who have a place.
  const { tournamentId } = route;
  const [brought, setBrought] = useState(() => placeFromLink(tournamentId));
  const followed = useTournament(tournamentId);
  const held = brought && heldPlace(tournamentId);
  if (brought && held) {
    const decide = (chosen: HeldPlace | null) => {
      decidePlace(tournamentId, chosen);
      setBrought(null);
    };
    return <WhichOne {...{ held, brought, decide }} words={t().tournaments.part.which} />;
  }
  return followed ? <Followed followed={followed} wall={isWall(route)} /> : null;
}

function Followed({ followed, wall }: { followed: FollowedTournament; wall: boolean }) {
  const { live, following } = followed;
  const { link, fault } = following;
  if (link.value === "failed") return <Notice kind="fault">{fault.value && wordsOf(fault.value)}</Notice>;
  if (!live.value) return <p class="soft">{t().common.loading}</p>;
  const lost = link.value === "lost" && <Notice kind="fault">{t().tournaments.part.lost}</Notice>;
  if (wall) {
    return (
      <>
        {lost}
        <Wall live={live.value} />
      </>
    );
  }
  return (
    <div class={tournamentsCss.tournament}>
      {lost}
      <Visited live={live.value} />
    </div>
  );
}

/** The page for a visitor or a participant. */
function Visited({ live }: { live: LiveTournament }) {
  const { tournament } = live;
  const { tournamentId } = tournament;
  const [held, setHeld] = useState<HeldPlace | null>(() => heldPlace(tournamentId));
  const open = tournament.state === TournamentState.OPEN;
  const isInvited = new URLSearchParams(location.search).get("code");
  const arrive = () => {
    // The link has been used: a reload shows the place that was taken.
    readdress(languageOf(location.search));
    setHeld(heldPlace(tournamentId));
  };
  const lost = held && lostPlace(tournament, held);
  if (held && lost) {
    return (
      <Overview live={live} mine={lost === "left" ? held.participant : undefined}>
        <Notice kind="hint">{t().tournaments.part[lost]}</Notice>
        <Organiser live={live} />
        {open && <JoinTournament tournament={tournament} onJoined={arrive} />}
      </Overview>
    );
  }
  if (held) {
    return (
      <Participation held={held} live={live} onLeft={() => setHeld(heldPlace(tournamentId))}>
        <Overview live={live} mine={held.participant}>
          <Organiser live={live} />
        </Overview>
      </Participation>
    );
  }
  return (
    <Overview live={live} mine={undefined}>
      <Organiser live={live} />
      {open && <JoinTournament tournament={tournament} onJoined={arrive} />}
      {!open && isInvited && !isEnded(tournament) && (
        <Notice kind="hint">{t().faults.byReason.TOURNAMENT_STARTED}</Notice>
      )}
    </Overview>
  );
}

interface OverviewProps {
  live: LiveTournament;
  /** The participant of this device. */
  mine: number | undefined;
  /** Shown between heading and standings. */
  children?: ComponentChildren;
}

function Overview({ live, mine, children }: OverviewProps) {
  const { tournament, standings } = live;
  const words = t().tournaments;
  const games = useGames(live);
  const confidence = useConfidence(live);
  const knockout = tournament.settings?.format === TournamentFormat.KNOCKOUT;
  const deals = dealsWords(tournament);
  return (
    <>
      <header class={tournamentsCss.head}>
        <div>
          <h1>{tournament.settings?.name}</h1>
          <p>
            <TournamentStateChip tournament={tournament} /> <span class="soft">{inShort(tournament)}</span>
          </p>
          {tournament.round === 0 && !isEnded(tournament) && (
            <ul class={tournamentsCss.play}>
              {playWords(tournament).map((words) => (
                <li key={words}>{words}</li>
              ))}
            </ul>
          )}
          {deals && <p class="soft small">{deals}</p>}
          <Countdown tournament={tournament} />
        </div>
        <div class={tournamentsCss.links}>
          {tournament.round > 0 && (
            <ButtonLink href={pathOf({ page: "results", tournamentId: tournament.tournamentId })}>
              {words.results.open}
            </ButtonLink>
          )}
          <ButtonLink href={wallOf(tournament)}>{words.wall.open}</ButtonLink>
        </div>
      </header>
      {children}
      <section class={`sheet ${tournamentsCss.part}`}>
        <h2>{tournament.round === 0 ? words.standings.field : standingsTitle(tournament)}</h2>
        {tournament.round === 0 ? (
          <Entrants tournament={tournament} mine={mine} />
        ) : (
          <Standings tournament={tournament} standings={standings} mine={mine} />
        )}
      </section>
      <Confidence tournament={tournament} confidence={confidence} />
      {tournament.round > 0 && (
        <section class={tournamentsCss.part}>
          <h2>{knockout ? words.games.bracket : words.games.title}</h2>
          {knockout ? (
            <Bracket tournament={tournament} games={games} mine={mine} />
          ) : (
            <Rounds tournament={tournament} games={games} mine={mine} />
          )}
          {games.length === MAX_GAMES && <p class="soft">{words.games.truncated(MAX_GAMES)}</p>}
        </section>
      )}
    </>
  );
}

/** The address of the wall view; on the organiser's device with the code, so that any screen shows it. */
function wallOf({ tournamentId, state }: Tournament): string {
  const code = state === TournamentState.OPEN ? hostedTournament(tournamentId)?.joinCode : undefined;
  const path = `${pathOf({ page: "tournament", tournamentId })}?wall`;
  return code ? `${path}&code=${encodeURIComponent(code)}` : path;
}

/** Whether the place of this device was given up, or somebody else has it. */
function lostPlace(tournament: Tournament, { participant, name }: HeldPlace): "left" | "replaced" | null {
  const here = participantOf(tournament, participant);
  if (!here || isEnded(tournament)) return null;
  if (here.withdrawn) return "left";
  return here.name !== name && here.former.some((former) => former.name === name) ? "replaced" : null;
}
