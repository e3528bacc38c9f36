// Which page an address names, and going to another one without loading the document again. Addresses have no "#": the server gives
// the same document for all of them. The pages themselves are in app.tsx.

import { signal } from "@preact/signals";

/** A page with what its address says. */
export type Route =
  | { page: "lobby" }
  | { page: "new" }
  | { page: "room"; roomId: string }
  | { page: "join"; code: string }
  | { page: "watch"; roomId: string }
  | { page: "replay"; gameId: string }
  | { page: "tournaments" }
  | { page: "newTournament" }
  | { page: "tournament"; tournamentId: string }
  | { page: "leaderboard" }
  | { page: "person"; name: string }
  | { page: "tutorial" }
  | { page: "unknown" };

/** The route of a path such as "/rooms/0123". */
export function routeOf(path: string): Route {
  const parts = path.split("/").filter((part) => part !== "");
  const [first, second] = parts.map(decoded);
  if (parts.length > 2) return { page: "unknown" };
  if (second === undefined) {
    switch (first) {
      case undefined:
        return { page: "lobby" };
      case "new":
        return { page: "new" };
      case "join":
        return { page: "join", code: "" };
      case "tournaments":
        return { page: "tournaments" };
      case "leaderboard":
        return { page: "leaderboard" };
      case "tutorial":
        return { page: "tutorial" };
      default:
        return { page: "unknown" };
    }
  }
  switch (first) {
    case "rooms":
      return { page: "room", roomId: second };
    case "join":
      return { page: "join", code: second };
    case "watch":
      return { page: "watch", roomId: second };
    case "replay":
      return { page: "replay", gameId: second };
    case "tournaments":
      return second === "new" ? { page: "newTournament" } : { page: "tournament", tournamentId: second };
    case "people":
      return { page: "person", name: second };
    default:
      return { page: "unknown" };
  }
}

/** The path of a route, the inverse of `routeOf`. */
export function pathOf(route: Route): string {
  switch (route.page) {
    case "lobby":
      return "/";
    case "room":
      return `/rooms/${encodeURIComponent(route.roomId)}`;
    case "join":
      return route.code === "" ? "/join" : `/join/${encodeURIComponent(route.code)}`;
    case "watch":
      return `/watch/${encodeURIComponent(route.roomId)}`;
    case "replay":
      return `/replay/${encodeURIComponent(route.gameId)}`;
    case "newTournament":
      return "/tournaments/new";
    case "tournament":
      return `/tournaments/${encodeURIComponent(route.tournamentId)}`;
    case "person":
      return `/people/${encodeURIComponent(route.name)}`;
    case "unknown":
      return "/";
    default:
      return `/${route.page}`;
  }
}

/** Where the reader is. Read it in a component to be drawn again when it changes. */
export const route = signal<Route>(routeOf(location.pathname));

/** Goes to a page; `replace` leaves no trace in the browser's history. */
export function navigate(to: Route, options: { replace?: boolean; search?: string } = {}): void {
  const address = pathOf(to) + (options.search ?? "");
  if (options.replace) history.replaceState(null, "", address);
  else history.pushState(null, "", address);
  arrive();
}

/** Follows the browser's buttons and links of this page. Gives a function that stops it. */
export function startRouter(): () => void {
  window.addEventListener("popstate", arrive);
  document.addEventListener("click", follow);
  return () => {
    window.removeEventListener("popstate", arrive);
    document.removeEventListener("click", follow);
  };
}

function arrive(): void {
  route.value = routeOf(location.pathname);
  window.scrollTo(0, 0);
}

/** A plain click on a link of our own changes the page; with a modifier key, a target or another origin the browser does its work. */
function follow(event: MouseEvent): void {
  if (event.defaultPrevented || event.button !== 0) return;
  if (event.metaKey || event.ctrlKey || event.shiftKey || event.altKey) return;
  const link = event.target instanceof Element ? event.target.closest("a") : null;
  if (!link || link.target || link.hasAttribute("download") || link.origin !== location.origin) return;
  if (link.pathname === location.pathname && link.hash) return;
  event.preventDefault();
  history.pushState(null, "", link.href);
  arrive();
}

/** A part of an address that is not well encoded stands for itself: it will name nothing. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
