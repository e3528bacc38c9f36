// German texts of people/.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("de");

export const people: Texts["people"] = {
  text: "Alle, die auf diesem Server eine gewertete Partie gespielt haben. Namen sind frei gewählt; gleiche unterscheidet ein Schlüssel.",
  ratedGames: (games) => plural(games, { one: "# gewertete Partie", other: "# gewertete Partien" }),
  kinds: { label: "Wer", all: "Alle", human: "Personen", robot: "Roboter", agent: "Agenten", model: "Sprachmodelle" },
  minGames: {
    label: "Mit mindestens",
    games: (games) => plural(games, { one: "# Partie", other: "# Partien" }),
  },
  none: "Hier hat noch niemand eine gewertete Partie gespielt.",
  noneOfThese: "Niemand passt zu diesen Filtern. Wähle weniger Partien oder alle.",
  toLobby: "Geh in die Lobby und spiele eine",
  ratingHint: "Geschätzte Spielstärke, ± ihre Unsicherheit (95 %)",
  order: "Sortiert nach einer vorsichtigen Schätzung: Wertung minus zwei Standardabweichungen.",
  truncated: (count) => `Nur die ersten ${count} werden gezeigt.`,
  which: {
    title: "Welche Partien werden gewertet?",
    text: "Eine Partie wird automatisch gewertet, wenn",
    conditions: [
      "alle sie finden können: sie ist weder „nicht gelistet“ noch privat;",
      "sie bis zum Ende gespielt oder von abwesenden Teilnehmern oder ihrem mitspielenden Besitzer abgebrochen wurde;",
      "der Server die Karten nach einem eigenen Seed ausgeteilt hat: kein fester Seed, keine vorgegebenen Blätter, keine Abzweigung einer anderen Partie, keine Partie mit echten Karten, keine anderswo gespielte Partie;",
      "auf jedem Platz ein anderer Teilnehmer saß, nach Name, Schlüssel und Art: nicht zweimal derselbe eingebaute Agent oder dieselbe Person, kein aufgezeichneter Spieler und niemand, der als Roboter spielte.",
    ],
    losing:
      "Wer am Ende abwesend ist, von einem Ersatz vertreten wird oder einen Tipp bekommt, verliert gegen alle anderen, gleich auf welchem Platz. Die Partie wird trotzdem gewertet.",
    toSee: "In der Liste der Partien eines Teilnehmers steht, warum eine Partie nicht gewertet wird.",
  },
  notRated: (why) => `nicht gewertet: ${why}`,
  forfeited: "als gegen alle verloren gewertet",
  unrated: {
    added: "anderswo gespielt",
    hidden: "nicht öffentlich",
    hinted: "jemand bekam Tipps",
    notDealt: "nicht nach einem Seed des Servers ausgeteilt",
    recorded: "ein aufgezeichneter Spieler nahm teil",
    substituted: "ein Ersatz traf Entscheidungen",
    twice: "jemand spielte auf zwei Plätzen",
    wizard: "eine Person spielte als Roboter",
  },
  fingerprint: (fingerprint) => `Schlüssel des Namens: ${fingerprint}`,
  person: {
    unrated: "Noch keine gewerteten Partien.",
    notListed: (lines) => `Nicht unter den ersten ${lines} der Bestenliste.`,
    rated: (place) => `Platz ${place} der Bestenliste`,
    ratingRange: (from, to) => `Die Spielstärke liegt mit 95 % Sicherheit zwischen ${from} und ${to}.`,
    games: "Beendete Partien",
    wins: "Gewonnen",
    meanPlace: "Mittlerer Platz",
    sameName:
      "Ein Name kann mehrere Schlüssel haben: Das können Partien mehrerer Personen sein, die denselben Namen gewählt haben.",
    played: "Gespielte Partien",
    none: "Es gibt keine Aufzeichnung einer Partie mit diesem Namen, die du sehen darfst.",
    noneOfNewest: "Keine der neuesten Partien mit diesem Namen hat diesen Schlüssel.",
    ofShown: (count) => plural(count, { one: "von # gezeigten Partie", other: "von # gezeigten Partien" }),
    ofThese: (count) => plural(count, { one: "in dieser Partie", other: "in diesen # Partien" }),
    columns: { date: "Wann", place: "Platz", points: "Punkte", game: "Partie" },
    against: "Gegen",
    aborted: "abgebrochen",
    of: (room, date) => `${room}, ${date}`,
    toLeaderboard: "Zur Bestenliste",
  },
};
