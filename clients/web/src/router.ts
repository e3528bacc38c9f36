// Maps addresses to pages and navigates between them without reloading the document. Routes
// contain no "#": the server returns the same document for every path. The pages themselves are in
// app.tsx.

import { signal } from "@preact/signals";

/** A page and the parameters in its address. */
export type Route =
  | { page: "lobby" }
  | { page: "new" }
  | { page: "room"; roomId: string }
  | { page: "attend"; roomId: string }
  | { page: "join"; code: string }
  | { page: "watch"; roomId: string }
  | { page: "replay"; gameId: string }
  | { page: "tournaments" }
  | { page: "newTournament" }
  | { page: "tournament"; tournamentId: string }
  | { page: "results"; tournamentId: string }
  | { page: "study"; link: string }
  | { page: "studies" }
  | { page: "newStudy" }
  | { page: "ownStudy"; studyId: string }
  | { page: "leaderboard" }
  | { page: "person"; name: string; fingerprint: string }
  | { page: "tutorial" }
  | { page: "rules" }
  | { page: "unknown" };

/** The props of every page. */
export interface PageProps<Name extends Route["page"]> {
  route: Extract<Route, { page: Name }>;
}

/** Whether the address is that of a tournament's wall view, which has no frame: with `?wall`. */
export function isWall({ page }: Route): boolean {
  return page === "tournament" && new URLSearchParams(location.search).has("wall");
}

/** Parses a path such as "/rooms/0123". */
export function routeOf(path: string): Route {
  const parts = path.split("/").filter((part) => part !== "");
  const [first, second, third] = parts.map(decoded);
  if (parts.length === 3 && first === "rooms" && third === "table") return { page: "attend", roomId: second ?? "" };
  if (parts.length === 3 && first === "tournaments" && third === "results")
    return { page: "results", tournamentId: second ?? "" };
  if (parts.length === 3 && first === "people") return personOf(second ?? "", third ?? "");
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
      case "studies":
        return { page: "studies" };
      case "leaderboard":
        return { page: "leaderboard" };
      case "tutorial":
        return { page: "tutorial" };
      case "rules":
        return { page: "rules" };
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
    case "study":
      return { page: "study", link: second };
    case "studies":
      return second === "new" ? { page: "newStudy" } : { page: "ownStudy", studyId: second };
    case "people":
      return personOf(second, "");
    default:
      return { page: "unknown" };
  }
}

function personOf(name: string, fingerprint: string): Route {
  return { page: "person", name: name === ". " || name === ".. " ? name.trim() : name, fingerprint };
}

/** Formats the path of a route; the inverse of `routeOf`. */
export function pathOf(route: Route): string {
  switch (route.page) {
    case "lobby":
      return "/";
    case "room":
      return `/rooms/${encodeURIComponent(route.roomId)}`;
    case "attend":
      return `/rooms/${encodeURIComponent(route.roomId)}/table`;
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
    case "results":
      return `/tournaments/${encodeURIComponent(route.tournamentId)}/results`;
    case "person":
      // Browsers resolve the parts "." and "..", however they are encoded. Names never end with a space.
      return `/people/${encodeURIComponent(route.name)}${/^\.{1,2}$/.test(route.name) ? "%20" : ""}${route.fingerprint && `/${encodeURIComponent(route.fingerprint)}`}`;
    case "study":
      return `/study/${encodeURIComponent(route.link)}`;
    case "newStudy":
      return "/studies/new";
    case "ownStudy":
      return `/studies/${encodeURIComponent(route.studyId)}`;
    case "unknown":
      return "/";
    default:
      return `/${route.page}`;
  }
}

/** The current page. */
export const route = signal<Route>(routeOf(location.pathname));

/** Path and query of the page that is shown. */
let shown = location.pathname + location.search;

/** Changes the query of the address, and removes or changes its fragment; the page stays. */
export function readdress(search: string, fragment = ""): void {
  shown = location.pathname + search;
  history.replaceState(history.state, "", shown + fragment);
}

/** Gives the page that is shown the address of a route, and shows nothing else. */
export function replaceAddress(to: Route): void {
  shown = pathOf(to);
  history.replaceState(history.state, "", shown);
}

/** Goes to a page; `replace` adds no entry to the browser's history. */
export function navigate(to: Route, options: { replace?: boolean; search?: string } = {}): void {
  const address = pathOf(to) + (options.search ?? "");
  if (options.replace) history.replaceState(history.state, "", address);
  else push(address);
  arrive(0);
}

