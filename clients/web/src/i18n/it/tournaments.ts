// Italian texts of tournaments/.

import type { Texts } from "../en";
import { plurals } from "../plural";
import { time } from "./time";

const plural = plurals("it");

export const tournaments: Texts["tournaments"] = {
  title: "Tornei",
  none: "Non c’è ancora nessun torneo. Creane uno, manda l’indirizzo a persone e agenti e segui qui la classifica.",
  sections: { open: "Iscrizioni aperte", playing: "In corso", over: "Conclusi", closed: "Chiusi in anticipo" },
  states: { open: "iscrizioni aperte", playing: "in corso", finished: "finito", closed: "chiuso in anticipo" },
  formats: { knockout: "A eliminazione", roundRobin: "All’italiana", swiss: "Svizzero" },
  deals: {
    same: "Tutti i tavoli di un turno ricevono le stesse carte. Spettatori e replay sono ammessi solo a turno concluso.",
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
    open: "Vista per maxischermo",
    close: "Esci dalla vista per maxischermo",
    more: (from, to) => `da ${from} a ${to}`,
    tables: (from, to) => `tavoli da ${from} a ${to}`,
  },
  play: {
    beginsAt: (count) => `Inizia automaticamente con ${count} partecipanti`,
    beginsByHand: "Inizia quando lo avvia chi organizza",
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
    scoreHint: "Punti in media per la posizione in una partita. Decidono l’ordine",
    points: "Punti",
    places: "Piazzamenti",
    placesWords: (places) => places.map((count, index) => `${count} × ${index + 1}º posto`).join(", "),
    rating: "Valutazione",
    ratingHint: "Media e incertezza, dalle partite valutate di questo torneo",
    round: "Ultimo turno",
    forfeited: (count) => plural(count, { one: "# assenza", other: "# assenze" }),
    byes: (count) => plural(count, { one: "# riposo", other: "# riposi" }),
    filler: "completa il tabellone",
    away: "non connesso",
    none: "Non si è ancora iscritto nessuno.",
    field: "Partecipanti",
  },
  games: {
    title: "Partite",
    bracket: "Tabellone",
    due: "non ancora chiamata",
    playing: "in corso",
    over: "conclusa",
    void: "annullata",
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
    title: "Quanto è certo l’ordine?",
    text: "Stima dai punteggi finora, per ogni coppia di vicini in classifica.",
    pair: (upper, lower) => `${upper} prima di ${lower}`,
    grades: {
      certain: "quasi certo",
      likely: "probabile",
      leaning: "più probabile che no",
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
    text: "Si gioca nel browser. Resta su questa pagina: le tue partite iniziano qui automaticamente.",
    code: "Codice d’ingresso del torneo",
    codeMissing: "Inserisci il codice che ti ha dato chi organizza.",
    name: "Il tuo nome",
    nameHint: "Lo vedono tutti. Dev’essere unico nel torneo.",
    nameMissing: "Inserisci un nome.",
    submit: "Iscriviti al torneo",
    notForPeople: "Le persone non possono iscriversi a questo torneo.",
  },
  part: {
    you: (name) => `Partecipi come ${name}.`,
    waitOpen:
      "Resta su questa pagina. Il torneo inizia quando lo avvia chi organizza o quando ci sono abbastanza iscritti.",
    waitNext: "Resta su questa pagina: la tua prossima partita inizia qui automaticamente.",
    over: "Il torneo è finito. Grazie per aver giocato.",
    connecting: "Connessione…",
    lost: "Connessione persa. Riconnessione…",
    superseded: "Stai partecipando in un’altra finestra.",
    takeBack: "Partecipa qui",
    begins: (place) => `La tua partita inizia: ${place}.`,
    back: "Torna alla classifica",
    place: (round, table) => `turno ${round}, tavolo ${table}`,
    toGame: "Vai alla mia partita",
  },
};
