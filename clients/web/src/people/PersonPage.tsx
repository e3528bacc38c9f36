// A participant: rating, totals, and games with links to their replays.

import { wordsOf } from "../api/faults";
import { type Beginning, countWords, useShown } from "../api/pages";
import { usePolled } from "../api/poll";
import type { PageProps } from "../app";
import type { RecordSummary } from "../gen/chefshat/v1/record_service_pb";
import type { Rated } from "../gen/chefshat/v1/tournament_pb";
import { dateLocale, decimal, t } from "../i18n";
import { nameOf } from "../lobby/rooms";
import { KindBadge } from "../parts/KindBadge";
import { MoreButton } from "../parts/MoreButton";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import { PersonName } from "../tournaments/PersonName";
import { gamesOf, type OwnGame, ratedAs, sum, unratedBecause } from "./games";
import css from "./People.module.css";
import { ratingRange, ratingWords } from "./rating";
import { WhichAreRated } from "./WhichAreRated";

/** Polling interval, milliseconds. */
const EVERY_MS = 60_000;
/** Games shown at first, and more at a time. */
const AT_A_TIME = 50;

/** The page. */
export function PersonPage({ route }: PageProps<"person">) {
  const { name } = route;
  const words = t().people.person;
  const shown = useShown(gamesOf(name), AT_A_TIME, EVERY_MS, name);
  const rated = usePolled((signal) => ratedAs(name, signal), EVERY_MS, name);
  const { list } = shown;
  const fault = shown.fault ?? rated.fault;
  const last = list?.items[0];
  const self = last?.record.seats[last.seat];
  return (
    <div class={css.people}>
      <header class={css.personHead}>
        <h1>{name}</h1>
        {self && <KindBadge kind={self.kind} builtIn={self.builtInAgent} />}
      </header>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      {!list && !fault && <p class="soft">{t().common.loading}</p>}
      {list?.items.length === 0 && <p class="sheet">{words.none}</p>}
      {list && list.items.length > 0 && (
        <>
          <Facts rated={rated.value} games={list} />
          <section class="sheet stack">
            <h2>{words.played}</h2>
            <WhichAreRated />
            <Games games={list.items} />
            <MoreButton shown={shown} what={words.played} />
          </section>
          {self?.builtInAgent === "" && <p class="soft small">{words.sameName}</p>}
        </>
      )}
      <p>
        <a href="/leaderboard">{words.toLeaderboard}</a>
      </p>
    </div>
  );
}

/** The rating, and the totals of the known games. */
function Facts({ rated, games }: { rated: readonly Rated[] | null; games: Beginning<OwnGame> }) {
  const words = t().people.person;
  const all = sum(games.items);
  const of = games.more ? words.ofNewest(games.items.length) : "";
  return (
    <dl class={css.personFacts}>
      {rated?.map((line) => (
        <Rating key={`${line.kind} ${line.builtIn}`} line={line} />
      ))}
      {rated?.length === 0 && <Fact label={words.rating} value="–" text={words.unrated} wide />}
      <Fact label={words.games} value={countWords(all.games, games.more)} />
      <Fact label={words.wins} value={String(all.wins)} text={of} />
      {all.games > 0 && <Fact label={words.meanPlace} value={decimal(all.meanPlace, 2)} text={of} />}
    </dl>
  );
}

function Rating({ line }: { line: Rated }) {
  const words = t().people.person;
  if (!line.rating) return null;
  const { from, to } = ratingRange(line.rating);
  const text = `${words.rated(line.place)}. ${words.ratingRange(decimal(from, 1), decimal(to, 1))}`;
  return <Fact label={words.rating} value={ratingWords(line.rating)} text={text} wide />;
}

function Fact(props: { label: string; value: string; text?: string; wide?: boolean }) {
  const { label, value, text = "", wide = false } = props;
  return (
    <div class={`sheet ${wide ? css.personFactWide : ""}`}>
      <dt class="soft">{label}</dt>
      <dd>
        <b class="number">{value}</b>
        {text && <span class="soft small">{text}</span>}
      </dd>
    </div>
  );
}

/** Why a game is not rated. */
function NotRated({ record }: { record: RecordSummary }) {
  const why = unratedBecause(record);
  return why && ` · ${t().people.notRated(t().people.unrated[why])}`;
}

function Games({ games }: { games: readonly OwnGame[] }) {
  const words = t().people.person;
  const dates = new Intl.DateTimeFormat(dateLocale(), { dateStyle: "medium", timeStyle: "short" });
  return (
    <table class={css.personGames}>
      <thead>
        <tr>
          <th scope="col">{words.columns.date}</th>
          <th scope="col">{words.columns.place}</th>
          <th scope="col" class={css.leaderboardMinor}>
            {words.columns.points}
          </th>
          <th scope="col" class={`${css.leaderboardMinor} ${css.personOthers}`}>
            {words.columns.others}
          </th>
          <th scope="col" class={css.personOthers}>
            {words.columns.game}
          </th>
        </tr>
      </thead>
      <tbody>
        {games.map(({ record, place, points, others }) => {
          const date = dates.format(Number(record.endedAtMs));
          return (
            <tr key={record.gameId}>
              <td class="number">{date}</td>
              <td>{place === undefined ? <span class="soft">{words.aborted}</span> : t().common.place(place)}</td>
              <td class={`number ${css.leaderboardMinor}`}>{points ?? "–"}</td>
              <td class={`${css.leaderboardMinor} ${css.personOthers}`}>
                {others.map((other, index) => (
                  <span key={other.seat}>
                    {index > 0 && ", "}
                    <PersonName name={nameOf(other)} />
                  </span>
                ))}
              </td>
              <td class={css.personOthers}>
                <a href={pathOf({ page: "replay", gameId: record.gameId })}>
                  {words.replay}
                  <span class="visually-hidden"> {words.of(record.roomName, date)}</span>
                </a>{" "}
                <span class="soft small">
                  {record.roomName}
                  <NotRated record={record} />
                </span>
              </td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}