/**
 * `navigate` for the end of a call, which may take long: it does nothing once another page has been
 * opened.
 */
export function navigateFromHere(): typeof navigate {
  const here = route.peek();
  return (to, options) => {
    if (route.peek() === here) navigate(to, options);
  };
}

/**
 * Follows the browser's Back and Forward buttons and the links of this page. Returns a function
 * that stops it.
 */
export function startRouter(): () => void {
  // The browser would restore a scroll position before the page that it belongs to is drawn.
  history.scrollRestoration = "manual";
  history.replaceState({ ...history.state, entry }, "");
  window.addEventListener("popstate", goBack);
  window.addEventListener("pagehide", storeScrolls);
  document.addEventListener("click", followLink);
  return () => {
    window.removeEventListener("popstate", goBack);
    window.removeEventListener("pagehide", storeScrolls);
    document.removeEventListener("click", followLink);
  };
}

/** Key of the scroll positions in sessionStorage, where they survive a reload. */
const SCROLLS = "chefshat.scrolls";
/** Scroll position of each page when it was left, by the key of its history entry. */
const scrolls = new Map<string, number>(storedScrolls());
/** Key of the current entry. */
let entry: string = history.state?.entry ?? newEntry();
/** Scroll position of the page that is loading. */
let wanted = scrolls.get(entry) ?? 0;

function newEntry(): string {
  return Math.random().toString(36).slice(2);
}

function storedScrolls(): [string, number][] {
  try {
    return JSON.parse(sessionStorage.getItem(SCROLLS) ?? "[]");
  } catch {
    return [];
  }
}

function push(address: string): void {
  scrolls.set(entry, window.scrollY);
  entry = newEntry();
  history.pushState({ entry }, "", address);
}

/**
 * After Back, Forward and links to a place in the page, which stays as it is. A fragment that carries
 * something, such as a ticket, is for the page to take.
 */
function goBack({ state }: PopStateEvent): void {
  scrolls.set(entry, window.scrollY);
  entry = state?.entry ?? newEntry();
  const scroll = scrolls.get(entry);
  const stays = location.pathname + location.search === shown && !location.hash.includes("=");
  if (!stays) arrive(scroll ?? 0);
  else if (scroll !== undefined) window.scrollTo(0, scroll);
}

/** Before a reload, or before another site is shown. */
function storeScrolls(): void {
  scrolls.set(entry, window.scrollY);
  try {
    sessionStorage.setItem(SCROLLS, JSON.stringify([...scrolls]));
  } catch {
    // Storage is blocked or full: a reload starts at the top.
  }
}

function arrive(scroll: number): void {
  stopRestoring();
  wanted = scroll;
  shown = location.pathname + location.search;
  route.value = routeOf(location.pathname);
}

let stopRestoring = () => {};

/**
 * Scrolls a page that was just rendered to where it was left, as soon as it is long enough. Stops
 * when the reader acts.
 */
export function restoreScroll(): void {
  stopRestoring();
  window.scrollTo(0, wanted);
  if (wanted === 0) return;
  const acts = ["wheel", "touchmove", "keydown", "pointerdown"] as const;
  const observer = new ResizeObserver(() => {
    window.scrollTo(0, wanted);
    if (Math.abs(window.scrollY - wanted) < 1) stopRestoring();
  });
  observer.observe(document.body);
  stopRestoring = () => {
    observer.disconnect();
    for (const kind of acts) window.removeEventListener(kind, stopRestoring);
    stopRestoring = () => {};
  };
  for (const kind of acts) window.addEventListener(kind, stopRestoring);
}

/** Follows a plain click on a link to this origin; leaves everything else to the browser. */
function followLink(event: MouseEvent): void {
  if (event.defaultPrevented || event.button !== 0) return;
  if (event.metaKey || event.ctrlKey || event.shiftKey || event.altKey) return;
  const link = event.target instanceof Element ? event.target.closest("a") : null;
  if (!link || link.target || link.hasAttribute("download") || link.origin !== location.origin) return;
  if (link.pathname === location.pathname && link.hash) return;
  event.preventDefault();
  push(link.href);
  arrive(0);
}

/** Decodes a part of an address; returns a badly encoded part unchanged. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}
