// Something that runs while a part of the page is shown, such as a stream.

import { useEffect, useState } from "preact/hooks";

/** What `start` has started, anew when `key` changes; undefined before, and if it starts nothing. */
export function useStarted<Started extends { stop(): void }>(
  start: () => Started | undefined,
  key: unknown,
): Started | undefined {
  const [running, setRunning] = useState<Started | undefined>(undefined);
  useEffect(() => {
    const started = start();
    setRunning(started);
    return () => started?.stop();
  }, [key]);
  return running;
}
