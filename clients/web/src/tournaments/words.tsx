// What a tournament is and where it stands, in words, with a sign beside the word that does not need its colour.

import { type Tournament, TournamentDeals, TournamentFormat, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";

/** Where a tournament stands, by sign and word. */
export function StateChip({ tournament }: { tournament: Tournament }) {
  const words = t().tournaments.states;
  const [sign, word] = ((): [string, string] => {
    switch (tournament.state) {
      case TournamentState.OPEN:
        return ["◔", words.open];
      case TournamentState.PLAYING:
        return ["▶", words.playing];
      case TournamentState.FINISHED:
        return ["✓", words.finished];
      default:
        return ["×", words.closed];
    }
  })();
  return (
    <span class={`tournament-state tournament-state-${tournament.state}`}>
      <span aria-hidden="true">{sign}</span> {word}
    </span>
  );
}

/** Form, size and how far it has come, in a line. */
export function inShort(tournament: Tournament): string {
  const words = t().tournaments;
  const parts = [formatWord(tournament)];
  if (tournament.participants.length > 0) parts.push(words.participants(tournament.participants.length));
  if (tournament.state === TournamentState.PLAYING) parts.push(words.roundOf(tournament.round, tournament.rounds));
  if (tournament.state !== TournamentState.OPEN) parts.push(words.gamesOver(tournament.gamesOver, tournament.games));
  return parts.join(" · ");
}

/** What has to be known of the deals; undefined if every game is dealt anew. */
export function dealsWords(tournament: Tournament): string | undefined {
  const words = t().tournaments.deals;
  switch (tournament.settings?.deals) {
    case TournamentDeals.SAME_AT_ALL_TABLES:
      return words.same;
    case TournamentDeals.ROTATED:
      return words.rotated;
    default:
      return undefined;
  }
}

function formatWord(tournament: Tournament): string {
  const words = t().tournaments.formats;
  switch (tournament.settings?.format) {
    case TournamentFormat.ROUND_ROBIN:
      return words.roundRobin;
    case TournamentFormat.SWISS:
      return words.swiss;
    default:
      return words.knockout;
  }
}
