// Asks which seat or place to use when a link brings one to a device that already has another.

import { Button } from "../parts/Button";
import css from "./Join.module.css";

interface WhichOneProps<Held extends { readonly name: string }> {
  held: Held;
  brought: Held;
  words: {
    title: string;
    text: (held: string, brought: string) => string;
    lost: (held: string) => string;
    stay: (held: string) => string;
    take: (brought: string) => string;
  };
  /** The one from the link, or null to stay with the own one. */
  decide: (chosen: Held | null) => void;
}

export function WhichOne<Held extends { readonly name: string }>(props: WhichOneProps<Held>) {
  const { held, brought, words, decide } = props;
  return (
    <section class={`sheet ${css.page}`} data-part="which-one">
      <h1>{words.title}</h1>
      <p>{words.text(held.name, brought.name)}</p>
      <p class="soft">{words.lost(held.name)}</p>
      <Button look="main" onClick={() => decide(null)}>
        {words.stay(held.name)}
      </Button>
      <Button onClick={() => decide(brought)}>{words.take(brought.name)}</Button>
    </section>
  );
}
