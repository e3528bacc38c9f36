// The form that joins a tournament: the join code (which a link may set with ?code=) and a name.

import { useState } from "preact/hooks";
import type { Tournament } from "../gen/chefshat/v1/tournament_pb";
import { t } from "../i18n";
import { MAX_NAME } from "../lobby/room-form";
import { lastName } from "../lobby/seat";
import { Submit } from "../parts/ActionButton";
import { useAttempt } from "../parts/attempt";
import { TextField } from "../parts/Field";
import { hostedTournament } from "./hosting";
import { takePlace } from "./place";
import css from "./Tournaments.module.css";
import { isForPeople } from "./words";

interface JoinTournamentProps {
  tournament: Tournament;
  onJoined: () => void;
}

/** The form. */
export function JoinTournament({ tournament, onJoined }: JoinTournamentProps) {
  const words = t().tournaments.join;
  const [code, setCode] = useState(() => codeOf(tournament));
  const [name, setName] = useState(lastName());
  const [tried, setTried] = useState(false);
  const { busy, fault, run } = useAttempt();
  if (!isForPeople(tournament)) return <p class="soft">{words.notForPeople}</p>;
  const join = (event: Event) => {
    event.preventDefault();
    setTried(true);
    if (code.trim() === "" || name.trim() === "") return;
    run(async () => {
      await takePlace(tournament.tournamentId, code, name);
      onJoined();
    });
  };
  return (
    <form class={`sheet ${css.join}`} onSubmit={join}>
      <h2>{words.title}</h2>
      <p>{words.text}</p>
      <TextField
        label={words.code}
        value={code}
        onText={setCode}
        autoCapitalize="characters"
        fault={tried && code.trim() === "" ? words.codeMissing : undefined}
      />
      <TextField
        label={t().lobby.join.name}
        hint={words.nameHint}
        value={name}
        onText={setName}
        maxLength={MAX_NAME}
        autoComplete="nickname"
        fault={tried && name.trim() === "" ? t().lobby.join.nameMissing : undefined}
      />
      <Submit {...{ busy, fault }}>{words.submit}</Submit>
    </form>
  );
}

/** The join code, if it is in the address or this device created the tournament. */
function codeOf({ tournamentId }: Tournament): string {
  return new URLSearchParams(location.search).get("code") ?? hostedTournament(tournamentId)?.joinCode ?? "";
}
