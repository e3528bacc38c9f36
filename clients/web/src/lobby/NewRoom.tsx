// Making a room: who plays, by which rules, how fast, what happens to those who are late, who may watch. What most people never
// change is folded away. What the form holds and asks for is in room-form.ts.

import { type Offered, useOffered } from "../api/server";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { SelectField, TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { navigate } from "../router";
import { type FieldFaults, useFilling } from "./filling";
import { ClockFields, FaultFields, RuleFields, WatchFields, wordsOfProblems } from "./GameFields";
import { gameProblems } from "./game-form";
import { type FieldName, MAX_NAME, newForm, ROOM_FIELDS, type RoomForm, requestOf } from "./room-form";
import { SeatFields } from "./SeatFields";
import { makeRoom } from "./seat";
import "./new-room.css";

/** What a part of the form gets: the form, the faults of its fields, and how to change it. */
export interface FormProps {
  form: RoomForm;
  faults: FieldFaults<FieldName>;
  change: (changed: Partial<RoomForm>) => void;
}

/** The page. */
export function NewRoom() {
  const { offered, fault } = useOffered();
  return (
    <section class="new-room">
      <h1>{t().lobby.make.title}</h1>
      {fault && <Notice kind="fault">{fault}</Notice>}
      {offered && <RoomFormView offered={offered} />}
    </section>
  );
}

function RoomFormView({ offered }: { offered: Offered }) {
  const words = t().lobby.make;
  const filling = useFilling(() => newForm(offered.agents), {
    check: (form) => wordsOfProblems<FieldName>(gameProblems(form, form.seats.length)),
    fields: ROOM_FIELDS,
    send: async (form) => {
      const { room } = await makeRoom(requestOf(form));
      navigate({ page: "room", roomId: room.roomId });
    },
  });
  const { form, faults, change } = filling;
  const parts = { form, faults, change };
  const aborts = ["allLost", "anyLost", "never"] as const;
  return (
    <form class="new-room-form" onSubmit={filling.submit} noValidate>
      <section class="sheet new-room-part">
        <TextField
          label={words.name}
          value={form.name}
          onText={(name) => change({ name })}
          fault={faults.name}
          maxLength={MAX_NAME}
          autoComplete="off"
          placeholder={words.namePlaceholder}
        />
        <SeatFields {...parts} agents={offered.agents} />
      </section>
      <section class="sheet new-room-part">
        <h2>{words.clock}</h2>
        <ClockFields {...parts} />
      </section>
      <details
        class="sheet new-room-part"
        open={filling.unfolded}
        onToggle={(event) => filling.unfold(event.currentTarget.open)}
      >
        <summary>
          <h2>{words.more}</h2>
        </summary>
        <h3>{words.rules}</h3>
        <RuleFields {...parts} players={form.seats.length} presets={offered.presets} />
        <h3>{words.faults}</h3>
        <FaultFields {...parts} agents={offered.agents}>
          <SelectField
            label={words.fault.abort}
            value={form.abort}
            options={aborts.map((value) => ({ value, label: words.fault.aborts[value] }))}
            onPick={(abort) => change({ abort })}
          />
        </FaultFields>
        <h3>{words.watching}</h3>
        <WatchFields {...parts} />
      </details>
      {filling.refusal && <Notice kind="fault">{filling.refusal}</Notice>}
      <div>
        <Button look="main" type="submit" busy={filling.busy}>
          {words.submit}
        </Button>
      </div>
    </form>
  );
}
