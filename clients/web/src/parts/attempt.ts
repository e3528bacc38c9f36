// An action that calls the server when a button is pressed or a form is sent.

import { useState } from "preact/hooks";
import { inWords } from "../api/faults";

/** The state of an action, and the way to start it. */
export interface Attempt {
  /** The action is running, or has succeeded: it cannot be started again. */
  readonly busy: boolean;
  /** Why the last attempt failed, in words; null if it did not. */
  readonly fault: string | null;
  /**
   * Starts the action. One that resolves to false may be started again; after any other the page
   * has no more use for its button.
   */
  readonly run: (action: () => Promise<unknown>) => void;
  /** Forgets a failure. */
  readonly reset: () => void;
}

/** An action that has not been started. */
export function useAttempt(): Attempt {
  const [busy, setBusy] = useState(false);
  const [fault, setFault] = useState<string | null>(null);
  const run = async (action: () => Promise<unknown>) => {
    setBusy(true);
    setFault(null);
    try {
      if ((await action()) === false) setBusy(false);
    } catch (thrown) {
      setFault(inWords(thrown));
      setBusy(false);
    }
  };
  return { busy, fault, run: (action) => void run(action), reset: () => setFault(null) };
}
