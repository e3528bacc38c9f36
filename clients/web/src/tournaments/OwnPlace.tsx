// What a participant can do about its own place: postpone a game that is due, leave the tournament,
// and choose between the place of this device and another one that a link brings.

import { type TournamentGame, TournamentGameState, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import joinCss from "../lobby/Join.module.css";
import { useAttempt } from "../parts/attempt";
import { Button } from "../parts/Button";
import { ConfirmButton } from "../parts/ConfirmButton";
import { Notice } from "../parts/Notice";
import css from "./ByHand.module.css";
import type { LiveTournament } from "./following";
import { useGames } from "./following";
import { forgetPlace, type HeldPlace, leaveTournament, postponeOwnGame } from "./place";
import { seatOf } from "./structure";

interface OwnPlaceProps {
  held: HeldPlace;
  live: LiveTournament;
  /** After leaving before the start: the device has no place any more. */
  onLeft: () => void;
}

/** The buttons; null after the end. */
export function OwnPlace({ held, live, onLeft }: OwnPlaceProps) {
  const { tournamentId, state } = live.tournament;
  const words = t().tournaments.part;
  const open = state === TournamentState.OPEN;
  if (!open && state !== TournamentState.PLAYING) return null;
  const leave = async () => {
    await leaveTournament(tournamentId, held);
    if (open) forgetPlace(tournamentId);
    onLeft();
  };
  return (
    <div class={css.row} data-part="own-place">
      {!open && <Postpone held={held} live={live} />}
      <ConfirmButton label={words.leave} confirm={words.leaveDo} act={leave}>
        {open ? words.leaveOpen : words.leavePlaying}
      </ConfirmButton>
    </div>
  );
}

/** Postpones the participant's next game, if it is due and it may. */
function Postpone({ held, live }: Omit<OwnPlaceProps, "onLeft">) {
  const { tournamentId } = live.tournament;
  const words = t().tournaments.part;
  const { busy, fault, run } = useAttempt();
  const next = nextOf(useGames(live), held.participant);
  if (!next) return null;
  const act = () => postponeOwnGame(tournamentId, held, next.game).then(() => false);
  return (
    <>
      <Button busy={busy} onClick={() => run(act)}>
        {words.postpone(words.place(next.round, next.table))}
      </Button>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </>
  );
}

interface WhichPlaceProps {
  held: HeldPlace;
  brought: HeldPlace;
  /** The place from the link, or null to stay with the own one. */
  decide: (chosen: HeldPlace | null) => void;
}

/** Asks which place to use when a link brings one to a device that already has another. */
export function WhichPlace({ held, brought, decide }: WhichPlaceProps) {
  const words = t().tournaments.part.which;
  return (
    <section class={`sheet ${joinCss.page}`} data-part="which-place">
      <h1>{words.title}</h1>
      <p>{words.text(held.name, brought.name)}</p>
      <p class="soft">{words.lost(held.name)}</p>
      <Button look="main" onClick={() => decide(null)}>
        {words.stay(held.name)}
      </Button>
      <Button onClick={() => decide(brought)}>{words.take(brought.name)}</Button>
    </section>
  );
}

/** The first due game of a participant. */
export function nextOf(games: readonly TournamentGame[], participant: number): TournamentGame | undefined {
  return games.find((game) => game.state === TournamentGameState.DUE && seatOf(game, participant) !== undefined);
}
