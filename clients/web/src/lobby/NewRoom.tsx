// Making a room: who plays, by which rules, how fast, what happens to those who are late, who may watch. What most people never
// change is folded away. What the form holds and asks for is in room-form.ts.

import { useEffect, useState } from "preact/hooks";
import { faultOf, wordsOf } from "../api/faults";
import { serverInfo } from "../api/server";
import type { RuleSet } from "../gen/chefshat/v1/rules_pb";
import { t } from "../i18n";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { navigate } from "../router";
import { ClockFields, FaultFields, RuleFields, WatchFields } from "./RoomFields";
import { type FieldName, fieldOf, MAX_NAME, newForm, type RoomForm, requestOf, unreadable } from "./room-form";
import { SeatFields } from "./SeatFields";
import { makeRoom } from "./seat";
import "./new-room.css";

/** What a part of the form gets: the form, the faults of its fields, and how to change it. */
export interface FormProps {
  form: RoomForm;
  faults: Partial<Record<FieldName, string>>;
  change: (changed: Partial<RoomForm>) => void;
}

/** What the server can host. */
export interface Offered {
  presets: RuleSet[];
  agents: string[];
}

/** The page. */
export function NewRoom() {
  const words = t().lobby.make;
  const [offered, setOffered] = useState<Offered | null>(null);
  const [fault, setFault] = useState<string | null>(null);
  useEffect(() => {
    serverInfo().then(
      ({ presets, builtInAgents }) => setOffered({ presets, agents: builtInAgents }),
      (error: unknown) => setFault(wordsOf(faultOf(error))),
    );
  }, []);
  return (
    <section class="new-room">
      <h1>{words.title}</h1>
      {fault && <Notice kind="fault">{fault}</Notice>}
      {offered && <RoomFormView offered={offered} />}
    </section>
  );
}

function RoomFormView({ offered }: { offered: Offered }) {
  const words = t().lobby.make;
  const [form, setForm] = useState(() => newForm(offered.agents));
  const [faults, setFaults] = useState<FormProps["faults"]>({});
  const [refusal, setRefusal] = useState<string | null>(null);
  const [busy, setBusy] = useState(false);
  const [open, setOpen] = useState(false);
  const change = (changed: Partial<RoomForm>) => {
    setForm((before) => ({ ...before, ...changed }));
    setFaults((before) => Object.fromEntries(Object.entries(before).filter(([field]) => !(field in changed))));
  };
  const refuse = (refused: FormProps["faults"], words: string) => {
    setFaults(refused);
    setRefusal(words);
    setOpen(true);
  };
  const submit = async (event: Event) => {
    event.preventDefault();
    const bad = unreadable(form);
    if (bad.length > 0) {
      refuse(Object.fromEntries(bad.map((field) => [field, words.notANumber])), words.lookAgain);
      return;
    }
    setBusy(true);
    setRefusal(null);
    try {
      const { room } = await makeRoom(requestOf(form));
      navigate({ page: "room", roomId: room.roomId });
    } catch (error) {
      setBusy(false);
      const fault = faultOf(error);
      const field = fieldOf(fault.metadata.field ?? "");
      refuse(field ? { [field]: fault.message } : {}, field ? words.lookAgain : wordsOf(fault));
    }
  };
  const parts = { form, faults, change };
  return (
    <form class="new-room-form" onSubmit={submit} noValidate>
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
      <details class="sheet new-room-part" open={open} onToggle={(event) => setOpen(event.currentTarget.open)}>
        <summary>
          <h2>{words.more}</h2>
        </summary>
        <h3>{words.rules}</h3>
        <RuleFields {...parts} presets={offered.presets} />
        <h3>{words.faults}</h3>
        <FaultFields {...parts} agents={offered.agents} />
        <h3>{words.watching}</h3>
        <WatchFields {...parts} />
      </details>
      {refusal && <Notice kind="fault">{refusal}</Notice>}
      <div>
        <Button look="main" type="submit" busy={busy}>
          {words.submit}
        </Button>
      </div>
    </form>
  );
}
