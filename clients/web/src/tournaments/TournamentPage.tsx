// A tournament: state, standings, bracket or rounds. Participants of this device play here, its
// organiser starts it here. With ?wall it is shown as a wall view.

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { tournamentApi } from "../api/client";
import { wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import { type Tournament, TournamentFormat, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { languageOf, t } from "../i18n";
import { canonical } from "../lobby/seat";
import { WhichOne } from "../lobby/WhichOne";
import { ButtonLink } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { isWall, navigateFromHere, type PageProps, pathOf, readdress } from "../router";
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

/** Polling interval of a private tournament before joining, milliseconds. */
const INVITED_EVERY_MS = 4_000;

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
  return followed ? <Followed followed={followed} tournamentId={tournamentId} wall={isWall(route)} /> : null;
}

interface FollowedProps {
  followed: FollowedTournament;
  tournamentId: string;
  wall: boolean;
}

function Followed({ followed, tournamentId, wall }: FollowedProps) {
  const { live, following } = followed;
  const { link, fault } = following;
  if (link.value === "failed") {
    const code = invitedWith();
    // A private tournament is followed only by its participants. Its code shows it to those who may join.
    if (!wall && code && fault.value?.reason === "TOURNAMENT_UNKNOWN") return <Invited {...{ tournamentId, code }} />;
    return <Notice kind="fault">{fault.value && wordsOf(fault.value)}</Notice>;
  }
  if (!live.value) return <p class="soft">{t().common.loading}</p>;
  const lost = link.value === "lost" && <Notice kind="fault">{t().table.link.lost}</Notice>;
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

/** The join code of the address; null without one. */
function invitedWith(): string | null {
  return new URLSearchParams(location.search).get("code");
}

/** A private tournament, shown to somebody who is invited. */
function Invited({ tournamentId, code }: { tournamentId: string; code: string }) {
  const ask = async (signal: AbortSignal) => {
    // The code alone: with the id of a private tournament, the server would not say that the code is wrong.
    return (await tournamentApi.getTournament({ joinCode: canonical(code) }, { signal })).tournament;
  };
  const { value: tournament, fault } = usePolled(ask, INVITED_EVERY_MS, code);
  const [navigate] = useState(navigateFromHere);
  const reasons = t().faults.byReason;
  if (fault && (!tournament || fault.reason === "JOIN_CODE_WRONG")) {
    return <Notice kind="fault">{wordsOf(fault)}</Notice>;
  }
  if (!tournament) return <p class="soft">{t().common.loading}</p>;
  if (tournament.tournamentId !== tournamentId) return <Notice kind="fault">{reasons.TOURNAMENT_UNKNOWN}</Notice>;
  // The page opens again, with the secret of the place.
  const arrive = () =>
    navigate({ page: "tournament", tournamentId }, { replace: true, search: languageOf(location.search) });
  return (
    <div class={tournamentsCss.tournament}>
      <Head tournament={tournament} />
      {tournament.state === TournamentState.OPEN ? (
        <JoinTournament tournament={tournament} onJoined={arrive} />
      ) : (
        !isEnded(tournament) && <Notice kind="hint">{reasons.TOURNAMENT_STARTED}</Notice>
      )}
    </div>
  );
}

/** The page for a visitor or a participant. */
function Visited({ live }: { live: LiveTournament }) {
  const { tournament } = live;
  const { tournamentId } = tournament;
  const [held, setHeld] = useState<HeldPlace | null>(() => heldPlace(tournamentId));
  const open = tournament.state === TournamentState.OPEN;
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
      {!open && invitedWith() && !isEnded(tournament) && (
        <Notice kind="hint">{t().faults.byReason.TOURNAMENT_STARTED}</Notice>
      )}
    </Overview>
  );
}

/** Name, state and how it is played, with links to other views. */
function Head({ tournament, children }: { tournament: Tournament; children?: ComponentChildren }) {
  const deals = dealsWords(tournament);
  return (
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
      <div class={tournamentsCss.links}>{children}</div>
    </header>
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
  return (
    <>
      <Head tournament={tournament}>
        {tournament.round > 0 && (
          <ButtonLink href={pathOf({ page: "results", tournamentId: tournament.tournamentId })}>
            {words.results.open}
          </ButtonLink>
        )}
        <ButtonLink href={wallOf(tournament)}>{words.wall.open}</ButtonLink>
      </Head>
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
