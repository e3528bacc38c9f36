// The page that creates a room: who plays, by which rules, how fast, what happens to late answers,
// who may watch. The form's fields are in room-form.ts.

import { agentsFor, type Offered } from "../api/server";
import { t } from "../i18n";
import { SelectField } from "../parts/Field";
import { navigateFromHere } from "../router";
import { FormFrame, FormPage, FormPart } from "./FormPage";
import { type FieldFaults, useFormState } from "./form-state";
import { ClockFields, FaultFields, RuleFields, VisibilityField, WatchFields, wordsOfProblems } from "./GameFields";
import { gameProblems } from "./game-form";
import { type FieldName, newForm, physicalProblems, ROOM_FIELDS, type RoomForm, requestOf } from "./room-form";
import { SeatFields } from "./SeatFields";
import { createRoom } from "./seat";

/** The page. */
export function NewRoom() {
  return <FormPage title={t().lobby.make.title}>{(offered) => <RoomFormView offered={offered} />}</FormPage>;
}

function RoomFormView({ offered }: { offered: Offered }) {
  const words = t().lobby.make;
  const state = useFormState(() => newForm(offered.agents), {
    check: (form) => ({
      ...wordsOfProblems<FieldName>(gameProblems(form, form.seats.length)),
      ...wordsOfPhysical(form),
    }),
    fields: ROOM_FIELDS,
    send: async (form) => {
      const navigate = navigateFromHere();
      const { room } = await createRoom(requestOf(form));
      navigate({ page: form.cards === "real" ? "attend" : "room", roomId: room.roomId });
    },
  });
  const { form, faults, change } = state;
  const parts = { form, faults, change };
  const aborts = ["allLost", "anyLost", "never"] as const;
  const folded = (
    <>
      <h3>{words.rules}</h3>
      <RuleFields {...parts} players={form.seats.length} presets={offered.presets} />
      <h3>{words.faults}</h3>
      <FaultFields {...parts} agents={agentsFor(offered, form.cards === "real", form.substitute)}>
        <SelectField
          label={words.fault.abort}
          value={form.abort}
          options={aborts.map((value) => ({ value, label: words.fault.aborts[value] }))}
          onPick={(abort) => change({ abort })}
        />
      </FaultFields>
      <h3>{words.watching}</h3>
      <WatchFields {...parts} />
    </>
  );
  return (
    <FormFrame state={state} words={words} first={<SeatFields {...parts} agents={offered.agents} />} folded={folded}>
      <FormPart title={words.clock}>
        <ClockFields {...parts} />
      </FormPart>
      <FormPart title={words.visibility.title}>
        <VisibilityField {...parts} />
      </FormPart>
    </FormFrame>
  );
}

/** What is wrong with a room for real cards, in words. */
function wordsOfPhysical(form: RoomForm): FieldFaults<FieldName> {
  const words = t().lobby.make;
  const entries = Object.entries(physicalProblems(form));
  return Object.fromEntries(entries.map(([field, problem]) => [field, words[problem]]));
}
