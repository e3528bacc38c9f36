// The entry point: takes the token from the address, applies the stored theme and language, then
// renders the page. The service worker (public/sw.js) caches nothing: it makes the page installable.

import { render } from "preact";
import "@fontsource-variable/atkinson-hyperlegible-next/wght.css";
import "./theme.css";
import { startToken } from "./api/token";
import { reloadsForNewVersion, startUpdates } from "./api/update";
import { App } from "./app";
import { startLanguage } from "./i18n";
import { startTheme } from "./theme";

const root = document.getElementById("app");
if (root) {
  startToken();
  startTheme();
  startUpdates();
  try {
    await startLanguage();
    root.replaceChildren();
    render(<App />, root);
  } catch (thrown) {
    console.error(thrown);
    if (!(await reloadsForNewVersion())) notLoaded();
  }
  // A browser has none in a private window, or without a secure origin.
  void navigator.serviceWorker?.register("/sw.js").catch(() => undefined);
}

/** Shows what the document says for a page that could not be loaded: without texts, in all languages. */
function notLoaded(): void {
  const part = document.getElementById("not-loaded");
  if (!part) return;
  part.hidden = false;
  part.querySelector("button")?.addEventListener("click", () => location.reload());
}
