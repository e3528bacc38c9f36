// A button, and a link that looks like one. Colour is never the only difference: the main button is
// filled, others have a border, dangerous ones say so in words.

import type { ButtonHTMLAttributes, ComponentChildren } from "preact";
import css from "./Button.module.css";

/** How prominent a button is. */
export type ButtonLook = "main" | "plain" | "quiet";

interface ButtonProps extends Omit<ButtonHTMLAttributes<HTMLButtonElement>, "loading"> {
  look?: ButtonLook;
  /** An action is running: the button cannot be pressed. */
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
