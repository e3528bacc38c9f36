// German texts of table/.

import { AbortReason, ParticipantKind } from "../../gen/chefshat/v1/room_pb";
import { ViolatedRule } from "../../gen/chefshat/v1/table_pb";
import { numerals, plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("de");
const number = numerals("eins zwei drei vier fünf sechs sieben acht neun zehn elf zwölf dreizehn vierzehn fünfzehn");

export const table: Texts["table"] = {
  title: "Tisch",
  heading: {
    waiting: "Warten auf alle",
    before: (shift) => `Shift ${shift} · vor der ersten Pizza`,
    turn: (shift, pizza, turn) => `Shift ${shift} · Pizza ${pizza} · Zug ${turn}`,
    shiftOver: (shift) => `Shift ${shift} ist zu Ende`,
    gameOver: "Die Partie ist zu Ende",
    aborted: "Die Partie wurde abgebrochen",
  },
  you: "du",
  freeSeat: "freier Platz",
  pointsWord: (count) => plural(count, { one: "Punkt", other: "Punkte" }),
  chips: { toPlay: "ist dran", toGive: "gibt", toDeclare: "sagt an?", passed: "gepasst", played: "gespielt" },
  presence: {
    away: "nicht verbunden",
    substituted: (agent) => `${agent} springt ein`,
  },
  card: {
    face: (face, ingredient) => `${face}, ${ingredient}`,
    golden: (face, ingredient) => `Goldene ${face}, ${ingredient}`,
    joker: "Joker",
    received: "im Tausch bekommen",
  },
  play: (quantity, face, golden, jokers) => {
    const one = golden ? `die goldene ${face}` : `eine ${face}`;
    const cards = quantity === 1 ? one : `${number(quantity)} ${face}er${golden ? " (davon eine golden)" : ""}`;
    return cards + (jokers === 0 ? "" : plural(jokers, { one: " mit Joker", other: " mit # Jokern" }));
  },
  jokers: (count) => plural(count, { one: "ein Joker", other: "# Joker" }),
  board: { label: "Brett", empty: "Das Brett ist leer", by: (cards, name) => `${cards} · ${name}` },
  hand: {
    label: "Dein Blatt",
    of: (name) => `Blatt von ${name}`,
    empty: "Keine Karten mehr",
    help: "Mit den Pfeiltasten bewegst du dich, die Leertaste wählt eine Karte, Enter spielt die gewählten, Esc legt alle zurück.",
    keysHelp: "Auch die Zahl einer Karte wählt sie, p passt, und das Fragezeichen zeigt alle Tasten.",
  },
  log: {
    title: "Verlauf",
    dealt: (shift) => `Die Karten für Shift ${shift} werden ausgeteilt`,
    plays: (cards) => `spielt ${cards}`,
    passes: "passt",
    finishes: (place) => `wird ${place}`,
    pizzaDone: (pizza, next) => `Pizza ${pizza} ist fertig, ${next} beginnt die nächste`,
    foodFight: "sagt Food Fight an: Alle Rollen werden umgekehrt",
    dinner: "sagt Dinner is Served an: kein Tausch",
    gives: (what, to) => `gibt ${to} ${what}`,
    shiftOver: (shift, winner) => `Shift ${shift} ist zu Ende, ${winner} war zuerst fertig`,
    shows: (expression) => `zeigt ${expression}`,
    says: (phrase) => `sagt „${phrase}“`,
    seated: "setzt sich",
    left: "geht",
    lost: "verliert die Verbindung",
    back: "ist zurück",
    substituted: (agent) => `wird von ${agent} vertreten`,
    restarted: "Der Server wurde neu gestartet; die Partie geht weiter",
    gameStarted: "Die Partie beginnt",
    gameOver: "Die Partie ist zu Ende",
    aborted: "Die Partie wurde abgebrochen",
    causes: {
      agent: "",
      timeout: "Zeit abgelaufen",
      invalid: "keine gültige Antwort",
      disconnected: "nicht verbunden",
      substitute: "durch einen Ersatz",
      recorded: "wie aufgezeichnet",
      table: "",
    },
    handReported: (name) => `Das Blatt von ${name} wurde erfasst`,
    violated: (text) => `wird vom Schiedsrichter gestoppt: ${text}`,
    corrected: () => "Ein Lesefehler wurde berichtigt",
    paused: "Die Partie ist unterbrochen",
    resumed: "Die Partie geht weiter",
  },
  physical: {
    atTable: "am Tisch",
    paused: "Die Partie ist am Tisch unterbrochen.",
    violation: (name, text) => (name ? `${name}: ${text}` : text),
    handAwaited: "Deine Karten kommen gleich",
    handAwaitedText:
      "Die Tischbetreuung zeigt deine Karten der Kamera oder gibt sie ein. Du siehst sie hier, sobald sie bekannt sind.",
    handUnknown: "Dieses Blatt ist nicht bekannt.",
  },
  violation: ({ rule, text, top, highest, fewest, onBoard, golden, next }) => {
    switch (rule) {
      case ViolatedRule.TURN:
        return next ? `Falsche Reihenfolge: ${next} ist dran.` : "Falsche Reihenfolge.";
      case ViolatedRule.FACE:
        if (!onBoard) return text;
        if (highest === 0) return "Nichts schlägt die Trüffel auf dem Brett: Man kann nur passen.";
        if (highest === top) return "Auf dem Brett liegt ein einzelner Joker: Jede Zutat schlägt ihn.";
        return `Auf dem Brett liegen schon Karten mit Wert ${highest + 1}: Nötig ist ${highest === 1 ? "eine 1" : `eine ${highest} oder eine kleinere Zahl`}.`;
      case ViolatedRule.SIZE:
        return plural(fewest, { one: "Nötig ist mindestens # Karte.", other: "Nötig sind mindestens # Karten." });
      case ViolatedRule.FORM:
        return "Gespielt werden Karten eines Wertes, mit oder ohne Joker, oder ein einzelner Joker.";
      case ViolatedRule.OPENING:
        return golden
          ? `Der Shift beginnt mit der goldenen ${top}: nur Karten mit Wert ${top} und Joker dazu.`
          : `Der Shift beginnt mit Wert ${top}: kein anderer Wert.`;
      case ViolatedRule.PASS:
        return "Passen ist jetzt nicht erlaubt.";
      case ViolatedRule.DECISION:
        return "Online wurde anders entschieden.";
      default:
        return text;
    }
  },
  now: {
    yourTurn: "Du bist dran",
    turnOf: (name) => `${name} ist dran`,
    giveOf: (name) => `${name} gibt eine Karte ab`,
    declareOf: (name) => `${name} darf ansagen`,
    wait: "Warten auf die anderen",
    awaited: (name, seconds) => `Warten auf ${name} seit ${seconds}\u00a0s`,
    awaitedAway: (name, seconds) =>
      seconds === undefined ? `Warten auf ${name} (abwesend)` : `Warten auf ${name} (abwesend): ${seconds}\u00a0s`,
    waitExchange: "Die Karten sind ausgeteilt",
    youGive: "Du gibst eine Karte ab",
    youGiveOf: (number, of) => `Du gibst Karte ${number} von ${of} ab`,
    youMayDeclare: "Du hast beide Joker",
    orLower: "oder kleiner",
    cards: "Karten",
    openingGolden: "die goldene muss dabei sein",
    openingFace: "kein anderer Wert",
    anything: "Eine neue Pizza: Alles darf gespielt werden.",
    beat: (highest, fewest) =>
      `${highest}${highest > 1 ? " oder kleiner" : ""}, mindestens ${plural(fewest, { one: "# Karte", other: "# Karten" })}.`,
    nothing: "Das schlägt keine Karte. Du musst passen.",
    opens: "Eröffnet den Shift und darf nicht passen.",
    opensMayPass: "Eröffnet den Shift.",
    giveTo: (name) => `Tausch: Wähle eine Karte für ${name}.`,
    give: "Tausch: Wähle eine Karte zum Abgeben.",
    foodFight: "Food Fight würde alle Rollen umkehren: Du würdest Chef.",
    dinner: "Mit Dinner is Served fiele der Tausch aus.",
    finished: (place) => `Du bist ${place} geworden.`,
    outOfPizza: "Du hast gepasst und bist bis zur nächsten Pizza draußen.",
  },
  played: { title: "In diesem Shift gespielt", allOut: "alle gespielt" },
  actions: {
    label: "Deine Entscheidung",
    play: "Spielen",
    playCards: (cards) => `Spielen: ${cards}`,
    pass: "Passen",
    give: "Abgeben",
    giveCard: (card) => `${card} abgeben`,
    foodFight: "Food Fight!",
    dinner: "Dinner is Served!",
    decline: "Nichts ansagen",
    putBack: "Zurücklegen",
    pick: "Wähle Karten oder passe.",
    pickMust: "Wähle die Karten, die du spielst.",
    onlyPass: "Keine deiner Karten kann gespielt werden.",
    autoPassing: "Du kannst nichts spielen: Es wird gepasst…",
    planHint: "Du bist nicht dran. Du kannst schon wählen, was du dann tust.",
    plan: (cards) => (cards ? `Dann: ${cards}` : "Dann: spielen"),
    planPass: "Dann: passen",
    planned: (what) => `Gewählt für deinen Zug: ${what}`,
    planOff: (what) => `Nicht mehr möglich: ${what}. Wähle neu.`,
    unplan: "Zurücknehmen",
    more: (count) => plural(count, { one: "Wähle noch eine Karte.", other: "Wähle noch # Karten." }),
    ready: "Das kannst du spielen.",
    hint: "Tipp",
    hintComes: "Der Tipp wird berechnet…",
    suggested: (move) => `Vorschlag: ${move}`,
    points: (points, error) => `${points} ± ${error} Punkte`,
    sending: "Wird gesendet…",
    noPass: "Wähle Karten: Wer eröffnet, darf nicht passen.",
    mustPlay: "Lange hat niemand gespielt: Du musst spielen.",
  },
  reasons: {
    openingGolden: (face) => `Spiel die goldene ${face}, nur mit ${face} und Jokern.`,
    openingFace: (face) => `Der Shift beginnt mit Wert ${face}, keinem anderen.`,
    notRarer: (face, board) => `${face} schlägt ${board} nicht: Spiel eine kleinere Zahl.`,
    nothingRarer: "Nichts schlägt die Karten auf dem Brett.",
    tooFew: (need, have) =>
      `Du brauchst ${plural(need, { one: "# Karte", other: "# Karten" })} eines Wertes; du hast ${have}.`,
    jokerAlone: "Ein Joker allein kann nur eine Pizza beginnen.",
    other: "Diese Karte kann jetzt nicht gespielt werden.",
    declareFirst: "Entscheide zuerst, ob du etwas ansagst.",
    gift: "Diese Karte kannst du jetzt nicht abgeben.",
    notYourTurn: "Du bist nicht dran.",
    notHeld: (face) => (face === undefined ? "Du hast keinen Joker." : `Du hast keine ${face}.`),
    noJoker: "Ein Joker kann nicht dazu.",
    mayNotPass: "Du darfst jetzt nicht passen.",
  },
  moments: {
    foodFight: {
      title: (name) => `${name}: Food Fight!`,
      text: "In diesem Shift sind alle Rollen umgekehrt: Der Tellerwäscher ist jetzt der Chef.",
    },
    dinner: {
      title: (name) => `${name}: Dinner is Served!`,
      text: "In diesem Shift werden keine Karten getauscht.",
    },
    exchange: {
      title: () => "Der Tausch",
      text: "Beim Tausch gibt der Tellerwäscher dem Chef die besten Karten und bekommt andere zurück: Das ist dessen Vorrecht.",
    },
    opening: {
      title: (name) => `${name} spielt die goldene Karte`,
      text: "Sie eröffnet den Shift.",
    },
    lastCard: {
      title: (name) => `${name} hat nur noch eine Karte`,
      text: "Wer seine letzte Karte spielt, bekommt den besten freien Platz.",
    },
  },
  clock: {
    label: "Zeit",
    bank: (time) => `+ ${time} Reserve`,
    onBank: "aus der Reserve",
    hurry: (seconds) => `Noch ${seconds} Sekunden.`,
  },
  expressions: {
    label: "Zeig, wie du dich fühlst",
    words: {
      joy: "Freude",
      amusement: "Belustigung",
      surprise: "Überraschung",
      concentration: "Konzentration",
      annoyance: "Ärger",
      sadness: "Traurigkeit",
    },
    say: "Sag etwas",
    ownWords: "Eigene Worte",
    sayIt: "Sagen",
    phrases: {
      "good-luck": "Viel Glück!",
      "well-played": "Gut gespielt!",
      thanks: "Danke!",
      "so-close": "Das war knapp!",
      oops: "Hoppla!",
      sorry: "Entschuldigung!",
      thinking: "Lass mich überlegen…",
      "good-game": "Schöne Partie!",
    },
  },
  tools: {
    label: "Werkzeuge",
    soundOn: "Ton ist an",
    soundOff: "Ton ist aus",
  },
  lookup: {
    title: "Mögliche Züge",
    caption: "Alle Züge nach Wert, Zahl der Karten und Jokern",
    legal: "erlaubt",
    notInHand: "zulässig, aber nicht in diesem Blatt",
    notAllowed: "in diesem Blatt, aber jetzt nicht zulässig",
    impossible: "keins von beiden",
    face: "Wert",
    loneJoker: "ein einzelner Joker",
    pass: "passen",
    count: (count) => plural(count, { one: "# erlaubte Aktion", other: "# erlaubte Aktionen" }),
    chosen: "gewählt",
    groups: "Zeilen: Werte. Spalten: Karten des Wertes; in jeder Spalte ohne Joker, mit einem, mit zwei.",
    signs: "Legende",
    none: "Du bist nicht dran. Diese Tabelle erscheint, wenn du dran bist.",
  },
  aborted: {
    [AbortReason.UNSPECIFIED]: "Sie hat kein Ergebnis.",
    [AbortReason.CLOSED]: "Der Raum wurde von der Person geschlossen, die ihn erstellt hat.",
    [AbortReason.SHUTDOWN]: "Der Server wurde abgeschaltet.",
    [AbortReason.PARTICIPANTS_LOST]: "Zu viele Teilnehmer haben die Verbindung verloren.",
    [AbortReason.NEVER_STARTED]: "Nicht alle Plätze wurden rechtzeitig besetzt.",
    [AbortReason.TOO_LONG]: "Die Partie wurde länger, als der Server speichern kann.",
  },
  result: {
    shift: (shift) => `Shift ${shift}`,
    game: "Endstand",
    total: "Gesamt",
    curve: "Punkte der Partie nach jedem Shift, eine Linie je Sitzplatz",
    adjudicated: "Durch das Zuglimit beendet.",
    replay: "Replay ansehen",
    youWon: "Du hast gewonnen!",
    wins: (name) => `${name} hat gewonnen`,
  },
  answers: {
    notLegal: "Diese Aktion ist nicht erlaubt. Wähle neu.",
    notLegalLeft: (attempts) =>
      attempts === 0
        ? "Diese Aktion ist nicht erlaubt. Die Standardentscheidung wurde für dich getroffen."
        : plural(attempts, {
            one: "Diese Aktion ist nicht erlaubt. Wähle neu: noch # Versuch.",
            other: "Diese Aktion ist nicht erlaubt. Wähle neu: noch # Versuche.",
          }),
    closed: "Zu spät: Das ist schon entschieden.",
    unknownDecision: "Die Partie ist schon weiter. Lade die Seite neu, wenn sich nichts ändert.",
  },
  link: {
    lost: "Verbindung verloren. Wird wiederhergestellt…",
    superseded: "Dieser Platz wird in einem anderen Fenster oder auf einem anderen Gerät benutzt.",
    takeBack: "Hier spielen",
    substituted: "Du warst weg: Ein eingebauter Agent spielt für dich.",
    resume: "Ich bin wieder da",
    refused: "Der Platz konnte nicht eingenommen werden.",
  },
  room: {
    seats: "Sitzplätze",
    waiting: (count) => plural(count, { one: "# Platz ist noch frei", other: "# Plätze sind noch frei" }),
    away: (count) => plural(count, { one: "# muss sich noch verbinden", other: "# müssen sich noch verbinden" }),
    begins: "Die Partie beginnt, sobald alle Plätze besetzt und verbunden sind.",
    ready: "bereit",
    here: "verbunden",
    notHere: "hat Platz genommen, ist aber nicht verbunden",
    waitsFor: {
      [ParticipantKind.UNSPECIFIED]: "frei für alle: eine Person, einen Roboter, einen Agenten oder ein Sprachmodell",
      [ParticipantKind.HUMAN]: "wartet auf eine Person",
      [ParticipantKind.ROBOT]: "wartet auf einen Roboter",
      [ParticipantKind.AGENT]: "wartet auf einen Agenten",
      [ParticipantKind.MODEL]: "wartet auf ein Sprachmodell",
    },
    ways: "So kommen andere dazu",
    invited: "Wer den Raum erstellt hat, lädt die anderen mit einer Adresse oder einem Beitrittscode ein.",
    assigned: "Das Turnier vergibt die Plätze. Sonst kann niemand dazukommen.",
    byCode: "Wer einen Beitrittscode hat, kann einen freien Platz nehmen.",
    toJoin: "Ich habe einen Beitrittscode",
    invite: "Die Einladung steht unten.",
  },
  watch: {
    viewer: "Zuschauersicht",
    spectators: (count: number) => plural(count, { one: "# sieht zu", other: "# sehen zu" }),
  },
};
