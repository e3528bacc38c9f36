// A short Shift that teaches the rules: the lessons one after the other at a table of its own, without a server.

import { useEffect, useState } from "preact/hooks";
import { t } from "../i18n";
import { announce } from "../parts/Announcer";
import { Button, ButtonLink } from "../parts/Button";
import { useAnnounced } from "../table/following";
import { actionOf } from "../table/model/actions";
import type { OpenDecision } from "../table/model/live";
import { applyEvent } from "../table/model/reduce";
import type { TableState } from "../table/model/state";
import { TableView } from "../table/view/TableView";
import { firstTable, LESSONS, nextEvent } from "./lessons";
import "./tutorial.css";

/** From one event of the script to the next, so that they can be followed. */
const PACE_MS = 850;

/** Where the reader stands: the lesson, and what of the one before is still to happen. */
interface Progress {
  readonly lesson: number;
  readonly table: TableState;
  readonly coming: ReturnType<(typeof LESSONS)[number]["then"]>;
}

/** The page. */
export function TutorialPage() {
  const words = t().tutorial;
  const [progress, setProgress] = useState<Progress>(() => ({ lesson: 0, table: firstTable(words.you), coming: [] }));
  const { lesson: at, table, coming } = progress;
  useEffect(() => {
    const [next, ...rest] = coming;
    if (!next) return;
    const timer = setTimeout(() => {
      setProgress({ lesson: at, table: applyEvent(table, nextEvent(table, next)), coming: rest });
    }, PACE_MS);
    return () => clearTimeout(timer);
  }, [progress]);

  const lesson = LESSONS[Math.min(at, LESSONS.length - 1)];
  const ready = coming.length === 0;
  const goOn = (action: number) => {
    if (lesson && ready) setProgress({ lesson: at + 1, table, coming: lesson.then(action) });
  };
  const decision = ready && lesson?.decision ? openDecision(at, table, lesson.decision) : undefined;
  useAnnounced(table, 0, decision);
  const said = lesson ? words.lessons[lesson.name] : "";
  useEffect(() => {
    if (ready) announce(said);
  }, [ready, said]);

  return (
    <TableView
      table={table}
      own={0}
      decision={decision}
      untimed
      refusal={words.notThis}
      caption={words.title}
      banner={
        <section class="lesson" aria-label={words.title}>
          <p class="lesson-count number">{words.step(at + 1, LESSONS.length)}</p>
          <p class="lesson-words">{ready ? said : words.watch}</p>
          {ready && !lesson?.decision && at < LESSONS.length - 1 && (
            <Button look="main" onClick={() => goOn(0)}>
              {words.next}
            </Button>
          )}
          {ready && at === LESSONS.length - 1 && (
            <ButtonLink look="main" href="/">
              {words.toLobby}
            </ButtonLink>
          )}
        </section>
      }
      onAnswer={goOn}
    />
  );
}

function openDecision(
  id: number,
  table: TableState,
  { kind, moves }: NonNullable<(typeof LESSONS)[number]["decision"]>,
): OpenDecision {
  return {
    id: BigInt(id),
    kind,
    legal: moves.map((move) => actionOf(move, table.faces)),
    hand: table.seats[0]?.hand ?? [],
    timeLeftMs: 0,
    bankLeftMs: 0,
    receivedAtMs: 0,
    attemptsLeft: undefined,
  };
}
