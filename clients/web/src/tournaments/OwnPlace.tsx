// What a participant can do about its own place: postpone a game that is due, leave the tournament,
// and play on another device.

import { tournamentApi } from "../api/client";
import { type TournamentGame, TournamentGameState, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { MoveToDevice } from "../lobby/MoveToDevice";
import { ActionButton } from "../parts/ActionButton";
import { ConfirmButton } from "../parts/ConfirmButton";
import css from "./ByHand.module.css";
import type { LiveTournament } from "./following";
import { useGames } from "./following";
import { forgetPlace, type HeldPlace, linkToPlace } from "./place";
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
    await tournamentApi.withdrawParticipant({ tournamentId, ticket: held.ticket });
    if (open) forgetPlace(tournamentId);
    onLeft();
  };
  return (
    <div class={css.row} data-part="own-place">
      {!open && <Postpone held={held} live={live} />}
      <MoveToDevice address={linkToPlace(tournamentId, held)} />
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
  const next = nextOf(useGames(live), held.participant);
  if (!next) return null;
  const act = () => tournamentApi.postponeGame({ tournamentId, ticket: held.ticket, game: next.game });
  return (
    <ActionButton look="plain" again act={act}>
      {words.postpone(words.place(next.round, next.table))}
    </ActionButton>
  );
}

/** The first due game of a participant. */
export function nextOf(games: readonly TournamentGame[], participant: number): TournamentGame | undefined {
  return games.find((game) => game.state === TournamentGameState.DUE && seatOf(game, participant) !== undefined);
}
