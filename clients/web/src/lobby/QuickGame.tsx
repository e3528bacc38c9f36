// One press from the lobby to the table: a room with three built-in agents, the relaxed clock, and the person on the first seat.

import { useState } from "preact/hooks";
import { inWords } from "../api/faults";
import { t } from "../i18n";
import { Button, ButtonLink } from "../parts/Button";
import { Drawing, faceDrawing } from "../parts/Drawing";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { playNow } from "./play-now";
import { MAX_NAME } from "./room-form";
import { lastName } from "./seat";
import "./quick-game.css";

/** The tile. */
export function QuickGame() {
  const words = t().lobby.quick;
  const [name, setName] = useState(lastName());
  const [busy, setBusy] = useState(false);
  const [fault, setFault] = useState<string | null>(null);
  const start = async (event: Event) => {
    event.preventDefault();
    setBusy(true);
    setFault(null);
    try {
      await playNow(name);
    } catch (error) {
      setFault(inWords(error));
      setBusy(false);
    }
  };
  return (
    <section class="quick">
      <div class="quick-cards" aria-hidden="true">
        {[1, 5, 8, 10].map((face) => (
          <span key={face} class="quick-card">
            <b>{face}</b>
            <Drawing name={faceDrawing(face)} />
          </span>
        ))}
      </div>
      <h2>{words.title}</h2>
      <p>{words.text}</p>
      <form class="quick-form" onSubmit={start}>
        <TextField
          label={words.name}
          value={name}
          onText={setName}
          maxLength={MAX_NAME}
          placeholder={words.guest}
          autoComplete="nickname"
        />
        <Button look="main" type="submit" busy={busy}>
          {words.start}
        </Button>
      </form>
      {fault && <Notice kind="fault">{fault}</Notice>}
      <p class="small">{t().lobby.make.clocks.hints.relaxed}</p>
      <p>
        <ButtonLink href="/tutorial" look="quiet">
          {words.learn}
        </ButtonLink>
      </p>
    </section>
  );
}
