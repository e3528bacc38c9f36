// What the certificates of a tournament say. Printed by ResultsPage.tsx.

import { type Tournament, type TournamentStanding, TournamentState } from "../gen/chefshat/v1/tournament_pb";
import { decimal, t } from "../i18n";
import { meanScore, nameOf, participantOf } from "./structure";
import { dayWords, formatWord } from "./words";

/** The texts of one certificate. */
export interface Certificate {
  readonly participant: number;
  readonly title: string;
  readonly name: string;
  /** What the participant achieved. */
  readonly achieved: string;
  readonly tournament: string;
  /** How it was played, and the participant's results, in a line each. */
  readonly lines: readonly string[];
  readonly signature: string;
}

/**
 * The certificates of a tournament that is over, in the order of the standings: one for every
 * participant who joined. Empty before the end.
 */
export function certificatesOf(tournament: Tournament, standings: readonly TournamentStanding[]): Certificate[] {
  if (tournament.state !== TournamentState.FINISHED) return [];
  const words = t().tournaments.certificate;
  return standings.flatMap((standing) => {
    const participant = participantOf(tournament, standing.participant);
    if (!participant || participant.filler || participant.builtInAgent !== "") return [];
    const placed = standing.place > 0 && standing.games > 0 && !participant.withdrawn;
    const wins = standing.places[0] ?? 0;
    const results = [words.games(standing.games), words.score(decimal(meanScore(standing), 2))];
    if (wins > 0) results.push(words.wins(wins));
    return {
      participant: standing.participant,
      title: words.title,
      name: nameOf(tournament, standing.participant),
      achieved: placed ? words.placed(standing.place, standings.length) : words.tookPart,
      tournament: tournament.settings?.name ?? "",
      lines: [
        [formatWord(tournament), words.rounds(tournament.rounds), dayWords(tournament)].join(" · "),
        ...(standing.games > 0 ? [results.join(" · ")] : []),
      ],
      signature: words.signature,
    };
  });
}
