// Italian texts of tournaments/.

import type { Texts } from "../en";
import { plurals } from "../plural";
import { time } from "./time";

const plural = plurals("it");

export const tournaments: Texts["tournaments"] = {
  title: "Tornei",
  none: "Non c’è ancora nessun torneo. Creane uno, manda l’indirizzo a persone e agenti, e segui qui la classifica.",
  sections: { open: "Iscrizioni aperte", playing: "In corso", over: "Conclusi", closed: "Chiusi prima della fine" },
  states: { open: "iscrizioni aperte", playing: "in corso", finished: "finito", closed: "chiuso in anticipo" },
  formats: { knockout: "A eliminazione", roundRobin: "All’italiana", swiss: "Svizzero" },
  deals: {
    same: "Tutti i tavoli di un turno ricevono le stesse carte; ciò che le rivelerebbe resta chiuso fino alla fine del turno.",
    rotated: "Ogni tavolo gioca ogni distribuzione una volta per posto.",
  },
  participants: (count) => plural(count, { one: "# partecipante", other: "# partecipanti" }),
  made: (date) => `creato il ${date}`,
  gamesOver: (over, games) => `${over} di ${plural(games, { one: "# partita", other: "# partite" })} concluse`,
  roundOf: (round, rounds) => `turno ${round} di ${rounds}`,
  round: (round) => `Turno ${round}`,
  final: "Finale",
  table: (table) => `Tavolo ${table}`,
  game: (number) => `partita ${number}`,
  wall: {
    open: "Per una parete",
    close: "Esci dalla vista a parete",
    more: (from, to) => `da ${from} a ${to}`,
    tables: (from, to) => `tavoli da ${from} a ${to}`,
  },
  play: {
    beginsAt: (count) => `Comincia da solo con ${count} partecipanti`,
    beginsByHand: "Comincia quando lo decide chi organizza",
    knockout: (games) =>
      `${plural(games, { one: "# partita per turno", other: "# partite per turno" })} a tavoli da quattro; i primi due vanno avanti`,
    rounds: (rounds, games) =>
      rounds === 0
        ? `Tanti turni quanti ne richiede il numero dei partecipanti, di ${plural(games, { one: "# partita", other: "# partite" })} ciascuno`
        : `${plural(rounds, { one: "# turno", other: "# turni" })} di ${plural(games, { one: "# partita", other: "# partite" })}`,
    toPoints: (points) => plural(points, { one: "Si gioca a # punto", other: "Si gioca a # punti" }),
    shifts: (shifts) => plural(shifts, { one: "Una partita è di # Shift", other: "Una partita è di # Shift" }),
    clock: (decisionMs, bankMs) =>
      `Le persone hanno ${time(decisionMs)} per ogni decisione${bankMs > 0 ? ` e ${time(bankMs)} in più in tutta la partita` : ""}`,
  },
  standings: {
    title: "Classifica",
    final: "Classifica finale",
    place: "Posizione",
    name: "Nome",
    games: "Partite",
    score: "Punteggio medio",
    scoreHint: "Punti delle regole per la posizione in una partita, in media: decidono l’ordine",
    points: "Punti",
    places: "Piazzamenti",
    placesWords: (places) => places.map((count, index) => `${count} × ${index + 1}º posto`).join(", "),
    rating: "Valutazione",
    ratingHint: "Media e incertezza, dalle partite valutate di questo torneo",
    round: "Ultimo turno",
    forfeited: (count) => plural(count, { one: "# assenza", other: "# assenze" }),
    byes: (count) => plural(count, { one: "# riposo", other: "# riposi" }),
    filler: "completa il tabellone",
    away: "non collegato",
    none: "Non si è ancora iscritto nessuno.",
    field: "Chi partecipa",
  },
  games: {
    title: "Partite",
    bracket: "Tabellone",
    due: "non ancora chiamata",
    playing: "in corso",
    over: "conclusa",
    void: "abbandonata",
    watch: "Guarda",
    replay: "Rivedi",
    of: (table, number) => `${table}, partita ${number}`,
    free: "da decidere",
    from: (first) => `i primi due del tavolo ${first}`,
    forfeited: "non si è presentato",
    advances: "passa il turno",
    champion: "vince il torneo",
    none: "I tavoli si sorteggiano all’inizio del torneo.",
    truncated: (count) => `Si vedono solo le prime ${count} partite.`,
  },
  confidence: {
    title: "Quanto è sicuro l’ordine?",
    text: "Dai punteggi finora, per ogni coppia di vicini in classifica.",
    pair: (upper, lower) => `${upper} prima di ${lower}`,
    grades: {
      certain: "praticamente certo",
      likely: "probabile",
      leaning: "più sì che no",
      open: "non si può ancora dire",
      against: "i punteggi dicono il contrario",
    },
    percent: (percent) => `${percent}%`,
    more: (games) =>
      plural(games, {
        one: "circa # altra partita a testa lo deciderebbe",
        other: "circa # altre partite a testa lo deciderebbero",
      }),
  },
  join: {
    title: "Partecipa",
    text: "Si gioca nel browser. Resta su questa pagina: le tue partite cominciano qui da sole.",
    code: "Codice d’ingresso del torneo",
    codeMissing: "Scrivi il codice che ti ha dato chi organizza.",
    name: "Il tuo nome",
    nameHint: "Lo vedono tutti; nessun altro nel torneo può averlo.",
    nameMissing: "Scrivi come devono chiamarti gli altri.",
    submit: "Iscriviti al torneo",
    notForPeople: "Questo torneo non è per persone.",
  },
  part: {
    you: (name) => `Partecipi come ${name}.`,
    waitOpen: "Resta su questa pagina. Il torneo comincia quando lo decide chi organizza o quando si è in abbastanza.",
    waitNext: "Resta su questa pagina: la tua prossima partita comincia qui da sola.",
    over: "Il torneo è finito. Grazie di aver giocato.",
    connecting: "Connessione…",
    lost: "La connessione si è interrotta; nuovo tentativo…",
    superseded: "Stai partecipando in un’altra finestra.",
    takeBack: "Partecipa qui",
    begins: (place) => `La tua partita comincia: ${place}.`,
    back: "Torna alla classifica",
    place: (round, table) => `turno ${round}, tavolo ${table}`,
    toGame: "Alla mia partita",
  },
};
