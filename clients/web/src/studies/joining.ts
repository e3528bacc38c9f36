// Taking part by a study's open link. For somebody with an id at a panel, this device keeps the
// request, so that the same link leads to the same participation.

import { faultOf } from "../api/faults";
import { newRequestId, REQUEST_ID_BYTES } from "../api/repeat";
import { fromHex, hex } from "../hex";
import { recallObject, remember, remembered } from "../store";
import { participationApi } from "./client";
import { thisDevice } from "./device";

const STORED = "study-join.";
/** The request of somebody without an id, until the page is loaded again: others may use this device. */
const unnamed = newRequestId();

/**
 * Takes part by an open link, with the id at the panel that the page's address has in this query
 * parameter, if any is asked for; returns the secret of the participant's own link.
 */
export async function join(openLink: string, idParameter: string): Promise<string> {
  const panelId = idParameter === "" ? "" : (new URLSearchParams(location.search).get(idParameter) ?? "");
  const stored = panelId === "" ? undefined : `${STORED}${openLink}.${panelId}`;
  const requestId = stored === undefined ? unnamed : (keptRequest(stored) ?? newRequestId());
  const keep = (link: string) => {
    if (stored !== undefined) remember(stored, JSON.stringify({ request: hex(requestId), link }));
  };
  if (stored !== undefined && keptRequest(stored) === undefined) keep("");
  try {
    const request = { openLink, panelId, requestId, device: thisDevice() };
    const { link } = await participationApi.joinStudy(request);
    keep(link);
    return link;
  } catch (thrown) {
    if (stored !== undefined && FINAL.includes(faultOf(thrown).reason)) remember(stored, null);
    throw thrown;
  }
}

/** Refusals after which nobody takes part by this request. */
const FINAL = [
  "STUDY_FULL",
  "STUDY_CLOSED",
  "PANEL_ID_TAKEN",
  "PANEL_ID_REFUSED",
  "TOO_MANY_PARTICIPANTS",
  "WRONG_DEVICE",
];

/** Forgets how the participant with this link of its own joined. */
export function forgetJoined(link: string): void {
  for (const name of remembered().keys())
    if (
      name.startsWith(STORED) &&
      recallObject(name, (kept) => (typeof kept.link === "string" ? kept.link : null)) === link
    )
      remember(name, null);
}

function keptRequest(stored: string): Uint8Array<ArrayBuffer> | undefined {
  const request = fromHex(
    recallObject(stored, (kept) => (typeof kept.request === "string" ? kept.request : null)) ?? "",
  );
  return request.length === REQUEST_ID_BYTES ? request : undefined;
}
