// German texts of replay/.

import type { Texts } from "../en";

export const replay: Texts["replay"] = {
  title: "Replay",
  controls: "Replay",
  first: "Zum Anfang",
  before: "Ein Schritt zurück",
  play: "Abspielen",
  pause: "Pause",
  after: "Ein Schritt vor",
  last: "Zum Ende",
  moment: "Stelle in der Partie",
  decisionOf: (decision, all) => `${decision} von ${all} Entscheidungen getroffen`,
  shift: "Shift",
  speed: "Tempo",
  perspective: "Sichtbare Karten",
  allHands: "alle Blätter",
  noHands: "gespielte Karten (kein Blatt ist bekannt)",
  as: (name) => `Sicht von ${name}`,
  asSpectator: "Sicht der Zuschauer",
  possible: "Mögliche Aktionen",
  answered: (name, answer) => `${name}: ${answer}`,
  seconds: (seconds) => `${seconds.toFixed(1).replace(".", ",")} s`,
  estimate: (value) => `Schätzung ${value.toFixed(2).replace(".", ",")}`,
  hints: (count) => (count === 1 ? "nach einem Tipp" : `nach ${count} Tipps`),
  reason: (text) => `Angegebener Grund: ${text}`,
  noTable: "Diese Entscheidung ist kein Zug und hat daher keine Tabelle.",
  analysis: {
    title: "Analyse",
    subtitle: (name) => `was die Aktionen wert waren, nach dem, was ${name} wusste`,
    running: "Mögliche Kartenverteilungen werden weitergespielt…",
    caption: (rollouts) =>
      `Mittlere Punkte des Shifts und Standardfehler, aus ${rollouts.toLocaleString("de")} Partien, von Greedy-Agenten weitergespielt`,
    action: "Aktion",
    points: "Punkte",
    value: (points, error) => `${points.toFixed(2)} ± ${error.toFixed(2)}`.replaceAll(".", ","),
    taken: "gespielt",
    best: "beste",
    others: (count) =>
      count === 1 ? "Eine weitere Aktion ist weniger wert." : `${count} weitere Aktionen sind weniger wert.`,
    hands: "Karten, die jeder Sitzplatz im Mittel hat",
    seat: "Sitzplatz",
    joker: "J",
    cards: (count) => count.toFixed(1).replace(".", ","),
  },
  empty: "Diese Aufzeichnung enthält keine Ereignisse.",
};
