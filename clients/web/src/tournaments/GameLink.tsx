// A link to a game of a tournament: live while it runs, as a replay once it counts.

import { type Tournament, type TournamentGame, TournamentGameState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { pathOf } from "../router";

interface GameLinkProps {
  tournament: Tournament;
  game: TournamentGame;
  /** Whether the pairing has several games: then each link has its number. */
  several: boolean;
}

/** A link to the game, or its state. */
export function GameLink({ tournament, game, several }: GameLinkProps) {
  const words = t().tournaments;
  const number = several ? ` ${game.number}` : "";
  const which = words.games.of(`${words.round(game.round)}, ${words.table(game.table)}`, game.number);
  const label = <span class="visually-hidden"> {which}</span>;
  switch (game.state) {
    case TournamentGameState.COUNTED:
      return (
        <a class="own-line" href={pathOf({ page: "replay", gameId: game.gameId })}>
          {t().lobby.rooms.replay}
          {number}
          {label}
        </a>
      );
    case TournamentGameState.PLAYING:
      return tournament.settings?.policy?.spectators && game.roomId !== "" ? (
        <a class="own-line" href={pathOf({ page: "watch", roomId: game.roomId })}>
          <span aria-hidden="true">▶{"\u00a0"}</span>
          {t().lobby.rooms.watch}
          {number}
          {label}
        </a>
      ) : (
        <span>
          <span aria-hidden="true">▶{"\u00a0"}</span>
          {words.states.playing}
          {number}
        </span>
      );
    case TournamentGameState.VOID:
      return (
        <span class="soft">
          × {words.games.void}
          {number}
        </span>
      );
    default:
      return (
        <span class="soft">
          {words.games.due}
          {number}
        </span>
      );
  }
}
