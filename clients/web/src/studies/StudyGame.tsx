// A game of a study: the table from the participant's seat, without what the study hides.

import { type Signal, signal } from "@preact/signals";
import { useEffect, useLayoutEffect, useRef } from "preact/hooks";
import { askUntilAnswered } from "../api/asking";
import { type Fault, isPassing, wordsOf } from "../api/faults";
import { StudyHide, type StudyShownGame } from "../gen/chefshat/v1/study_pb";
import { type Hideable, leaveOut } from "../hiding";
import { t } from "../i18n";
import { roomOfTicket } from "../lobby/room-like";
import { ActionButton } from "../parts/ActionButton";
import { Notice } from "../parts/Notice";
import { useStarted } from "../parts/started";
import { inStudy, labelled } from "../table/labels";
import { isOver, tableFromRoom } from "../table/model/state";
import { SeatBanner } from "../table/SeatBanner";
import { Seated } from "../table/Seated";
import { type Session, startSession } from "../table/session";
import type { Participating } from "./participating";
import { StageTitle } from "./Stage";
import { startTracing, type Tracing } from "./tracing";

interface StudyGameProps {
  game: StudyShownGame;
  /** Title of the study, in place of the room's name. */
  title: string;
  traces: boolean;
  part: Participating;
}

const HIDEABLE: Partial<Record<StudyHide, Hideable>> = {
  [StudyHide.LOG]: "log",
  [StudyHide.LOOKUP]: "lookup",
  [StudyHide.EXPRESSIONS]: "expressions",
  [StudyHide.PLAYED]: "played",
};

/** The stage of a game. */
export function StudyGame({ game, title, traces, part }: StudyGameProps) {
  const words = t().studies.game;
  const start = () => (game.ticket === "" ? undefined : startStudyTable(game, title));
  const table = useStarted(start, game.ticket);
  const hide = game.hide.flatMap((one) => HIDEABLE[one] ?? []).join(" ");
  useLayoutEffect(() => leaveOut((hide === "" ? [] : hide.split(" ")) as Hideable[]), [hide]);
  useLayoutEffect(() => {
    labelled.value = game.labelled;
    inStudy.value = true;
    return () => {
      labelled.value = false;
      inStudy.value = false;
    };
  }, [game.labelled]);
  const session = table?.session.value;
  const fault = table?.fault.value;
  const label = game.practice ? words.practice : game.games > 1 ? words.gameOf(game.game, game.games) : words.game;
  if (!session) {
    return (
      <section class="sheet stack" data-part="study-game">
        <StageTitle>{label}</StageTitle>
        {game.ended ? (
          <ContinueStudy part={part} />
        ) : fault ? (
          <Notice kind="fault">{wordsOf(fault)}</Notice>
        ) : (
          <p class="soft">{game.waitsFor > 0 ? words.waitsFor(game.waitsFor) : words.preparing}</p>
        )}
      </section>
    );
  }
  return <Table {...{ session, part, label, game }} send={traces} />;
}

interface TableProps {
  session: Session;
  part: Participating;
  label: string;
  game: StudyShownGame;
  send: boolean;
}

function Table({ session, part, label, game, send }: TableProps) {
  const words = t().studies.game;
  const whole = useRef<HTMLDivElement>(null);
  const tracing = useRef<Tracing | undefined>(undefined);
  useEffect(() => {
    if (!send || !whole.current) return;
    const started = startTracing(whole.current, session.live, (traces) => part.sendTraces(game.gameId, traces));
    tracing.current = started;
    return () => {
      tracing.current = undefined;
      started.stop();
    };
  }, [session, send]);
  const { table } = session.live.value;
  const over = isOver(table);
  const acting: Session = {
    ...session,
    answer: (action, automatic) => {
      tracing.current?.answered(action);
      session.answer(action, automatic);
    },
  };
  const banner = (
    <>
      <p class="soft small">{label}</p>
      {!over && !game.ended && <SeatBanner session={session} />}
      {over && !game.ended && <Notice kind="hint">{words.ending}</Notice>}
      {game.ended && (
        <Notice kind="good">
          <ContinueStudy part={part} />
        </Notice>
      )}
    </>
  );
  return (
    <div ref={whole} data-part="study-game">
      <Seated acting={acting} study banner={banner} onPick={(card, picked) => tracing.current?.pick(card, picked)} />
    </div>
  );
}

/** The game is over: continues with the study. */
function ContinueStudy({ part }: { part: Participating }) {
  const words = t().studies;
  return (
    <>
      {words.game.over}{" "}
      <ActionButton again act={part.proceed}>
        {words.next}
      </ActionButton>
    </>
  );
}

interface StudyTable {
  readonly session: Signal<Session | undefined>;
  readonly fault: Signal<Fault | undefined>;
  stop(): void;
}

/** Requests the room, which only those who have its ticket see, and attaches to the seat. */
function startStudyTable({ roomId, ticket }: StudyShownGame, title: string): StudyTable {
  const session = signal<Session | undefined>(undefined);
  const fault = signal<Fault | undefined>(undefined);
  let stopped = false;
  const load = async () => {
    const room = await askUntilAnswered(
      () => roomOfTicket(roomId, ticket),
      () => !stopped,
      (found) => {
        if (!isPassing(found)) fault.value = found;
      },
    );
    if (room && !stopped) session.value = startSession({ ticket }, { ...tableFromRoom(room), roomName: title }, true);
  };
  void load();
  return {
    session,
    fault,
    stop: () => {
      stopped = true;
      session.peek()?.stop();
    },
  };
}
