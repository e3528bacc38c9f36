// The number of players, and who fills each seat: people, robots, connected agents or built-in
// agents.

import { t } from "../i18n";
import { SelectField } from "../parts/Field";
import { SeatNumber } from "../parts/SeatNumber";
import css from "./FormPage.module.css";
import type { FormProps } from "./NewRoom";
import { type SeatChoice, withPlayers } from "./room-form";

/** Possible numbers of players. */
const PLAYERS = ["2", "3", "4", "5", "6"] as const;

/** The part of the form. */
export function SeatFields({ form, change, agents }: FormProps & { agents: string[] }) {
  const words = t().lobby.make;
  const choices: SeatChoice[] = [
    "human",
    "anybody",
    "agent",
    "robot",
    ...agents.map((agent): SeatChoice => `built-in ${agent}`),
  ];
  const options = choices.map((value) => ({ value, label: choiceWord(value) }));
  const players = PLAYERS.find((count) => Number(count) === form.seats.length) ?? "4";
  return (
    <>
      <SelectField
        label={words.players}
        value={players}
        options={PLAYERS.map((value) => ({ value, label: value }))}
        onPick={(count) => change(withPlayers(form, Number(count)))}
      />
      <ol class={css.seatFields} aria-label={words.seats}>
        {form.seats.map((choice, seat) => (
          <li key={seat}>
            <SeatNumber seat={seat} />
            <SelectField
              label={t().common.seat(seat)}
              value={choice}
              options={options}
              onPick={(picked) => change({ seats: form.seats.with(seat, picked) })}
            />
          </li>
        ))}
      </ol>
    </>
  );
}

function choiceWord(choice: SeatChoice): string {
  const words = t().lobby.make.choices;
  switch (choice) {
    case "human":
      return words.human;
    case "anybody":
      return words.anybody;
    case "agent":
      return words.agent;
    case "robot":
      return words.robot;
    default:
      return words.builtIn(choice.slice("built-in ".length));
  }
}
