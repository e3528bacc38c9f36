// The ratings of everyone with rated games on this server, by kind if desired, with their
// uncertainty.

import { useState } from "preact/hooks";
import { tournamentApi } from "../api/client";
import { wordsOf } from "../api/faults";
import { usePolled } from "../api/poll";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import type { Rated } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { ButtonLink } from "../parts/Button";
import { SelectField } from "../parts/Field";
import { KindBadge } from "../parts/KindBadge";
import { MoreButton } from "../parts/MoreButton";
import { Notice } from "../parts/Notice";
import { MAX_LINES } from "./games";
import css from "./People.module.css";
import { Fingerprint, PersonName } from "./PersonName";
import { ratingRange, ratingWords } from "./rating";
import { WhichAreRated } from "./WhichAreRated";

/** Polling interval, milliseconds. */
const EVERY_MS = 15_000;
/** Lines shown at first, and more at a time. */
const LINES = 200;

const KINDS = {
  all: ParticipantKind.UNSPECIFIED,
  human: ParticipantKind.HUMAN,
  robot: ParticipantKind.ROBOT,
  agent: ParticipantKind.AGENT,
  model: ParticipantKind.MODEL,
};
const MIN_GAMES = ["1", "5", "20", "100"] as const;

/** The page. */
export function LeaderboardPage() {
  const words = t().people;
  const [kind, setKind] = useState<keyof typeof KINDS>("all");
  const [minGames, setMinGames] = useState<(typeof MIN_GAMES)[number]>("1");
  const [lines, setLines] = useState(LINES);
  const ask = (signal: AbortSignal) =>
    tournamentApi.getLeaderboard(
      { kind: KINDS[kind], minGames: Number(minGames), limit: Math.min(lines + 1, MAX_LINES) },
      { signal },
    );
  const { value, fault } = usePolled(ask, EVERY_MS, `${kind} ${minGames} ${lines}`);
  const rated = value?.rated.slice(0, lines) ?? [];
  const list = { items: rated, more: (value?.rated.length ?? 0) > lines };
  const kinds = Object.keys(KINDS) as (keyof typeof KINDS)[];
  return (
    <div class={css.people}>
      <h1>{t().common.nav.leaderboard}</h1>
      <p class="soft">{words.text}</p>
      <div class={css.filter}>
        <SelectField
          label={words.kinds.label}
          value={kind}
          options={kinds.map((value) => ({ value, label: words.kinds[value] }))}
          onPick={setKind}
        />
        <SelectField
          label={words.minGames.label}
          value={minGames}
          options={MIN_GAMES.map((value) => ({ value, label: words.minGames.games(Number(value)) }))}
          onPick={setMinGames}
        />
        {value && <p class={`soft ${css.games}`}>{words.ratedGames(Number(value.games))}</p>}
      </div>
      {fault && <Notice kind="fault">{wordsOf(fault)}</Notice>}
      {value?.rated.length === 0 && <Nobody anybody={Number(value.games) > 0} />}
      {value && value.rated.length > 0 && (
        <>
          <Lines rated={rated} />
          <MoreButton
            shown={{ list, fault, showMore: () => setLines(lines + LINES) }}
            what={t().common.nav.leaderboard}
          />
          {rated.length === MAX_LINES && <p class="soft">{words.truncated(MAX_LINES)}</p>}
          <WhichAreRated />
        </>
      )}
    </div>
  );
}

/** What to do about an empty list: other filters, or the first game. */
function Nobody({ anybody }: { anybody: boolean }) {
  const words = t().people;
  if (anybody) return <p class="sheet">{words.noneOfThese}</p>;
  return (
    <section class={`sheet ${css.none}`}>
      <p>{words.none}</p>
      <WhichAreRated open />
      <ButtonLink href="/">{words.toLobby}</ButtonLink>
    </section>
  );
}

function Lines({ rated }: { rated: readonly Rated[] }) {
  const words = t().common.columns;
  const ranges = rated.flatMap(({ rating }) => (rating ? [ratingRange(rating)] : []));
  const lowest = Math.min(...ranges.map(({ from }) => from));
  const highest = Math.max(...ranges.map(({ to }) => to));
  const places = Math.max(...rated.map((line) => line.places.length));
  const share = (value: number) => `${((100 * (value - lowest)) / Math.max(1e-9, highest - lowest)).toFixed(1)}%`;
  return (
    <section class="sheet">
      <table class={`listing ${css.leaderboard}`}>
        <caption class="soft small">{t().people.order}</caption>
        <thead>
          <tr>
            <th scope="col">{words.place}</th>
            <th scope="col" class={css.leaderboardName}>
              {words.name}
            </th>
            <th scope="col" title={t().people.ratingHint}>
              {words.rating}
            </th>
            <td class={css.leaderboardRange} />
            <th scope="col" class={css.leaderboardMinor}>
              {words.games}
            </th>
            <th scope="col" class={css.leaderboardMinor}>
              {words.places}
            </th>
          </tr>
        </thead>
        <tbody>
          {rated.map((line) => {
            const range = line.rating && ratingRange(line.rating);
            return (
              <tr key={`${line.kind} ${line.builtIn} ${line.name} ${line.nameFingerprint}`}>
                <td class="number">{line.place}</td>
                <th scope="row" class={css.leaderboardName}>
                  <PersonName name={line.name} fingerprint={line.nameFingerprint} />{" "}
                  <Fingerprint of={line.nameFingerprint} />{" "}
                  <KindBadge kind={line.kind} builtIn={line.builtIn ? line.name : ""} />
                </th>
                <td class={`number ${css.leaderboardRating}`}>{line.rating && ratingWords(line.rating)}</td>
                <td class={css.leaderboardRange} aria-hidden="true">
                  {range && (
                    <span class={css.leaderboardBar}>
                      <span style={{ left: share(range.from), right: `calc(100% - ${share(range.to)})` }} />
                      <b style={{ left: share((range.from + range.to) / 2) }} />
                    </span>
                  )}
                </td>
                <td class={`number ${css.leaderboardMinor}`}>{line.rating?.games}</td>
                <td class={`number ${css.leaderboardMinor}`}>
                  {Array.from({ length: places }, (_, index) => line.places[index] ?? 0).join(" · ")}
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </section>
  );
}
