// German texts of attend/: the attendant of a table with real cards.

import { plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("de");

/** The names of a list in English, "Ada, Bo and Cy", in German. */
const names = (list: string) => list.replace(" and ", " und ");

export const attend: Texts["attend"] = {
  title: "Den Tisch betreuen",
  heading: (room) => room || "Tisch mit echten Karten",
  noTicket:
    "Dieses Gerät darf für diesen Tisch nichts melden. Öffne auf dem Gerät, das den Raum erstellt hat, den Link für die Tischbetreuung oder scanne seinen QR-Code.",
  gone: "Diesen Tisch gibt es nicht mehr, oder der Link ist falsch.",
  now: {
    label: "Worauf der Tisch wartet",
    waiting: "Warten auf die Online-Spieler",
    waitingText: "Die Partie beginnt, sobald alle Online-Plätze besetzt und verbunden sind.",
    hand: (name) => `Zeige das Blatt von ${name}`,
    handText:
      "Halte die Karten so, dass die Kamera sie alle sieht, oder gib sie unten ein. Zeige sie nicht den anderen.",
    special: "Sagt jemand eine Sonderaktion an?",
    specialOf: (name) => `${name} entscheidet über eine Sonderaktion`,
    specialText: "Wer beide Joker hat, darf das. Melde, wer etwas ansagt oder dass niemand es tut.",
    gift: (name) => `${name} gibt Karten ab`,
    giftOf: (name) => `${name} wählt, was abgegeben wird`,
    giftText: "Melde den Tausch, wenn die Karten übergeben sind. Du musst sie nicht sehen.",
    opening: (face) => `Wer die goldene ${face} hat, eröffnet den Shift`,
    turn: (name) => `${name} ist dran`,
    turnOf: (name) => `${name} entscheidet gerade`,
    remoteText: "Hier wird online gespielt. Bis die Entscheidung da ist, gibt es nichts zu tun.",
    question: "Eine Frage an dich",
    questionText: "Die Partie geht weiter, wenn sie beantwortet ist.",
    confirmation: "Wurde der letzte Zug richtig gelesen?",
    confirmationText:
      "Dann ist die Partie zu Ende. Sonst berichtige ihn; ohne Meldung gilt das Ergebnis nach 20 Sekunden.",
    confirm: "Ja, die Partie ist zu Ende",
    over: "Die Partie ist zu Ende",
    paused: "Unterbrochen",
    pausedText: "Die Uhren stehen. Meldungen zählen trotzdem.",
    pause: "Pause",
    resume: "Weiter",
  },
  violation: {
    label: "Nicht erlaubt",
    todo: "Es zählt nicht. Lass die Karten zurücknehmen oder berichtige, was falsch gelesen wurde.",
    takenBack: "Zurückgenommen",
    reenter: "Eingeben, was wirklich dort liegt",
    correct: "Eine frühere Meldung berichtigen",
  },
  questions: {
    picture: "Was die Kamera sieht",
    withdraw: "Keine Antwort",
    words: (text) => {
      const [, passed] = /^Did (.+) pass\?$/.exec(text) ?? [];
      if (passed) return `${passed.includes(" and ") ? "Haben" : "Hat"} ${names(passed)} gepasst?`;
      const [, leads] = /^Is that a new play by (.+)\?$/.exec(text) ?? [];
      if (leads) return `Ist das ein neuer Zug von ${leads}?`;
      return text === "Who opened the Shift?" ? "Wer hat den Shift eröffnet?" : text;
    },
    option: (text) => {
      const [, name, play] = /^No, (.+) passed before (.+)$/.exec(text) ?? [];
      if (name) return `Nein, ${name} hatte davor gepasst (${play})`;
      return text === "Yes" ? "Ja" : text === "No" ? "Nein" : text;
    },
  },
  toLay: {
    title: "Am Tisch zu tun",
    lay: (name) => `Für ${name} legen`,
    pass: (name) => `Die Passkarte von ${name} zeigen`,
    give: (name, to) => `Von ${name} an ${to} geben`,
    foodFight: (name) => `Ausrufen: ${name} sagt Food Fight an`,
    dinner: (name) => `Ausrufen: ${name} sagt Dinner is Served an`,
    done: "Erledigt",
  },
  enter: {
    title: "Von Hand eingeben",
    what: "Was geschehen ist",
    kinds: {
      turn: "Gespielt oder gepasst",
      hand: "Ein Blatt",
      special: "Sonderaktion",
      gift: "Tausch",
      role: "Rolle genommen",
      passWithdrawn: "Passen zurückgenommen",
      cleared: "Brett geleert",
    },
    seat: "Wer",
    face: "Wert",
    number: "Wie viele",
    jokers: "Joker dazu",
    fewer: (what) => `Weniger: ${what}`,
    more: (what) => `Mehr: ${what}`,
    golden: (face) => `Die goldene ${face} ist dabei`,
    notAllowed: "jetzt nicht erlaubt",
    lay: "Zug melden",
    lays: (name, cards) => `${name} legt ${cards}`,
    pass: "Gepasst",
    passes: (name) => `${name} passt`,
    passWithdrawn: (name) => `${name} nimmt das Passen zurück`,
    clearedText: "Die Pizza ist fertig, und die Karten wurden vom Brett genommen.",
    declares: (name) => `${name} sagt an`,
    nobodyDeclares: "Niemand sagt an",
    giftUnseen: (name) => `${name} hat gegeben, Karten nicht gesehen`,
    giftSeen: (name) => `${name} hat diese Karten gegeben`,
    handSeen: (name) => `Das ist das Blatt von ${name}`,
    role: "Rolle",
    takesRole: (name, role) => `${name} ist ${role}`,
    whoFirst: "Wähle, wer es war.",
    hand: {
      label: "Karten",
      hint: "Schreib sie, zum Beispiel 3 4 4 11 J oder 2x4, oder tippe sie unten an.",
      tap: "Zum Hinzufügen antippen",
      remove: (card) => `${card} entfernen`,
      add: (card) => `${card} hinzufügen`,
      count: (count, of) =>
        of === undefined ? plural(count, { one: "# Karte", other: "# Karten" }) : `${count} von ${of} Karten`,
      clear: "Leeren",
      word: (word) => `„${word}“ ist keine Karte. Schreib Zahlen, und J für einen Joker.`,
      tooMany: (face, all) =>
        plural(all, {
          one: `Das Deck hat nur # Karte mit Wert ${face}.`,
          other: `Das Deck hat nur # Karten mit Wert ${face}.`,
        }),
      tooManyJokers: (all) => `Das Deck hat nur ${all} Joker.`,
      mustBe: (count) => plural(count, { one: "Das Blatt hat # Karte.", other: "Das Blatt hat # Karten." }),
    },
  },
  reports: {
    title: "Meldungen in diesem Shift",
    none: "Es wurde noch nichts gemeldet.",
    assumed: "(wer es war, ist angenommen)",
    change: "Ändern",
    remove: "Entfernen",
    removeSure: "Es ist dann, als wäre es nie geschehen. Was danach nicht mehr passt, wird auch entfernt.",
    changeTitle: (text) => `Ändern: ${text}`,
    changeText: "Was ist stattdessen geschehen? Alles danach wird neu beurteilt.",
    laid: (name, cards) => `${name} hat ${cards} gelegt`,
    passed: (name) => `${name} hat gepasst`,
    passWithdrawn: (name) => `${name} hat das Passen zurückgenommen`,
    hand: (name) => `Das Blatt von ${name} wurde gesehen`,
    cleared: "Das Brett wurde geleert",
    declared: (name) => `${name} hat eine Sonderaktion angesagt`,
    nobodyDeclared: "Niemand hat eine Sonderaktion angesagt",
    gave: (name) => `${name} hat Karten abgegeben`,
    gaveCards: (name, cards) => `${name} hat ${cards} abgegeben`,
    role: (name, role) => `${name} hat die Karte ${role} genommen`,
  },
  outcome: {
    accepted: "Gemeldet.",
    known: "Das war schon bekannt.",
    held: "Das wartet auf die Antwort auf eine Frage.",
    notSent: "Nicht gesendet, weil die Meldung davor nicht zählt. Sieh auf den Tisch und gib sie noch einmal ein.",
    violation: "Nicht erlaubt. Es zählt nicht.",
    void: (count) =>
      plural(count, {
        one: "Berichtigt. # spätere Meldung passt nicht mehr und wurde entfernt: Gib noch einmal ein, was geschehen ist.",
        other:
          "Berichtigt. # spätere Meldungen passen nicht mehr und wurden entfernt: Gib noch einmal ein, was geschehen ist.",
      }),
  },
  seats: {
    remote: "online",
    handKnown: "Blatt bekannt",
    handUnknown: "Blatt nicht bekannt",
    passed: "gepasst",
    next: "ist dran",
  },
  link: {
    title: "Auf einem Tablet neben dem Tisch",
    text: "Wer diese Adresse hat, kann für den Tisch melden. Zeige sie nur denen, die ihn betreuen.",
    qr: "QR-Code der Ansicht für die Tischbetreuung",
  },
  room: {
    realCards: "echte Karten",
  },
};
