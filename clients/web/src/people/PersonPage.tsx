// One participant: its rating, what its games add up to, and the games, each with a link to its replay.

import { wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import type { PageProps } from "../app";
import type { Rated } from "../gen/chefshat/v1/tournament_pb";
import { language, t } from "../i18n";
import { nameOf } from "../lobby/rooms";
import { KindBadge } from "../parts/KindBadge";
import { Notice } from "../parts/Notice";
import { pathOf } from "../router";
import { PersonName } from "../tournaments/PersonName";
import { askPerson, type OwnGame, SHOWN_GAMES, sum } from "./games";
import { ratingRange, ratingWords } from "./rating";
import "./people.css";

/** How often it is asked for, milliseconds. */
const EVERY_MS = 60_000;

/** The page. */
export function PersonPage({ route }: PageProps<"person">) {
  const { name } = route;
  const words = t().people.person;
  const { value, fault } = usePolled((signal) => askPerson(name, signal), EVERY_MS, name);
  const self = value?.games[0]?.record.seats[value.games[0].seat];
  return (
    <div class="people">
      <header class="person-head">
        <h1>{name}</h1>
        {self && <KindBadge kind={self.kind} builtIn={self.builtInAgent} />}
      </header>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      {!value && !fault && <p class="soft">{t().common.loading}</p>}
      {value && value.games.length === 0 && value.rated.length === 0 && <p class="sheet">{words.none}</p>}
      {value && value.games.length > 0 && (
        <>
          <Facts rated={value.rated} games={value.games} />
          <section class="sheet">
            <h2>{words.played}</h2>
            <Games games={value.games.slice(0, SHOWN_GAMES)} />
            {value.games.length > SHOWN_GAMES && <p class="soft">{words.newest(SHOWN_GAMES)}</p>}
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

function Facts({ rated, games }: { rated: readonly Rated[]; games: readonly OwnGame[] }) {
  const words = t().people.person;
  const all = sum(games);
  return (
    <dl class="person-facts">
      {rated.map((line) => (
        <Rating key={`${line.kind} ${line.builtIn}`} line={line} />
      ))}
      {rated.length === 0 && <Fact label={words.rating} value="–" text={words.unrated} />}
      <Fact label={words.games} value={String(all.games)} />
      <Fact label={words.wins} value={String(all.wins)} />
      {all.games > 0 && <Fact label={words.meanPlace} value={all.meanPlace.toFixed(2)} />}
    </dl>
  );
}

function Rating({ line }: { line: Rated }) {
  const words = t().people.person;
  if (!line.rating) return null;
  const { from, to } = ratingRange(line.rating);
  const text = `${words.rated(line.place)}. ${words.ratingRange(from.toFixed(1), to.toFixed(1))}`;
  return <Fact label={words.rating} value={ratingWords(line.rating)} text={text} />;
}

function Fact({ label, value, text = "" }: { label: string; value: string; text?: string }) {
  return (
    <div class={`sheet ${text ? "person-fact-wide" : ""}`}>
      <dt class="soft">{label}</dt>
      <dd>
        <b class="number">{value}</b>
        {text && <span class="soft small">{text}</span>}
      </dd>
    </div>
  );
}

/** How dates are written where the reader is, if the browser says so for the page's language. */
function dateLocale(): string {
  return navigator.languages.find((one) => one.startsWith(language.value)) ?? language.value;
}

function Games({ games }: { games: readonly OwnGame[] }) {
  const words = t().people.person;
  const dates = new Intl.DateTimeFormat(dateLocale(), { dateStyle: "medium", timeStyle: "short" });
  return (
    <table class="person-games">
      <thead>
        <tr>
          <th scope="col">{words.columns.date}</th>
          <th scope="col">{words.columns.place}</th>
          <th scope="col" class="leaderboard-minor">
            {words.columns.points}
          </th>
          <th scope="col" class="leaderboard-minor person-others">
            {words.columns.others}
          </th>
          <th scope="col" class="person-others">
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
              <td class="number leaderboard-minor">{points ?? "–"}</td>
              <td class="leaderboard-minor person-others">
                {others.map((other, index) => (
                  <span key={other.seat}>
                    {index > 0 && ", "}
                    <PersonName name={nameOf(other)} />
                  </span>
                ))}
              </td>
              <td class="person-others">
                <a href={pathOf({ page: "replay", gameId: record.gameId })}>
                  {words.replay}
                  <span class="only-heard"> {words.of(record.roomName, date)}</span>
                </a>{" "}
                <span class="soft small">
                  {record.roomName}
                  {record.added && ` · ${words.added}`}
                </span>
              </td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}
