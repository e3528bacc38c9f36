// A game in one click: a room with three built-in agents and the relaxed clock, with the person on
// the first seat.

import { useState } from "preact/hooks";
import { t } from "../i18n";
import { useAttempt } from "../parts/attempt";
import { Button, ButtonLink } from "../parts/Button";
import { Drawing, faceDrawing } from "../parts/Drawing";
import { TextField } from "../parts/Field";
import { Notice } from "../parts/Notice";
import { playNow } from "./play-now";
import css from "./QuickGame.module.css";
import { MAX_NAME } from "./room-form";
import { lastName } from "./seat";

/** The tile. */
export function QuickGame() {
  const words = t().lobby.quick;
  const [name, setName] = useState(lastName());
  const { busy, fault, run } = useAttempt();
  const start = (event: Event) => {
    event.preventDefault();
    run(() => playNow(name));
  };
  return (
    <section class={css.quick} data-part="quick">
      <div class={css.cards} aria-hidden="true">
        {[1, 5, 8, 10].map((face, index) => (
          <span key={face} class={css.card} style={{ "--nth": index }}>
            <b>{face}</b>
            <Drawing name={faceDrawing(face)} />
          </span>
        ))}
      </div>
      <h2>{words.title}</h2>
      <p>{words.text}</p>
      <form class={css.form} onSubmit={start}>
        <TextField
          label={t().lobby.join.name}
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
