// The form that takes a place in a tournament: its join code (which a link may bring, ?code=) and a name.

import { useState } from "preact/hooks";
import { inWords } from "../api/faults";
import { ParticipantKind } from "../gen/chefshat/v1/room_pb";
import type { Tournament } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { MAX_NAME } from "../lobby/room-form";
import { lastName } from "../lobby/seat";
import { Button } from "../parts/Button";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { type HeldPlace, takePlace } from "./place";

interface JoinTournamentProps {
  tournament: Tournament;
  onJoined: (held: HeldPlace) => void;
}

/** The form. */
export function JoinTournament({ tournament, onJoined }: JoinTournamentProps) {
  const words = t().tournaments.join;
  const [code, setCode] = useState(new URLSearchParams(location.search).get("code") ?? "");
  const [name, setName] = useState(lastName());
  const [tried, setTried] = useState(false);
  const [busy, setBusy] = useState(false);
  const [fault, setFault] = useState("");
  const kinds = tournament.settings?.kinds ?? [];
  if (kinds.length > 0 && !kinds.includes(ParticipantKind.HUMAN)) return <p class="soft">{words.notForPeople}</p>;
  const join = async (event: Event) => {
    event.preventDefault();
    setTried(true);
    if (code.trim() === "" || name.trim() === "") return;
    setBusy(true);
    setFault("");
    try {
      onJoined(await takePlace(tournament.tournamentId, code, name));
    } catch (thrown) {
      setFault(inWords(thrown));
      setBusy(false);
    }
  };
  return (
    <form class="sheet tournament-join" onSubmit={join}>
      <h2>{words.title}</h2>
      <p>{words.text}</p>
      <TextField
        label={words.code}
        value={code}
        onText={setCode}
        autoCapitalize="characters"
        autoComplete="off"
        fault={tried && code.trim() === "" ? words.codeMissing : undefined}
      />
      <TextField
        label={words.name}
        hint={words.nameHint}
        value={name}
        onText={setName}
        maxLength={MAX_NAME}
        autoComplete="nickname"
        fault={tried && name.trim() === "" ? words.nameMissing : undefined}
      />
      {fault && <Notice kind="fault">{fault}</Notice>}
      <Button look="main" type="submit" busy={busy}>
        {words.submit}
      </Button>
    </form>
  );
}
