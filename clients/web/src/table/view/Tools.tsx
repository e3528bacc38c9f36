// The tools beside the table's heading: look-up table and sound; and the expressions.

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { ExpressionSource } from "../../gen/chefshat/v1/decision_pb";
import { t } from "../../i18n";
import { Button } from "../../parts/Button";
import { Dialog } from "../../parts/Dialog";
import { TextField } from "../../parts/Field";
import { Icon } from "../../parts/Icon";
import {
  type Gesture,
  gesture,
  LABELS,
  lineGesture,
  MAX_LINE,
  PHRASES,
  type Phrase,
  phraseGesture,
} from "../expressions";
import type { OpenDecision } from "../model/live";
import { lookupOf } from "../model/lookup";
import type { Requirement } from "../model/requirement";
import type { TableState } from "../model/state";
import { setSound, soundOn } from "../sounds";
import { Face } from "./Face";
import { LookupTable } from "./LookupTable";
import css from "./Tools.module.css";

/** A turn for the look-up table. */
export interface ShownTurn {
  readonly table: TableState;
  readonly decision: Pick<OpenDecision, "hand" | "legal"> & { readonly requirement: Requirement };
}

interface ToolProps {
  label: string;
  "data-part"?: string;
  /** Of a switch: whether it is on. */
  pressed?: boolean;
  onClick: () => void;
  /** The drawing of the icon. */
  children: ComponentChildren;
}

/** An icon that does something. */
export function Tool({ label, "data-part": part = "tool", pressed, onClick, children }: ToolProps) {
  return (
    <button
      type="button"
      class={css.tool}
      data-part={part}
      aria-pressed={pressed}
      aria-label={label}
      title={label}
      onClick={onClick}
    >
      <Icon>{children}</Icon>
    </button>
  );
}

interface ToolsProps {
  /** The reader's last turn. */
  turn: ShownTurn | undefined;
  /** Whether the reader has turns at all. */
  lookup: boolean;
  /** Additional tools. */
  children?: ComponentChildren;
}

export function Tools({ turn, lookup, children }: ToolsProps) {
  const words = t().table.tools;
  const [open, setOpen] = useState<ShownTurn | "none" | undefined>(undefined);
  const on = soundOn.value;
  return (
    <fieldset class={css.tools} aria-label={words.label}>
      {lookup && (
        <Tool label={t().table.lookup.title} data-part="tool tool-lookup" onClick={() => setOpen(turn ?? "none")}>
          <path d="M4 4h16v16H4ZM4 9.3h16M4 14.6h16M9.3 4v16M14.6 4v16" />
        </Tool>
      )}
      <Tool label={on ? words.soundOn : words.soundOff} pressed={on} onClick={() => setSound(!on)}>
        <path fill="currentColor" d="M4 9.5v5h3.5L12 19V5L7.500 9.500Z" />
        <path d={on ? "M15.500 9a4 4 0 0 1 0 6M18 6.500a8 8 0 0 1 0 11" : "M16 9.500l5 5M21 9.500l-5 5"} />
      </Tool>
      {children}
      {open && (
        <Dialog title={t().table.lookup.title} onClose={() => setOpen(undefined)}>
          {open === "none" ? (
            <p>{t().table.lookup.none}</p>
          ) : (
            <LookupTable
              lookup={lookupOf(open.table, open.decision.requirement, open.decision.hand, new Set(open.decision.legal))}
            />
          )}
        </Dialog>
      )}
    </fieldset>
  );
}

interface ExpressionsProps {
  /** Resolves to whether it was sent. */
  onExpress: (gesture: Gesture) => Promise<boolean>;
  /** Whether there are quick phrases too. */
  phrases: boolean;
  /** Whether people may write. */
  chat: boolean;
}

export function Expressions({ onExpress, phrases, chat }: ExpressionsProps) {
  const words = t().table.expressions;
  const [talking, setTalking] = useState(false);
  const [typed, setTyped] = useState("");
  const say = (gesture: Gesture) => {
    setTalking(false);
    return onExpress(gesture);
  };
  const write = async () => {
    const sent = await say(lineGesture(typed.trim(), ExpressionSource.SELF_REPORT));
    // Words that did not arrive are there when the dialog is opened again.
    if (sent) setTyped((now) => (now === typed ? "" : now));
  };
  return (
    <fieldset class={css.expressions} data-part="expressions" aria-label={words.label}>
      {LABELS.map((label) => (
        <button
          key={label}
          type="button"
          class={css.tool}
          data-part="tool"
          aria-label={words.words[label]}
          title={words.words[label]}
          onClick={() => void onExpress(gesture(label))}
        >
          <Face label={label} />
        </button>
      ))}
      {(phrases || chat) && (
        <Tool label={words.say} onClick={() => setTalking(true)}>
          <path d="M4 5h16v11H11l-4.500 4v-4H4ZM8 9h8M8 12h5" />
        </Tool>
      )}
      {talking && (
        <Dialog title={words.say} onClose={() => setTalking(false)}>
          {chat && <OwnWords text={typed} onText={setTyped} onSend={() => void write()} />}
          {phrases && (
            <div class={css.phrases} data-part="phrases">
              {(Object.keys(PHRASES) as Phrase[]).map((phrase) => (
                <Button key={phrase} onClick={() => void say(phraseGesture(phrase))}>
                  {words.phrases[phrase]}
                </Button>
              ))}
            </div>
          )}
        </Dialog>
      )}
    </fieldset>
  );
}

/** A line of the person's own words. */
function OwnWords(props: { text: string; onText: (text: string) => void; onSend: () => void }) {
  const words = t().table.expressions;
  const isEmpty = props.text.trim() === "";
  return (
    <form
      class={css.ownWords}
      onSubmit={(event) => {
        event.preventDefault();
        if (!isEmpty) props.onSend();
      }}
    >
      <TextField label={words.ownWords} value={props.text} maxLength={MAX_LINE} onText={props.onText} />
      <Button look="main" type="submit" disabled={isEmpty}>
        {words.sayIt}
      </Button>
    </form>
  );
}
