// Parsing and formatting addresses.

import { expect, test } from "vitest";
import { navigate, navigateFromHere, pathOf, type Route, readdress, route, routeOf, startRouter } from "../src/router";

const ROUTES: [string, Route][] = [
  ["/", { page: "lobby" }],
  ["/new", { page: "new" }],
  ["/rooms/0123", { page: "room", roomId: "0123" }],
  ["/rooms/0123/table", { page: "attend", roomId: "0123" }],
  ["/join", { page: "join", code: "" }],
  ["/join/BCDF2345", { page: "join", code: "BCDF2345" }],
  ["/watch/0123", { page: "watch", roomId: "0123" }],
  ["/replay/4567", { page: "replay", gameId: "4567" }],
  ["/tournaments", { page: "tournaments" }],
  ["/tournaments/new", { page: "newTournament" }],
  ["/tournaments/89ab", { page: "tournament", tournamentId: "89ab" }],
  ["/tournaments/89ab/results", { page: "results", tournamentId: "89ab" }],
  ["/study/AbC-123_x", { page: "study", link: "AbC-123_x" }],
  ["/studies", { page: "studies" }],
  ["/studies/new", { page: "newStudy" }],
  ["/studies/0123", { page: "ownStudy", studyId: "0123" }],
  ["/leaderboard", { page: "leaderboard" }],
  ["/people/Dr.%20R%C3%B6sa%2FII", { page: "person", name: "Dr. Rösa/II", fingerprint: "" }],
  ["/people/%3F%23%25%20%22%3Cb%3E", { page: "person", name: '?#% "<b>', fingerprint: "" }],
  ["/people/.%20", { page: "person", name: ".", fingerprint: "" }],
  ["/people/..%20", { page: "person", name: "..", fingerprint: "" }],
  ["/people/Ada/0123456789abcdef", { page: "person", name: "Ada", fingerprint: "0123456789abcdef" }],
  ["/people/...", { page: "person", name: "...", fingerprint: "" }],
  ["/tutorial", { page: "tutorial" }],
  ["/rules", { page: "rules" }],
];

test.each(ROUTES)("%s is parsed and formatted", (path, route) => {
  expect(routeOf(path)).toEqual(route);
  expect(pathOf(route)).toBe(path);
  expect(new URL(path, location.origin).pathname).toBe(path);
});

test.each(["/nowhere", "/rooms/1/2", "/lobby/x"])("%s is unknown", (path) => {
  expect(routeOf(path)).toEqual({ page: "unknown" });
});

test("a badly encoded part is kept as it is", () => {
  expect(routeOf("/people/%E0%A4%A")).toEqual({ page: "person", name: "%E0%A4%A", fingerprint: "" });
});

test("a call that ends late leads nowhere once another page has been opened", () => {
  navigate({ page: "tutorial" });
  const [first, second] = [navigateFromHere(), navigateFromHere()];
  first({ page: "rules" });
  expect(location.pathname).toBe("/rules");
  second({ page: "studies" }, { replace: true });
  expect([location.pathname, route.value]).toEqual(["/rules", { page: "rules" }]);
  // Also if it is the same page again.
  const third = navigateFromHere();
  navigate({ page: "rules" });
  third({ page: "tutorial" });
  expect(location.pathname).toBe("/rules");
});

test("a link to a place in the page leaves the page as it is, one that carries a ticket does not", () => {
  const stop = startRouter();
  navigate({ page: "room", roomId: "0123" }, { search: "?lang=it" });
  const shown = route.value;
  /** As the browser follows a fragment. */
  const follow = (fragment: string) => {
    history.pushState(null, "", location.pathname + location.search + fragment);
    window.dispatchEvent(new PopStateEvent("popstate", { state: null }));
  };
  follow("#content");
  expect(route.value).toBe(shown);
  readdress("");
  follow("#content");
  expect(route.value).toBe(shown);
  follow("#ticket=abc");
  expect(route.value).not.toBe(shown);
  expect(route.value).toEqual(shown);
  stop();
  navigate({ page: "lobby" });
});
