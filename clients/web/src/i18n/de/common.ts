// German texts that several parts of the page use: the frame, kinds of participants, words of the
// game. The same word stands for the same thing in all parts: face "Wert", board "Brett", hand
// "Blatt", play "spielen", pass "passen", declare "ansagen", exchange "Tausch", game "Partie".

import { ordinals, plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("de");

export const common: Texts["common"] = {
  name: "Chef’s Hat",
  skipToContent: "Zum Inhalt springen",
  nav: {
    label: "Seiten",
    lobby: "Lobby",
    tournaments: "Turniere",
    leaderboard: "Bestenliste",
    tutorial: "Spielen lernen",
  },
  settings: {
    title: "Einstellungen",
    language: "Sprache",
    theme: "Design",
    themes: { system: "System", light: "Hell", dark: "Dunkel" },
    table: {
      title: "Am Tisch",
      names: {
        notification: "Benachrichtige mich, wenn ich dran bin",
        tab: "Zeige im Browser-Tab, wenn ich dran bin",
        vibration: "Vibriere, wenn ich dran bin",
        awake: "Lass den Bildschirm an",
        keys: "Tasten für Karten, Passen und Spielen",
        plans: "Lass mich schon vor meinem Zug wählen",
        autoPass: "Passe für mich, wenn ich nichts spielen kann",
        moments: "Zeige besondere Momente groß",
      },
      hints: {
        notification: "Während du etwas anderes ansiehst. Dein Browser fragt dich vorher.",
        tab: "Im Titel und im Symbol.",
        vibration: "Auf Geräten, die das können.",
        awake: "Während einer Partie.",
        keys: "9 und Enter spielen eine 9, p passt. Das Fragezeichen zeigt alle Tasten.",
        plans: "Gespielt wird, wenn du dran bist und es dann noch erlaubt ist.",
        autoPass: "Nach einer Pause wie deiner eigenen, damit es den anderen nichts verrät. Nicht in Studien.",
        moments: "Food Fight, Dinner is Served, der Tausch, die goldene Karte, eine letzte Karte.",
      },
      notAllowed:
        "Dein Browser erlaubt dieser Seite keine Benachrichtigungen. Das kannst du in den Einstellungen des Browsers ändern.",
    },
    names: {
      key: "Dein Identitätsschlüssel",
      hint: "Andere können deinen Namen wählen, haben aber deinen Schlüssel nicht: Bestenlisten führen euch getrennt. Der Schlüssel entsteht, wenn du zum ersten Mal an einer Partie teilnimmst. Gib ihn auf einem anderen Gerät ein, um dort dieselbe Person zu sein; verrate ihn sonst niemandem.",
      notAKey: "Ein Schlüssel hat 64 Ziffern von 0 bis 9 und a bis f.",
      use: "Diesen Schlüssel verwenden",
      replaces:
        "Dieses Gerät spielt dann als die Person des neuen Schlüssels. Kopiere zuerst den bisherigen, wenn du wieder diese Person sein willst.",
    },
    measuring: "Die Verbindung wird gemessen …",
    lag: (ms) => `Der Server antwortet nach ${ms}\u00a0ms.`,
    fullScreen: "Vollbild",
    fullScreenOff: "Vollbild beenden",
    forget: "Alles auf diesem Gerät vergessen",
    forgetSure:
      "Damit verschwinden von diesem Gerät deine Plätze an Tischen und in Turnieren, die Räume und Turniere, die du erstellt hast, dein Name mit seinem Schlüssel und deine Einstellungen. Du kannst sie nicht zurückholen.",
    forgetDo: "Alles vergessen",
  },
  kinds: {
    agent: "Agent",
    human: "Person",
    robot: "Roboter",
    model: "Modell",
    builtIn: "eingebauter Agent",
    open: "frei",
  },
  characters: {
    trained: "erfahren",
    greedy: "hastig",
    random: "nach Laune",
    random_unmasked: "blindlings",
    monte_carlo: "bedächtig",
  },
  roles: { chef: "Chef", sousChef: "Sous-Chef", cook: "Koch", waiter: "Kellner", dishwasher: "Tellerwäscher" },
  faces: [
    "Trüffel",
    "Garnele",
    "Sardelle",
    "Artischocke",
    "Chili",
    "Basilikum",
    "Olive",
    "Paprika",
    "Pilz",
    "Tomate",
    "Mozzarella",
  ],
  cards: (count) => plural(count, { one: "# Karte", other: "# Karten" }),
  points: (count) => plural(count, { one: "# Punkt", other: "# Punkte" }),
  place: ordinals("de", { other: "." }),
  seat: (seat) => `Sitzplatz ${seat + 1}`,
  /** Headings of tables. */
  columns: {
    place: "Platz",
    name: "Name",
    games: "Partien",
    points: "Punkte",
    places: "Platzierungen",
    rating: "Wertung",
  },
  close: "Schließen",
  cancel: "Abbrechen",
  changedMeanwhile: (before, now) =>
    `Es wurde nichts getan: ${now} hat inzwischen den Platz von ${before} eingenommen.`,
  copy: "Kopieren",
  copied: "Kopiert",
  loading: "Wird geladen…",
  showMore: "Mehr anzeigen",
  toLobby: "Zur Lobby",
  pageNotLoaded: "Diese Seite konnte nicht geladen werden. Prüfe deine Verbindung und lade sie neu.",
  outdated: {
    text: "Der Server wurde aktualisiert, und diese Seite ist noch die alte Version. Deine Plätze und Spiele bleiben, wenn du die neue lädst.",
    load: "Neue Version laden",
  },
  pageBroken: {
    title: "Auf dieser Seite ist ein Fehler aufgetreten",
    text: "Ein Fehler der Seite selbst, nicht deiner Verbindung. Dein Platz und alles am Tisch bleiben erhalten.",
    reload: "Neu laden",
  },
  notFound: { title: "Seite nicht gefunden", text: "Unter dieser Adresse gibt es nichts." },
};
