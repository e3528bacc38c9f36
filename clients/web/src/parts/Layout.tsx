// The frame of all pages: header with navigation and settings, content, live region.

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { outdated } from "../api/update";
import { hidden } from "../hiding";
import { t } from "../i18n";
import { isWall, type Route } from "../router";
import { Announcer } from "./Announcer";
import { Drawing } from "./Drawing";
import css from "./Layout.module.css";
import { Shows } from "./marks";
import { Settings } from "./Settings";
import { useTab } from "./tab";
import { UpdateNotice } from "./Update";

interface LayoutProps {
  here: Route;
  children: ComponentChildren;
}

/** The frame around a page. */
export function Layout({ here, children }: LayoutProps) {
  const content = useRef<HTMLElement>(null);
  const [open, setOpen] = useState(false);
  const first = useRef(true);
  // After keyboard navigation the focus is at the start of the new page, not in the header.
  useEffect(() => {
    if (first.current) first.current = false;
    else content.current?.focus({ preventScroll: true });
  }, [here]);
  const words = t().common;
  const home = (
    <>
      <Drawing name="joker" />
      <span>{words.name}</span>
    </>
  );
  useTab(`${pageName(here)} · ${words.name}`);
  const wall = isWall(here);
  return (
    <div class={css.layout} data-part="layout" data-page={wall ? "wall" : here.page}>
      {wall && <Shows what="wall" />}
      <a class={css.skip} href="#content">
        {words.skipToContent}
      </a>
      <header class={css.header} data-part="header">
        {hidden.value.includes("pages") ? (
          <span class={css.headerName} data-part="header-name">
            {home}
          </span>
        ) : (
          <a class={css.headerName} data-part="header-name" href="/">
            {home}
          </a>
        )}
        <nav class={css.headerNav} data-part="header-nav" aria-label={words.nav.label}>
          {links().map(({ href, label, pages }) => (
            <a key={href} href={href} aria-current={pages.includes(here.page) ? "page" : undefined}>
              {label}
            </a>
          ))}
        </nav>
        <button
          type="button"
          class={css.headerSettings}
          data-part="header-settings"
          data-outdated={outdated.value ? "" : undefined}
          aria-label={outdated.value ? `${words.settings.title}. ${words.outdated.text}` : words.settings.title}
          onClick={() => setOpen(true)}
        >
          <GearSign />
        </button>
      </header>
      <main id="content" ref={content} tabIndex={-1} class={css.content} data-part="content">
        {children}
      </main>
      <UpdateNotice unattended={wall} />
      <Announcer />
      {open && <Settings onClose={() => setOpen(false)} />}
    </div>
  );
}

function links(): { href: string; label: string; pages: Route["page"][] }[] {
  const words = t().common.nav;
  return [
    { href: "/", label: words.lobby, pages: ["lobby", "new", "join"] },
    {
      href: "/tournaments",
      label: words.tournaments,
      pages: ["tournaments", "tournament", "results", "newTournament"],
    },
    { href: "/leaderboard", label: words.leaderboard, pages: ["leaderboard", "person"] },
    { href: "/tutorial", label: words.tutorial, pages: ["tutorial", "rules"] },
  ];
}

/** The page's title in the browser's tab. */
function pageName(here: Route): string {
  const { attend, common, lobby, organise, replay, rules, studies, table, tournaments } = t();
  if (here.page === "person") return here.name;
  const names: Record<Exclude<Route["page"], "person">, string> = {
    lobby: common.nav.lobby,
    new: lobby.make.title,
    join: lobby.join.title,
    room: table.title,
    attend: attend.title,
    watch: lobby.rooms.watch,
    replay: replay.title,
    tournaments: common.nav.tournaments,
    tournament: common.nav.tournaments,
    results: tournaments.results.title,
    newTournament: organise.title,
    study: studies.title,
    studies: studies.own.title,
    ownStudy: studies.own.title,
    newStudy: studies.make.title,
    leaderboard: common.nav.leaderboard,
    tutorial: common.nav.tutorial,
    rules: rules.title,
    unknown: common.notFound.title,
  };
  return names[here.page];
}

/** Two sliders, as the icon of the settings. */
function GearSign() {
  return (
    <svg
      viewBox="0 0 24 24"
      width="24"
      height="24"
      fill="none"
      stroke="currentColor"
      stroke-width="2"
      aria-hidden="true"
    >
      <path d="M3 8h9M18 8h3M3 16h3M12 16h9" stroke-linecap="round" />
      <circle cx="15" cy="8" r="3" />
      <circle cx="9" cy="16" r="3" />
    </svg>
  );
}
