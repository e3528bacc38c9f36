// German texts of tournaments/.

import { plurals } from "../plural";
import type { Texts } from "../texts";
import { time } from "./time";

const plural = plurals("de");

export const tournaments: Texts["tournaments"] = {
  none: "Es gibt noch kein Turnier. Erstelle eines, schick seine Adresse an Personen und Agenten und verfolge hier die Rangliste.",
  sections: { open: "Anmeldung offen", playing: "Laufend", over: "Beendet", closed: "Vorzeitig geschlossen" },
  states: {
    open: "Anmeldung offen",
    playing: "läuft",
    paused: "unterbrochen",
    finished: "beendet",
    closed: "vorzeitig geschlossen",
  },
  formats: { knockout: "K.‑o.‑System", roundRobin: "Jeder gegen jeden", swiss: "Schweizer System" },
  deals: {
    same: "Alle Tische einer Runde bekommen dieselben Karten. Zuschauen und Replays gibt es erst nach der Runde.",
    rotated: "Jeder Tisch spielt jede Kartenverteilung einmal pro Sitzplatz.",
  },
  participants: (count) => plural(count, { one: "# Teilnehmer", other: "# Teilnehmer" }),
  made: (date) => `erstellt am ${date}`,
  gamesOver: (over, games) => `${over} von ${plural(games, { one: "# Partie", other: "# Partien" })} beendet`,
  roundOf: (round, rounds) => `Runde ${round} von ${rounds}`,
  round: (round) => `Runde ${round}`,
  final: "Finale",
  table: (table) => `Tisch ${table}`,
  game: (number) => `Partie ${number}`,
  wall: {
    open: "Großanzeige",
    close: "Großanzeige beenden",
    more: (from, to) => `${from} bis ${to}`,
    tables: (from, to) => `Tische ${from} bis ${to}`,
    join: "Zum Anmelden scannen",
    orCode: (host) => `oder ${host} öffnen und eingeben:`,
  },
  print: "Drucken",
  results: {
    title: "Ergebnisse",
    open: "Ergebnisse und Urkunden",
    back: "Zurück zum Turnier",
    provisional: (date) => `Stand: ${date}; das Turnier ist noch nicht zu Ende.`,
    settings: "Wie gespielt wurde",
    table: "Tisch",
    game: "Partie",
    result: "Ergebnis",
    foot: (id) => `Chef’s Hat · Turnier ${id}`,
  },
  certificate: {
    heading: "Urkunden",
    text: "Auf Papier oder, im Dialog des Druckens, als PDF. Unterschreibe sie von Hand.",
    all: (count) => plural(count, { one: "# Urkunde drucken", other: "Alle # Urkunden drucken" }),
    of: "Urkunde drucken von",
    title: "Urkunde",
    placed: (place, of) => `hat im Turnier den ${place}. Platz von ${of} erreicht`,
    tookPart: "hat am Turnier teilgenommen",
    rounds: (count) => plural(count, { one: "# Runde", other: "# Runden" }),
    games: (count) => plural(count, { one: "# gespielte Partie", other: "# gespielte Partien" }),
    score: (mean) => `mittlere Punktzahl ${mean}`,
    wins: (count) => plural(count, { one: "# gewonnene Partie", other: "# gewonnene Partien" }),
    signature: "Unterschrift der Turnierleitung",
  },
  countdown: {
    label: "Beginnt in",
    due: "Beginnt, sobald sich zwei angemeldet haben",
    days: (days, clock) => `${plural(days, { one: "# Tag", other: "# Tagen" })} ${clock}`,
  },
  play: {
    beginsAt: (count) => `Beginnt automatisch bei ${count} Teilnehmern`,
    beginsByHand: "Beginnt, wenn die Turnierleitung es startet",
    beginsOn: (moment) => `Beginnt am ${moment}`,
    beginsAtOrOn: (count, moment) => `Beginnt bei ${count} Teilnehmern, spätestens am ${moment}`,
    knockout: (games) =>
      `${plural(games, { one: "# Partie pro Runde", other: "# Partien pro Runde" })} an Vierertischen; die ersten zwei kommen weiter`,
    rounds: (rounds, games) =>
      rounds === 0
        ? `So viele Runden, wie die Zahl der Teilnehmer erfordert, mit je ${plural(games, { one: "# Partie", other: "# Partien" })}`
        : `${plural(rounds, { one: "# Runde", other: "# Runden" })} mit ${plural(games, { one: "# Partie", other: "# Partien" })}`,
    toPoints: (points) =>
      plural(points, { one: "Eine Partie geht bis # Punkt", other: "Eine Partie geht bis # Punkte" }),
    shifts: (shifts) => plural(shifts, { one: "Eine Partie hat # Shift", other: "Eine Partie hat # Shifts" }),
    clock: (decisionMs, bankMs) =>
      `Personen haben ${time(decisionMs)} pro Entscheidung${bankMs > 0 ? `, dazu ${time(bankMs)} für die ganze Partie` : ""}`,
  },
  standings: {
    title: "Rangliste",
    final: "Endstand",
    score: "Mittlere Punktzahl",
    scoreHint: "Punkte im Mittel für den Platz in einer Partie. Sie bestimmen die Reihenfolge",
    placesWords: (places) => places.map((count, index) => `${count} × ${index + 1}. Platz`).join(", "),
    ratingHint: "Mittelwert und Unsicherheit, aus den gewerteten Partien dieses Turniers",
    round: "Letzte Runde",
    forfeited: (count) => plural(count, { one: "# kampflos verloren", other: "# kampflos verloren" }),
    byes: (count) => plural(count, { one: "# Freilos", other: "# Freilose" }),
    filler: "füllt auf",
    withdrawn: "gegangen",
    former: (names) => `vorher: ${names}`,
    none: "Noch hat sich niemand angemeldet.",
    field: "Teilnehmer",
  },
  games: {
    title: "Partien",
    bracket: "Turnierbaum",
    due: "noch nicht aufgerufen",
    void: "ungültig",
    of: (table, number) => `${table}, Partie ${number}`,
    from: (first) => `die ersten zwei von Tisch ${first}`,
    forfeited: "nicht erschienen",
    advances: "kommt weiter",
    champion: "gewinnt das Turnier",
    none: "Die Tische werden beim Start des Turniers ausgelost.",
    truncated: (count) => `Nur die ersten ${count} Partien werden gezeigt.`,
  },
  confidence: {
    title: "Wie sicher ist die Reihenfolge?",
    text: "Geschätzt aus den bisherigen Punktzahlen, für jedes Paar von Nachbarn in der Rangliste.",
    pair: (upper, lower) => `${upper} vor ${lower}`,
    grades: {
      certain: "fast sicher",
      likely: "wahrscheinlich",
      leaning: "eher ja als nein",
      open: "noch nicht klar",
      against: "die Punktzahlen sprechen für das Gegenteil",
    },
    percent: (percent) => `${percent} %`,
    more: (games) =>
      plural(games, {
        one: "etwa # weitere Partie für beide würde es entscheiden",
        other: "etwa # weitere Partien für beide würden es entscheiden",
      }),
  },
  join: {
    title: "Teilnehmen",
    text: "Du spielst im Browser. Bleib auf dieser Seite: Deine Partien beginnen hier automatisch.",
    code: "Beitrittscode des Turniers",
    codeMissing: "Gib den Code ein, den du von der Turnierleitung bekommen hast.",
    nameHint: "Alle sehen ihn. Er muss im Turnier einmalig sein.",
    submit: "Zum Turnier anmelden",
    notForPeople: "Personen können sich zu diesem Turnier nicht anmelden.",
  },
  part: {
    you: (name) => `Du nimmst als ${name} teil.`,
    waitOpen:
      "Bleib auf dieser Seite. Das Turnier beginnt, wenn die Turnierleitung es startet oder genug Anmeldungen da sind.",
    waitNext: "Bleib auf dieser Seite: Deine nächste Partie beginnt hier automatisch.",
    waitPaused:
      "Die Turnierleitung hat das Turnier unterbrochen. Deine nächste Partie beginnt hier, wenn es fortgesetzt wird.",
    postpone: (place) => `Meine nächste Partie verschieben (${place})`,
    leave: "Turnier verlassen…",
    leaveDo: "Jetzt verlassen",
    leaveOpen: "Dein Platz wird für andere frei.",
    leavePlaying:
      "Ein Ersatz spielt deine laufende Partie zu Ende, und die anderen verlierst du kampflos. Du kannst nicht zurückkommen.",
    left: "Du nimmst an diesem Turnier nicht mehr teil. Deine bisherigen Ergebnisse zählen.",
    replaced: "Jemand anders hat deinen Platz in diesem Turnier eingenommen.",
    over: "Das Turnier ist zu Ende. Danke fürs Mitspielen.",
    superseded: "Du nimmst in einem anderen Fenster oder auf einem anderen Gerät teil.",
    takeBack: "Hier teilnehmen",
    begins: (place) => `Deine Partie beginnt: ${place}.`,
    back: "Zurück zur Rangliste",
    place: (round, table) => `Runde ${round}, Tisch ${table}`,
    toGame: "Zu meiner Partie",
    which: {
      title: "Welchen Platz möchtest du verwenden?",
      text: (held, brought) =>
        `Auf diesem Gerät nimmt schon ${held} an diesem Turnier teil. Der Link bringt den Platz von ${brought}.`,
      lost: (held) =>
        `Ein Gerät spielt für einen Teilnehmer. Wenn du den Link hier verwendest, verliert dieses Gerät den Platz von ${held}.`,
      stay: (held) => `Als ${held} weitermachen`,
      take: (brought) => `Als ${brought} teilnehmen`,
    },
  },
};
