// A participant: rating, totals, and games with links to their replays.

import type { ComponentChildren } from "preact";
import { wordsOf } from "../api/faults";
import { useShown } from "../api/pages";
import { usePolled } from "../api/poll";
import type { Rated } from "../gen/chefshat/v1/tournament_pb";
import { decimal, momentOf, t } from "../i18n";
import { nameOf } from "../lobby/rooms";
import { KindBadge } from "../parts/KindBadge";
import { MoreButton } from "../parts/MoreButton";
import { Notice } from "../parts/Notice";
import { type PageProps, pathOf } from "../router";
import { gamesOf, isForfeited, MAX_LINES, type OwnGame, type Ratings, ratedAs, sum, unratedBecause } from "./games";
import css from "./People.module.css";
import { Fingerprint, PersonName } from "./PersonName";
import { ratingRange, ratingWords } from "./rating";
import { WhichAreRated } from "./WhichAreRated";

/** Polling interval, milliseconds. */
const EVERY_MS = 60_000;
/** Games shown at first, and more at a time. */
const AT_A_TIME = 50;

/** The page. */
export function PersonPage({ route }: PageProps<"person">) {
  const { name, fingerprint } = route;
  const words = t().people.person;
  const who = `${name} ${fingerprint}`;
  const shown = useShown(gamesOf(name, fingerprint), AT_A_TIME, EVERY_MS, who);
  const rated = usePolled((signal) => ratedAs(name, fingerprint, signal), EVERY_MS, who);
  const { list } = shown;
  const fault = shown.fault ?? rated.fault;
  const games = list?.items ?? [];
  const self = games[0]?.record.seats[games[0].seat];
  return (
    <div class={css.people}>
      <header class={css.personHead}>
        <h1>{name}</h1>
        <Fingerprint of={fingerprint} whole />
        {self && <KindBadge kind={self.kind} builtIn={self.builtInAgent} />}
      </header>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      {!list && !fault && <p class="soft">{t().common.loading}</p>}
      <Facts rated={rated.value} games={games} />
      {list && games.length === 0 && <p class="sheet">{list.more ? words.noneOfNewest : words.none}</p>}
      {games.length > 0 && (
        <>
          <section class="sheet stack">
            <h2>{words.played}</h2>
            <WhichAreRated />
            <Games games={games} />
            <MoreButton shown={shown} what={words.played} />
          </section>
          {self?.builtInAgent === "" && fingerprint === "" && <p class="soft small">{words.sameName}</p>}
        </>
      )}
      <p>
        <a class="own-line" href="/leaderboard">
          {words.toLeaderboard}
        </a>
      </p>
    </div>
  );
}

/** The ratings, and the totals of the games shown. */
function Facts({ rated, games }: { rated: Ratings | null; games: readonly OwnGame[] }) {
  const words = t().people.person;
  const { games: finished, wins, meanPlace } = sum(games);
  const lines = rated?.lines ?? [];
  if (lines.length === 0 && games.length === 0) return null;
  return (
    <dl class={css.personFacts}>
      {lines.map((line) => (
        <Rating key={`${line.kind} ${line.builtIn} ${line.nameFingerprint}`} line={line} />
      ))}
      {rated && lines.length === 0 && (
        <Fact
          label={t().common.columns.rating}
          value="–"
          text={rated.complete ? words.unrated : words.notListed(MAX_LINES)}
          wide
        />
      )}
      {games.length > 0 && <Fact label={words.games} value={String(finished)} text={words.ofShown(games.length)} />}
      {finished > 0 && (
        <>
          <Fact label={words.wins} value={String(wins)} text={words.ofThese(finished)} />
          <Fact label={words.meanPlace} value={decimal(meanPlace, 2)} text={words.ofThese(finished)} />
        </>
      )}
    </dl>
  );
}

/** A line of the leaderboard. Its kind is shown, because a name can have several. */
function Rating({ line }: { line: Rated }) {
  const words = t().people;
  if (!line.rating) return null;
  const { from, to } = ratingRange(line.rating);
  const place = `${words.person.rated(line.place)}, ${words.ratedGames(line.rating.games)}.`;
  const label = (
    <>
      {t().common.columns.rating} <KindBadge kind={line.kind} builtIn={line.builtIn ? line.name : ""} />{" "}
      {line.nameFingerprint && (
        <a href={pathOf({ page: "person", name: line.name, fingerprint: line.nameFingerprint })}>
          <Fingerprint of={line.nameFingerprint} />
        </a>
      )}
    </>
  );
  const range = words.person.ratingRange(decimal(from, 1), decimal(to, 1));
  return <Fact label={label} value={ratingWords(line.rating)} text={`${place} ${range}`} wide />;
}

function Fact(props: { label: ComponentChildren; value: string; text: string; wide?: boolean }) {
  const { label, value, text, wide = false } = props;
  return (
    <div class={`sheet ${wide ? css.personFactWide : ""}`}>
      <dt class="soft">{label}</dt>
      <dd>
        <b class="number">{value}</b>
        <span class="soft small">{text}</span>
      </dd>
    </div>
  );
}

/** Why a game is not rated, or not by its place. */
function NotRated({ record, seat }: Pick<OwnGame, "record" | "seat">) {
  if (isForfeited(record, seat)) return ` · ${t().people.forfeited}`;
  const why = unratedBecause(record);
  return why && ` · ${t().people.notRated(t().people.unrated[why])}`;
}

function Games({ games }: { games: readonly OwnGame[] }) {
  const words = t().people.person;
  return (
    <table class={`listing ${css.personGames}`}>
      <thead>
        <tr>
          <th scope="col">{words.columns.date}</th>
          <th scope="col">{words.columns.place}</th>
          <th scope="col">{words.columns.points}</th>
          <th scope="col" class={css.personGame}>
            {words.columns.game}
          </th>
        </tr>
      </thead>
      <tbody>
        {games.map(({ record, seat, place, points, others }) => {
          const date = momentOf(record.endedAtMs);
          return (
            <tr key={record.gameId}>
              <td class="number">{date}</td>
              <td>{place === undefined ? <span class="soft">{words.aborted}</span> : t().common.place(place)}</td>
              <td class="number">{points ?? "–"}</td>
              <td class={css.personGame}>
                <a href={pathOf({ page: "replay", gameId: record.gameId })}>
                  {t().lobby.rooms.replay}
                  <span class="visually-hidden"> {words.of(record.roomName, date)}</span>
                </a>{" "}
                <span class="soft small">
                  {record.roomName}
                  <NotRated record={record} seat={seat} />
                </span>
                <p class="small">
                  {words.against}{" "}
                  {others.map((other, index) => (
                    <span key={other.seat}>
                      {index > 0 && ", "}
                      <PersonName
                        name={nameOf(other)}
                        builtIn={other.builtInAgent}
                        fingerprint={other.nameFingerprint}
                      />
                    </span>
                  ))}
                </p>
              </td>
            </tr>
          );
        })}
      </tbody>
    </table>
  );
}
