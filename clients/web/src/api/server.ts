// What the server says of itself: asked for once and kept, since it does not change while the page is open.

import { useEffect, useState } from "preact/hooks";
import type { RuleSet } from "../gen/chefshat/v1/rules_pb";
import type { GetServerInfoResponse } from "../gen/chefshat/v1/server_service_pb";
import { CALL_LIMIT_MS, serverApi } from "./client";
import { inWords } from "./faults";

let asked: Promise<GetServerInfoResponse> | undefined;

/** Version, presets, built-in agents, limits. */
export function serverInfo(): Promise<GetServerInfoResponse> {
  asked ??= serverApi.getServerInfo({}, { timeoutMs: CALL_LIMIT_MS }).catch((error: unknown) => {
    // The next who asks tries again.
    asked = undefined;
    throw error;
  });
  return asked;
}

/** What games can be made of. */
export interface Offered {
  presets: RuleSet[];
  agents: string[];
}

/** What the server can host, for a form; null until it is known, with what went wrong in words. */
export function useOffered(): { offered: Offered | null; fault: string | null } {
  const [offered, setOffered] = useState<Offered | null>(null);
  const [fault, setFault] = useState<string | null>(null);
  useEffect(() => {
    serverInfo().then(
      ({ presets, builtInAgents }) => setOffered({ presets, agents: builtInAgents }),
      (error: unknown) => setFault(inWords(error)),
    );
  }, []);
  return { offered, fault };
}
