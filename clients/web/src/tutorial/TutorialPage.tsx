// The tutorial: lessons at a table without a server, which teach the rules in a short Shift.

import { useEffect, useState } from "preact/hooks";
import { DecisionKind } from "../gen/chefshat/v1/decision_pb";
import { SpecialAction } from "../gen/chefshat/v1/rules_pb";
import { t } from "../i18n";
import { playNow } from "../lobby/play-now";
import { lastName } from "../lobby/seat";
import { ActionButton } from "../parts/ActionButton";
import { announce } from "../parts/Announcer";
import { Button, ButtonLink } from "../parts/Button";
import { Shows } from "../parts/marks";
import { useAnnounced } from "../table/following";
import { actionOf } from "../table/model/actions";
import { type Card, without } from "../table/model/cards";
import type { OpenDecision } from "../table/model/live";
import { applyEvent } from "../table/model/reduce";
import { holds, publicRequirement } from "../table/model/requirement";
import type { TableState } from "../table/model/state";
import { TableView } from "../table/view/TableView";
import { firstTable, GIFTS, givenBy, LESSONS, type Lesson, nextEvent } from "./lessons";
import css from "./Tutorial.module.css";

/** Delay between the events of the script, milliseconds. */
const PACE_MS = 850;

/** The reader's progress: the lesson, and the events of the previous one still to come. */
interface Progress {
  readonly lesson: number;
  readonly table: TableState;
  readonly coming: ReturnType<Lesson["follows"]>;
  /** The actions taken so far. */
  readonly actions: readonly number[];
}

/** The page. */
export function TutorialPage() {
  const words = t().tutorial;
  const [progress, setProgress] = useState<Progress>(() => ({
    lesson: 0,
    table: firstTable(words.you),
    coming: [],
    actions: [],
  }));
  const { lesson: at, table, coming, actions } = progress;
  useEffect(() => {
    const [next, ...rest] = coming;
    if (!next) return;
    const timer = setTimeout(() => {
      setProgress({ ...progress, table: applyEvent(table, nextEvent(table, next)), coming: rest });
    }, PACE_MS);
    return () => clearTimeout(timer);
  }, [progress]);

  const lesson = LESSONS[Math.min(at, LESSONS.length - 1)];
  const ready = coming.length === 0;
  const goOn = (action: number) => {
    if (!lesson || !ready) return;
    const taken = lesson.decision ? [...actions, action] : actions;
    setProgress({ lesson: at + 1, table, coming: lesson.follows(taken), actions: taken });
  };
  const decision = ready && lesson?.decision ? openDecision(progress, lesson.decision) : undefined;
  useAnnounced(table, 0, decision);
  const text = lesson ? words.lessons[lesson.name] : "";
  useEffect(() => {
    if (ready) announce(text);
  }, [ready, text]);

  return (
    <TableView
      table={table}
      own={0}
      decision={decision}
      untimed
      refusal={words.notThis}
      caption={t().common.nav.tutorial}
      banner={
        <section class={css.lesson} data-part="lesson" aria-label={t().common.nav.tutorial}>
          <Shows what="lesson" />
          <p class={`${css.count} number`}>{words.step(at + 1, LESSONS.length)}</p>
          <p class={css.words}>{ready ? text : words.watch}</p>
          {ready && !lesson?.decision && at < LESSONS.length - 1 && (
            <Button look="main" onClick={() => goOn(0)}>
              {words.next}
            </Button>
          )}
          {ready && at === LESSONS.length - 1 && (
            <>
              <ActionButton act={() => playNow(lastName())}>{words.play}</ActionButton>
              <ButtonLink look="quiet" href="/">
                {t().common.toLobby}
              </ButtonLink>
            </>
          )}
        </section>
      }
      onAnswer={goOn}
    />
  );
}

/**
 * The lesson's decision in the form of a real one. Given cards have left the hand, although nobody
 * has received them yet.
 */
function openDecision({ lesson, table, actions }: Progress, asked: NonNullable<Lesson["decision"]>): OpenDecision {
  const given = givenBy(actions).map((face): Card => ({ kind: "face", face }));
  const hand = without(table.seats[0]?.hand ?? [], given);
  return {
    id: BigInt(lesson),
    kind: asked.kind,
    legal: asked.moves.filter((move) => holds(hand, move)).map((move) => actionOf(move, table.faces)),
    hand,
    requirement: asked.kind === DecisionKind.TURN ? publicRequirement(table) : undefined,
    gift: asked.kind === DecisionKind.EXCHANGE ? { number: given.length + 1, ...GIFTS } : undefined,
    special: SpecialAction.UNSPECIFIED,
    timeLeftMs: 0,
    bankLeftMs: 0,
    receivedAtMs: 0,
    attemptsLeft: undefined,
  };
}
