// A participant's part of a tournament's page: status and next game; during a game, the table in
// place of the page, unless the participant goes back to the page: to leave, or to organise.

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import { wordsOf } from "../api/faults";
import { TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { Button } from "../parts/Button";
import { Notice } from "../parts/Notice";
import { useStarted } from "../parts/started";
import type { Acting } from "../table/acting";
import { useAttention } from "../table/attention";
import { isOver } from "../table/model/state";
import { Seated } from "../table/Seated";
import { Tool } from "../table/view/Tools";
import { refusedWords } from "../table/words";
import type { LiveTournament } from "./following";
import { OwnPlace } from "./OwnPlace";
import { type Participation as Part, startParticipation } from "./participation";
import type { HeldPlace } from "./place";
import { gameOf, isEnded } from "./structure";

interface ParticipationProps {
  held: HeldPlace;
  live: LiveTournament;
  /** After the participant has left. */
  onLeft: () => void;
  /** The rest of the page, shown between games. */
  children: ComponentChildren;
}

/** The page for a participant. */
export function Participation({ held, live, onLeft, children }: ParticipationProps) {
  // The stream reports games of others that end only after the participant's own game.
  const start = () => (isEnded(live.tournament) ? undefined : startParticipation(held.ticket));
  const part = useStarted(start, held.ticket);
  const game = part?.game.value;
  const [left, setLeft] = useState<Acting | undefined>(undefined);
  useEffect(() => {
    if (game) announce(t().tournaments.part.begins(placeWords(live, game)));
  }, [game]);
  const banner = part && <Banner part={part} />;
  // The tournament was closed during the game, or the game has ended while the connection was lost.
  const gone = game && !isOverThere(game) && (part?.presence.value === "over" || isRefused(game));
  if (game && game !== left && !gone) {
    return (
      <Seated
        acting={game}
        banner={
          <>
            {banner}
            <GameBanner game={game} />
          </>
        }
        tools={
          !isOverThere(game) && (
            <Tool label={t().tournaments.results.back} onClick={() => setLeft(game)}>
              <path d="M7 4h10v5a5 5 0 0 1-10 0ZM7 5H4v2a3 3 0 0 0 3 3M17 5h3v2a3 3 0 0 1-3 3M12 14v4M8 20h8" />
            </Tool>
          )
        }
        nextStep={
          <Button look="main" onClick={() => setLeft(game)}>
            {t().tournaments.part.back}
          </Button>
        }
      />
    );
  }
  return (
    <>
      {banner}
      <OwnState held={held} live={live}>
        {game && !gone && !isOverThere(game) && <ToGame game={game} onClick={() => setLeft(undefined)} />}
        <OwnPlace {...{ held, live, onLeft }} />
      </OwnState>
      {children}
    </>
  );
}

/** The participant's status, and what happens next. */
function OwnState(props: { held: HeldPlace; live: LiveTournament; children: ComponentChildren }) {
  const words = t().tournaments.part;
  const { state, paused } = props.live.tournament;
  return (
    <Notice kind="good">
      <strong>{words.you(props.held.name)}</strong>{" "}
      {state === TournamentState.OPEN
        ? words.waitOpen
        : state === TournamentState.PLAYING
          ? paused
            ? words.waitPaused
            : words.waitNext
          : words.over}{" "}
      {props.children}
    </Notice>
  );
}

/** The way to the own game, which calls as the table does. */
function ToGame({ game, onClick }: { game: Acting; onClick: () => void }) {
  const { table, decision } = game.live.value;
  useAttention(table.roomId, decision, true);
  return (
    <>
      {decision && <strong role="alert">{t().table.now.yourTurn}</strong>}{" "}
      <Button look="main" onClick={onClick}>
        {t().tournaments.part.toGame}
      </Button>
    </>
  );
}

/** The state of the connection, if there is something to say. */
function Banner({ part }: { part: Part }) {
  const words = t().tournaments.part;
  const { link, fault } = part.following.value;
  const failed = link.value === "failed" && fault.value;
  if (failed) return <Notice kind="fault">{wordsOf(failed)}</Notice>;
  const refusal = part.refusal.value;
  if (refusal) return <Notice kind="fault">{refusedWords(refusal)}</Notice>;
  if (part.presence.value === "superseded") {
    return (
      <Notice kind="hint">
        {words.superseded} <Button onClick={part.takeBack}>{words.takeBack}</Button>
      </Notice>
    );
  }
  return link.value === "lost" ? <Notice kind="fault">{t().table.link.lost}</Notice> : null;
}

/** During a game: takes the seat back from a substitute. */
function GameBanner({ game }: { game: Acting }) {
  const { substituted } = game.live.value;
  if (!substituted || isOverThere(game)) return null;
  return (
    <Notice kind="hint">
      {t().table.link.substituted}{" "}
      <Button look="main" onClick={game.resume}>
        {t().table.link.resume}
      </Button>
    </Notice>
  );
}

function isOverThere(game: Acting): boolean {
  return isOver(game.live.value.table);
}

/** Whether the server does not know the seat any more. */
function isRefused(game: Acting): boolean {
  return game.live.value.attachment.kind === "refused";
}

function placeWords({ games }: LiveTournament, game: Acting): string {
  const { roomName, gameId } = game.live.peek().table;
  const found = gameOf(games, gameId);
  return found ? t().tournaments.part.place(found.round, found.table) : roomName;
}
