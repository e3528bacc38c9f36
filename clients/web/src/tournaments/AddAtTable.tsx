// The organiser's form that adds a participant at a physical table, for whom nobody joins.

import { useState } from "preact/hooks";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import { t } from "../i18n";
import { MAX_NAME } from "../lobby/room-form";
import { Submit } from "../parts/ActionButton";
import { useAttempt } from "../parts/attempt";
import { SelectField, TextField } from "../parts/Field";
import { addAtTable } from "./hosting";
import css from "./Tournaments.module.css";

const KINDS = { human: ParticipantKind.HUMAN, robot: ParticipantKind.ROBOT };

/** The form. */
export function AddAtTable({ tournamentId }: { tournamentId: string }) {
  const words = t().organise.own.atTable;
  const { atTableHuman, atTableRobot } = t().lobby.make.choices;
  const [name, setName] = useState("");
  const [kind, setKind] = useState<keyof typeof KINDS>("human");
  const [tried, setTried] = useState(false);
  const { busy, fault, run } = useAttempt();
  const add = (event: Event) => {
    event.preventDefault();
    setTried(true);
    if (name.trim() === "") return;
    run(async () => {
      await addAtTable(tournamentId, name, KINDS[kind]);
      setName("");
      setTried(false);
      return false;
    });
  };
  return (
    <form class={css.join} onSubmit={add} data-part="add-at-table">
      <h3>{words.title}</h3>
      <p class="soft small">{words.text}</p>
      <TextField
        label={words.name}
        value={name}
        onText={setName}
        maxLength={MAX_NAME}
        fault={tried && name.trim() === "" ? t().organise.problems.nameMissing : undefined}
      />
      <SelectField
        label={words.kind}
        value={kind}
        options={[
          { value: "human", label: atTableHuman },
          { value: "robot", label: atTableRobot },
        ]}
        onPick={setKind}
      />
      <Submit look="plain" {...{ busy, fault }}>
        {words.submit}
      </Submit>
    </form>
  );
}
