// The console of a person who plays a seat of another kind: how long the robot should seem to
// think, every legal move with the agent's suggestion, lines to say, and expressions. Others see the
// same as from a robot.

import { useEffect, useState } from "preact/hooks";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import type { GivenHint } from "../table/acting";
import { type Gesture, LABELS, lineGesture } from "../table/expressions";
import { actionOf, moveOf } from "../table/model/actions";
import type { OpenDecision } from "../table/model/live";
import type { SeatState, TableState } from "../table/model/state";
import { Face } from "../table/view/Face";
import { moveWords } from "../table/words";
import css from "./Console.module.css";
import { MAX_LINES, robotGesture, storedLines, storeLines } from "./lines";
import { drawn, paceOf, storedPace, storePace } from "./pace";

/** What a person may play a seat as. */
const PLAYED: readonly ParticipantKind[] = [ParticipantKind.ROBOT, ParticipantKind.AGENT, ParticipantKind.MODEL];

/** Whether the person at this page plays the seat as something else. */
export function isWizard(seat: SeatState | undefined): boolean {
  return seat !== undefined && PLAYED.includes(seat.kind);
}

interface ConsoleProps {
  table: TableState;
  decision: OpenDecision | undefined;
  /** The last hint. */
  hint: GivenHint | undefined;
  sending: boolean;
  /** Undefined if the room gives no hints. */
  onHint: (() => void) | undefined;
  onAnswer: (action: number) => void;
  onExpress: (gesture: Gesture) => void;
}

export function Console(props: ConsoleProps) {
  const words = t().wizard;
  return (
    <section class={`sheet ${css.console}`} data-part="wizard" aria-label={words.title}>
      <h2>{words.title}</h2>
      <p class="soft small">{words.what}</p>
      <div class={css.columns}>
        <Timing decision={props.decision} />
        <Moves {...props} />
        <Lines onExpress={props.onExpress} />
        <fieldset class={css.part}>
          <legend>{words.expressions}</legend>
          <div class={css.faces}>
            {LABELS.map((label) => (
              <button
                key={label}
                type="button"
                class={css.face}
                data-part="wizard-face"
                title={t().table.expressions.words[label]}
                aria-label={t().table.expressions.words[label]}
                onClick={() => props.onExpress(robotGesture(label))}
              >
                <Face label={label} />
              </button>
            ))}
          </div>
        </fieldset>
      </div>
    </section>
  );
}

/** The lines, which Alt and a digit say too. */
function Lines({ onExpress }: Pick<ConsoleProps, "onExpress">) {
  const words = t().wizard;
  const [lines, setLines] = useState(() => storedLines() ?? words.firstLines);
  const [edited, setEdited] = useState<string | undefined>(undefined);
  useEffect(() => {
    const listen = (event: KeyboardEvent) => {
      // The code: with Alt, some keyboards type another character.
      const digit = /^Digit([1-9])$/.exec(event.code)?.[1];
      const line = digit && event.altKey && !event.ctrlKey && !event.metaKey ? lines[Number(digit) - 1] : undefined;
      if (line === undefined || event.repeat) return;
      event.preventDefault();
      onExpress(lineGesture(line));
    };
    document.addEventListener("keydown", listen);
    return () => document.removeEventListener("keydown", listen);
  }, [lines, onExpress]);
  return (
    <fieldset class={css.part}>
      <legend>{words.lines}</legend>
      {edited === undefined ? (
        <>
          <ol class={css.lines}>
            {lines.map((line, index) => (
              <li key={line}>
                <Button data-line={index + 1} onClick={() => onExpress(lineGesture(line))}>
                  <kbd>Alt {index + 1}</kbd> {line}
                </Button>
              </li>
            ))}
          </ol>
          <Button look="quiet" data-action="edit-lines" onClick={() => setEdited(lines.join("\n"))}>
            {words.edit}
          </Button>
        </>
      ) : (
        <>
          <label class="small">
            {words.editHint(MAX_LINES)}
            <textarea
              class={css.editor}
              rows={MAX_LINES}
              value={edited}
              onInput={(event) => setEdited(event.currentTarget.value)}
            />
          </label>
          <Button
            look="main"
            data-action="keep-lines"
            onClick={() => {
              setLines(storeLines(edited));
              setEdited(undefined);
            }}
          >
            {words.keep}
          </Button>
        </>
      )}
    </fieldset>
  );
}

/** How often the countdown is updated, milliseconds. */
const TICK_MS = 100;

/** When the robot should act at the open decision. */
function Timing({ decision }: Pick<ConsoleProps, "decision">) {
  const words = t().wizard;
  const [pace, setPace] = useState(storedPace);
  const [typed, setTyped] = useState(`${pace.least}-${pace.most}`);
  const [time, setTime] = useState<{ id: bigint; ms: number } | undefined>(undefined);
  const [now, setNow] = useState(() => performance.now());
  const id = decision?.id;
  useEffect(() => {
    if (id === undefined) return;
    setTime({ id, ms: drawn(pace, Math.random()) });
    setNow(performance.now());
    const ticking = setInterval(() => setNow(performance.now()), TICK_MS);
    return () => clearInterval(ticking);
  }, [id, pace]);
  const left = decision && time && time.id === id ? time.ms - (now - decision.receivedAtMs) : undefined;
  return (
    <fieldset class={css.part}>
      <legend>{words.timing}</legend>
      <p class={css.timer} data-part="wizard-timer" data-now={left !== undefined && left <= 0 ? "" : undefined}>
        {left === undefined ? words.noDecision : left > 0 ? words.wait(Math.ceil(left / 1000)) : words.act}
      </p>
      <TextField
        label={words.pace}
        hint={words.paceHint}
        value={typed}
        fault={paceOf(typed) ? undefined : words.paceFault}
        onText={(text) => {
          setTyped(text);
          const pace = paceOf(text);
          if (!pace) return;
          storePace(pace);
          setPace(pace);
        }}
      />
    </fieldset>
  );
}

/** Every legal move, and the agent's suggestion. */
function Moves({ table, decision, hint, sending, onHint, onAnswer }: ConsoleProps) {
  const words = t().wizard;
  const suggested = decision && hint?.decision === decision.id ? hint.hint?.action : undefined;
  const asked = decision !== undefined && hint?.decision === decision.id;
  const moves = (decision?.legal ?? []).flatMap((action) => moveOf(action, table.faces) ?? []);
  return (
    <fieldset class={css.part}>
      <legend>{words.moves}</legend>
      {onHint ? (
        <Button data-action="suggest" disabled={!decision || asked || sending} onClick={onHint}>
          {words.suggest}
        </Button>
      ) : (
        <p class="soft small">{words.noHints}</p>
      )}
      <ul class={css.legal} data-part="wizard-moves">
        {moves.map((move) => {
          const action = actionOf(move, table.faces);
          return (
            <li key={action}>
              <Button
                look={action === suggested ? "main" : "plain"}
                data-move={action}
                disabled={sending}
                onClick={() => onAnswer(action)}
              >
                {moveWords(move)}
                {action === suggested && ` · ${words.suggested}`}
              </Button>
            </li>
          );
        })}
      </ul>
      {!decision && <p class="soft small">{words.noDecision}</p>}
    </fieldset>
  );
}
