// What a test leaves in the browser is not there for the next one, nor what the tests of one file leave
// in modules and the document.

import { afterEach, vi } from "vitest";

const clear = () => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
  vi.restoreAllMocks();
  localStorage.clear();
  sessionStorage.clear();
  history.replaceState(null, "", "/");
};

afterEach(clear);

clear();
vi.resetModules();
document.body.replaceChildren();
document.head.replaceChildren();
for (const name of document.documentElement.getAttributeNames()) document.documentElement.removeAttribute(name);
