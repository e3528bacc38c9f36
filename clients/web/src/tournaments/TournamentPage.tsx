// One tournament, as it goes on: where it stands, the standings, the bracket or the rounds. Who has joined here plays here. With ?wall it is
// drawn for a wall.

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { wordsOf } from "../api/faults";
import type { PageProps } from "../app";
import { TournamentFormat, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import { Bracket } from "./Bracket";
import { isEnded } from "./course";
import { type FollowedTournament, type Heard, MAX_GAMES, useConfidence, useGames, useTournament } from "./following";
import { JoinTournament } from "./JoinTournament";
import { Participation } from "./Participation";
import { type HeldPlace, heldPlace } from "./place";
import { Rounds } from "./Rounds";
import { Confidence, Standings } from "./Standings";
import { Wall } from "./Wall";
import { dealsWords, inShort, StateChip } from "./words";
import "./tournaments.css";

/** The page. */
export function TournamentPage({ route }: PageProps<"tournament">) {
  const followed = useTournament(route.tournamentId);
  return followed ? <Followed followed={followed} /> : null;
}

function Followed({ followed }: { followed: FollowedTournament }) {
  const { heard, following } = followed;
  const { link, fault } = following;
  if (link.value === "failed") return <Notice kind="fault">{fault.value && wordsOf(fault.value)}</Notice>;
  if (!heard.value) return <p class="soft">{t().common.loading}</p>;
  const lost = link.value === "lost" && <Notice kind="fault">{t().tournaments.part.lost}</Notice>;
  if (new URLSearchParams(location.search).has("wall")) {
    return (
      <>
        {lost}
        <Wall heard={heard.value} />
      </>
    );
  }
  return (
    <div class="tournament">
      {lost}
      <Visited heard={heard.value} />
    </div>
  );
}

/** The page for a visitor, or for a participant. */
function Visited({ heard }: { heard: Heard }) {
  const { tournament } = heard;
  const [held, setHeld] = useState<HeldPlace | null>(() => heldPlace(tournament.tournamentId));
  if (held) {
    return (
      <Participation held={held} heard={heard}>
        <Course heard={heard} mine={held.participant} />
      </Participation>
    );
  }
  return (
    <Course heard={heard} mine={undefined}>
      {tournament.state === TournamentState.OPEN && <JoinTournament tournament={tournament} onJoined={setHeld} />}
    </Course>
  );
}

interface CourseProps {
  heard: Heard;
  /** The participant that this device plays for. */
  mine: number | undefined;
  /** Between the head and the standings. */
  children?: ComponentChildren;
}

function Course({ heard, mine, children }: CourseProps) {
  const { tournament, standings } = heard;
  const words = t().tournaments;
  const games = useGames(heard);
  const confidence = useConfidence(heard);
  const knockout = tournament.settings?.format === TournamentFormat.KNOCKOUT;
  const deals = dealsWords(tournament);
  return (
    <>
      <header class="tournament-head">
        <div>
          <h1>{tournament.settings?.name}</h1>
          <p>
            <StateChip tournament={tournament} /> <span class="soft">{inShort(tournament)}</span>
          </p>
          {deals && <p class="soft small">{deals}</p>}
        </div>
        <ButtonLink href={`${pathOf({ page: "tournament", tournamentId: tournament.tournamentId })}?wall`}>
          {words.wall.open}
        </ButtonLink>
      </header>
      {children}
      <section class="sheet tournament-part">
        <h2>{standingsTitle(heard)}</h2>
        {standings.length === 0 ? (
          <p class="soft">{words.standings.none}</p>
        ) : (
          <Standings tournament={tournament} standings={standings} mine={mine} />
        )}
      </section>
      <Confidence tournament={tournament} confidence={confidence} />
      {tournament.state !== TournamentState.OPEN && (
        <section class="tournament-part">
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

function standingsTitle({ tournament }: Heard): string {
  const words = t().tournaments.standings;
  if (tournament.state === TournamentState.OPEN) return words.field;
  return isEnded(tournament) ? words.final : words.title;
}
