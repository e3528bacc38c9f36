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

/** The path of each page. Parts with ":" are parameters, which may be missing with "?". Of several that fit, the first counts. */
const PATHS: Readonly<Record<Exclude<Route["page"], "unknown">, string>> = {
  lobby: "/",
  new: "/new",
  join: "/join/:code?",
  room: "/rooms/:roomId",
  attend: "/rooms/:roomId/table",
  watch: "/watch/:roomId",
  replay: "/replay/:gameId",
  tournaments: "/tournaments",
  newTournament: "/tournaments/new",
  tournament: "/tournaments/:tournamentId",
  results: "/tournaments/:tournamentId/results",
  study: "/study/:link",
  studies: "/studies",
  newStudy: "/studies/new",
  ownStudy: "/studies/:studyId",
  leaderboard: "/leaderboard",
  person: "/people/:name/:fingerprint?",
  tutorial: "/tutorial",
  rules: "/rules",
};

/** Parses a path such as "/rooms/0123". */
export function routeOf(path: string): Route {
  const given = partsOf(path).map(decoded);
  for (const [page, pattern] of Object.entries(PATHS)) {
    const parts = partsOf(pattern).map((part, index) => ({ part, value: given[index] }));
    const isFitting = parts.every(({ part, value }) => {
      return part.startsWith(":") ? value !== undefined || part.endsWith("?") : value === part;
    });
    if (!isFitting || given.length > parts.length) continue;
    const parameters = parts.filter(({ part }) => part.startsWith(":"));
    // TypeScript cannot see that the parameters are those of the page.
    return { page, ...Object.fromEntries(parameters.map(({ part, value = "" }) => [nameOf(part), value])) } as Route;
  }
  return { page: "unknown" };
}

/** Formats the path of a route; the inverse of `routeOf`. */
export function pathOf(route: Route): string {
  if (route.page === "unknown") return "/";
  const values: Readonly<Record<string, string>> = { ...route };
  const parts = partsOf(PATHS[route.page]).map((part) => {
    return part.startsWith(":") ? encoded(values[nameOf(part)] ?? "") : part;
  });
  return `/${parts.filter((part) => part !== "").join("/")}`;
}

function partsOf(path: string): string[] {
  return path.split("/").filter((part) => part !== "");
}

/** The name of a parameter in a path. */
function nameOf(part: string): string {
  return part.replaceAll(/[:?]/g, "");
}

/** Encodes a part of an address. Browsers resolve "." and "..": these get a space, with which no name ends. */
function encoded(part: string): string {
  return encodeURIComponent(part.replace(/^\.{1,2}$/, "$& "));
}

/** Decodes a part of an address; returns a badly encoded part unchanged. */
function decoded(part: string): string {
  try {
    return decodeURIComponent(part).replace(/^(\.{1,2}) $/, "$1");
  } catch {
    return part;
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
