// A button, and a link that looks like one. Colour is never all that tells them apart: the main one of a page is filled, others have an
// edge, dangerous ones say so in words.

import type { ButtonHTMLAttributes, ComponentChildren } from "preact";
import css from "./Button.module.css";

/** How much a button stands out. */
export type ButtonLook = "main" | "plain" | "quiet";

interface ButtonProps extends Omit<ButtonHTMLAttributes<HTMLButtonElement>, "loading"> {
  look?: ButtonLook;
  /** Something is under way: the button cannot be pressed again until it is done. */
  busy?: boolean;
  children: ComponentChildren;
}

/** A button. */
export function Button({ look = "plain", busy = false, disabled, type = "button", children, ...rest }: ButtonProps) {
  return (
    <button
      {...rest}
      type={type}
      class={css.button}
      data-part="button"
      data-look={look}
      disabled={busy || disabled}
      aria-busy={busy}
    >
      {children}
    </button>
  );
}

/** A link that looks like a button. */
export function ButtonLink(props: { href: string; look?: ButtonLook; children: ComponentChildren }) {
  return (
    <a class={css.button} data-part="button" data-look={props.look ?? "plain"} href={props.href}>
      {props.children}
    </a>
  );
}
