// The controls that reports are entered with: a seat, the cards of a play, the cards of a hand.

import type { ComponentChildren } from "preact";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { Card } from "../parts/Card";
import { CheckField, TextField } from "../parts/Field";
import { SeatNumber } from "../parts/SeatNumber";
import { type Card as CardValue, stacks } from "../table/model/cards";
import type { Requirement } from "../table/model/requirement";
import type { TableState as Table } from "../table/model/state";
import { cardWord, distinctName, playWords } from "../table/words";
import { type Deck, type HandProblem, handText, type PlayDraft, parseHand } from "./entries";
import css from "./Picks.module.css";

/** Most cards in one row. */
const ONE_ROW = 8;

interface ChoiceProps {
  label: string;
  /** Hides the label for readers who see the buttons. */
  quiet?: boolean;
  /** Number of options that are cards; undefined if they are not. */
  cards?: number;
  children: ComponentChildren;
}

/** A group of buttons of which one is chosen. */
export function Choice({ label, quiet = false, cards, children }: ChoiceProps) {
  return (
    <fieldset class={css.choice} data-part="choice">
      <legend class={quiet ? "visually-hidden" : ""}>{label}</legend>
      {cards === undefined ? (
        <div class={css.options}>{children}</div>
      ) : (
        <div class={css.faces} style={{ "--columns": cards > ONE_ROW ? Math.ceil(cards / 2) : cards }}>
          {children}
        </div>
      )}
    </fieldset>
  );
}

interface OptionProps {
  chosen: boolean;
  onChoose: () => void;
  children: ComponentChildren;
}

/** A button of a choice. */
export function Option({ chosen, onChoose, children }: OptionProps) {
  return (
    <button type="button" class={css.option} aria-pressed={chosen} onClick={onChoose}>
      {children}
    </button>
  );
}

interface SeatPickProps {
  table: Table;
  seats: readonly number[];
  value: number | undefined;
  onPick: (seat: number) => void;
}

/** Who it was. */
export function SeatPick({ table, seats, value, onPick }: SeatPickProps) {
  return (
    <Choice label={t().attend.enter.seat}>
      {seats.map((seat) => (
        <Option key={seat} chosen={seat === value} onChoose={() => onPick(seat)}>
          <SeatNumber seat={seat} /> <span>{distinctName(table, seat)}</span>
        </Option>
      ))}
    </Choice>
  );
}

interface PlayPickProps {
  deck: Deck;
  draft: PlayDraft;
  /** What a play must be now, if it is known: other faces are dimmed, but can be entered. */
  requirement: Requirement | undefined;
  /** Whether the Golden card can be among cards of the top face. */
  golden: boolean;
  onChange: (draft: PlayDraft) => void;
}

/** The cards of a play: the face, how many, jokers, the Golden card. */
export function PlayPick({ deck, draft, requirement, golden, onChange }: PlayPickProps) {
  const words = t().attend.enter;
  const { faces, jokers } = deck;
  const numbers = Array.from({ length: faces + (jokers > 0 ? 1 : 0) }, (_, index) => index + 1);
  const alone = draft.face !== undefined && draft.face > faces;
  const allowed = (face: number) => {
    if (!requirement) return true;
    if (face > faces) return requirement.loneJoker;
    return requirement.lowestFace <= face && face <= requirement.highestFace;
  };
  const pick = (face: number) => {
    const fewest = face > faces ? 1 : Math.max(1, (requirement?.fewestCards ?? 1) - draft.jokers);
    onChange({
      face,
      quantity: Math.min(face, Math.max(fewest, draft.quantity)),
      jokers: face > faces ? 0 : draft.jokers,
      golden: face === faces && golden && (requirement?.goldenCard ?? false),
    });
  };
  return (
    <div class={css.play}>
      <Choice label={words.face} cards={numbers.length}>
        {numbers.map((face) => {
          const card: CardValue = face > faces ? { kind: "joker" } : { kind: "face", face };
          return (
            <button
              key={face}
              type="button"
              class={`${css.face} ${allowed(face) ? "" : css.dim}`}
              data-part="face-option"
              data-face={face > faces ? "J" : face}
              aria-pressed={draft.face === face}
              aria-label={`${face > faces ? t().table.lookup.loneJoker : cardWord(card)}${allowed(face) ? "" : `, ${words.notAllowed}`}`}
              onClick={() => pick(face)}
            >
              <Card card={card} />
            </button>
          );
        })}
      </Choice>
      {draft.face !== undefined && !alone && (
        <div class={css.counts}>
          <Stepper
            label={words.number}
            value={draft.quantity}
            from={1}
            to={draft.face}
            onChange={(quantity) => onChange({ ...draft, quantity })}
          />
          {jokers > 0 && (
            <Stepper
              label={words.jokers}
              value={draft.jokers}
              from={0}
              to={jokers}
              onChange={(with_) => onChange({ ...draft, jokers: with_ })}
            />
          )}
          {golden && draft.face === faces && (
            <CheckField
              label={words.golden(faces)}
              checked={draft.golden}
              onCheck={(golden) => onChange({ ...draft, golden })}
            />
          )}
        </div>
      )}
    </div>
  );
}

