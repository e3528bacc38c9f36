// Timeouts of the tests. Tests wait for states; this is only when they give up.

/**
 * Milliseconds after which a state that was waited for counts as missing, on the busiest machine.
 */
export const PATIENCE_MS = 300_000;
