// The server's description of itself, requested once, since it does not change while the page is
// open; and its clock.

import { useEffect, useState } from "preact/hooks";
import type { RuleSet } from "../gen/chefshat/v1/rules_pb";
import type { GetServerInfoResponse } from "../gen/chefshat/v1/server_service_pb";
import { askUntilAnswered } from "./asking";
import { serverApi } from "./client";
import { wordsOf } from "./faults";

let asked: Promise<GetServerInfoResponse> | undefined;

/** Version, presets, built-in agents, limits. */
export function serverInfo(): Promise<GetServerInfoResponse> {
  asked ??= serverApi.getServerInfo({}).catch((error: unknown) => {
    // The next call tries again.
    asked = undefined;
    throw error;
  });
  return asked;
}

/** Milliseconds by which the server's time of day is ahead of the browser's; 0 if it does not say. */
export async function aheadMs(): Promise<number> {
  const askedMs = Date.now();
  try {
    const { receivedAtUs, sentAtUs } = await serverApi.getClock({});
    return Number((receivedAtUs + sentAtUs) / 2_000n) - (askedMs + Date.now()) / 2;
  } catch {
    return 0;
  }
}

/** What a game can be configured with. */
export interface Offered {
  presets: RuleSet[];
  agents: string[];
  /** Those that play where cards are real, too. */
  quickAgents: string[];
}

/** The agents to choose from; with real cards those that do not search, and the one that is chosen already. */
export function agentsFor({ agents, quickAgents }: Offered, real: boolean, chosen: string): string[] {
  return agents.filter((agent) => !real || quickAgents.includes(agent) || agent === chosen);
}

/** For programs only: it answers with illegal actions until one is legal. */
const FOR_PROGRAMS = "random_unmasked";

/** Whether people should be offered an agent. */
export function isForPeople(agent: string): boolean {
  return agent !== FOR_PROGRAMS;
}

/**
 * The server's offer for a form, and the error in words; both null while loading. Asked for again
 * while the server is away.
 */
export function useOffered(): { offered: Offered | null; fault: string | null } {
  const [offered, setOffered] = useState<Offered | null>(null);
  const [fault, setFault] = useState<string | null>(null);
  useEffect(() => {
    let wanted = true;
    const asking = askUntilAnswered(
      serverInfo,
      () => wanted,
      (found) => wanted && setFault(wordsOf(found)),
    );
    void asking.then((info) => {
      if (!wanted || !info) return;
      setFault(null);
      setOffered({
        presets: info.presets,
        agents: info.builtInAgents.filter(isForPeople),
        quickAgents: info.quickBuiltInAgents.filter(isForPeople),
      });
    });
    return () => {
      wanted = false;
    };
  }, []);
  return { offered, fault };
}
