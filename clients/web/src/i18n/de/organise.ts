// German texts of creating and running a tournament, in tournaments/.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("de");

export const organise: Texts["organise"] = {
  title: "Turnier erstellen",
  link: "Turnier erstellen…",
  name: "Name des Turniers",
  namePlaceholder: "Frühlingspokal",
  format: "Wer gegen wen spielt",
  formats: {
    knockout:
      "Vierertische, ausgelost. Die ersten zwei jedes Tisches kommen weiter, bis zu einem Finale zu viert. Kurz, mit einem klaren Sieger.",
    roundRobin:
      "Alle treffen auf alle, so gleichmäßig, wie die Zahl es zulässt. Die gerechteste Rangliste und die meisten Partien.",
    swiss:
      "Einige Runden, in denen Teilnehmer mit ähnlichem Punktestand aufeinandertreffen. Niemand scheidet aus, und es braucht weniger Partien.",
  },
  players: "Spieler pro Tisch",
  playersKnockout: "Das K.‑o.‑System hat immer Vierertische.",
  rounds: "Runden",
  roundsHint: "Leer: so viele, wie die Turnierform vorschlägt",
  gamesPerPairing: "Partien pro Tisch und Runde",
  gamesPerPairingHint: "Von Partie zu Partie rücken alle um einen Platz weiter.",
  gamesPerPairingRotated: "Hier die Zahl der Kartenverteilungen; jede wird einmal pro Sitzplatz gespielt.",
  who: "Wer teilnimmt",
  builtIn: "Eingebaute Agenten",
  builtInHint: "Wie viele von jedem; 0 für keinen",
  builtInSum: (count) => plural(count, { one: "# eingebauter Agent", other: "# eingebaute Agenten" }),
  kinds: "Wer sich mit dem Code anmelden darf",
  kind: { people: "Personen", agents: "Agenten", robots: "Roboter", models: "Sprachmodelle" },
  maxParticipants: "Höchstzahl der Teilnehmer",
  maxParticipantsHint: "2 bis 1024, mit eingebauten Agenten",
  physicalTables: "Tische mit echten Karten",
  physicalTablesHint: "Für alle, die mit echten Karten spielen; du fügst sie vor dem Start hinzu. 0 für keine",
  filler: "Füllagent",
  fillerHint: "Füllt den Turnierbaum oder einen Tisch auf und spielt für Teilnehmer, die nicht erscheinen.",
  when: "Wann es beginnt",
  start: {
    label: "Es beginnt",
    byHand: "wenn ich es starte",
    joined: "automatisch, bei einer Zahl von Teilnehmern",
    time: "automatisch, zu einer Uhrzeit",
    timeHint: "Mit allen, die sich bis dahin angemeldet haben, wenn es mindestens zwei sind.",
    byHandHint: "Mit einem Knopf auf seiner Seite, den nur dieses Gerät zeigt.",
    joinedHint: "Sobald sich so viele angemeldet haben.",
  },
  startWhen: "Teilnehmer",
  startWhenHint: "Mit eingebauten Agenten",
  startAt: "Datum und Uhrzeit",
  noShow: "Sekunden, die eine Partie auf Abwesende wartet",
  noShowHint: "1 bis 86400. Danach wird die Partie später noch einmal aufgerufen.",
  maxCalls: "Aufrufe pro Partie",
  maxCallsHint: "Beim letzten Aufruf wird sie ohne die Fehlenden gespielt.",
  otherClocks: "Andere Zeiten für Agenten, Roboter und Sprachmodelle",
  otherClocksHint: "Programme brauchen Sekunden, Menschen brauchen länger.",
  agentSeconds: "Sekunden pro Entscheidung eines Agenten",
  robotSeconds: "Sekunden pro Entscheidung eines Roboters",
  modelSeconds: "Sekunden pro Entscheidung eines Sprachmodells",
  more: "Kartenverteilung, Regeln, Fehler und Zuschauer",
  deals: "Wie die Karten verteilt werden",
  dealWords: {
    independent: {
      name: "Neu in jeder Partie",
      hint: "Für Personen und Agenten.",
    },
    same: {
      name: "Gleich an allen Tischen einer Runde",
      hint: "Das Glück mit den Karten gleicht sich aus. Zuschauer sind nicht erlaubt, und Replays gibt es erst nach der Runde.",
    },
    rotated: {
      name: "Jede Verteilung einmal pro Sitzplatz",
      hint: "Für eingebaute Agenten und Agenten, die sich als zustandslos anmelden. Personen können sich nicht anmelden.",
    },
  },
  maxParallel: "Höchstzahl gleichzeitiger Partien",
  notWatched:
    "Bei diesen Verteilungen sind Zuschauer nicht erlaubt: Die Karten eines Tisches würden die eines anderen verraten.",
  experiment: "Für ein wiederholbares Experiment",
  drawSeed: "Seed der Auslosung",
  drawSeedHint: "64 hexadezimale Ziffern; leer für einen zufälligen Seed",
  dealSeed: "Seed der Kartenverteilung",
  dealSeedHint: "Wer ihn kennt, kennt die Karten; die Partien werden nicht gewertet.",
  problems: {
    nameMissing: "Gib einen Namen ein.",
    tooMany: "Höchstens 1024 können teilnehmen.",
    nobody: "Erlaube mindestens einer Art von Teilnehmern die Anmeldung.",
    notASeed: "Gib 64 hexadezimale Ziffern ein.",
    startPassed: "Gib eine Zeit ein, die noch nicht vorbei ist.",
  },
  submit: "Turnier erstellen",
  own: {
    title: "Du leitest dieses Turnier",
    text: "Nur dieses Gerät kann es starten, ändern und schließen.",
    invite: "Teilnehmer einladen",
    joined: (count) => plural(count, { one: "# Anmeldung.", other: "# Anmeldungen." }),
    startsAt: (count) => `Es beginnt automatisch bei ${count} Anmeldungen.`,
    start: "Turnier starten",
    startText: "Lost die Tische aus und ruft die ersten Partien auf. Danach kann sich niemand mehr anmelden.",
    filledUp: (field, filler, more) =>
      plural(more, {
        one: `# Agent „${filler}“ kommt dazu, damit es ${field} sind.`,
        other: `# Agenten „${filler}“ kommen dazu, damit es ${field} sind.`,
      }),
    atTable: {
      title: "Teilnehmer an einem Tisch mit echten Karten hinzufügen",
      text: "Für sie verbindet sich niemand. Die Tischbetreuung meldet, was sie tun.",
      name: "Name",
      kind: "Wer es ist",
      submit: "Hinzufügen",
    },
    tables: {
      title: "Partien mit echten Karten",
      text: "Betreue den Tisch auf diesem Gerät. Auf seiner Seite steht auch der Link für ein anderes Gerät.",
    },
    pause: {
      pause: "Pause",
      resume: "Turnier fortsetzen",
      text: "Es beginnt keine neue Partie; laufende gehen weiter.",
      isPaused: "Das Turnier ist unterbrochen: Es beginnt keine neue Partie.",
    },
    people: {
      title: "Teilnehmer ändern",
      change: "Ändern…",
      remove: "Entfernen…",
      removeDo: "Jetzt entfernen",
      removeOpen: (name) => `${name} entfernen? Der Platz wird frei. Wer den Code hat, kann sich wieder anmelden.`,
      removePlaying: (name) =>
        `${name} entfernen? Ein Ersatz spielt die laufende Partie zu Ende; die anderen gehen kampflos verloren.`,
      replace: "Den Platz weitergeben an",
      somebody: "eine andere Person",
      agent: (name) => `den Agenten „${name}“`,
      newName: "Name der anderen Person",
      replaceDo: "Ersetzen",
      linkFor: (name) => `Schick diesen Link nur an ${name}; er enthält den Platz.`,
      linkSent: "Ich habe ihn weitergegeben",
    },
    games: {
      title: "Partien ändern",
      text: "„Jetzt aufrufen“ setzt eine Partie vor alle anderen. „Verschieben“ setzt sie dahinter und kostet keinen Aufruf.",
      call: "Jetzt aufrufen",
      postpone: "Verschieben",
      more: (count) => plural(count, { one: "… und # weitere Partie", other: "… und # weitere Partien" }),
    },
    close: "Turnier schließen…",
    closeOpen: "Niemand kann sich mehr anmelden, und es wird nicht gespielt.",
    closePlaying:
      "Laufende Partien werden abgebrochen. Bisherige Ergebnisse bleiben, und die Rangliste ist nicht endgültig.",
    closeDo: "Jetzt schließen",
  },
};
