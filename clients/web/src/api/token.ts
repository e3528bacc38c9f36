// The token that lets this page use a server that requires one. A link brings it after "#", which
// browsers send to no server. It is removed from the address bar at once, so that it is not shown
// or shared by accident, and lasts as long as the tab. No link that this page makes contains it.

import type { Interceptor } from "@connectrpc/connect";
import { readdress } from "../router";

const MARK = "token=";
const STORED = "chefshat.token";

let token = stored();

/** Takes a token from the address, now and whenever the address changes; see `withoutToken`. */
export function startToken(): void {
  take();
  window.addEventListener("hashchange", () => {
    // Whatever was refused without the token starts again.
    if (take()) location.reload();
  });
}

/** Sends the token with each call. */
export const authorize: Interceptor = (next) => (request) => {
  if (token !== "") request.header.set("Authorization", `Bearer ${token}`);
  return next(request);
};

/**
 * The token in the hash of an address, empty if it has none, and the hash without it. Other parts,
 * such as the ticket of a table, are joined to it by "&".
 */
export function withoutToken(hash: string): { token: string; hash: string } {
  const parts = hash.replace(/^#/, "").split("&");
  const [given = ""] = parts.flatMap((part) => (part.startsWith(MARK) ? [part.slice(MARK.length)] : []));
  const rest = parts.filter((part) => !part.startsWith(MARK)).join("&");
  return { token: given, hash: rest === "" ? "" : `#${rest}` };
}

/** Takes the token from the address, if it has one; returns whether it has. */
function take(): boolean {
  const { token: given, hash } = withoutToken(location.hash);
  if (given === "") return false;
  token = given;
  try {
    sessionStorage.setItem(STORED, given);
  } catch {
    // Storage is blocked: the token lasts until the page is reloaded.
  }
  readdress(location.search, hash);
  return true;
}

function stored(): string {
  try {
    return sessionStorage.getItem(STORED) ?? "";
  } catch {
    return "";
  }
}
