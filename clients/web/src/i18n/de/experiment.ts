// German texts of experiment/.

import type { Texts } from "../en";
import { plurals } from "../plural";
import { time } from "./time";

const plural = plurals("de");

export const experiment: Texts["experiment"] = {
  join: {
    title: "Du bist zu einer Studie eingeladen",
    as: (name) => `Du nimmst als ${name} teil.`,
    atSeat: (seat) => `Dein Sitzplatz ist Nummer ${seat + 1}.`,
    consent: "Bevor du beginnst",
    fromHost:
      "Dieser Text kommt von der Person, die dich eingeladen hat, nicht von denen, die diese Seite gemacht haben.",
    agree: "Ich habe das gelesen und bin einverstanden",
    decline: "Ich bin nicht einverstanden",
    declined: "Du nimmst nicht teil. Es wurde nichts gespeichert; du kannst diese Seite schließen.",
    before: "Zuerst ein Fragebogen",
    beforeText: (host) =>
      `Er öffnet sich in einem neuen Fenster, auf ${host}. Komm hierher zurück, wenn du fertig bist.`,
    open: "Fragebogen öffnen",
    done: "Ich habe ihn ausgefüllt",
    reconsider: "Noch einmal lesen",
    gone: "Dieser Link funktioniert nicht mehr: Der Raum wurde geschlossen, oder die Partie ist zu Ende. Frage die Person, die ihn dir geschickt hat.",
    taken: (name) => `Mit diesem Link hat auf diesem Gerät schon jemand einen Platz genommen, als ${name}.`,
    goOn: (name) => `Als ${name} weitermachen`,
    another: "Einen anderen Platz nehmen",
    held: (name) => `${name} hat auf diesem Gerät schon einen Platz in diesem Raum.`,
    oneSeat: (name) =>
      `Ein Gerät kann nur einen Platz pro Raum haben. Wenn sich hier jemand anders setzt, wird der Platz von ${name} frei.`,
    begun: (name) =>
      `Die Partie hat begonnen, und auf diesem Gerät kann nur ${name} weitermachen. Öffne diesen Link auf einem anderen Gerät.`,
    giveBack: (name, as) => `Den Platz von ${name} aufgeben und als ${as} teilnehmen`,
    seated: (name) =>
      `${name} hat schon einen Platz. Mach auf dem Gerät weiter, an dem du dich gesetzt hast; wenn du das nicht warst, frage die Person, die dir den Link geschickt hat.`,
    takenPlace: (name) => `Mit diesem Link hat sich auf diesem Gerät schon jemand angemeldet, als ${name}.`,
    heldPlace: (name) => `${name} nimmt auf diesem Gerät schon an diesem Turnier teil.`,
    onePlace: (name) =>
      `Ein Gerät spielt für einen Teilnehmer. Wenn sich hier jemand anders anmeldet, kann ${name} keine Partien mehr spielen.`,
    joinAs: (name) => `Als ${name} teilnehmen`,
    anotherPlace: "Jemand anderen anmelden",
    come: { room: "An den Tisch setzen", tournament: "Zum Turnier anmelden" },
    recorded: {
      room: "Die Partie wird aufgezeichnet: der Name oben, deine Entscheidungen und wie lange jede dauert, und die Reaktionen, die du zeigst. Sonst nichts.",
      tournament:
        "Die Partien werden aufgezeichnet: der Name oben, deine Entscheidungen und wie lange jede dauert, und die Reaktionen, die du zeigst. Sonst nichts. Bleib auf dieser Seite: Deine Partien beginnen hier automatisch.",
    },
    over: "Du hast an dieser Studie teilgenommen",
    timed:
      "Die Zeit, die du brauchst, wird auch auf diesem Gerät gemessen und mit deinen Entscheidungen aufgezeichnet.",
  },
  after: {
    title: "Danke fürs Mitspielen",
    text: (host) => `Noch eine letzte Bitte: ein Fragebogen auf ${host}.`,
    whose: (name) => `Er ist für ${name}.`,
  },
  links: {
    title: "Links für eine Studie",
    text: "Ein Link, der festlegt, wer teilnimmt, auf welchem Sitzplatz und in welcher Sprache, und was zu sehen ist. Das alles steht im Link selbst; der Server speichert nichts davon.",
    tournamentText:
      "Ein Link, der festlegt, wer teilnimmt, in welcher Sprache, und was in jeder Partie zu sehen ist. Das alles steht im Link selbst; der Server speichert nichts davon.",
    hosted:
      "Für Bedingungen, die der Server zuteilt, aufgezeichnete Einwilligung und eingebaute Fragebögen erstelle stattdessen eine Studie:",
    where: "Wo sie spielen",
    here: "alle in diesem Raum",
    names: "Teilnehmer, einer pro Zeile",
    namesHint: "Pseudonyme wie P07, oder P01-P20 für zwanzig. Wenn das Feld leer ist, wählen alle selbst einen Namen.",
    tooManyNames: (most) => `Höchstens ${most} auf einmal; die übrigen fallen weg.`,
    tooLong: (most) => `Ein Name darf höchstens ${most} Zeichen haben; für längere Namen gibt es keinen Link.`,
    seat: "Sitzplatz des ersten Teilnehmers; die anderen folgen",
    anySeat: "ein beliebiger freier Platz",
    language: "Sprache",
    browserLanguage: "die des Browsers",
    hide: "Am Tisch ausblenden",
    hidden: {
      log: "Verlauf",
      lookup: "mögliche Züge",
      expressions: "Reaktionen",
      played: "im Shift gespielte Karten",
      pages: "Links zu anderen Seiten",
    },
    times: "Auch die im Browser gemessene Zeit aufzeichnen",
    timesHint: "Wird als Anmerkung zu jeder Entscheidung gespeichert, neben der Messung des Servers.",
    consent: "Einwilligungstext",
    consentHint: "Die Teilnehmer müssen zustimmen, bevor sie sich setzen. Einfacher Text.",
    consentTournamentHint: "Die Teilnehmer müssen zustimmen, bevor sie sich anmelden. Einfacher Text.",
    before: "Adresse eines Fragebogens vor dem Spielen",
    after: "Adresse eines Fragebogens nach dem Spielen",
    beforeHint: "https://…; {name} wird ersetzt, wenn der Link einen Namen festlegt.",
    afterHint: "https://…; {name} und {room} werden ersetzt.",
    afterTournamentHint: "Erscheint nach dem Ende des Turniers. https://…; {name} und {tournament} werden ersetzt.",
    notAnAddress: "Gib eine Adresse ein, die mit https:// oder http:// beginnt.",
    tooMany: (seats) =>
      plural(seats, {
        one: "Es gibt mehr Namen als Plätze: Nur # Platz ist frei.",
        other: "Es gibt mehr Namen als Plätze: Nur # Plätze sind frei.",
      }),
    own: {
      label: "jeder in einem eigenen Raum wie diesem",
      namesHint: "Pseudonyme wie P07, oder P01-P20 für zwanzig: Für jedes wird ein Raum erstellt.",
      seat: "Ihr Sitzplatz",
      text: "Jeder Raum bekommt die Regeln, Zeiten und Agenten von diesem. Dieses Gerät speichert, was es braucht, um sie zu schließen. Ihre Links bleiben hier aufgelistet, jeder mit den Einstellungen, die dieses Formular beim Erstellen seines Raums hatte.",
      barred: {
        seed: "Die Karten dieses Raums sind durch einen geheimen Seed festgelegt; in den anderen Räumen wird zufällig ausgeteilt.",
        real: "Dieser Raum hat einen Tisch mit echten Karten, und einen zweiten gibt es nicht.",
        hands:
          "Dieser Raum beginnt mit vorgegebenen Blättern, die hier nicht bekannt sind; daher kann kein gleicher Raum erstellt werden.",
      },
      wait: "Jeder Raum wartet",
      waitHint: "Ist bis dahin niemand gekommen, wird der Raum geschlossen, und der Link funktioniert nicht mehr.",
      time,
      namesMissing: "Gib oben die Teilnehmer ein.",
      make: (count) => plural(count, { one: "# Raum erstellen", other: "# Räume erstellen" }),
      making: (made, all) => `${made} von ${all} Räumen erstellt…`,
      keptMade: (made, missing) => `${made} erstellt und unten aufgelistet; ${missing} noch zu erstellen.`,
    },
    copyAll: "Alle kopieren",
    download: "Als Tabelle herunterladen (CSV)",
    result: "Links",
    everybody: "alle",
  },
};
