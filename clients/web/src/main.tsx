// The first thing that runs: it takes the language and the look that were chosen, then draws the page. Nothing else.

import { render } from "preact";
import "@fontsource-variable/atkinson-hyperlegible-next/wght.css";
import "./theme.css";
import { App } from "./app";
import { startLanguage } from "./i18n";
import { startLook } from "./look";

const root = document.getElementById("app");
if (root) {
  startLook();
  await startLanguage();
  render(<App />, root);
}
