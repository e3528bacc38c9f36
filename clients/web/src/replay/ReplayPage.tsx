// A record played back at the table, from any perspective, with the look-up table of every turn.

import { useEffect, useMemo, useState } from "preact/hooks";
import { DecisionKind, type DecisionRequest } from "../gen/chefshat/v1/decision_pb";
import type { DecisionRecord } from "../gen/chefshat/v1/record_pb";
import { t } from "../i18n";
import { ErrorPage } from "../parts/ErrorPage";
import type { PageProps } from "../router";
import { useAnnounced } from "../table/following";
import { legalActions, moveOf } from "../table/model/actions";
import { lookupOf } from "../table/model/lookup";
import { publicRequirement } from "../table/model/requirement";
import type { TableState } from "../table/model/state";
import { LookupTable } from "../table/view/LookupTable";
import { TableView } from "../table/view/TableView";
import { distinctName, moveWords } from "../table/words";
import { Analysis } from "./Analysis";
import { Controls, type Speed } from "./Controls";
import type { Film } from "./frames";
import { Graph } from "./Graph";
import { useFilm } from "./hooks";
import { decidingFor, type Perspective, seenFrom } from "./perspective";
import css from "./Replay.module.css";

/** Duration of a moment at speed 1, milliseconds. */
const MOMENT_MS = 1000;

/** Key of the annotation with the reason that an agent gave for its decision. */
const REASON_KEY = "reason";

/** A shorter time would be shown as 0.0 s. */
const SHOWN_SECONDS = 0.05;

/** The page. */
export function ReplayPage({ route }: PageProps<"replay">) {
  const { gameId } = route;
  const { film, fault } = useFilm(gameId);
  if (fault) return <ErrorPage title={t().replay.title} words={fault} />;
  if (!film) return <p class="soft">{t().common.loading}</p>;
  if (film.length === 0) return <ErrorPage title={t().replay.title} words={t().replay.empty} />;
  return <Playback gameId={gameId} film={film} />;
}

function Playback({ gameId, film }: { gameId: string; film: Film }) {
  const [at, setAt] = useState(() => firstFrame(film));
  const [playing, setPlaying] = useState(false);
  const [speed, setSpeed] = useState<Speed>(1);
  const [perspective, setPerspective] = useState<Perspective>("all");
  const [analysing, setAnalysing] = useState(false);
  const last = film.length - 1;
  useEffect(() => {
    if (!playing) return;
    if (at >= last) {
      setPlaying(false);
      return;
    }
    const timer = setTimeout(() => setAt(at + 1), MOMENT_MS / speed);
    return () => clearTimeout(timer);
  }, [playing, at, speed, last]);

  const frame = useMemo(() => film.at(at), [film, at]);
  const table = seenFrom(frame.table, perspective);
  const next = decidingFor(frame, perspective);
  useAnnounced(table, undefined, undefined);
  const go = (to: number) => setAt(Math.max(0, Math.min(last, to)));
  const jump = (to: number) => {
    setPlaying(false);
    go(to);
  };
  const open = next === undefined ? undefined : frame.open;
  const known = open && (perspective === "all" || perspective === open.seat);
  return (
    <TableView
      table={table}
      own={typeof perspective === "number" ? perspective : undefined}
      next={next}
      nextKind={open?.kind}
      caption={film.header?.roomName ?? ""}
      replayed
    >
      <Controls
        film={film}
        frame={frame}
        at={at}
        playing={playing}
        speed={speed}
        perspective={perspective}
        onGo={jump}
        onPlaying={(start) => {
          if (start && at >= last) go(0);
          setPlaying(start);
        }}
        onSpeed={setSpeed}
        onPerspective={setPerspective}
      />
      {known && <Decision table={frame.table} open={open} />}
      {known && (
        <Analysis
          gameId={gameId}
          decisions={frame.decisions}
          table={frame.table}
          open={open}
          shown={analysing}
          onShown={setAnalysing}
        />
      )}
      {film.handsKnown && !table.physical && perspective !== "none" && (
        <Graph
          gameId={gameId}
          film={film}
          table={frame.table}
          perspective={perspective}
          decisions={frame.decisions}
          onGo={jump}
        />
      )}
    </TableView>
  );
}

/** The open decision: answer, decision time, hints and possible plays. */
export function Decision({ table, open }: { table: TableState; open: DecisionRecord }) {
  const words = t().replay;
  const move = moveOf(open.action, table.faces);
  const seconds = Number(open.decisionTimeUs) / 1e6;
  const estimate = open.annotations?.valueEstimate;
  const reason = open.annotations?.extra[REASON_KEY];
  return (
    <details class={`${css.decision} sheet`} data-part="replay-decision">
      <summary>
        <strong>{words.possible}</strong>{" "}
        <span class="soft">
          {words.answered(distinctName(table, open.seat), move ? moveWords(move) : open.text)}
          {seconds >= SHOWN_SECONDS && ` · ${words.seconds(seconds)}`}
          {estimate !== undefined && ` · ${words.estimate(estimate)}`}
          {open.hints > 0 && ` · ${words.hints(open.hints)}`}
        </span>
      </summary>
      {reason && <p data-part="reason">{words.reason(reason)}</p>}
      {open.kind === DecisionKind.TURN && open.actionMask.length === 0 ? (
        <p>{t().table.physical.handUnknown}</p>
      ) : open.kind === DecisionKind.TURN ? (
        <LookupTable lookup={lookupAt(table, open)} taken={open.action} />
      ) : (
        <p>{words.noTable}</p>
      )}
    </details>
  );
}

function lookupAt(table: TableState, open: Pick<DecisionRequest, "actionMask"> & { seat: number }) {
  return lookupOf(
    table,
    publicRequirement(table),
    table.seats[open.seat]?.hand ?? [],
    new Set(legalActions(open.actionMask)),
  );
}

/** The moment of ?decision=N in the address, or of the first deal. */
function firstFrame(film: Film): number {
  const asked = Number(new URLSearchParams(location.search).get("decision"));
  return film.opening(asked) ?? film.shifts[0]?.frame ?? 0;
}
