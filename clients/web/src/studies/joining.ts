// Taking part by a study's open link. This device keeps the request, so that the open link leads the
// same person to the same participation.

import { CALL_LIMIT_MS } from "../api/client";
import { fromHex, hex } from "../hex";
import { recall, remember } from "../store";
import { participationApi } from "./client";

const STORED = "study-join.";

/**
 * Takes part by an open link, with the id of the panel that the page's address has in this query
 * parameter, if any is asked for; returns the secret of one's own link.
 */
export async function join(openLink: string, idParameter: string): Promise<string> {
  const panelId = idParameter === "" ? "" : (new URLSearchParams(location.search).get(idParameter) ?? "");
  const stored = `${STORED}${openLink}.${panelId}`;
  const kept = fromHex(recall(stored) ?? "");
  const requestId = kept.length === 32 ? kept : crypto.getRandomValues(new Uint8Array(32));
  remember(stored, hex(requestId));
  return (await participationApi.joinStudy({ openLink, panelId, requestId }, { timeoutMs: CALL_LIMIT_MS })).link;
}
