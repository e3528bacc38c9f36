// Buttons that call the server, with the reason why a call failed beside them.

import type { ComponentChildren } from "preact";
import { type Attempt, useAttempt } from "./attempt";
import { Button, type ButtonLook } from "./Button";
import { Notice } from "./Notice";

interface ActionButtonProps {
  look?: ButtonLook;
  /** Whether the button stays in use after the action has succeeded. */
  again?: boolean;
  act: () => Promise<unknown>;
  children: ComponentChildren;
}

/** A button for an action that needs no confirmation (ConfirmButton.tsx). */
export function ActionButton({ look = "main", again = false, act, children }: ActionButtonProps) {
  const { busy, fault, run } = useAttempt();
  return (
    <>
      <Button look={look} busy={busy} onClick={() => run(again ? () => act().then(() => false) : act)}>
        {children}
      </Button>
      {fault && <Notice kind="fault">{fault}</Notice>}
    </>
  );
}

interface SubmitProps extends Pick<Attempt, "busy" | "fault"> {
  look?: ButtonLook;
  children: ComponentChildren;
}

/** The end of a form: why it was refused, and the button that sends it. */
export function Submit({ look = "main", busy, fault, children }: SubmitProps) {
  return (
    <>
      {fault && <Notice kind="fault">{fault}</Notice>}
      <div>
        <Button look={look} type="submit" busy={busy}>
          {children}
        </Button>
      </div>
    </>
  );
}
