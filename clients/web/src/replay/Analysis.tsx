// What the actions of a decision were worth, estimated by the server while the moment is on screen:
// a bar for each action, and the cards that each seat held on average. Only what the seat knew counts.

import { useEffect, useState } from "preact/hooks";
import { analysisApi } from "../api/client";
import { inWords } from "../api/faults";
import type { EvaluateResponse } from "../gen/chefshat/v1/analysis_service_pb";
import type { DecisionRecord } from "../gen/chefshat/v1/record_pb";
import { t } from "../i18n";
import { moveOf } from "../table/model/actions";
import type { TableState } from "../table/model/state";
import { distinctName, moveWords } from "../table/words";
import css from "./Analysis.module.css";
import { type Estimate, ranked } from "./estimates";
import replayCss from "./Replay.module.css";

/** The cost of an analysis, and how often its estimates so far arrive, milliseconds. */
const TIME_MS = 3000;
const UPDATE_MS = 250;

/** The most actions listed, besides the one that was taken. */
const MOST_LISTED = 8;

/** The shade of a kind that a seat has all cards of, percent. */
const SHADE = 40;

/** Fewer cards are shown as 0.0. */
const SHOWN_CARDS = 0.05;

interface AnalysisProps {
  gameId: string;
  /** Decisions before this one. */
  decisions: number;
  table: TableState;
  open: DecisionRecord;
  /** Whether the section is open; it stays so from moment to moment. */
  shown: boolean;
  onShown: (shown: boolean) => void;
}

export function Analysis({ gameId, decisions, table, open, shown, onShown }: AnalysisProps) {
  const words = t().replay.analysis;
  return (
    <details
      class={`${replayCss.decision} sheet`}
      data-part="replay-analysis"
      open={shown}
      onToggle={(event) => onShown(event.currentTarget.open)}
    >
      <summary>
        <strong>{words.title}</strong> <span class="soft">{words.subtitle(distinctName(table, open.seat))}</span>
      </summary>
      {shown && <Estimates key={decisions} {...{ gameId, decisions, table, open }} />}
    </details>
  );
}

type EstimatesProps = Omit<AnalysisProps, "shown" | "onShown">;

function Estimates({ gameId, decisions, table, open }: EstimatesProps) {
  const { found, fault, running } = useEvaluation(gameId, decisions);
  const words = t().replay.analysis;
  if (fault) return <p role="alert">{fault}</p>;
  if (!found) return <p class="soft">{words.running}</p>;
  const { estimates, others } = ranked(found, open.action, MOST_LISTED);
  return (
    <div class={css.analysis} aria-busy={running} data-state={running ? "running" : "done"}>
      <div class={css.scroll}>
        <table class={css.bars}>
          <caption class="small soft">{words.caption(Number(found.rollouts))}</caption>
          <thead class="visually-hidden">
            <tr>
              <th scope="col">{words.action}</th>
              <th scope="col">{t().common.columns.points}</th>
            </tr>
          </thead>
          <tbody>
            {estimates.map((estimate) => (
              <Bar key={estimate.action} estimate={estimate} faces={table.faces} />
            ))}
          </tbody>
        </table>
        {others > 0 && <p class="small soft">{words.others(others)}</p>}
      </div>
      <Hands found={found} table={table} />
    </div>
  );
}

/** A row: the action, its points with standard error, and a bar for the eye. */
function Bar({ estimate, faces }: { estimate: Estimate; faces: number }) {
  const words = t().replay.analysis;
  const { action, points, standardError, part, from, to, best, taken } = estimate;
  const move = moveOf(action, faces);
  const percent = (value: number) => `${(100 * value).toFixed(1)}%`;
  return (
    <tr data-part="estimate" data-best={best} data-taken={taken}>
      <th scope="row">
        {move ? moveWords(move) : action}
        {taken && (
          <>
            {" "}
            <span class={`${css.mark} ${css.taken}`}>{words.taken}</span>
          </>
        )}
        {best && (
          <>
            {" "}
            <span class={`${css.mark} ${css.best}`}>{words.best}</span>
          </>
        )}
      </th>
      <td>
        <span class={css.track} aria-hidden="true">
          <i class={`${css.bar} ${best ? css.bestBar : ""}`} style={{ inlineSize: percent(part) }} />
          <i class={css.error} style={{ insetInlineStart: percent(from), inlineSize: percent(to - from) }} />
        </span>
        <span class="number">{words.value(points, standardError)}</span>
      </td>
    </tr>
  );
}

/** The cards that each seat holds on average over the possible deals. */
function Hands({ found, table }: { found: EvaluateResponse; table: TableState }) {
  const words = t().replay.analysis;
  const kinds = Array.from({ length: table.faces + 1 }, (_, kind) => kind);
  return (
    // biome-ignore lint/a11y/noNoninteractiveTabindex: a scrollable region must be reachable by keyboard
    <section class={css.scroll} tabIndex={0} aria-label={words.hands}>
      <table class={css.hands} data-part="likely-hands">
        <caption class="small soft">{words.hands}</caption>
        <thead>
          <tr>
            <th scope="col">
              <span class="visually-hidden">{words.seat}</span>
            </th>
            {kinds.map((kind) => (
              <th scope="col" key={kind} class="number">
                {kind < table.faces ? kind + 1 : words.joker}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {found.hands.map(({ cards }, seat) => (
            <tr key={seat}>
              <th scope="row">{distinctName(table, seat)}</th>
              {kinds.map((kind) => {
                const count = cards[kind] ?? 0;
                const most = kind < table.faces ? kind + 1 : table.jokers;
                return (
                  <td
                    key={kind}
                    class={`number ${count < SHOWN_CARDS ? css.none : ""}`}
                    style={{ "--part": `${Math.round((SHADE * count) / Math.max(1, most))}%` }}
                  >
                    {words.cards(count)}
                  </td>
                );
              })}
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

/** Asks the server, which sends better and better estimates. Stepping on cancels the work. */
function useEvaluation(gameId: string, decisions: number) {
  const [found, setFound] = useState<EvaluateResponse | undefined>(undefined);
  const [fault, setFault] = useState("");
  const [running, setRunning] = useState(true);
  useEffect(() => {
    const leaving = new AbortController();
    const load = async () => {
      try {
        const position = { case: "moment" as const, value: { gameId, decisions: BigInt(decisions) } };
        const asked = { position, timeMs: TIME_MS, updateMs: UPDATE_MS };
        for await (const answer of analysisApi.evaluate(asked, { signal: leaving.signal })) setFound(answer);
      } catch (thrown) {
        if (!leaving.signal.aborted) setFault(inWords(thrown));
      }
      if (!leaving.signal.aborted) setRunning(false);
    };
    void load();
    return () => leaving.abort();
  }, [gameId, decisions]);
  return { found, fault, running };
}