interface StepperProps {
  label: string;
  value: number;
  from: number;
  to: number;
  onChange: (value: number) => void;
}

/** A small number with a button on either side. */
function Stepper({ label, value, from, to, onChange }: StepperProps) {
  const words = t().attend.enter;
  return (
    <fieldset class={css.stepper} aria-label={label}>
      <span class={css.stepperLabel}>{label}</span>
      <button
        type="button"
        class={css.step}
        aria-label={words.fewer(label)}
        aria-disabled={value <= from}
        onClick={() => value > from && onChange(value - 1)}
      >
        −
      </button>
      <output class={`${css.value} number`}>{value}</output>
      <button
        type="button"
        class={css.step}
        aria-label={words.more(label)}
        aria-disabled={value >= to}
        onClick={() => value < to && onChange(value + 1)}
      >
        +
      </button>
    </fieldset>
  );
}

/** Cards side by side, with their words for screen readers; nothing for no cards. */
export function Cards({ cards, words }: { cards: readonly CardValue[]; words?: string }) {
  if (cards.length === 0) return null;
  return (
    <div class={css.cards} data-part="shown-cards">
      <span class="visually-hidden">{words ?? playWords(cards)}</span>
      {stacks(cards).map((stack, index) => (
        <span key={index} class={css.stack} aria-hidden="true">
          {stack.map((card, inStack) => (
            <Card key={inStack} card={card} />
          ))}
        </span>
      ))}
    </div>
  );
}

interface HandPickProps {
  deck: Deck;
  /** What is typed. */
  text: string;
  /** Whether the Golden card is among them. */
  golden: boolean;
  /** Whether to ask for the Golden card. */
  asksGolden: boolean;
  /** Number of cards that there should be, if it is known. */
  expected?: number | undefined;
  fault?: string | undefined;
  onChange: (changed: { text?: string; golden?: boolean }) => void;
}

/** The cards of a hand or gift, typed or tapped. */
export function HandPick({ deck, text, golden, asksGolden, expected, fault, onChange }: HandPickProps) {
  const words = t().attend.enter.hand;
  const { cards, problem } = parseHand(text, deck);
  const { faces, jokers } = deck;
  const all = Array.from({ length: faces + (jokers > 0 ? 1 : 0) }, (_, index) => index + 1);
  const put = (next: readonly number[]) => onChange({ text: handText(next, deck) });
  const asCard = (card: number): CardValue => (card > faces ? { kind: "joker" } : { kind: "face", face: card });
  return (
    <div class={css.hand}>
      <TextField
        label={words.label}
        hint={words.hint}
        value={text}
        fault={problem ? problemWords(problem) : fault}
        onText={(typed) => onChange({ text: typed })}
        autoCapitalize="characters"
      />
      <Choice label={words.tap} cards={all.length}>
        {all.map((card) => {
          const count = cards.filter((other) => other === card).length;
          const full = count >= (card > faces ? jokers : card);
          return (
            <span key={card} class={css.tap}>
              <button
                type="button"
                class={`${css.face} ${full ? css.dim : ""}`}
                data-part="hand-option"
                data-face={card > faces ? "J" : card}
                aria-label={`${words.add(cardWord(asCard(card)))}${count > 0 ? `, ${count}` : ""}`}
                aria-disabled={full}
                onClick={() => !full && put([...cards, card])}
              >
                <Card card={asCard(card)} />
              </button>
              {count > 0 && (
                <b class={`${css.count} number`} aria-hidden="true">
                  {count}
                </b>
              )}
              {count > 0 && (
                <button
                  type="button"
                  class={css.less}
                  aria-label={words.remove(cardWord(asCard(card)))}
                  onClick={() => put(cards.toSpliced(cards.indexOf(card), 1))}
                >
                  −
                </button>
              )}
            </span>
          );
        })}
      </Choice>
      {asksGolden && cards.includes(faces) && (
        <CheckField
          label={t().attend.enter.golden(faces)}
          checked={golden}
          onCheck={(checked) => onChange({ golden: checked })}
        />
      )}
      <p class={css.total}>
        <output class="number">{words.count(cards.length, expected)}</output>{" "}
        {text !== "" && (
          <Button look="quiet" onClick={() => onChange({ text: "", golden: false })}>
            {words.clear}
          </Button>
        )}
      </p>
    </div>
  );
}

/** What is wrong with typed cards, in words. */
function problemWords(problem: HandProblem): string {
  const words = t().attend.enter.hand;
  switch (problem.kind) {
    case "word":
      return words.word(problem.word);
    case "tooMany":
      return words.tooMany(problem.face, problem.all);
    case "tooManyJokers":
      return words.tooManyJokers(problem.all);
  }
}
