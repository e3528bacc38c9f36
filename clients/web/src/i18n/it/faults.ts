// What can go wrong in a call, in Italian.

import type { Texts } from "../en";

export const faults: Texts["faults"] = {
  notReached: "Il server non risponde. Forse si sta riavviando: riprova tra poco.",
  unknown: "Qualcosa è andato storto.",
  byReason: {
    ROOM_UNKNOWN: "Questa stanza non esiste più.",
    ROOM_FULL: "Tutti i posti di questa stanza sono occupati.",
    SEAT_TAKEN: "Qualcun altro ha appena preso questo posto.",
    NO_SUCH_SEAT: "Questa stanza non ha un posto simile.",
    KIND_NOT_ADMITTED: "I posti liberi sono riservati ad altri tipi di partecipanti.",
    GAME_STARTED: "La partita è già iniziata. Puoi guardarla.",
    GAME_OVER: "La partita è finita.",
    JOIN_CODE_WRONG:
      "Nessuna stanza e nessun torneo in cui si possa entrare ha questo codice. Ricontrollalo; o forse è tutto finito, e il codice con esso.",
    TICKET_UNKNOWN: "Il posto è stato liberato. Entra di nuovo con il codice.",
    SPECTATORS_NOT_ADMITTED: "Nessuno può guardare questa stanza.",
    TOO_MANY_SPECTATORS: "Troppe persone stanno già guardando questa stanza.",
    TOO_MANY_EXPRESSIONS: "Troppe espressioni in poco tempo. Aspetta un momento.",
    TOO_MANY_ROOMS: "Il server ha già tutte le stanze che può tenere. Riprova più tardi.",
    SHUTTING_DOWN: "Il server si sta spegnendo. Le partite continuano quando torna.",
    GAME_UNKNOWN: "Il server non ha la registrazione di questa partita.",
    GAME_RUNNING: "La partita è ancora in corso; la registrazione arriva alla fine.",
    SERIES_OPEN: "Si giocano ancora altre partite con le stesse carte; la registrazione arriva alla fine del turno.",
    TOURNAMENT_UNKNOWN: "Questo torneo non esiste.",
    TOURNAMENT_STARTED: "Il torneo è già iniziato.",
    TOO_FEW_PARTICIPANTS: "Prima di cominciare devono iscriversi almeno in due.",
    TOO_MANY_TOURNAMENTS: "Il server ha già tutti i tornei che può tenere. Riprova quando qualcuno è concluso.",
    OWNER_TOKEN_WRONG: "Può farlo solo il dispositivo che l’ha creato.",
    NOT_STATELESS: "Questo torneo non è per persone: le stesse carte ritornano.",
    TOURNAMENT_FULL: "Il torneo è al completo.",
    NAME_REFUSED: "Questo nome ha più di 64 caratteri, o ne ha che non si vedono. Scegline un altro.",
    NAME_TAKEN: "Qualcun altro ha già questo nome. Scegline un altro.",
  },
};
