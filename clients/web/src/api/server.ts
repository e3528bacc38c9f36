// What the server says of itself: asked for once and kept, since it does not change while the page is open.

import type { GetServerInfoResponse } from "../gen/chefshat/v1/server_service_pb";
import { CALL_LIMIT_MS, serverApi } from "./client";

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
