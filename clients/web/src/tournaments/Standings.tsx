// The standings of a tournament, and how certain their order is. Before the start there is
// Entrants.tsx instead.

import {
  type OrderConfidence,
  type Tournament,
  TournamentFormat,
  type TournamentStanding,
  TournamentState,
} from "../gen/chefshat/v1/tournament_pb";
import { decimal, t } from "../i18n";
import { KindBadge } from "../parts/KindBadge";
import { PersonName } from "../people/PersonName";
import { ratingWords } from "../people/rating";
import css from "./Standings.module.css";
import { gradeOf, isEnded, meanScore, nameOf, participantOf } from "./structure";

/** Number of lines up to which each has room for two rows, in the wall view. */
const FEW = 5;

interface StandingsProps {
  tournament: Tournament;
  standings: readonly TournamentStanding[];
  /** The participant of this device. */
  mine?: number | undefined;
  /** Wall view: without details that cannot be read from afar. */
  large?: boolean;
}

/** The heading of the standings. */
export function standingsTitle({ state }: Tournament): string {
  const words = t().tournaments.standings;
  return state === TournamentState.FINISHED ? words.final : words.title;
}

/** The table of standings. */
export function Standings({ tournament, standings, mine, large = false }: StandingsProps) {
  const words = t().tournaments.standings;
  const { columns } = t().common;
  const knockout = tournament.settings?.format === TournamentFormat.KNOCKOUT;
  const players = tournament.settings?.rules?.players ?? 4;
  return (
    <table class={`listing ${css.standings}`} data-part="standings" data-long={standings.length > FEW ? "" : undefined}>
      <caption class="visually-hidden">{standingsTitle(tournament)}</caption>
      <thead>
        <tr>
          <th scope="col">{columns.place}</th>
          <th scope="col" class={css.name} data-part="standings-name">
            {columns.name}
          </th>
          {knockout && (
            <th scope="col" data-part="standings-detail">
              {words.round}
            </th>
          )}
          <th scope="col" class={css.minor} data-part="standings-detail">
            {columns.games}
          </th>
          <th scope="col" title={words.scoreHint}>
            {words.score}
          </th>
          {!large && (
            <>
              <th scope="col" class={css.minor}>
                {columns.points}
              </th>
              <th scope="col" class={css.minor}>
                {columns.places}
              </th>
              <th scope="col" class={css.minor} title={words.ratingHint}>
                {columns.rating}
              </th>
            </>
          )}
        </tr>
      </thead>
      <tbody>
        {standings.map((standing) => (
          <tr key={standing.participant} aria-current={standing.participant === mine || undefined}>
            <td class={`number ${css.place} ${standing.place === 1 && standing.games > 0 ? css.first : ""}`}>
              {standing.place || "–"}
            </td>
            <th scope="row" class={css.name} data-part="standings-name">
              <Who tournament={tournament} standing={standing} large={large} />
            </th>
            {knockout && (
              <td class="number" data-part="standings-detail">
                {standing.lastRound || "–"}
              </td>
            )}
            <td class={`number ${css.minor}`} data-part="standings-detail">
              {standing.games}
            </td>
            <td class="number">
              <b>{standing.games > 0 ? decimal(meanScore(standing), 2) : "–"}</b>
            </td>
            {!large && (
              <>
                <td class={`number ${css.minor}`}>{String(standing.points)}</td>
                <td class={`number ${css.minor}`}>
                  <Places places={standing.places} count={players} />
                </td>
                <td class={`number ${css.minor}`}>
                  {standing.rating && standing.rating.games > 0 ? ratingWords(standing.rating) : "–"}
                </td>
              </>
            )}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

function Who(props: { tournament: Tournament; standing: TournamentStanding; large: boolean }) {
  const { tournament, standing, large } = props;
  const words = t().tournaments.standings;
  const participant = participantOf(tournament, standing.participant);
  if (!participant) return null;
  const gone = participant.withdrawn
    ? words.withdrawn
    : !participant.connected && !isEnded(tournament) && t().table.presence.away;
  const remarks = [
    participant.filler && words.filler,
    participant.former.length > 0 && words.former(participant.former.map(({ name }) => name).join(", ")),
    standing.forfeited > 0 && words.forfeited(standing.forfeited),
    standing.byes > 0 && words.byes(standing.byes),
    gone,
  ].filter(Boolean);
  return (
    <>
      <PersonName
        name={nameOf(tournament, standing.participant)}
        builtIn={participant.builtInAgent}
        fingerprint={participant.nameFingerprint}
        linked={!large}
      />{" "}
      {large && gone ? (
        <span class="soft" data-part="standings-gone">
          {gone}
        </span>
      ) : (
        <KindBadge kind={participant.kind} builtIn={participant.builtInAgent} />
      )}
      {!large && remarks.length > 0 && <span class={`soft small ${css.remarks}`}>{remarks.join(" · ")}</span>}
    </>
  );
}

/** How often the participant took each place. */
function Places({ places, count }: { places: readonly number[]; count: number }) {
  const all = Array.from({ length: count }, (_, index) => places[index] ?? 0);
  return (
    <>
      <span aria-hidden="true">{all.join(" · ")}</span>
      <span class="visually-hidden">{t().tournaments.standings.placesWords(all)}</span>
    </>
  );
}

/** How certain the order of each pair of neighbours is. */
export function Confidence(props: { tournament: Tournament; confidence: readonly OrderConfidence[] }) {
  const { tournament, confidence } = props;
  const words = t().tournaments.confidence;
  if (confidence.length === 0) return null;
  return (
    <details class={`sheet ${css.confidence}`}>
      <summary>{words.title}</summary>
      <p class="soft">{words.text}</p>
      <ul>
        {confidence.map((pair) => (
          <li key={pair.upper}>
            <span>{words.pair(nameOf(tournament, pair.upper), nameOf(tournament, pair.lower))}</span>
            <span>
              <b>{words.grades[gradeOf(pair.confidence)]}</b>{" "}
              <span class="soft number">
                {words.percent(Math.floor(100 * pair.confidence))}
                {pair.moreGames !== undefined && ` · ${words.more(Number(pair.moreGames))}`}
              </span>
            </span>
          </li>
        ))}
      </ul>
    </details>
  );
}
