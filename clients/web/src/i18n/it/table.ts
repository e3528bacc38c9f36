// Italian texts of table/.

import { AbortReason, ParticipantKind } from "../../gen/chefshat/v1/room_pb";
import { ViolatedRule } from "../../gen/chefshat/v1/table_pb";
import { numerals, plurals } from "../plural";
import type { Texts } from "../texts";

const plural = plurals("it");
const number = numerals(
  "uno due tre quattro cinque sei sette otto nove dieci undici dodici tredici quattordici quindici",
);
/** A face with its article: "l’8", "l’11", "il 9". */
const il = (face: number) => `${face === 8 || face === 11 ? "l’" : "il "}${face}`;

export const table: Texts["table"] = {
  title: "Tavolo",
  heading: {
    waiting: "In attesa di tutti",
    before: (shift) => `Shift ${shift} · prima della prima pizza`,
    turn: (shift, pizza, turn) => `Shift ${shift} · Pizza ${pizza} · Turno ${turn}`,
    shiftOver: (shift) => `Lo Shift ${shift} è finito`,
    gameOver: "La partita è finita",
    aborted: "La partita è stata interrotta",
  },
  you: "tu",
  freeSeat: "posto libero",
  pointsWord: (count) => plural(count, { one: "punto", other: "punti" }),
  chips: { toPlay: "gioca", toGive: "dà", toDeclare: "dichiara?", passed: "ha passato", played: "ha giocato" },
  presence: {
    away: "non connesso",
    substituted: (agent) => `sostituito da ${agent}`,
  },
  card: {
    face: (face, ingredient) => `${face}, ${ingredient}`,
    golden: (face, ingredient) => `${face} d’oro, ${ingredient}`,
    joker: "jolly",
    received: "ricevuta nello scambio",
  },
  play: (quantity, face, golden, jokers) => {
    const one = golden ? `${il(face)} d’oro` : `un ${face}`;
    const cards = quantity === 1 ? one : `${number(quantity)} ${face}${golden ? " (uno d’oro)" : ""}`;
    return cards + (jokers === 0 ? "" : plural(jokers, { one: " con jolly", other: " con # jolly" }));
  },
  jokers: (count) => plural(count, { one: "un jolly", other: "# jolly" }),
  board: { label: "Piatto", empty: "Il piatto è vuoto", by: (cards, name) => `${cards} · ${name}` },
  hand: {
    label: "La tua mano",
    of: (name) => `Mano di ${name}`,
    empty: "Nessuna carta",
    help: "Le frecce spostano, la barra spaziatrice sceglie una carta, Invio gioca quelle scelte, Esc le rimette tutte a posto.",
    keysHelp: "Anche il numero di una carta la sceglie, p passa e il punto interrogativo mostra tutti i tasti.",
  },
  log: {
    title: "Che cosa è successo",
    dealt: (shift) => `Si distribuiscono le carte dello Shift ${shift}`,
    plays: (cards) => `gioca ${cards}`,
    passes: "passa",
    finishes: (place) => `finisce ${place}`,
    pizzaDone: (pizza, next) => `La pizza ${pizza} è finita, inizia ${next}`,
    foodFight: "dichiara Food Fight: tutti i ruoli si invertono",
    dinner: "dichiara Dinner is Served: niente scambio",
    gives: (what, to) => `dà ${what} a ${to}`,
    shiftOver: (shift, winner) => `Lo Shift ${shift} è finito, primo ${winner}`,
    shows: (expression) => `mostra ${expression}`,
    says: (phrase) => `dice «${phrase}»`,
    seated: "si siede",
    left: "lascia il tavolo",
    lost: "perde la connessione",
    back: "si riconnette",
    substituted: (agent) => `viene sostituito da ${agent}`,
    restarted: "Il server è stato riavviato; la partita continua",
    gameStarted: "La partita inizia",
    gameOver: "La partita è finita",
    aborted: "La partita è stata interrotta",
    causes: {
      agent: "",
      timeout: "tempo scaduto",
      invalid: "nessuna risposta valida",
      disconnected: "non connesso",
      substitute: "da un sostituto",
      recorded: "come registrato",
      table: "",
    },
    handReported: (name) => `L’arbitro ha visto la mano di ${name}`,
    violated: (text) => `riceve un richiamo dall’arbitro: ${text}`,
    corrected: () => "Un errore di lettura è stato corretto",
    paused: "La partita è in pausa",
    resumed: "La partita riprende",
  },
  physical: {
    atTable: "al tavolo",
    paused: "La partita è in pausa al tavolo.",
    violation: (name, text) => (name ? `${name}: ${text}` : text),
    handAwaited: "Le tue carte stanno arrivando",
    handAwaitedText:
      "Chi assiste al tavolo mostra le tue carte alla telecamera o le scrive. Compaiono qui appena sono note.",
    handUnknown: "Questa mano non è nota.",
  },
  violation: ({ rule, text, top, highest, fewest, onBoard, golden, next }) => {
    switch (rule) {
      case ViolatedRule.TURN:
        return next ? `Non è il suo turno: tocca a ${next}.` : "Non è il suo turno.";
      case ViolatedRule.FACE:
        if (!onBoard) return text;
        if (highest === 0) return "Niente batte il tartufo sul piatto: si può solo passare.";
        if (highest === top) return "Sul piatto c’è un jolly da solo: si batte con qualsiasi ingrediente.";
        return `Sul piatto ci sono già carte di valore ${highest + 1}: serve ${highest === 1 ? "un 1" : `un ${highest} o un numero più basso`}.`;
      case ViolatedRule.SIZE:
        return plural(fewest, { one: "Serve almeno # carta.", other: "Servono almeno # carte." });
      case ViolatedRule.FORM:
        return "Una giocata è di carte dello stesso valore, con o senza jolly, oppure di un solo jolly.";
      case ViolatedRule.OPENING:
        return golden
          ? `Lo Shift si apre con ${il(top)} d’oro: solo ${top} e jolly insieme.`
          : `Lo Shift si apre con ${il(top)}: nessun altro valore.`;
      case ViolatedRule.PASS:
        return "Ora non si può passare.";
      case ViolatedRule.DECISION:
        return "Chi gioca a distanza ha deciso diversamente.";
      default:
        return text;
    }
  },
  now: {
    yourTurn: "Tocca a te",
    turnOf: (name) => `Tocca a ${name}`,
    giveOf: (name) => `${name} dà una carta`,
    declareOf: (name) => `${name} può dichiarare`,
    wait: "Decidono gli altri",
    awaited: (name, seconds) => `Si aspetta ${name} da ${seconds}\u00a0s`,
    awaitedAway: (name, seconds) =>
      seconds === undefined ? `Si aspetta ${name} (assente)` : `Si aspetta ${name} (assente): ${seconds}\u00a0s`,
    waitExchange: "Le carte sono distribuite",
    youGive: "Dai una carta",
    youGiveOf: (number, of) => `Dai la carta ${number} di ${of}`,
    youMayDeclare: "Hai tutti e due i jolly",
    orLower: "o più basso",
    cards: "carte",
    openingGolden: "va giocata la carta d’oro",
    openingFace: "nessun altro valore",
    anything: "Una nuova pizza: va bene qualsiasi giocata.",
    beat: (highest, fewest) =>
      `${highest}${highest > 1 ? " o più basso" : ""}, almeno ${plural(fewest, { one: "# carta", other: "# carte" })}.`,
    nothing: "Niente batte queste carte: devi passare.",
    opens: "Apre lo Shift e non può passare.",
    opensMayPass: "Apre lo Shift.",
    giveTo: (name) => `Scambio: scegli una carta per ${name}.`,
    give: "Scambio: scegli una carta da dare.",
    foodFight: "Food Fight invertirebbe tutti i ruoli: diventeresti Chef.",
    dinner: "Dinner is Served salterebbe lo scambio.",
    finished: (place) => `Hai finito ${place}.`,
    outOfPizza: "Hai passato e sei fuori fino alla prossima pizza.",
  },
  played: { title: "Giocate in questo Shift", allOut: "tutte giocate" },
  actions: {
    label: "La tua decisione",
    play: "Gioca",
    playCards: (cards) => `Gioca ${cards}`,
    pass: "Passa",
    give: "Dai",
    giveCard: (card) => `Dai ${card}`,
    foodFight: "Food Fight!",
    dinner: "Dinner is Served!",
    decline: "Non dichiarare",
    putBack: "Rimetti a posto",
    pick: "Scegli delle carte, o passa.",
    pickMust: "Scegli le carte da giocare.",
    onlyPass: "Nessuna delle tue carte si può giocare qui.",
    autoPassing: "Qui non puoi giocare: la pagina passa per te…",
    planHint: "Non tocca a te. Puoi già scegliere che cosa fare dopo.",
    plan: (cards) => (cards ? `Poi: ${cards}` : "Poi: gioca"),
    planPass: "Poi: passa",
    planned: (what) => `Scelto per il tuo turno: ${what}`,
    planOff: (what) => `Non è più possibile: ${what}. Scegli di nuovo.`,
    unplan: "Annulla la scelta",
    more: (count) => plural(count, { one: "Scegli ancora una carta.", other: "Scegli ancora # carte." }),
    ready: "Si può giocare.",
    hint: "Suggerimento",
    hintComes: "Calcolo del suggerimento…",
    suggested: (move) => `Mossa suggerita: ${move}`,
    points: (points, error) => `${points} ± ${error} punti`,
    sending: "Invio…",
    noPass: "Scegli le carte: apri tu e non puoi passare.",
    mustPlay: "Nessuno gioca da tempo: ora devi giocare.",
  },
  reasons: {
    openingGolden: (face) => `Gioca ${il(face)} d’oro, solo con ${face} e jolly.`,
    openingFace: (face) => `Lo Shift si apre con ${il(face)}: nessun altro.`,
    notRarer: (face, board) => `${face} non batte ${board}: gioca un numero più basso.`,
    nothingRarer: "Niente batte le carte sul piatto.",
    tooFew: (need, have) =>
      `${plural(need, { one: "Ti serve # carta", other: "Ti servono # carte" })} di un valore; ne hai ${have}.`,
    jokerAlone: "Un jolly da solo apre soltanto una pizza.",
    other: "Questa carta ora non si può giocare.",
    declareFirst: "Prima decidi se dichiarare.",
    gift: "Questa carta ora non si può dare.",
    notYourTurn: "Non tocca a te.",
    notHeld: (face) => (face === undefined ? "Non hai jolly." : `Non hai carte di valore ${face}.`),
    noJoker: "Non si può aggiungere un jolly.",
    mayNotPass: "Ora non puoi passare.",
  },
  moments: {
    foodFight: {
      title: (name) => `${name}: Food Fight!`,
      text: "In questo Shift tutti i ruoli si invertono: il Lavapiatti ora è lo Chef.",
    },
    dinner: {
      title: (name) => `${name}: Dinner is Served!`,
      text: "In questo Shift non si scambiano carte.",
    },
    exchange: {
      title: () => "Lo scambio",
      text: "Nello scambio il Lavapiatti dà allo Chef le carte migliori e ne riceve altre: è il privilegio dello Chef.",
    },
    opening: {
      title: (name) => `${name} gioca la carta d’oro`,
      text: "La carta d’oro apre lo Shift.",
    },
    lastCard: {
      title: (name) => `${name} ha una carta sola`,
      text: "Chi gioca la sua ultima carta prende il miglior posto libero.",
    },
  },
  clock: {
    label: "Tempo",
    bank: (time) => `+ ${time} di riserva`,
    onBank: "dalla riserva",
    hurry: (seconds) => `Restano ${seconds} secondi.`,
  },
  expressions: {
    label: "Mostra come ti senti",
    words: {
      joy: "gioia",
      amusement: "divertimento",
      surprise: "sorpresa",
      concentration: "concentrazione",
      annoyance: "fastidio",
      sadness: "tristezza",
    },
    say: "Di’ qualcosa",
    ownWords: "Parole tue",
    sayIt: "Dillo",
    phrases: {
      "good-luck": "Buona fortuna!",
      "well-played": "Bella giocata!",
      thanks: "Grazie!",
      "so-close": "C’è mancato poco!",
      oops: "Ops!",
      sorry: "Scusate!",
      thinking: "Fammi pensare…",
      "good-game": "Bella partita!",
    },
  },
  tools: {
    label: "Strumenti",
    soundOn: "Suoni accesi",
    soundOff: "Suoni spenti",
  },
  lookup: {
    title: "Giocate possibili",
    caption: "Tutte le giocate per valore, numero di carte e jolly",
    legal: "permessa",
    notInHand: "ammessa, ma non in questa mano",
    notAllowed: "in mano, ma ora non ammessa",
    impossible: "né l’una né l’altra",
    face: "valore",
    loneJoker: "un jolly da solo",
    pass: "passare",
    count: (count) => plural(count, { one: "# azione permessa", other: "# azioni permesse" }),
    chosen: "scelta",
    groups: "Righe: valori. Colonne: carte di quel valore; in ogni colonna senza jolly, con uno, con due.",
    signs: "Legenda",
    none: "Non tocca a te. La tabella compare nei tuoi turni.",
  },
  aborted: {
    [AbortReason.UNSPECIFIED]: "Non ha un risultato.",
    [AbortReason.CLOSED]: "Chi ha creato la stanza l’ha chiusa.",
    [AbortReason.SHUTDOWN]: "Il server è stato spento.",
    [AbortReason.PARTICIPANTS_LOST]: "Troppi partecipanti hanno perso la connessione.",
    [AbortReason.NEVER_STARTED]: "Non tutti i posti sono stati presi in tempo.",
    [AbortReason.TOO_LONG]: "La partita è diventata più lunga di quanto il server possa conservare.",
  },
  result: {
    shift: (shift) => `Shift ${shift}`,
    game: "Classifica finale",
    total: "Totale",
    curve: "Punti della partita dopo ogni Shift, una linea per posto",
    adjudicated: "Terminato per il limite di turni.",
    replay: "Guarda il replay",
    youWon: "Hai vinto!",
    wins: (name) => `Ha vinto ${name}`,
  },
  answers: {
    notLegal: "Azione non permessa. Scegli di nuovo.",
    notLegalLeft: (attempts) =>
      attempts === 0
        ? "Azione non permessa. È stata presa la decisione predefinita."
        : plural(attempts, {
            one: "Azione non permessa. Scegli di nuovo: resta # tentativo.",
            other: "Azione non permessa. Scegli di nuovo: restano # tentativi.",
          }),
    closed: "Troppo tardi: è già stato deciso.",
    unknownDecision: "La partita è andata avanti. Se non cambia nulla, ricarica la pagina.",
  },
  link: {
    lost: "Connessione persa. Riconnessione…",
    superseded: "Questo posto è in uso in un’altra finestra o su un altro dispositivo.",
    takeBack: "Gioca qui",
    substituted: "Non c’eri: un agente integrato gioca al tuo posto.",
    resume: "Eccomi",
    refused: "Non è stato possibile prendere il posto.",
  },
  room: {
    seats: "Posti",
    waiting: (count) => plural(count, { one: "# posto è ancora libero", other: "# posti sono ancora liberi" }),
    away: (count) => plural(count, { one: "# deve ancora connettersi", other: "# devono ancora connettersi" }),
    begins: "La partita inizia appena tutti i posti sono presi e connessi.",
    ready: "pronto",
    here: "connesso",
    notHere: "seduto, ma non connesso",
    waitsFor: {
      [ParticipantKind.UNSPECIFIED]: "in attesa di chiunque: una persona, un robot, un agente o un modello linguistico",
      [ParticipantKind.HUMAN]: "in attesa di una persona",
      [ParticipantKind.ROBOT]: "in attesa di un robot",
      [ParticipantKind.AGENT]: "in attesa di un agente",
      [ParticipantKind.MODEL]: "in attesa di un modello linguistico",
    },
    ways: "Come entrano gli altri",
    invited: "Chi ha creato la stanza invita gli altri con un indirizzo o un codice d’ingresso.",
    assigned: "Il torneo assegna i posti ai suoi partecipanti. Nessun altro può entrare.",
    byCode: "Chi ha un codice d’ingresso può prendere un posto libero.",
    toJoin: "Ho un codice d’ingresso",
    invite: "L’invito è qui sotto.",
  },
  watch: {
    viewer: "vista da spettatore",
    spectators: (count: number) => plural(count, { one: "# spettatore", other: "# spettatori" }),
  },
};
