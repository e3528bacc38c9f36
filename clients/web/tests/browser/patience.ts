// How long tests wait. They wait for states, never for time: this is only when they give up.

/**
 * Milliseconds after which a state that was waited for counts as missing, however busy the machine
 * is.
 */
export const PATIENCE_MS = 120_000;
