// Whether the cards are real, the number of players, and who fills each seat: players at the table,
// people, robots, connected agents or built-in agents.

import { t } from "../i18n";
import { SelectField, TextField } from "../parts/Field";
import { SeatNumber } from "../parts/SeatNumber";
import css from "./FormPage.module.css";
import type { FieldFaults } from "./form-state";
import {
  type FieldName,
  isAtTable,
  MAX_NAME,
  type RoomForm,
  SEARCHING,
  type SeatChoice,
  withCards,
  withPlayers,
} from "./room-form";

/** Possible numbers of players. */
const PLAYERS = ["2", "3", "4", "5", "6"] as const;

interface SeatFieldsProps {
  form: RoomForm;
  faults: FieldFaults<FieldName>;
  change: (changed: Partial<RoomForm>) => void;
  /** The built-in agents that the server offers. */
  agents: string[];
}

/** The part of the form. */
export function SeatFields({ form, faults, change, agents }: SeatFieldsProps) {
  const words = t().lobby.make;
  const real = form.cards === "real";
  const choices: SeatChoice[] = [
    ...(real ? (["at-table human", "at-table robot"] as const) : []),
    "human",
    "anybody",
    "agent",
    "robot",
    "model",
    ...(real ? [] : (["wizard"] as const)),
    ...agents.map((agent): SeatChoice => `built-in ${agent}`).filter((choice) => !real || choice !== SEARCHING),
  ];
  const options = choices.map((value) => ({ value, label: choiceWord(value, real) }));
  const players = PLAYERS.find((count) => Number(count) === form.seats.length) ?? "4";
  return (
    <>
      <div class={css.fields}>
        <SelectField
          label={words.cards}
          hint={real ? words.realHint : undefined}
          value={form.cards}
          options={[
            { value: "dealt", label: words.dealt },
            { value: "real", label: words.real },
          ]}
          onPick={(cards) => change(withCards(form, cards))}
        />
        <SelectField
          label={words.players}
          value={players}
          options={PLAYERS.map((value) => ({ value, label: value }))}
          onPick={(count) => change(withPlayers(form, Number(count)))}
        />
      </div>
      <ol class={`${css.seatFields} ${real ? css.named : ""}`} aria-label={words.seats}>
        {form.seats.map((choice, seat) => {
          const name = form.seatNames[seat] ?? "";
          return (
            <li key={seat}>
              <SeatNumber seat={seat} />
              <SelectField
                label={t().common.seat(seat)}
                value={choice}
                options={options}
                onPick={(picked) => change({ seats: form.seats.with(seat, picked) })}
              />
              {isAtTable(choice) && (
                <TextField
                  label={words.nameOf(seat)}
                  value={name}
                  fault={name.trim() === "" ? faults.seatNames : undefined}
                  onText={(typed) =>
                    change({ seatNames: form.seats.map((_, at) => (at === seat ? typed : (form.seatNames[at] ?? ""))) })
                  }
                  maxLength={MAX_NAME}
                />
              )}
            </li>
          );
        })}
      </ol>
    </>
  );
}

function choiceWord(choice: SeatChoice, real: boolean): string {
  const words = t().lobby.make.choices;
  switch (choice) {
    case "at-table human":
      return words.atTableHuman;
    case "at-table robot":
      return words.atTableRobot;
    case "wizard":
      return words.wizard;
    case "human":
    case "anybody":
    case "agent":
    case "robot":
    case "model": {
      const free = words[choice];
      return real ? words.remote(free.charAt(0).toLowerCase() + free.slice(1)) : free;
    }
    default:
      return words.builtIn(choice.slice("built-in ".length));
  }
}
